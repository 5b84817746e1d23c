"""The checker: judge a port's arrays by a kit and name the first wrong stage. NumPy alone, but for reading manifests.

A port writes what a stage writes to `OUTPUT/<case>/<array>.npy`. Isolated, it has read the stage's inputs from the kit;
chained, from its own outputs, and the bounds are those of a chain.
"""

import itertools
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from refgi.errors import InputError
from refgi.vectors.causes import EXPLAINED, Difference, explain, explained, places_of
from refgi.vectors.findings import CAUSES, findings
from refgi.vectors.judge import Judged, judge, judge_estimate, unlike
from refgi.vectors.kit import Asked, DamagedError, Kit, find_array, fits, places_of_case, read_array
from refgi.vectors.manifest import ArrayVerdict, CaseManifest, Cause, Result, StageEntry, StageVerdict, Verdict
from refgi.vectors.spec import Array
from refgi.vectors.words import did_you_mean

__all__ = ["ALL_WITHIN", "DAMAGED", "NOT_COMPARABLE", "OUT", "TIERS", "Asked", "DamagedError", "Kit", "check_output",
           "stage_of_array"]

ALL_WITHIN, OUT, NOT_COMPARABLE, DAMAGED = 0, 1, 4, 5
TIERS = ("T0", "T1", "T2", "T2B")
OF_A_KIT = ("cases", "scenes", "schema")  # folders beside the cases where a kit itself is checked
ORDER: tuple[Verdict, ...] = ("out", "invalid", "within", "exact", "not-run")


def check_output(kit: Kit, output: Path, asked: Asked) -> Result:
    """Judge a port's output.

    Parameters
    ----------
    kit : Kit
        The kit.
    output : Path
        Folder of the port's arrays.
    asked : Asked
        Cases, stages, tiers and mode.

    Returns
    -------
    Result
        A verdict for each stage of each case; the first wrong stage is the first that is out or invalid.

    Raises
    ------
    DamagedError
        If the kit or a file of the output is damaged.
    InputError
        If there is no such folder, case or stage.
    """
    if not output.is_dir():
        raise InputError(f"{output}: expected a folder of a port's arrays, got none", file=str(output))
    cases = list(kit.cases(asked))
    _require_known(kit, asked, {step.name for case in cases for step in case.stages})
    verdicts: list[StageVerdict] = []
    for case in cases:
        wrong: set[str] = set()  # chained: arrays that are out, or made from such
        for step in (step for step in case.stages if asked.fits(step.name)):
            dirty = bool(wrong & set(step.reads))
            verdict = check_stage(kit, case, step, output, asked, dirty=dirty)
            if asked.chained and (dirty or verdict.verdict in ("out", "invalid")):
                wrong.update(step.writes)
            verdicts.append(verdict)
    if not verdicts:
        raise DamagedError(f"{kit.folder}: expected cases with stages, got none", file=str(kit.folder))
    return _summed(kit, asked, cases, verdicts, output, _unknown(kit, cases, output))


def _require_known(kit: Kit, asked: Asked, stages: set[str]) -> None:
    """Refuse names of cases, stages and tiers that nothing has, with the nearest that there are."""
    ids = [entry.id for entry in kit.manifest.cases]
    parts = {part for stage in stages for part in stage.split(".")}
    for case in asked.cases:
        if not any(one.startswith(case) for one in ids):
            raise InputError(f"--case: expected the start of a case's id, got {case!r}{did_you_mean(case, ids)}")
    for option, names in (("--stage", asked.stages), ("--tier", tuple(name for name in asked.tiers if name))):
        for name in names:
            if not any(fits(stage, (name,)) for stage in stages):
                where = f" of {', '.join(asked.cases)}" if asked.cases else ""
                raise InputError(f"{option}: expected the start of a stage's name{where}, got {name!r}"
                                 f"{did_you_mean(name, sorted(stages | parts))}")


def _unknown(kit: Kit, cases: list[CaseManifest], output: Path) -> tuple[str, ...]:
    """Return what a port has written that the kit does not know: folders, and files beside the arrays of a case."""
    ids = [entry.id for entry in kit.manifest.cases]
    found = [f"{place.name}: no such case{did_you_mean(place.name, ids)}" for place in sorted(output.iterdir())
             if place.is_dir() and place.name not in (*ids, *OF_A_KIT)]
    for case in cases:
        files = sorted((output / case.id).glob("*"))
        found += [f"{case.id}/{file.name}: no array of this case{did_you_mean(file.stem, case.arrays)}"
                  for file in files if file.is_file() and (file.suffix != ".npy" or file.stem not in case.arrays)]
    return tuple(found)


def _summed(
    kit: Kit, asked: Asked, cases: list[CaseManifest], verdicts: list[StageVerdict], output: Path,
    unknown: tuple[str, ...],
) -> Result:
    found = {one.verdict for one in verdicts}
    begun = {one.case for one in verdicts if any(place.is_dir() for place in places_of_case(output, one.case))}
    missing = asked.stages and any(one.verdict == "not-run" and one.case in begun for one in verdicts)
    damaged = any(array.damaged for one in verdicts for array in one.arrays)
    ran = found - {"not-run"}
    incomparable = "invalid" in found or missing or not ran
    code = DAMAGED if damaged else OUT if "out" in found else NOT_COMPARABLE if incomparable else ALL_WITHIN
    worst = next(verdict for verdict in ORDER if verdict in found)
    manifests = {case.id: case for case in cases}

    def tried(verdict: StageVerdict) -> set[str]:
        return {bug.cause for bug in kit.bugs(manifests[verdict.case]).of(verdict.stage) if not bug.blind}

    wrong = findings(verdicts, tried)
    return Result(kit=kit.manifest.kit, vectors=kit.manifest.vectors, mode="chained" if asked.chained else "isolated",
                  verdict=worst, exit_code=code, first=wrong[0].first if wrong else None, findings=wrong,
                  stages=tuple(one.model_copy(update={"causes": one.causes[:CAUSES]}) for one in verdicts),
                  unknown=unknown)


def check_stage(
    kit: Kit, case: CaseManifest, step: StageEntry, output: Path, asked: Asked, *, dirty: bool
) -> StageVerdict:
    """Judge what a port has of one stage, with every cause; `dirty`: what it read is wrong already."""
    got = {name: file for name in step.writes if (file := find_array(output, case.id, name)) is not None}
    tier = asked.tier_of(step.name)
    judged: dict[str, Judged] = {}
    arrays: dict[str, Array] = {}
    for name, file in got.items():
        try:
            arrays[name] = read_array(file)
        except DamagedError as error:
            fault = ArrayVerdict(name=name, verdict="invalid", tier=tier, said=str(error), damaged=True)
            judged[name] = Judged(fault)
    for name in arrays:
        judged[name] = _judged(kit, case, name, arrays, tier, asked)
    verdicts = [judged[name].verdict if name in judged else _not_run(name, tier, bool(got)) for name in step.writes]
    kinds = {one.verdict for one in verdicts}
    verdict: Verdict = next(one for one in ORDER if one in kinds)
    causes = _causes(kit, case, step, judged, arrays) if verdict in ("out", "invalid") and not dirty else []
    upstream = ("dirty" if dirty else "clean") if asked.chained else "isolated"
    return StageVerdict(case=case.id, stage=step.name, verdict=verdict, upstream=upstream,  # type: ignore[arg-type]
                        arrays=tuple(verdicts), causes=tuple(causes))


def _not_run(name: str, tier: str, others: bool) -> ArrayVerdict:
    """Return the verdict on an array that is not there: missing where others of its stage are."""
    return ArrayVerdict(name=name, verdict="invalid" if others else "not-run", tier=tier,
                        said="missing, though other arrays of the stage are there" if others else "")


def stage_of_array(kit: Kit, case: str, name: str, got: Array, tier: str = "T1") -> StageVerdict:
    """Judge one array by itself, its stage having read the kit's inputs.

    Parameters
    ----------
    kit : Kit
        The kit.
    case : str
        Id of a case.
    name : str
        Name of an array that a stage of it writes.
    got : ndarray
        What the port has.
    tier : {"T0", "T1", "T2", "T2B"}
        How near it must be.

    Returns
    -------
    StageVerdict
        Of the array's stage, from that array alone.

    Raises
    ------
    InputError
        If there is no such case, array or tier.
    """
    manifest = next((one for one in kit.cases(Asked(cases=(case,))) if one.id == case), None)
    if manifest is None:
        raise InputError(f"case: expected one of {', '.join(one.id for one in kit.manifest.cases)}, got {case!r}")
    step = next((one for one in manifest.stages if name in one.writes), None)
    if step is None:
        written = ", ".join(array for one in manifest.stages for array in one.writes)
        raise InputError(f"array: expected one of {written}, got {name!r}")
    if tier not in TIERS:
        raise InputError(f"tier: expected one of {', '.join(TIERS)}, got {tier!r}")
    judged = _judged(kit, manifest, name, {name: got}, tier, Asked())
    causes = _causes(kit, manifest, step, {name: judged}, {name: got}) if judged.verdict.verdict == "out" else []
    return StageVerdict(case=case, stage=step.name, verdict=judged.verdict.verdict, upstream="isolated",
                        arrays=(judged.verdict,), causes=tuple(causes[:CAUSES]))


def _ratios(kit: Kit, case: CaseManifest) -> dict[str, float]:
    """Return what an element comes to where a channel of a colour that is given takes the place of another."""
    found: dict[str, float] = {}
    for name in case.given:
        if case.arrays[name].axes == "rgb" and case.arrays[name].shape == (3,):
            colour = dict(zip(("red", "green", "blue"), kit.array(case, name).astype(float), strict=True))
            found |= {f"{name}, {a}/{b}": x / y for (a, x), (b, y) in itertools.permutations(colour.items(), 2)
                      if x and y}
    return found


def differences_of(
    kit: Kit, case: CaseManifest, step: StageEntry, output: Path, asked: Asked
) -> dict[str, Difference]:
    """Return what is out of the arrays that a port has of one stage, by name.

    Raises
    ------
    DamagedError
        If one cannot be read.
    """
    files = {name: file for name in step.writes if (file := find_array(output, case.id, name)) is not None}
    arrays = {name: read_array(file) for name, file in files.items()}
    judged = {name: _judged(kit, case, name, arrays, asked.tier_of(step.name), asked) for name in arrays}
    return _differing(kit, case, judged, arrays)


def _differing(
    kit: Kit, case: CaseManifest, judged: Mapping[str, Judged], arrays: Mapping[str, Array]
) -> dict[str, Difference]:
    return {name: Difference(name, case.arrays[name], kit.array(case, name), arrays[name], one.out, one.limit)
            for name, one in judged.items() if one.verdict.verdict == "out" and one.out is not None
            and one.limit is not None}


def _judged(
    kit: Kit, case: CaseManifest, name: str, arrays: Mapping[str, Array], tier: str, asked: Asked
) -> Judged:
    entry, got = case.arrays[name], arrays[name]
    fault = unlike(name, tier, entry, got)
    if fault is not None:
        return Judged(fault)
    expected = kit.array(case, name)
    if entry.dtype == "|b1":
        got = got.astype(np.bool_)
    if entry.tier == "T3":
        return _judged_estimate(kit, case, name, arrays, expected)
    tolerance = entry.chained if asked.chained else None
    few_bits = {"T2": entry.half, "T2B": entry.bytes}.get(tier)
    if few_bits is not None:
        outliers = max(few_bits.outliers, 0.0 if tolerance is None else tolerance.outliers)
        tolerance = few_bits.model_copy(update={"outliers": outliers})
    limit = kit.extra(case, entry.bound) if entry.bound is not None else None
    masked = kit.extra(case, entry.masked) if entry.masked is not None else None
    return judge(name, expected, got, "T0" if entry.tier == "T0" else tier, limit, masked, tolerance)


def _judged_estimate(kit: Kit, case: CaseManifest, name: str, arrays: Mapping[str, Array], expected: Array) -> Judged:
    """Judge a mean by the standard errors of both; what goes with it, its variance, is judged with it."""
    variance = name.replace(".mean", ".variance_of_mean")
    if variance == name or variance not in case.arrays:
        return Judged(ArrayVerdict(name=name, verdict="within", tier="T3", said="judged with its mean"))
    own = arrays.get(variance)
    own = None if own is None or own.shape != expected.shape else own
    return judge_estimate(name, expected, arrays[name], kit.array(case, variance), own)


def _causes(
    kit: Kit, case: CaseManifest, step: StageEntry, judged: Mapping[str, Judged], arrays: Mapping[str, Array]
) -> list[Cause]:
    """Return the causes that explain a stage's difference: the stage's own likely bugs first, then any array's."""
    differing = _differing(kit, case, judged, arrays)
    shapes = {name: array.shape for name, array in arrays.items()}
    found, bugs = [], kit.bugs(case)
    for bug in bugs.of(step.name):
        if bug.blind or any(shapes.get(name, shape) != shape for name, shape in bug.shapes.items()):
            continue
        told = {name: bugs.told(bug, name, one.expected) for name, one in differing.items() if name in bug.arrays}
        shares = [explained(differing[name], one.values, one.places) for name, one in told.items()]
        other_shape = any(case.arrays[name].shape != shape for name, shape in bug.shapes.items() if name in shapes)
        share = min(shares, default=0.0) if len(shares) == len(differing) else 0.0
        share = 1.0 if other_shape and not differing else share
        if share >= EXPLAINED:
            found.append(Cause(cause=bug.cause, share=share, paper=bug.paper))
    factors = {**case.factors, **_ratios(kit, case)} if differing else {}
    for one in differing.values():
        found += explain(one, factors, {name: kit.array(case, name) for name in case.arrays
                                              if case.arrays[name].shape == one.expected.shape})
    if not found and not differing:
        found = [Cause(cause="no known cause fits this shape", share=0.0)]
    found = found or [cause for one in differing.values() for cause in places_of(one)]
    unique = {one.cause: one for one in sorted(found, key=lambda one: -round(one.share, 2))}
    return list(unique.values())
