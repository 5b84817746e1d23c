"""The checker: judge a port's arrays by a kit and name the first wrong stage. NumPy alone, but for reading manifests.

A port writes what a stage writes to `OUTPUT/<case>/<array>.npy`. Isolated, it has read the stage's inputs from the kit;
chained, from its own outputs, and the bounds are those of a chain.
"""

import itertools
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from refgi.errors import InputError
from refgi.types import Array
from refgi.vectors.bounds import MOST_SPARED, distance, large_value
from refgi.vectors.causes import EXPLAINED, SEEN, Difference, explain, explained, places_of
from refgi.vectors.judge import Judged, judge, judge_estimate, unlike
from refgi.vectors.kit import Asked, DamagedError, Kit, fits, places_of_case
from refgi.vectors.manifest import (
    ArrayVerdict,
    BugEntry,
    Bugs,
    CaseManifest,
    Cause,
    Result,
    StageEntry,
    StageVerdict,
    Told,
    Tolerance,
    Verdict,
)
from refgi.vectors.port import IN_ORDER, Got, Port
from refgi.vectors.report import (
    CAUSES,
    did_you_mean,
    findings,
    is_line_of,
    is_required,
    lines_of,
    passing_lines,
    require_lines_known,
)
from refgi.vectors.spec import kind_of
from refgi.vectors.storage import PACKED, can_pack, depth_from, list_axis, planes_of

__all__ = ["ALL_WITHIN", "DAMAGED", "NOT_COMPARABLE", "OUT", "TIERS", "Asked", "DamagedError", "Kit",
           "check_output", "stage_of_array"]

ALL_WITHIN, OUT, NOT_COMPARABLE, DAMAGED = 0, 1, 4, 5
TIERS = ("T0", "T1", "T2", "T2B")
FORMATS = (*TIERS, *PACKED)
WRONG = ("out", "invalid")
FOLLOWS = "made from stages that are expected to fail"
DOUBTED = "made from inputs in doubt: not judged are "
OF_A_KIT = ("bounds", "cases", "scenes", "schema")  # folders beside the cases where a kit itself is checked
WIRED = 0.95  # share of the differing elements from which on a wrong wiring counts: there are hundreds to choose from
ORDER: tuple[Verdict, ...] = ("out", "invalid", "not-judged", "within", "exact", "not-run")


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
    _require_known(kit, asked, cases)
    verdicts: list[StageVerdict] = []
    total = sum(asked.fits(step.name) for case in cases for step in case.stages)
    for case in cases:
        verdicts += _of_case(kit, case, output, asked)
        if asked.fail_fast and any(map(_counts, verdicts)):
            break
    if not verdicts:
        raise DamagedError(f"{kit.folder}: expected cases with stages, got none", file=str(kit.folder))
    result = _summed(kit, asked, cases, verdicts, output, _unknown(kit, cases, output))
    return result.model_copy(update={"left": total - len(verdicts)})


def asked_from(options: Mapping[str, Any]) -> Asked:
    """Return what the options of a command line ask for.

    InputError if a tier or a depth is none, or the file of expected failures cannot be read.
    """
    tiers = {}
    for text in options["tiers"]:
        start, _, tier = text.rpartition("=")
        if tier.upper() not in FORMATS:
            raise InputError(f"--tier: expected [NAME=]TIER with a tier of {', '.join(FORMATS)}, got {text!r}")
        tiers[start] = tier.upper()
    return Asked(options["chained"], tuple(options["stages"]), tuple(options["cases"]), tiers, options["layout"],
                 dict(map(depth_from, options["depths"])), tuple(options["unordered"]),
                 lines_of(options["expect"]) if options["expect"] else (),
                 tuple("" if name == "all" else name for name in options["require"]), options["fail_fast"])


def _of_case(kit: Kit, case: CaseManifest, output: Path, asked: Asked) -> list[StageVerdict]:
    """Judge the stages of a case that are asked for; until one is wrong where no more is asked for."""
    port, verdicts = Port(kit, case, output, asked), []
    wrong: dict[str, bool] = {}  # chained: arrays that are out, or made from such; whether that is expected
    doubted: set[str] = set()  # the same: those that are not judged
    for step in case.stages:
        if not asked.fits(step.name):
            port.read(step)
            continue
        upstream = [wrong[name] for name in step.reads if name in wrong]
        verdict = check_stage(port, step, dirty=bool(upstream))
        if verdict.verdict in WRONG:
            why = [f"expected to fail: {line}" for line in asked.expect if is_line_of(line, case.id, step.name)]
            why += [FOLLOWS] if upstream and all(upstream) else []
            verdict = verdict.model_copy(update={"excused": next(iter(why), "")})
            if not upstream and (doubts := ", ".join(name for name in step.reads if name in doubted)):
                causes = (Cause(cause=f"{DOUBTED}{doubts}", share=0.0), *verdict.causes)
                verdict = verdict.model_copy(update={"upstream": "dirty", "causes": causes})
        doubted |= {one.name for one in verdict.arrays if asked.chained and one.verdict == "not-judged"}
        if asked.chained and (upstream or verdict.verdict in WRONG):
            wrong.update(dict.fromkeys(step.writes, bool(verdict.excused) or bool(upstream and all(upstream))))
        verdicts.append(verdict)
        if asked.fail_fast and _counts(verdict):
            break
    return verdicts


def _counts(verdict: StageVerdict) -> bool:
    """Return whether a stage is wrong and not expected to be."""
    return verdict.verdict in WRONG and not verdict.excused


def _require_known(kit: Kit, asked: Asked, cases: list[CaseManifest]) -> None:
    """Refuse names of cases, stages and arrays that nothing has, with the nearest that there are."""
    ids = [entry.id for entry in kit.manifest.cases]
    stages = {step.name for case in cases for step in case.stages}
    arrays = {name for case in cases for step in case.stages for name in step.writes}
    packable = {one for case in cases for step in case.stages for name in step.writes if can_pack(case.arrays[name])
                for one in (name, step.name)}
    lists = {step.name for case in cases for step in case.stages if list_axis(case, step) is not None}
    for case in asked.cases:
        if not any(one.startswith(case) for one in ids):
            raise InputError(f"--case: expected the start of a case's id, got {case!r}{did_you_mean(case, ids)}")
    where = f" of {', '.join(asked.cases)}" if asked.cases else ""
    packed = [name for name, tier in asked.tiers.items() if tier in PACKED]
    for option, what, names, known in (
        ("--stage", "a stage's name", asked.stages, stages),
        ("--tier", "a stage's or an array's name", [*asked.tiers], stages | arrays),
        ("--tier", "the name of an array of three floats", packed, packable),
        ("--depth", "an array's name", [*asked.depth], arrays),
        ("--unordered", "the name of a stage that writes a list", asked.unordered, lists),
    ):
        for name in names:
            if name and not any(fits(one, (name,)) for one in known):
                parts = {part for one in known for part in one.split(".")}
                raise InputError(f"{option}: expected the start of {what}{where}, got {name!r}"
                                 f"{did_you_mean(name, sorted(known | parts))}")
    require_lines_known(kit, asked)


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
    if not any(_counts(one) and one.upstream != "dirty" for one in verdicts):  # doubts alone: the first is to be seen
        verdicts = [one.model_copy(update={"upstream": "clean"}) if one.upstream == "dirty" and one.causes else one
                    for one in verdicts]
    counted = [one for one in verdicts if not one.excused]
    found = {one.verdict for one in counted}
    begun = {one.case for one in verdicts if any(place.is_dir() for place in places_of_case(output, one.case))}
    absent = [one for one in verdicts if one.verdict == "not-run"]
    missing = tuple(f"{one.case}/{one.stage}" for one in absent if is_required(asked.require, one.case, one.stage)
                    or (asked.stages and one.case in begun))
    damaged = any(array.damaged for one in counted for array in one.arrays)
    incomparable = "invalid" in found or missing or len(absent) == len(verdicts)
    code = DAMAGED if damaged else OUT if "out" in found else NOT_COMPARABLE if incomparable else ALL_WITHIN
    worst: Verdict = next((verdict for verdict in ORDER if verdict in found), "within")
    manifests = {case.id: case for case in cases}

    def tried(verdict: StageVerdict) -> dict[str, BugEntry]:
        return {bug.cause: bug for bug in kit.bugs(manifests[verdict.case]).of(verdict.stage) if not bug.blind}

    wrong = findings(counted, tried)
    return Result(kit=kit.manifest.kit, vectors=kit.manifest.vectors, mode="chained" if asked.chained else "isolated",
                  verdict=worst, exit_code=code, first=wrong[0].first if wrong else None, findings=wrong,
                  stages=tuple(one.model_copy(update={"causes": one.causes[:CAUSES]}) for one in verdicts),
                  not_judged=sum(array.verdict == "not-judged" for one in verdicts for array in one.arrays),
                  unknown=unknown, missing=missing, passing=passing_lines(asked.expect, verdicts))


def check_stage(port: Port, step: StageEntry, *, dirty: bool) -> StageVerdict:
    """Judge what a port has of one stage, with every cause; `dirty`: what it read is wrong already."""
    got, asked = port.read(step), port.asked
    tiers = {name: asked.tier_of(step.name, name) for name in step.writes}
    judged = {name: Judged(ArrayVerdict(name=name, verdict="invalid", tier=tiers[name], said=why, damaged=True))
              for name, why in got.damaged.items()}
    judged |= {name: _judged(port, name, got, tiers[name]) for name in got.arrays}
    absent: dict[str, Any] = {"verdict": "invalid", "said": "missing, though other arrays of the stage are there"} if (
        judged) else {"verdict": "not-run"}
    verdicts = [judged[name].verdict if name in judged else ArrayVerdict(name=name, tier=tiers[name], **absent)
                for name in step.writes]
    kinds = {one.verdict for one in verdicts}
    verdict: Verdict = next(one for one in ORDER if one in kinds)
    causes = _causes(port, step, judged, got.arrays) if verdict in WRONG and not dirty else []
    upstream = ("dirty" if dirty else "clean") if asked.chained else "isolated"
    return StageVerdict(case=port.case.id, stage=step.name, verdict=verdict, upstream=upstream,  # type: ignore[arg-type]
                        arrays=tuple(verdicts), causes=tuple(causes))


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
    tier : {"T0", "T1", "T2", "T2B", "R11G11B10F", "RGB9E5"}
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
    if tier not in FORMATS:
        raise InputError(f"tier: expected one of {', '.join(FORMATS)}, got {tier!r}")
    port = Port(kit, manifest, Path(), Asked(tiers={name: tier}))
    port.note_storage(step)
    judged = _judged(port, name, Got({name: got}, {}, {}), tier)
    causes = _causes(port, step, {name: judged}, {name: got}) if judged.verdict.verdict == "out" else []
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


def differences_of(port: Port, step: StageEntry) -> dict[str, Difference]:
    """Return what is out of the arrays that a port has of one stage, by name; DamagedError if one cannot be read."""
    for one in port.case.stages[: port.case.stages.index(step)]:
        port.read(one)
    got = port.read(step)
    for why in got.damaged.values():
        raise DamagedError(why)
    judged = {name: _judged(port, name, got, port.asked.tier_of(step.name, name)) for name in got.arrays}
    return _differing(port.kit, port.case, judged, got.arrays)


def _differing(
    kit: Kit, case: CaseManifest, judged: Mapping[str, Judged], arrays: Mapping[str, Array]
) -> dict[str, Difference]:
    return {name: Difference(name, case.arrays[name], kit.array(case, name), arrays[name], one.out, one.limit)
            for name, one in judged.items() if one.verdict.verdict == "out" and one.out is not None
            and one.limit is not None}


def _judged(port: Port, name: str, got: Got, tier: str) -> Judged:
    """Judge an array; in isolated mode in its own order, or in that of a list that its stage reads."""
    judged = _of_array(port, name, got.arrays, tier)
    if judged.verdict.verdict == "out" and IN_ORDER not in got.read.get(name, ""):
        array = port.in_order_of_lists(name, got.arrays[name])
        other = judged if array is None else _of_array(port, name, {**got.arrays, name: array}, tier)
        if array is not None and other.verdict.verdict != "out":
            judged, got.arrays[name], got.read[name] = other, array, IN_ORDER
    more: dict[str, Any] = {"read": got.read[name]} if name in got.read else {}
    if name in port.loose and judged.verdict.verdict in WRONG:
        return Judged(judged.verdict.model_copy(update={
            **more, "verdict": "not-judged", "said": "made from a list without lights whose flux is stored as 0"}))
    if judged.verdict.verdict == "out" and _may_be_buffer(port, name, got.arrays[name]):
        more["said"] = "a depth buffer? --depth says how it is stored"
    return judged._replace(verdict=judged.verdict.model_copy(update=more))


def _may_be_buffer(port: Port, name: str, got: Array) -> bool:
    """Return whether an array that should hold depth in m holds numbers of a depth buffer."""
    return (name.endswith(".depth") and port.asked.depth_of(name) is None and bool((np.abs(got) <= 1.0).all())
            and large_value(port.kit.array(port.case, name)) > 1.0)


def _of_array(port: Port, name: str, arrays: Mapping[str, Array], tier: str) -> Judged:
    kit, case, asked = port.kit, port.case, port.asked
    entry, got = case.arrays[name], arrays[name]
    fault = unlike(name, tier, entry, got)
    if fault is not None:
        hint = "; --layout rgba takes it" if planes_of(entry, got)[1] else ""
        return Judged(fault.model_copy(update={"said": fault.said + hint}))
    expected = kit.array(case, name)
    if entry.dtype == "|b1":
        got = got.astype(np.bool_)
    if entry.tier == "T3":
        return _judged_estimate(kit, case, name, arrays, expected)
    tolerance = entry.chained if asked.chained else None
    masks = {entry.masked, None if tolerance is None else tolerance.masked}
    if name in port.halved:
        tolerance = _wider(entry.chained_half, entry.half)
        masks |= {one.masked for one in (entry.chained_half, entry.half) if one is not None}
    few_bits = {"T2": None if asked.chained else entry.half, "T2B": entry.bytes}.get(tier)
    if few_bits is not None:
        outliers = max(few_bits.outliers, 0.0 if tolerance is None else tolerance.outliers)
        tolerance = few_bits.model_copy(update={"outliers": outliers})
        masks.add(few_bits.masked)
    if name in port.few and PACKED.keys() & {*asked.tiers.values()}:
        masks.add(entry.packed)
    alone = entry.bound is None or few_bits is not None
    limit = None if alone else kit.extra(case, entry.bound)  # type: ignore[arg-type]
    masked = [kit.extra(case, file) for file in sorted(file for file in masks if file is not None)]
    return judge(name, expected, got, "T0" if entry.tier == "T0" else tier, limit,
                 np.logical_or.reduce(masked) if masked else None, tolerance, port.few.get(name))


def _wider(one: Tolerance | None, other: Tolerance | None) -> Tolerance | None:
    """Return the larger of two tolerances, field by field."""
    if one is None or other is None:
        return one or other
    return one.model_copy(update={key: max(getattr(one, key), getattr(other, key))
                                  for key in ("relative", "large", "outliers")})


def _judged_estimate(kit: Kit, case: CaseManifest, name: str, arrays: Mapping[str, Array], expected: Array) -> Judged:
    """Judge a mean by the standard errors of both; what goes with it, its variance, is judged with it."""
    variance = name.replace(".mean", ".variance_of_mean")
    if variance == name or variance not in case.arrays:
        return Judged(ArrayVerdict(name=name, verdict="within", tier="T3", said="judged with its mean"))
    own = arrays.get(variance)
    own = None if own is None or own.shape != expected.shape else own
    return judge_estimate(name, expected, arrays[name], kit.array(case, variance), own)


def _refutes(kit: Kit, case: CaseManifest, bugs: Bugs, bug: BugEntry, name: str, judged: Judged) -> bool:
    """Return whether an array that is right would not be with a bug."""
    if judged.verdict.verdict not in ("exact", "within") or judged.limit is None or judged.out is None:
        return False
    expected = kit.array(case, name)
    told = bugs.told(bug, name, expected)
    off = distance(told.values, expected.reshape(-1)[told.places])
    return bool(np.mean(off > judged.limit.reshape(-1)[told.places]) > MOST_SPARED)


def _reach(told: Told, difference: Difference) -> float:
    """Return the share of what differs that a bug changes at most, by numbers of elements alone."""
    return min(1.0, told.differing / np.count_nonzero(difference.out)) if told.differing else 1.0


def _alike(values: Array) -> bool:
    counts = np.unique(values, return_counts=True)[1]
    return len(values) > 1 and int(counts.max()) >= EXPLAINED * len(values)


def _causes(
    port: Port, step: StageEntry, judged: Mapping[str, Judged], arrays: Mapping[str, Array]
) -> list[Cause]:
    """Return the causes that explain a stage's difference: the stage's own likely bugs first, then any array's."""
    kit, case = port.kit, port.case
    differing = _differing(kit, case, judged, arrays)
    shapes = {name: array.shape for name, array in arrays.items()}
    found, bugs = [], kit.bugs(case)
    for bug in bugs.of(step.name):
        if bug.blind or any(shapes.get(name, shape) != shape for name, shape in bug.shapes.items()):
            continue
        if any(_refutes(kit, case, bugs, bug, name, judged[name]) for name in bug.arrays.keys() & judged.keys()):
            continue
        told = {name: bugs.told(bug, name, one.expected) for name, one in differing.items() if name in bug.arrays}
        shares = [explained(differing[name], one.values, one.places) for name, one in told.items()]
        shares += [_reach(one, differing[name]) for name, one in told.items() if bug.wired]
        other_shape = any(case.arrays[name].shape != shape for name, shape in bug.shapes.items() if name in shapes)
        share = min(shares, default=0.0) if len(told) == len(differing) else 0.0
        share = 1.0 if other_shape and not differing else share
        if share < (WIRED if bug.wired else EXPLAINED):
            continue
        if bug.wired and told and all(_alike(one.values) for one in told.values()):
            share = min(share, SEEN)  # all dark, say: many wirings lead there
        found.append(Cause(cause=bug.cause, share=share, paper=bug.paper))
    factors = {**case.factors, **_ratios(kit, case)} if differing else {}
    own = {name: explain(one, factors, {other: kit.array(case, other) for other in case.arrays
                                        if case.arrays[other].shape == one.expected.shape})
           for name, one in differing.items()}
    arrays_of = Counter(cause.cause for causes in own.values() for cause in causes)
    found += [cause if arrays_of[cause.cause] == len(own) else cause.model_copy(update={
        "cause": f"in {kind_of(name)}: {cause.cause}", "share": min(cause.share, SEEN)})
        for name, causes in own.items() for cause in causes]
    if not found and not differing:
        found = [Cause(cause="no known cause fits this shape", share=0.0)]
    found = found or [cause for one in differing.values() for cause in places_of(one)]
    unique = {one.cause: one for one in sorted(found, key=lambda one: -round(one.share, 2))}
    return list(unique.values())
