"""One stage run as plain Python with single changes of its source: a process of its own, for kernels are not compiled.

Reads a `Task` as JSON from its input, tells its progress and writes what it found, both as lines of JSON.
"""

import ast
import gc
import hashlib
import json
import random
import resource
import signal
import sys
import time
import types
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from refgi.vectors.bounds import distance
from refgi.vectors.cases import kit_cases
from refgi.vectors.causes import EXPLAINED, explained
from refgi.vectors.check import differences_of
from refgi.vectors.kit import Asked, Kit
from refgi.vectors.manifest import CaseManifest
from refgi.vectors.search.edits import FUNCTIONS, Edit, edits_of
from refgi.vectors.spec import Array, Stage, outputs_of

PACKAGE = Path(__file__).parents[2]
NOT_CHANGED = ("jit", "errors.py", "stages.py", "settings.py", "vectors/recipe.py", "vectors/spec.py", "vectors/search")
MOST_BYTES = 6 << 30  # of memory: a change may ask for any
SLOWER, LEAST_SECONDS = 20.0, 0.5  # how long a changed stage may take: times what it takes as it is, and at least
MOST_KEPT = 40  # changes that explain the first case and are tried in others


class Task(NamedTuple):
    """What is asked for."""

    kit: str  # folder
    output: str
    chained: bool
    tiers: dict[str, str]
    wrong: list[tuple[str, str]]  # cases and stages of one kind, the first first
    seconds: float


class Change(NamedTuple):
    """One change of one function."""

    file: str  # below the package
    function: str
    edit: Edit
    root: ast.stmt  # the statement of the module that holds the function


class Found(NamedTuple):
    """A change that explains a port's arrays."""

    said: str
    function: str
    file: str
    line: int
    explained: int  # cases
    tried: int
    share: float  # of the elements that differ in them, the mean


class Outcome(NamedTuple):
    """What a change leads to."""

    share: float  # of the differing elements that it explains; 0 where it does not run
    digest: bytes  # of its arrays


class TooSlowError(Exception):
    """A changed stage takes far longer than it should."""


def main() -> int:
    """Run a task."""
    task = Task(**json.loads(sys.stdin.readline()))
    resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    np.seterr(all="ignore")

    def tell(done: float, count: int) -> None:
        print(json.dumps({"done": done, "tried": count}), flush=True)

    print(json.dumps({"found": [one._asdict() for one in search(task, tell)]}), flush=True)
    return 0


def search(task: Task, tell: Callable[[float, int], None]) -> list[Found]:
    """Return the changes that explain the first wrong case of a task, those that explain most cases first.

    Parameters
    ----------
    task : Task
        What is asked for.
    tell : callable
        Called with (share done, changes tried).

    Returns
    -------
    list of Found
        One of those that give the same arrays: the first in the order of `edits_of`.
    """
    kit, asked = Kit(Path(task.kit)), Asked(chained=task.chained, tiers=task.tiers)
    trials = [Trial(kit, asked, Path(task.output), case, stage) for case, stage in task.wrong]
    trials = [trial for trial in trials if trial.usable]
    if not trials:
        return []
    found = []
    for change, share in islice(_explaining(trials[0], trials[0].changes(), task.seconds, tell), MOST_KEPT):
        shares = [share, *(trial.tried(change).share for trial in trials[1:])]
        right = [one for one in shares if one >= EXPLAINED]
        found.append(Found(change.edit.said, change.function, change.file, change.edit.line, len(right), len(shares),
                           sum(right) / len(right)))
    return sorted(found, key=lambda one: (-one.explained, -round(one.share, 2)))


def _explaining(
    trial: "Trial", changes: list[Change], seconds: float, tell: Callable[[float, int], None]
) -> Iterator[tuple[Change, float]]:
    """Yield the changes that explain a case, of those that give the same arrays the first, until time is up."""
    begun, known = time.monotonic(), set()
    for number, change in enumerate(changes):
        spent = time.monotonic() - begun
        if spent > seconds:
            break
        if number % 50 == 0:
            tell(max(number / len(changes), spent / seconds), number)
        outcome = trial.tried(change)
        if outcome.share >= EXPLAINED and outcome.digest not in known:
            known.add(outcome.digest)
            yield change, outcome.share


class Trial:
    """One stage of one case, run again and again.

    Parameters
    ----------
    kit : Kit
        The kit.
    asked : Asked
        Mode and tiers.
    output : Path
        The port's folder.
    case, stage : str
        Which stage is wrong.
    """

    def __init__(self, kit: Kit, asked: Asked, output: Path, case: str, stage: str) -> None:
        manifest = next(one for one in kit.cases(Asked(cases=(case,))) if one.id == case)
        step = next(one for one in manifest.stages if one.name == stage)
        self._wrong = differences_of(kit, manifest, step, output, asked)
        self._limits = {name: _limit(kit, manifest, name) for name in step.writes}
        made = kit_cases(kit.manifest.kit)[case]()
        self._stage: Stage = next(one for one in made.stages if one.name == stage)
        self._known = {name: kit.array(manifest, name) for name in manifest.arrays}
        for array in self._known.values():
            array.setflags(write=False)
        self._seconds = LEAST_SECONDS
        self._reached: dict[types.CodeType, set[int]] = {}  # and the lines that ran
        self.usable = bool(self._wrong) and self._is_right()
        self._functions = _functions_of(self._reached)

    def _is_right(self) -> bool:
        """Run the stage as it is, noting what it reaches; return whether it gives the kit's arrays as plain Python."""
        try:
            with _noting(self._reached):
                outputs_of(self._stage, self._known, np.float64)
            begun = time.monotonic()
            made = outputs_of(self._stage, self._known, np.float64)
        except Exception:  # code that is not Python: calls of Embree, vectors of eight
            return False
        self._seconds = max(LEAST_SECONDS, SLOWER * (time.monotonic() - begun))
        return all(made[name].shape == self._known[name].shape and bool(
            (distance(made[name], self._known[name]) <= self._limits[name]).all()) for name in made)

    def changes(self) -> list[Change]:
        """Return the changes of all lines that ran, in random order: operators and numbers first, then names.

        Those of the kit's own code come last.
        """
        found = []
        for file in sorted({code.co_filename for code in self._reached}):
            where = Path(file).relative_to(PACKAGE)
            if not str(where).startswith(NOT_CHANGED):
                tree = ast.parse(Path(file).read_text(encoding="utf-8"))
                codes = {code.co_firstlineno: code for code in self._reached if code.co_filename == file}
                for root, function in _functions_in(tree):
                    code = codes.get(_first_line(function))
                    if code is not None:
                        found += [Change(str(where), code.co_qualname, edit, root) for edit in edits_of(function)
                                  if edit.line in self._reached[code]]
        random.Random(0).shuffle(found)
        return sorted(found, key=lambda one: (one.file.startswith("vectors"), one.edit.is_name))

    def tried(self, change: Change) -> Outcome:
        """Run the stage with a change."""
        try:
            with self._put(change), _limited(self._seconds):
                made = outputs_of(self._stage, self._known, np.float64)
        except Exception:  # whatever a change leads to
            return Outcome(0.0, b"")
        shares = [explained(one, made[name]) if made[name].shape == one.expected.shape else 0.0
                  for name, one in self._wrong.items()]
        for name in made.keys() - self._wrong.keys():  # arrays that the port has right
            same = made[name].shape == self._known[name].shape
            shares.append(float((distance(made[name], self._known[name]) <= self._limits[name]).mean()) if same else 0)
        digest = hashlib.sha256(b"".join(array.tobytes() for _, array in sorted(made.items()))).digest()
        return Outcome(min(shares), digest)

    @contextmanager
    def _put(self, change: Change) -> Iterator[None]:
        """Run functions with a change; those around it too, which make such functions anew."""
        change.edit.put()
        try:
            file = str(PACKAGE / change.file)
            compiled = compile(ast.Module([change.root], []), file, "exec", dont_inherit=True)
        finally:
            change.edit.take_back()
        new = {(code.co_qualname, code.co_firstlineno): code for code in _codes_in(compiled)}
        replaced = []
        for code, functions in self._functions.items():
            other = new.get((code.co_qualname, code.co_firstlineno)) if code.co_filename == file else None
            if other is not None and other.co_freevars == code.co_freevars:
                replaced += [(function, code) for function in functions]
                for function in functions:
                    function.__code__ = other
        try:
            yield
        finally:
            for function, code in replaced:
                function.__code__ = code


def _limit(kit: Kit, case: CaseManifest, name: str) -> Array:
    """Return how far elements may be off, as much as they like on edges."""
    entry = case.arrays[name]
    limit = np.zeros(entry.shape) if entry.bound is None else np.asarray(kit.extra(case, entry.bound), np.float64)
    return np.where(kit.extra(case, entry.masked), np.inf, limit) if entry.masked is not None else limit


@contextmanager
def _noting(reached: dict[types.CodeType, set[int]]) -> Iterator[None]:
    """Note which of the package's functions are called, and which of their lines run."""
    here = str(PACKAGE)

    def note(frame: types.FrameType, *_: Any) -> Any:
        if frame.f_code.co_filename.startswith(here):
            reached.setdefault(frame.f_code, set()).add(frame.f_lineno)
            return note
        return None

    sys.settrace(note)
    try:
        yield
    finally:
        sys.settrace(None)


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """Raise `TooSlowError` where a block takes longer."""
    def stop(*_: Any) -> None:
        raise TooSlowError

    signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def _functions_of(codes: Iterable[types.CodeType]) -> dict[types.CodeType, list[types.FunctionType]]:
    """Return the functions that have some code."""
    found: dict[types.CodeType, list[types.FunctionType]] = {}
    for thing in gc.get_objects():
        if type(thing) is types.FunctionType and thing.__code__.co_filename.startswith(str(PACKAGE)):
            found.setdefault(thing.__code__, []).append(thing)
    files = {code.co_filename for code in codes}
    return {code: functions for code, functions in found.items() if code.co_filename in files}


def _codes_in(code: types.CodeType) -> Iterator[types.CodeType]:
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield constant
            yield from _codes_in(constant)


def _functions_in(tree: ast.Module) -> Iterator[tuple[ast.stmt, ast.AST]]:
    """Yield every function of a module with the statement of the module that holds it."""
    for root in tree.body:
        for node in ast.walk(root):
            if isinstance(node, FUNCTIONS):
                yield root, node


def _first_line(function: ast.AST) -> int:
    """Return where a function's code begins: at its first decorator."""
    decorators = getattr(function, "decorator_list", [])
    return int(decorators[0].lineno if decorators else function.lineno)  # type: ignore[attr-defined]


if __name__ == "__main__":
    raise SystemExit(main())
