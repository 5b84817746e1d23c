"""How far a port may be off: bounds for each element, measured by what rounding does to the stage itself.

A port that computes in float32, with fused or reordered operations, returns about what the exact stage returns for
inputs a few roundings away. So each stage is run again: by refgi's float32 kernels, in other ways that ports write it
in float32, and in float64 on inputs changed at random by up to two roundings of float32. The bound is SAFETY times the
largest change seen, plus the rounding of the result and of the largest values beside it. Where a change moves a
decision (an edge, a tie) the element is masked: it may differ at will.

Tier T2 has the same for storage in half floats, as one bound for the array and a share of outliers; tier T2B for 8 bits
where values have no unit and lie in [0, 1] or [-1, 1] (normals, albedo, shares), half floats elsewhere. Bounds of a
chained run, in which every stage reads the roundings of those before, in float32 or in half floats, are of that form
too. Where more than MOST_SPARED
of an array would be outliers, further runs find which elements they are: those are masked, and outliers are what a run
has beside them.

Inputs that a stage takes as `exact` are not changed: points whose differences float32 finds without error, numbers that
decide which texel is meant. The kit holds them to the bit.
"""

import functools
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from refgi.types import Array
from refgi.vectors.spec import Arrays, Case, Stage, as_read, outputs_of, stored

SAFETY = 4.0  # a handful of runs sees a third to all of what a rounding can do
SIGMAS = 4.0  # of an estimate's mean, and of a pixel but for a few of them
RUNS = 4  # with changed inputs
MORE_RUNS = 8  # where the first ones have many outliers
MOST_SPARED = 0.05  # share of an array beyond its bounds from which on it is not judged
ROUNDING = 2.0**-24  # of float32, relative
HALF_ROUNDING = 2.0**-11  # of float16
PACKED_STEP = 2.0**-5  # of R11G11B10F, relative, at its coarsest
BYTE, SIGNED_BYTE = 1 / 255, 1 / 127  # steps of [0, 1] and [-1, 1] in 8 bits
TYPICAL = 0.5  # quantile of an array's relative changes: an element that a few runs hardly move has been lucky
LARGEST = 2.0  # times the largest change that runs have shown, where none is an outlier: one more run may have more
CHANGE = 2.0  # roundings that inputs are changed by, at most
FLUSHED = 2.0**-126  # smaller numbers are subnormal in float32: many machines flush them to 0
BELOW_1 = 1.0 - 2.0**-24  # sample points stay in [0, 1)
LEAST_IN_BYTES = 0.1  # large values below are not kept in 8 bits: too few steps would be left
LARGE = 0.9  # quantile of an array's magnitudes that stands for "the largest values beside it"
USUAL = 0.995  # quantile of changes that a budget is made of; what lies beyond are outliers
DECIDED = 0.02  # a change beyond this share of the array's large values is a decision taken otherwise
DECIDED_IN_BYTES = 0.1  # the same in 8 bits, whose steps are 0.4 to 0.8 %


class Bound(NamedTuple):
    """How far each element of an array may be off."""

    limit: Array  # as the array: absolute; 0 for integers
    masked: Array  # as the array, bool: elements that may differ at will


class Budget(NamedTuple):
    """How far an array may be off: ``|got - expected| <= relative (|expected| + large)`` but for outliers."""

    relative: float
    large: float  # magnitude that stands for the array's large values
    outliers: float  # share of elements
    masked: Array | None = None  # as the array, bool: elements that may differ at will


NO_BUDGET = Budget(0.0, 0.0, 1.0)  # of estimates, which have standard errors instead, and of what chains make of them


def isolated_bounds(case: Case, step: Stage, known: Arrays, seed: int) -> dict[str, Bound]:
    """Return the bound of each array that a stage of a case writes, its inputs being the stored ones."""
    if is_estimate(case, step):
        return {name: _spread_bound(known, name) for name in step.writes}
    runs = [outputs_of(step, known, np.float32, run) for run in (step.run, *step.variants)]
    changed = _changed_runs(step, known, seed, _rounded_at_random)
    runs += [changed(number) for number in range(RUNS)]
    return {name: _bound(known[name], [run[name] for run in runs], _large(case, name, known[name]))
            for name in step.writes}


def stored_budgets(case: Case, step: Stage, known: Arrays, seed: int) -> tuple[dict[str, Budget], dict[str, Budget]]:
    """Return the budgets of each array that a stage of a case writes when its floats are kept in few bits.

    In half floats (T2), and in 8 bits where they fit (T2B); where none fits both rest on the same runs.
    """
    if is_estimate(case, step):
        return dict.fromkeys(step.writes, NO_BUDGET), dict.fromkeys(step.writes, NO_BUDGET)
    steps = {name: byte_step(case, name, known[name]) for name in (*step.reads, *step.writes)}
    large = {name: _large(case, name, known[name]) for name in step.writes}

    def in_half(name: str, array: Array, random: np.random.Generator) -> Array:
        return _rounded_at_random(name, array, random, HALF_ROUNDING / CHANGE)

    def in_few_bits(name: str, array: Array, random: np.random.Generator) -> Array:
        if not steps[name]:
            return in_half(name, array, random)
        stored_near = steps[name] * np.floor(array / steps[name] + random.uniform(0.0, 1.0, array.shape))
        return np.asarray(np.where(array < 1.0, np.minimum(stored_near, BELOW_1), stored_near))

    half_run = _changed_runs(step, known, seed, in_half, lambda _, array: _to_half(array))
    byte_run = half_run if not any(steps.values()) else _changed_runs(
        step, known, seed, in_few_bits, lambda name, array: _to_bytes(array, steps[name]))
    rounding = {name: 0.5 * steps[name] / large[name] if steps[name] and large[name] else HALF_ROUNDING
                for name in step.writes}
    halves, in_bytes = ({name: Measures(known[name], share[name], large[name], decided) for name in step.writes}
                        for share, decided in ((dict.fromkeys(step.writes, HALF_ROUNDING), DECIDED),
                                               (rounding, DECIDED_IN_BYTES)))
    return _budgets(halves, half_run), _budgets(in_bytes, byte_run)


def packed_masks(case: Case, step: Stage, known: Arrays, seed: int) -> dict[str, Array]:
    """Return which whole numbers that a stage writes change where the floats it reads do by a step of packed floats.

    By name; those of which none does are left out. Each float is moved to either end of its step.
    """
    def at_ends(_: str, array: Array, random: np.random.Generator) -> Array:
        if array.dtype.kind != "f":
            return array
        moved = array * (1.0 + PACKED_STEP * random.choice((-1.0, 1.0), array.shape))
        return np.asarray(np.where(array < 1.0, np.minimum(moved, BELOW_1), moved))

    whole = [name for name in step.writes if known[name].dtype.kind != "f" and known[name].size]
    if not whole or is_estimate(case, step):
        return {}
    run = _changed_runs(step, known, seed, at_ends)
    with np.errstate(all="ignore"):  # what no stage is handed
        runs = [run(number) for number in range(RUNS + MORE_RUNS)]
    masks = {name: np.logical_or.reduce([made[name] != known[name] for made in runs
                                         if made[name].shape == known[name].shape] or [
                                             np.zeros(known[name].shape, np.bool_)]) for name in whole}
    return {name: mask for name, mask in masks.items() if mask.any()}


def byte_step(case: Case, name: str, array: Array) -> float:
    """Return the step at which 8 bits keep an array's numbers; 0 where its numbers are not of that kind."""
    spec = case.specs[name]
    if array.dtype.kind != "f" or spec.unit != "1" or spec.alone or not np.isfinite(array).all():
        return 0.0
    if large_value(array) < LEAST_IN_BYTES or np.abs(array).max(initial=0.0) > 1.0:
        return 0.0
    return BYTE if array.min(initial=0.0) >= 0.0 else SIGNED_BYTE


def chained_budgets(case: Case, known: Arrays, seed: int, *, in_halves: bool = False) -> dict[str, Budget]:
    """Return the budget of each array when every stage reads the rounded outputs of those before it.

    Every other run is in float32, whose roundings within a stage are more than those of what it reads. `in_halves`: all
    that stages write is stored in half floats but for what one takes as exact.
    """
    exact = {name for step in case.stages for name in step.exact}
    halved = {name for step in case.stages for name in step.writes if in_halves and name not in exact}
    rounding = {name: HALF_ROUNDING / CHANGE for name in halved}
    estimates = set[str]()  # and what is made of them
    for step in case.stages:
        if is_estimate(case, step) or not estimates.isdisjoint(step.reads):
            estimates.update(step.writes)

    def run(number: int) -> dict[str, Array]:
        random, real = np.random.default_rng([seed, number]), np.float32 if number % 2 else np.float64
        chain = {name: stored(array) for name, array in case.given.items()}
        for step in case.stages:
            if estimates.isdisjoint(step.writes):
                changed = {name: array if name in step.exact else _rounded_at_random(
                    name, array, random, rounding.get(name, ROUNDING))
                    for name, array in as_read(chain, step.reads, real).items()}
                chain.update({name: _to_half(array) if name in halved else array
                              for name, array in _run(step, changed, real).items()})
        return chain

    written = [name for step in case.stages for name in step.writes if name not in estimates]
    return dict.fromkeys(estimates, NO_BUDGET) | _budgets(
        {name: Measures(known[name], HALF_ROUNDING if name in halved else ROUNDING, _large(case, name, known[name]),
                        DECIDED) for name in written}, run)


def is_estimate(case: Case, step: Stage) -> bool:
    """Return whether a stage writes estimates (T3), which are judged by their standard errors."""
    return any(case.specs[name].tier == "T3" for name in step.writes)


def _spread_bound(known: Arrays, name: str) -> Bound:
    """Return SIGMAS standard errors of the difference of two such estimates; 0 for what is no mean."""
    variance = known.get(name.replace(".mean", ".variance_of_mean"))
    nowhere = np.zeros(known[name].shape, np.bool_)
    if variance is None or variance is known[name] or variance.shape != known[name].shape:
        return Bound(np.zeros(known[name].shape, np.float32), nowhere)
    return Bound((SIGMAS * np.sqrt(2.0 * variance.astype(np.float64))).astype(np.float32), nowhere)


def _changed_runs(
    step: Stage, known: Arrays, seed: int, change: Callable[[str, Array, np.random.Generator], Array],
    keep: Callable[[str, Array], Array] = lambda _, array: array,
) -> Callable[[int], dict[str, Array]]:
    """Return what makes a stage's arrays of changed inputs, by number, as `keep` stores them; once if none changes."""
    read = as_read(known, step.reads, np.float64)
    changes = any(array.dtype.kind == "f" for name, array in read.items() if name not in step.exact)

    @functools.cache
    def run(number: int) -> dict[str, Array]:
        random = np.random.default_rng([seed, number])
        made = _run(step, {name: array if name in step.exact else change(name, array, random)
                           for name, array in read.items()})
        return {name: keep(name, array) for name, array in made.items()}

    return run if changes else lambda _: run(0)


def _run(step: Stage, inputs: Arrays, real: type = np.float64) -> dict[str, Array]:
    made = step.run(inputs, real)
    return {name: stored(made[name]) for name in step.writes}


def _rounded_at_random(
    _: str, array: Array, random: np.random.Generator, rounding: float = ROUNDING
) -> Array:
    if array.dtype.kind != "f":
        return array
    changed = array * (1.0 + rounding * CHANGE * random.uniform(-1.0, 1.0, array.shape))
    return np.asarray(changed, array.dtype)


def _to_half(array: Array) -> Array:
    if array.dtype.kind != "f":
        return array
    with np.errstate(over="ignore", under="ignore"):
        return array.astype(np.float16).astype(np.float32)


def _to_bytes(array: Array, step: float) -> Array:
    if not step:
        return _to_half(array)
    least = 0.0 if step == BYTE else -1.0
    return (step * np.rint(np.clip(array, least, 1.0) / step)).astype(np.float32)


def _large(case: Case, name: str, expected: Array) -> float:
    return 0.0 if case.specs[name].alone or expected.dtype.kind != "f" else large_value(expected)


def _bound(expected: Array, runs: list[Array], large: float) -> Bound:
    if any(run.shape != expected.shape for run in runs):
        return Bound(np.zeros(expected.shape, np.float32), np.ones(expected.shape, np.bool_))
    off = distance(np.stack(runs), expected).max(axis=0, initial=0.0)
    if expected.dtype.kind != "f":
        return Bound(np.zeros(expected.shape, np.float32), off > 0)
    magnitude = np.where(np.isfinite(expected), np.abs(expected), 0.0).astype(np.float64)
    masked = off > np.maximum(DECIDED * large, DECIDED * magnitude)
    size = magnitude + large
    moved = (off > 0) & ~masked & (magnitude > 0)
    if moved.any():
        typical = float(np.quantile(off[moved] / size[moved], TYPICAL))
        off = np.where(moved, np.maximum(off, typical * size), off)
    limit = SAFETY * (off + ROUNDING * size) + FLUSHED
    return Bound(np.where(masked, 0.0, limit).astype(np.float32), masked)


class Measures(NamedTuple):
    """What a budget is measured by."""

    expected: Array
    rounding: float  # of the result, relative
    large: float
    decided: float  # DECIDED


def _budgets(
    arrays: Mapping[str, Measures], run: Callable[[int], Mapping[str, Array]]
) -> dict[str, Budget]:
    """Return budgets by runs that write all the arrays; by further runs where outliers are many."""
    runs = [run(number) for number in range(RUNS)]
    found = {name: _budget(one, [made[name] for made in runs]) for name, one in arrays.items()}
    many = [name for name, one in found.items() if one.outliers > MOST_SPARED]
    if many:
        runs += [run(number) for number in range(RUNS, RUNS + MORE_RUNS)]
        found |= {name: _masked(arrays[name], found[name], [made[name] for made in runs]) for name in many}
    return found


def _budget(measures: Measures, runs: list[Array]) -> Budget:
    """Return the budget that the usual changes need; the rest are outliers."""
    expected, rounding, large, decided = measures
    same = [run for run in runs if run.shape == expected.shape]
    if not same or expected.size == 0:
        return Budget(0.0, large, 1.0 if expected.size else 0.0)
    if expected.dtype.kind != "f":
        budget, beyond = Budget(0.0, 0.0, 0.0), _beyond(expected, same, Budget(0.0, 0.0, 0.0))
    else:
        if not large:  # nothing but 0 is expected: what a run has instead is rounding
            large = max(large_value(run) for run in same) / rounding if not expected.any() else 0.0
        share = _shares(expected, same, large)
        usual = share[share < decided]
        budget = Budget(SAFETY * (rounding + (float(np.quantile(usual, USUAL)) if usual.size else 0.0)), large, 0.0)
        beyond = share > budget.relative
    worst = max(int(np.count_nonzero(one)) for one in beyond)
    if not worst and budget.relative:
        budget = budget._replace(relative=max(budget.relative, LARGEST * float(usual.max(initial=0.0))))
    return budget._replace(outliers=_allowed(worst, expected.size))


def _masked(measures: Measures, budget: Budget, runs: list[Array]) -> Budget:
    """Return a budget that masks what is beyond it in any run; outliers are what one run alone has."""
    same = [run for run in runs if run.shape == measures.expected.shape]
    if not same:
        return budget
    beyond = _beyond(measures.expected, same, budget)
    count = beyond.sum(axis=0)
    alone = max(int(np.count_nonzero(one & (count == 1))) for one in beyond)
    return budget._replace(outliers=_allowed(alone, measures.expected.size), masked=count > 0)


def _shares(expected: Array, runs: list[Array], large: float) -> Array:
    """Return how far runs are off, beside an element and the array's large values."""
    off = distance(np.stack(runs), expected)
    size = np.where(np.isfinite(expected), np.abs(expected), 0.0).astype(np.float64) + large
    return np.asarray(np.divide(off, size, out=np.where(off > 0, np.inf, 0.0), where=size > 0))


def _beyond(expected: Array, runs: list[Array], budget: Budget) -> Array:
    if expected.dtype.kind != "f":
        return np.array([run != expected for run in runs])
    return np.asarray(_shares(expected, runs, budget.large) > budget.relative)


def _allowed(count: int, size: int) -> float:
    """Return the share of outliers to allow: SAFETY times that seen, and never none where some were."""
    return min(1.0, SAFETY * count / size)


def large_value(expected: Array) -> float:
    """Return the magnitude that stands for an array's large values; 0 where all is 0."""
    magnitude = np.abs(expected[np.isfinite(expected) & (expected != 0)], dtype=np.float64)
    return float(np.quantile(magnitude, LARGE)) if magnitude.size else 0.0


def distance(got: Array, expected: Array) -> Array:
    """Return ``|got - expected|`` in float64: 0 where both are the same infinity, inf where one alone is finite."""
    with np.errstate(invalid="ignore"):  # a signalling NaN
        a, b = np.asarray(got, np.float64), np.asarray(expected, np.float64)
    finite = np.isfinite(a) & np.isfinite(b)
    off = np.where((a == b), 0.0, np.inf)
    np.subtract(a, b, out=off, where=finite)
    return np.asarray(np.abs(off))
