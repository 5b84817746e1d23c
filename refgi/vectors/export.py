"""Writing a kit: expected arrays, bounds, likely bugs, manifests, schemas, scenes, and how to read them.

A kit is written to a folder beside its own and renamed when it is whole. Its bytes depend on the cases alone, and in
the last bit on the platform's libm where a stage uses it.
"""

import functools
import hashlib
import io
import math
import secrets
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np

from refgi.errors import InputError, expect
from refgi.jit import threads
from refgi.types import Array
from refgi.vectors.bounds import Bound, Budget, chained_budgets, distance, isolated_bounds, stored_budgets
from refgi.vectors.cases import kit_cases
from refgi.vectors.causes import FEWEST
from refgi.vectors.manifest import (
    BUGS,
    CASE,
    KIT,
    SCHEMAS,
    VERSION,
    ArrayEntry,
    BugEntry,
    BugWriter,
    CaseManifest,
    KitEntry,
    KitManifest,
    StageEntry,
    Told,
    Tolerance,
    schema_text,
    text_of,
)
from refgi.vectors.rows import sharing
from refgi.vectors.spec import Arrays, Bug, Case, Stage, as_read, expected_of, kind_of, stored
from refgi.vectors.standalone import is_plain, standalone_text, write_scene
from refgi.vectors.wiring import ANOTHER, wirings

SEED = 20090101  # of the changes that bounds are measured by
TOLD_BY, BESIDE = 64, 24  # elements of a likely bug that are kept: those that tell it, and others
WIRING_TOLD_BY, WIRING_BESIDE = 20, 6  # the same of wrong wirings, of which there are many
SMALL = 16  # elements: of fewer, fewer than FEWEST differing ones do not tell a wrong wiring
PARTS = 2  # of the bytes of an array that it takes with its bounds
TOLD_IN = 3  # stages of a method that tell a likely bug: it is tried in no further ones
TOLD_AGAIN = 2  # the same where another method tells it already, as the stages do that all begin with
WIRING_TRIED = 2  # cases of a method in which a wrong wiring is tried; in no further ones once it is told
Tell = Callable[[str, float], None]


def export_kit(kit: str, out: Path, tell: Tell = lambda _, __: None, only: str | None = None) -> KitManifest:
    """Write a kit.

    Parameters
    ----------
    kit : {"quick", "full"}
        Which cases.
    out : Path
        Its folder; must not exist, or hold a kit, which is replaced.
    tell : callable, optional
        Called with the case's id and the share done.
    only : str, optional
        Start of the ids of cases to write; all where absent.

    Returns
    -------
    KitManifest
        What was written.

    Raises
    ------
    InputError
        If the folder holds something else, a likely bug is told by no case of the kit, or the disk is full.
    """
    cases = {name: make for name, make in kit_cases(kit).items() if only is None or name.startswith(only)}
    expect(bool(cases), "case", f"the start of one of {', '.join(kit_cases(kit))}", only)
    with threads(1):  # pictures of a few hundred pixels are done before a second thread has woken
        return _write_kit(kit, cases, out, tell, whole=only is None)


def export_case(case: Case, out: Path, tell: Tell = lambda _, __: None, most: float = math.inf) -> KitManifest:
    """Write a kit of one case.

    Parameters
    ----------
    case : Case
        The case, such as `refgi.vectors.recorded.recorded_case` makes of any scene.
    out : Path
        Its folder; must not exist, or hold a kit, which is replaced.
    tell : callable, optional
        Called with what runs and the share done.
    most : float
        Bytes of arrays and bounds that it may take.

    Returns
    -------
    KitManifest
        What was written.

    Raises
    ------
    InputError
        If it would take more, the folder holds something else, or the disk is full.
    """
    taken = sum(stored(array).nbytes for array in case.given.values()) + PARTS * sum(
        array.nbytes for name, array in expected_of(case).items() if name not in case.given)
    if taken > most:
        raise InputError(f"{out}: expected a kit of at most {most / 1e6:g} MB, got {taken / 1e6:.3g} MB: a smaller "
                         "size or map (--size, --rsm-resolution), fewer stages (--stage) or more room (--most)")
    return _write_kit("scene", {case.id: lambda: case}, out, tell, whole=False)


def _write_kit(
    kit: str, cases: Mapping[str, Callable[[], Case]], out: Path, tell: Tell, *, whole: bool
) -> KitManifest:
    """Write cases; `whole`: all of a kit, some of which must tell each likely bug."""
    from refgi.provenance import program

    if out.exists() and any(out.iterdir()) and not (out / KIT).is_file():
        raise InputError(f"{out}: expected a new folder or a kit, got a folder of other files", file=str(out))
    part = out.with_name(f".{out.name}.{secrets.token_hex(4)}.part")
    try:
        part.mkdir(parents=True)
        entries, told = [], _Told()
        for number, (name, make) in enumerate(cases.items()):
            share = number / len(cases)
            manifest = write_case(make(), part, told, lambda stage, done, name=name, share=share: tell(  # type: ignore[misc]
                f"{name}: {stage}" if stage else name, share + done / len(cases)))
            text = text_of(manifest)
            (part / "cases" / name / CASE).write_text(text, encoding="utf-8", newline="\n")
            entries.append(KitEntry(id=name, method=manifest.method, what=manifest.what,
                                    manifest=f"cases/{name}/{CASE}", sha256=_sha256(text.encode())))
        if whole:
            told.expect_none_blind()
        made = KitManifest(kit=kit, vectors=VERSION, refgi=" ".join(program().values()), cases=tuple(entries))
        _write_frame(part, made)
        if out.exists():
            shutil.rmtree(out)
        part.replace(out)
    except OSError as error:
        raise InputError(f"{out}: cannot be written: {error.strerror or error}", file=str(out)) from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
    tell("done", 1.0)
    return made


class _Told:
    """Which likely bugs cases tell from the right stage: a few of each method are enough, of wrong wirings one.

    And which bounds and masks the kit holds: equal ones are kept once.
    """

    def __init__(self) -> None:
        self._files: dict[str, Path] = {}
        self._cases: dict[tuple[str, str, str], int] = {}
        self._first: dict[tuple[str, str], str] = {}  # stage and cause: the method that tells it first
        self._wirings: dict[tuple[str, str, str], int] = {}

    def once(self, home: Path, file: str, array: Array) -> str:
        """Write an array below a case's folder unless the kit holds it; return its file, as seen from there."""
        content = _npy(array)
        known = self._files.setdefault(_sha256(content), home / file)
        if known == home / file:
            known.write_bytes(content)
        return known.relative_to(home).as_posix() if known.is_relative_to(home) else (
            f"../{known.relative_to(home.parent).as_posix()}")

    def wiring(self, method: str, stage: str, cause: str) -> bool:
        """Return whether a wrong wiring is to be tried in a further case."""
        return self._wirings.get(_wiring_key(method, stage, cause), 0) < WIRING_TRIED

    def tried(self, method: str, stage: str, cause: str) -> None:
        """Count a case in which a wrong wiring is tried."""
        key = _wiring_key(method, stage, cause)
        self._wirings[key] = self._wirings.get(key, 0) + 1

    def wired(self, method: str, stage: str, cause: str) -> None:
        """Mark a wrong wiring that a case tells."""
        self._wirings[_wiring_key(method, stage, cause)] = WIRING_TRIED

    def enough(self, method: str, stage: str, cause: str) -> bool:
        """Return whether enough stages of a method tell a bug."""
        first = self._first.get((kind_of(stage), cause), method) == method
        return self._cases.get((method, kind_of(stage), cause), 0) >= (TOLD_IN if first else TOLD_AGAIN)

    def add(self, method: str, stage: str, cause: str, told: bool) -> None:
        """Count a stage that tells a bug, or cannot."""
        key = method, kind_of(stage), cause
        if told:
            self._first.setdefault(key[1:], method)
        self._cases[key] = self._cases.get(key, 0) + told

    def expect_none_blind(self) -> None:
        """Refuse bugs that no case tells."""
        told: dict[tuple[str, str], int] = {}
        for (_, stage, cause), count in self._cases.items():
            told[stage, cause] = told.get((stage, cause), 0) + count
        blind = [f"{stage}: {cause}" for (stage, cause), count in told.items() if not count]
        if blind:
            raise InputError(f"kit: expected a case that tells each likely bug, got none for {'; '.join(blind)}")


def _wiring_key(method: str, stage: str, cause: str) -> tuple[str, str, str]:
    """Return what a wrong wiring is counted by: each lamp, level and round by itself where it is one of them."""
    return method, stage if cause.endswith(ANOTHER) else kind_of(stage), cause


def write_case(case: Case, folder: Path, told: _Told, tell: Tell) -> CaseManifest:
    """Write the arrays of a case below a kit's folder and return its manifest, which is not written yet."""
    home = folder / "cases" / case.id
    for name in ("in", "out", "bound", "mask"):
        (home / name).mkdir(parents=True, exist_ok=True)
    known = expected_of(case)
    arrays = {name: _entry(case, name, known[name], _save(home, f"in/{name}.npy", known[name])) for name in case.given}
    tell("", 0.0)
    chained, chained_half = (chained_budgets(case, known, SEED, in_halves=one) for one in (False, True))
    stages, bugs = [], BugWriter()
    for number, step in enumerate(case.stages):
        tell(step.name, number / len(case.stages))
        bounds = isolated_bounds(case, step, known, SEED)
        halves, in_bytes = stored_budgets(case, step, known, SEED)
        for name in step.writes:
            entry = _entry(case, name, known[name], _save(home, f"out/{name}.npy", known[name]))
            arrays[name] = entry.model_copy(update=_tolerances(home, name, entry, bounds[name], {
                "chained": chained[name], "half": halves[name], "bytes": in_bytes[name],
                "chained_half": chained_half[name]}, told))
        right = _Right(step, as_read(known, step.reads, np.float64), known, bounds)
        with sharing():
            for bug in step.bugs:
                if not told.enough(case.method, step.name, bug.cause):
                    told.add(case.method, step.name, bug.cause, not _keep_bug(bugs, right, bug))
            for bug in wirings(case, step, known, functools.partial(told.wiring, case.method, step.name)):
                told.tried(case.method, step.name, bug.cause)
                if not _keep_bug(bugs, right, bug, wired=True):
                    told.wired(case.method, step.name, bug.cause)
        stages.append(StageEntry(name=step.name, what=step.what, paper=step.paper, reads=step.reads,
                                 writes=step.writes, exact=step.exact))
    content = bugs.content()
    (home / BUGS).write_bytes(content)
    scene = None
    if case.scene is not None and is_plain(case.scene):
        scene = f"scenes/{case.id}"
        size = case.facts.get("camera", {"columns": 1, "rows": 1})
        write_scene(case.scene, (size["columns"], size["rows"]), folder / scene)
    return CaseManifest(id=case.id, method=case.method, what=case.what, vectors=VERSION, facts=dict(case.facts),
                        factors=dict(case.factors), scene=scene, given=tuple(case.given), stages=tuple(stages),
                        arrays=arrays, bugs_sha256=_sha256(content))


def _entry(case: Case, name: str, array: Array, saved: tuple[str, str]) -> ArrayEntry:
    spec = case.specs[name]
    kind = {"f": "<f4", "i": "<i4", "b": "|b1"}[array.dtype.kind]
    return ArrayEntry(file=saved[0], sha256=saved[1], dtype=kind, shape=array.shape,  # type: ignore[arg-type]
                      axes=spec.axes, unit=spec.unit, what=spec.what, space=spec.space, paper=spec.paper,
                      tier="T0" if array.dtype.kind != "f" and spec.tier != "T3" else spec.tier,
                      index_of=spec.index_of)


def _tolerances(
    home: Path, name: str, entry: ArrayEntry, bound: Bound, budgets: Mapping[str, Budget], told: _Told
) -> Mapping[str, object]:
    """Return the fields of an array that say how far it may be off."""
    more: dict[str, object] = {}
    for key, budget in budgets.items():
        file = None if budget.masked is None else told.once(home, f"mask/{name}.{key}.npy", budget.masked)
        relative, large = (float(f"{one:.6g}") for one in (budget.relative, budget.large))
        more[key] = Tolerance(relative=relative, large=large, outliers=budget.outliers, masked=file)
    if entry.dtype == "<f4":
        more |= {"bound": told.once(home, f"bound/{name}.npy", bound.limit)}
    if bound.masked.any():
        more |= {"masked": told.once(home, f"mask/{name}.npy", bound.masked),
                 "masked_count": int(np.count_nonzero(bound.masked))}
    return more


@dataclass(frozen=True)
class _Right:
    """A stage without a bug: what it reads in float64, all arrays of its case, its bounds."""

    step: Stage
    read: Arrays
    known: Arrays
    bounds: Mapping[str, Bound]


def _keep_bug(bugs: BugWriter, right: _Right, bug: Bug, *, wired: bool = False) -> bool:
    """Run a stage with a likely bug and keep elements that tell it; return whether none does.

    `wired`: a wrong wiring, of which fewer elements are kept, and none where none tells it, or a few numbers alone,
    which nearly any array can lead to.
    """
    step, known, bounds = right.step, right.known, right.bounds
    try:
        made = bug.run(dict(right.read), np.float64)
        made = {name: stored(made[name]) for name in step.writes}
    except Exception:  # whatever a wrong buffer leads to: it is seen at once
        if wired:
            return True
        raise
    told, blind, elements, differing = {}, True, 0, 0
    counts = (WIRING_TOLD_BY, WIRING_BESIDE) if wired else (TOLD_BY, BESIDE)
    for name in step.writes:
        array, expected = made[name], known[name]
        if array.shape != expected.shape:
            blind = False
            continue
        elements += array.size
        if np.array_equal(array, expected):
            continue
        off = (distance(array, expected) > bounds[name].limit) & ~bounds[name].masked
        differing += int(np.count_nonzero(off))
        if off.any():
            blind = False
            places = np.concatenate([_spread(np.flatnonzero(one), count) for one, count in zip((off, ~off), counts,
                                                                                               strict=True)])
            told[name] = Told(places, array.reshape(-1)[places])
    blind = blind or (wired and differing < FEWEST and 0 < elements < SMALL)
    if not (blind and wired):
        entry = BugEntry(cause=bug.cause, paper=bug.paper, arrays={}, blind=blind, wired=wired,
                         shapes={name: made[name].shape for name in step.writes})
        bugs.add(step.name, entry, told, known, {name: bound.limit for name, bound in bounds.items()})
    return blind


def _spread(indices: Array, count: int) -> Array:
    """Return at most so many of some indices, evenly spread."""
    if len(indices) <= count:
        return indices
    return np.asarray(indices[_evenly(len(indices), count)])


@functools.cache
def _evenly(size: int, count: int) -> Array:
    return np.linspace(0, size - 1, count).astype(np.int64)


def _save(home: Path, file: str, array: Array) -> tuple[str, str]:
    content = _npy(array)
    (home / file).write_bytes(content)
    return file, _sha256(content)


def _npy(array: Array) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array, version=(1, 0), allow_pickle=False)
    return stream.getvalue()


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _write_frame(folder: Path, made: KitManifest) -> None:
    """Write what surrounds the cases: version, list, schemas, how to read them."""
    (folder / "schema").mkdir()
    for name, model in SCHEMAS.items():
        (folder / "schema" / name).write_text(schema_text(model), encoding="utf-8", newline="\n")
    (folder / "VERSION").write_text(f"{VERSION}\n", encoding="utf-8")
    (folder / KIT).write_text(text_of(made), encoding="utf-8", newline="\n")
    for name in ("README.md", "CHANGES.md", "names-1.toml"):
        (folder / name).write_bytes(resources.files("refgi.vectors").joinpath("files", name).read_bytes())
    (folder / "check.py").write_text(standalone_text(), encoding="utf-8", newline="\n")
