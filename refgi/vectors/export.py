"""Writing a kit: expected arrays, bounds, likely bugs, manifests, schemas, scenes, and how to read them.

A kit is written to a folder beside its own and renamed when it is whole. Its bytes depend on the cases alone, not on
how many processes write them, and in the last bit on the platform's libm where a stage uses it.
"""

import functools
import hashlib
import io
import math
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, wait
from importlib import resources
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from refgi.errors import InputError, expect
from refgi.image.whole import temporary_name
from refgi.jit import threads
from refgi.processes import pool
from refgi.types import Array, Tell
from refgi.vectors.bounds import Bound, Budget, chained_budgets, isolated_bounds, packed_masks, stored_budgets
from refgi.vectors.cases import kit_cases
from refgi.vectors.manifest import (
    BUGS,
    CASE,
    KIT,
    SCHEMAS,
    VERSION,
    ArrayEntry,
    BugWriter,
    CaseManifest,
    KitEntry,
    KitManifest,
    StageEntry,
    Tolerance,
    schema_text,
    text_of,
)
from refgi.vectors.rows import sharing
from refgi.vectors.spec import Arrays, Case, as_read, axes_of, expected_of, kind_of
from refgi.vectors.standalone import is_plain, standalone_text, write_scene
from refgi.vectors.trials import Right, Trials, keep_bug
from refgi.vectors.wiring import wirings

SEED = 20090101  # of the changes that bounds are measured by
PARTS = 2  # of the bytes of an array that it takes with its bounds
SHARED = "bounds"  # folder of bounds and masks, by their hashes: equal ones are kept once
SECONDS_BETWEEN_LOOKS = 0.2
LEVELS, LEAST_SIDE = 8, 8  # of a smaller picture that is proposed: levels of its arrays that are told, pixels
Report = tuple[str, str, float]  # method, what runs, how many of its cases are done
Written = tuple[list[KitEntry], dict[tuple[str, str], int]]

_reports: Any = None  # where a process tells how far it is


def export_kit(
    kit: str, out: Path, tell: Tell = lambda _, __: None, only: str | None = None, processes: int = 1
) -> KitManifest:
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
    processes : int
        How many write at once, each the cases of a method.

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
    return _write_kit(kit, cases, out, tell, whole=only is None, processes=processes)


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
    expect(most > 0, "most", "a number of bytes above 0", most)
    known = expected_of(case)
    sizes = {name: array.nbytes * (1 if name in case.given else PARTS) for name, array in known.items()}
    if (taken := sum(sizes.values())) > most:
        largest = max(sizes, key=lambda name: sizes[name])
        raise InputError(f"{out}: expected a kit of at most {most / 1e6:g} MB, got {taken / 1e6:.3g} MB, of which "
                         f"{sizes[largest] / 1e6:.3g} are {largest}: a smaller size or map "
                         f"({_smaller(case, known, sizes, most)}; --set), fewer stages (--stage) or more room (--most)")
    return _write_kit("scene", {case.id: lambda: case}, out, tell, whole=False)


def _smaller(case: Case, known: Arrays, sizes: Mapping[str, int], most: float) -> str:
    """Return options for sides of picture and maps, halved until a kit of arrays of such bytes fits, as far as known.

    Arrays of rows and columns shrink with the picture, whose level they may be, or with the maps, all others stay.
    """
    camera = case.facts.get("camera", {"rows": 1, "columns": 1})
    picture, maps = (camera["rows"], camera["columns"]), [
        array.shape for name, array in known.items() if kind_of(name) == "rsm.map_triangles"] or [(1, 1)]
    sides: dict[str, tuple[int, ...]] = {  # faces of a cube lie below each other
        "--size": picture, "--rsm-resolution": (maps[0][1], maps[0][1])}
    options = {_level(side, k): option for option, some in (("--rsm-resolution", maps), ("--size", [picture]))
               for side in some for k in range(LEVELS)}
    taken = dict.fromkeys((*sides, "no option"), 0.0)
    for name, size in sizes.items():
        axes = dict(zip(axes_of(case.specs[name].axes), known[name].shape, strict=False))
        taken[options.get((axes.get("row", 0), axes.get("column", 0)), "no option")] += size
    halved = set()
    while sum(taken.values()) > most:
        option = max(sides, key=lambda one: taken[one])
        side, sides[option] = sides[option], _level(sides[option], 1)
        taken[option] *= math.prod(sides[option]) / math.prod(side)
        halved.add(option)
        if min(sides[option]) < LEAST_SIDE:
            return ", ".join(sides)
    rest = [f"{option} {'x'.join(map(str, side[::-1][:1 + (option == '--size')]))}" for option, side in sides.items()
            if option in halved]
    return f"{' '.join(rest)} would take {sum(taken.values()) / 1e6:.3g} MB"


def _level(side: tuple[int, ...], number: int) -> tuple[int, ...]:
    """Return rows and columns halved some times, rounded up."""
    return tuple(-(-one // 2**number) for one in side)


def _write_kit(
    kit: str, cases: Mapping[str, Callable[[], Case]], out: Path, tell: Tell, *, whole: bool, processes: int = 1
) -> KitManifest:
    """Write cases; `whole`: all of a kit, some of which must tell each likely bug."""
    from refgi.provenance import program

    if out.exists() and (not out.is_dir() or (any(out.iterdir()) and not (out / KIT).is_file())):
        found = "a folder of other files" if out.is_dir() else "a file"
        raise InputError(f"{out}: expected a new folder or a kit, got {found}", file=str(out))
    part = temporary_name(out)
    groups: dict[str, list[str]] = {}
    for name in cases:
        groups.setdefault(name.partition("-")[0], []).append(name)
    done = dict.fromkeys(groups, 0.0)

    def report(said: Report) -> None:
        done[said[0]] = said[2]
        tell(said[1], sum(done.values()) / len(cases))

    try:
        (part / SHARED).mkdir(parents=True)
        if min(processes, len(groups)) > 1:
            written = _write_in_processes(kit, groups, part, report, processes)
        else:
            written = [_write_cases(method, {name: cases[name] for name in names}, part, report)
                       for method, names in groups.items()]
        if whole:
            _expect_none_blind(told for _, told in written)
        made = KitManifest(kit=kit, vectors=VERSION, refgi=" ".join(program().values()),
                           cases=tuple(entry for entries, _ in written for entry in entries))
        _write_frame(part, made)
        if out.exists():
            shutil.rmtree(out)
        part.replace(out)
    except OSError as error:
        raise InputError(f"{out}: cannot be written: {error.strerror or error}", file=str(out)) from error
    except BrokenExecutor as error:
        raise InputError(f"{out}: cannot be written: a process was ended, maybe for lack of memory") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
    tell("done", 1.0)
    return made


def _write_in_processes(
    kit: str, groups: Mapping[str, list[str]], part: Path, report: Callable[[Report], None], processes: int
) -> list[Written]:
    """Write the cases of methods in several processes, the longest first."""
    reports = get_context("spawn").SimpleQueue()
    with pool(min(processes, len(groups)), _report_to, reports) as workers:
        of = {method: workers.submit(_write_of_kit, kit, method, groups[method], part)
              for method in sorted(groups, key=lambda method: -len(groups[method]))}
        left = set(of.values())
        while left:
            ended, left = wait(left, SECONDS_BETWEEN_LOOKS, FIRST_COMPLETED)
            for one in ended:
                one.result()
            while not reports.empty():
                report(reports.get())
    return [of[method].result() for method in groups]


def _report_to(reports: Any) -> None:
    """Begin a process that writes cases."""
    global _reports
    _reports = reports


def _write_of_kit(kit: str, method: str, names: list[str], part: Path) -> Written:
    makes = kit_cases(kit)
    return _write_cases(method, {name: makes[name] for name in names}, part, _reports.put)


def _write_cases(
    method: str, cases: Mapping[str, Callable[[], Case]], part: Path, report: Callable[[Report], None]
) -> Written:
    """Write the cases of a method; return their entries and how many stages tell each likely bug."""
    entries, trials = [], Trials()
    with threads(1):  # pictures of a few hundred pixels are done before a second thread has woken
        for number, (name, make) in enumerate(cases.items()):
            manifest = write_case(make(), part, trials, lambda stage, done, name=name, number=number: report(  # type: ignore[misc]
                (method, f"{name}: {stage}" if stage else name, number + done)))
            text = text_of(manifest)
            (part / "cases" / name / CASE).write_text(text, encoding="utf-8", newline="\n")
            entries.append(KitEntry(id=name, method=manifest.method, what=manifest.what,
                                    manifest=f"cases/{name}/{CASE}", sha256=_sha256(text.encode())))
    return entries, trials.stages


def _expect_none_blind(methods: Iterable[Mapping[tuple[str, str], int]]) -> None:
    """Refuse bugs that no case tells."""
    total = Counter[tuple[str, str]]()
    for told in methods:
        total.update(told)
    blind = [f"{stage}: {cause}" for (stage, cause), count in total.items() if not count]
    if blind:
        raise InputError(f"kit: expected a case that tells each likely bug, got none for {'; '.join(blind)}")


def write_case(case: Case, folder: Path, trials: Trials, tell: Tell) -> CaseManifest:
    """Write the arrays of a case below a kit's folder and return its manifest, which is not written yet."""
    home = folder / "cases" / case.id
    for name in ("in", "out"):
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
        packed = packed_masks(case, step, known, SEED)
        for name in step.writes:
            entry = _entry(case, name, known[name], _save(home, f"out/{name}.npy", known[name]))
            arrays[name] = entry.model_copy(update=_tolerances(folder, entry, bounds[name], packed.get(name), {
                "chained": chained[name], "half": halves[name], "bytes": in_bytes[name],
                "chained_half": chained_half[name]}))
        right = Right(step, as_read(known, step.reads, np.float64), known, bounds)
        with sharing():
            for bug in step.bugs:
                if not trials.enough(step.name, bug.cause):
                    trials.add(step.name, bug.cause, not keep_bug(bugs, right, bug))
            for bug in wirings(case, step, known, functools.partial(trials.wiring, step.name)):
                trials.tried(step.name, bug.cause, not keep_bug(bugs, right, bug, wired=True))
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
    folder: Path, entry: ArrayEntry, bound: Bound, packed: Array | None, budgets: Mapping[str, Budget]
) -> Mapping[str, object]:
    """Return the fields of an array that say how far it may be off."""
    more: dict[str, object] = {}
    for key, budget in budgets.items():
        file = None if budget.masked is None else _shared(folder, budget.masked)
        relative, large = (float(f"{one:.6g}") for one in (budget.relative, budget.large))
        more[key] = Tolerance(relative=relative, large=large, outliers=budget.outliers, masked=file)
    if entry.dtype == "<f4":
        more |= {"bound": _shared(folder, bound.limit)}
    if packed is not None:
        more |= {"packed": _shared(folder, packed)}
    if bound.masked.any():
        more |= {"masked": _shared(folder, bound.masked),
                 "masked_count": int(np.count_nonzero(bound.masked))}
    return more


def _shared(folder: Path, array: Array) -> str:
    """Write an array that equal ones share unless it is there; return its file, as seen from a case's folder."""
    content = _npy(array)
    file = folder / SHARED / f"{_sha256(content)[:16]}.npy"
    if not file.exists():
        file.write_bytes(content)
    return f"../../{SHARED}/{file.name}"


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
