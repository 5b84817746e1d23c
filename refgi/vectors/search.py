"""The search for a cause that no likely bug is: which single change of the literal text gives what a port has.

The literal form of the first wrong stage runs on the kit's arrays with one change of a line after the other: operators
and numbers first, then names, in random order. A change is told if it explains the port's arrays (`causes.EXPLAINED`).
"""

import ast
import hashlib
import random
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from refgi.types import Array
from refgi.vectors.bounds import distance
from refgi.vectors.cases import kit_cases
from refgi.vectors.causes import EXPLAINED, SEEN, explained
from refgi.vectors.changes import Change, changes_of
from refgi.vectors.check import differences_of
from refgi.vectors.kit import Asked, Kit
from refgi.vectors.manifest import CaseManifest, Cause, CommonCause, Result, StageVerdict
from refgi.vectors.port import Port
from refgi.vectors.report import CAUSES, weight
from refgi.vectors.rows import Form, Function, called_by, code_of, compiled
from refgi.vectors.spec import as_read, kind_of, stored

MOST_CASES = 3  # that a change must explain
MOST_KEPT = 40  # changes that explain the first case and are tried in others
SLOWER, LEAST_SECONDS = 20.0, 0.5  # how long a changed form may take: times what it takes as it is, and at least
Tell = Callable[[str, float], None]


class TooSlowError(Exception):
    """A changed form takes far longer than it should."""


class Outcome(NamedTuple):
    """What a change leads to."""

    share: float  # of the differing elements that it explains; 0 where it does not run
    digest: bytes  # of its arrays


def searched(
    kit: Kit, output: Path, asked: Asked, result: Result, *, seconds: float = 60.0, tell: Tell = lambda *_: None
) -> Result:
    """Look for causes of the first wrong stage among single changes of its literal text, after those that are known.

    Return the result with up to three causes for its first finding; as it was where nothing is wrong or found. No
    change is tried after some seconds; `tell` is called with what runs and the share done.
    """
    if not result.findings:
        return result
    first = result.findings[0]
    wrong: dict[str, str] = {}  # the first wrong stage of that kind in each case
    for one in result.stages:
        if one.verdict == "out" and one.upstream != "dirty" and kind_of(one.stage) == first.stage:
            wrong.setdefault(one.case, one.stage)
    if not wrong:
        return result
    shares = {cause.cause: cause.share for one in result.stages if (one.case, one.stage) == first.first
              for cause in one.causes}
    wirings = {bug.cause for case in kit.cases(Asked(cases=(*wrong,))) for step in case.stages
               if kind_of(step.name) == first.stage for bug in kit.bugs(case).of(step.name) if bug.wired}
    known = [one for one in first.causes if one.explained]
    sure = [one for one in known if shares.get(one.cause, 1.0) > SEEN and 2 * one.explained > one.tried
            and one.cause not in wirings]  # one of hundreds that fits may do so by chance
    if len(sure) >= CAUSES:
        return result
    trials = [Trial(kit, asked, output, case, stage) for case, stage in islice(wrong.items(), MOST_CASES)]
    found = _found([one for one in trials if one.usable], seconds, lambda done, count: tell(
        f"{first.stage}: {count} changes tried", done))[: CAUSES - len(sure)]
    if not found:
        return result
    common, own = zip(*found, strict=True)
    stages = (_told(one, own) if (one.case, one.stage) == first.first else one for one in result.stages)
    rest = [one for one in known if one not in sure]
    rest = sorted((*rest[:1], *common, *rest[1:]), key=weight, reverse=True)
    finding = first.model_copy(update={"causes": (*sure, *rest)[:CAUSES]})
    return result.model_copy(update={"findings": (finding, *result.findings[1:]), "stages": tuple(stages)})


def _told(verdict: StageVerdict, found: Sequence[Cause]) -> StageVerdict:
    """Return a verdict with more causes, in place of remarks that explain nothing."""
    known = [one for one in verdict.causes if one.share > 0]
    return verdict.model_copy(update={"causes": tuple([*known, *found][:CAUSES])})


def _found(
    trials: list["Trial"], seconds: float, tell: Callable[[float, int], None]
) -> list[tuple[CommonCause, Cause]]:
    """Return the changes that explain the first case, those that explain most cases first."""
    found = []
    for (function, change), share in islice(_explaining(trials, seconds, tell), MOST_KEPT):
        shares = [share, *(trial.tried(function, change).share for trial in trials[1:])]
        right = [one for one in shares if one >= EXPLAINED]
        file = function.__module__.removeprefix("refgi.").replace(".", "/")
        said = f"{change.said}, as if refgi's {file}.py:{change.line} were changed so in {function.__name__}"
        found.append((CommonCause(cause=said, explained=len(right), tried=len(shares)),
                      Cause(cause=said, share=sum(right) / len(right))))
    return sorted(found, key=lambda one: (-one[0].explained, -round(one[1].share, 2)))


def _explaining(
    trials: list["Trial"], seconds: float, tell: Callable[[float, int], None]
) -> Iterator[tuple[tuple[Function, Change], float]]:
    """Yield the changes that explain the first case, of those that give the same arrays the first, until time is up."""
    changes = trials[0].changes() if trials else []
    begun, known = time.monotonic(), set()
    for number, (function, change) in enumerate(changes):
        spent = time.monotonic() - begun
        if spent > seconds:
            break
        if number % 50 == 0:
            tell(max(number / len(changes), min(1.0, spent / seconds)), number)
        outcome = trials[0].tried(function, change)
        if outcome.share >= EXPLAINED and outcome.digest not in known:
            known.add(outcome.digest)
            yield (function, change), outcome.share


class Trial:
    """The literal form of one stage of one case, run again and again on what a port has read."""

    def __init__(self, kit: Kit, asked: Asked, output: Path, case: str, stage: str) -> None:
        manifest = next(one for one in kit.cases(Asked(cases=(case,))) if one.id == case)
        step = next(one for one in manifest.stages if one.name == stage)
        self._wrong = differences_of(Port(kit, manifest, output, asked), step)
        self._limits = {name: _limit(kit, manifest, name) for name in step.writes}
        made = next(one for one in kit_cases(kit.manifest.kit)[case]().stages if one.name == stage)
        self._form = next((one for one in made.variants if isinstance(one, Form)), None)
        self._expected = {name: kit.array(manifest, name) for name in step.writes}
        self._read = as_read({name: kit.array(manifest, name) for name in step.reads}, step.reads, np.float64)
        self._seconds = LEAST_SECONDS
        self.usable = bool(self._wrong) and self._form is not None and self._is_right(self._form)

    def _is_right(self, form: Form) -> bool:
        """Return whether the form gives the kit's arrays."""
        begun = time.monotonic()
        made = form.by(form.function, self._read)
        self._seconds = max(LEAST_SECONDS, SLOWER * (time.monotonic() - begun))
        return all(self._is_within(name, stored(made[name])).all() for name in self._expected)

    def _is_within(self, name: str, array: Array) -> Array:
        if array.shape != self._expected[name].shape:
            return np.zeros(1, bool)
        return np.asarray(distance(array, self._expected[name]) <= self._limits[name])

    def changes(self) -> list[tuple[Function, Change]]:
        """Return the changes of the text in random order: operators and numbers first, then names."""
        assert self._form is not None
        found = [(function, change) for function in called_by(self._form.function)
                 for change in changes_of(ast.parse(code_of(function)).body[0])]
        random.Random(0).shuffle(found)
        return sorted(found, key=lambda one: one[1].is_name)

    def tried(self, function: Function, change: Change) -> Outcome:
        """Run the form with a change."""
        assert self._form is not None
        parts: dict[Function, str | ast.Module] = {one: code_of(one) for one in called_by(self._form.function)}
        change.put()
        try:
            parts[function] = ast.Module([change.root], [])
            changed = compiled(self._form.function, parts)
        except Exception:  # no program
            return Outcome(0.0, b"")
        finally:
            change.take_back()
        try:
            with limited(self._seconds), np.errstate(all="ignore"):
                made = self._form.by(changed, self._read)
                made = {name: stored(made[name]) for name in self._expected}
        except Exception:  # whatever a change leads to
            return Outcome(0.0, b"")
        shares = [explained(one, made[name]) if made[name].shape == one.expected.shape else 0.0
                  for name, one in self._wrong.items()]
        right = made.keys() - self._wrong.keys()  # arrays that the port has right
        shares += [float(self._is_within(name, made[name]).mean()) for name in right]
        digest = hashlib.sha256(b"".join(array.tobytes() for _, array in sorted(made.items()))).digest()
        return Outcome(min(shares), digest)


def _limit(kit: Kit, case: CaseManifest, name: str) -> Array:
    """Return how far elements may be off, as much as they like on edges."""
    entry = case.arrays[name]
    limit = np.zeros(entry.shape) if entry.bound is None else np.asarray(kit.extra(case, entry.bound), np.float64)
    return np.where(kit.extra(case, entry.masked), np.inf, limit) if entry.masked is not None else limit


@contextmanager
def limited(seconds: float) -> Iterator[None]:
    """Raise `TooSlowError` where a block takes longer; without effect where signals do not reach it."""
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return

    def stop(*_: Any) -> None:
        raise TooSlowError

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
