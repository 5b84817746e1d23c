"""How far a port may be off: bounds for each element, measured by what rounding does to the stage itself.

A port that computes in float32, with fused or reordered operations, returns about what the exact stage returns for
inputs a few roundings away. So each stage is run again: by refgi's float32 kernels, in other ways that ports write it
in float32, and in float64 on inputs changed at random by up to two roundings of float32. The bound is SAFETY times the
largest change seen, plus the rounding of the result and of the largest values beside it. Where a change moves a
decision (an edge, a tie) the element is masked: it may differ at will.

Tier T2 has the same for storage in half floats, as one bound for the array and a share of outliers; tier T2B for 8 bits
where values have no unit and lie in [0, 1] or [-1, 1] (normals, albedo, shares), half floats elsewhere. Bounds of a
chained run, in which every stage reads the roundings of those before, are of that form too.

Inputs that a stage takes as `exact` are not changed: points whose differences float32 finds without error, numbers that
decide which texel is meant. The kit holds them to the bit.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from refgi.vectors.spec import Array, Arrays, Case, Stage, as_read, outputs_of, stored

SAFETY = 4.0  # a handful of runs sees a third to all of what a rounding can do
SIGMAS = 4.0  # of an estimate's mean, and of a pixel but for a few of them
RUNS = 4  # with changed inputs
ROUNDING = 2.0**-24  # of float32, relative
HALF_ROUNDING = 2.0**-11  # of float16
BYTE, SIGNED_BYTE = 1 / 255, 1 / 127  # steps of [0, 1] and [-1, 1] in 8 bits
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


NO_BUDGET = Budget(0.0, 0.0, 1.0)  # of estimates, which have standard errors instead


def isolated_bounds(case: Case, step: Stage, known: Arrays, seed: int) -> dict[str, Bound]:
    """Return the bound of each array that a stage of a case writes, its inputs being the stored ones."""
    if is_estimate(case, step):
        return {name: _spread_bound(known, name) for name in step.writes}
    runs = [outputs_of(step, known, np.float32, run) for run in (step.run, *step.variants)]
    runs += [_run(step, changed) for changed in _changed(step, known, seed, _rounded_at_random)]
    return {name: _bound(known[name], [run[name] for run in runs], _large(case, name, known[name]))
            for name in step.writes}


def stored_budgets(case: Case, step: Stage, known: Arrays, seed: int, *, in_bytes: bool) -> dict[str, Budget]:
    """Return the budget of each array that a stage of a case writes when its floats are kept in few bits.

    In half floats (T2), or `in_bytes`: in 8 bits where they fit (T2B).
    """
    if is_estimate(case, step):
        return dict.fromkeys(step.writes, NO_BUDGET)
    steps = {name: byte_step(case, name, known[name]) if in_bytes else 0.0 for name in (*step.reads, *step.writes)}

    def change(name: str, array: Array, random: np.random.Generator) -> Array:
        if steps[name]:
            stored_near = steps[name] * np.floor(array / steps[name] + random.uniform(0.0, 1.0, array.shape))
            return np.asarray(np.where(array < 1.0, np.minimum(stored_near, BELOW_1), stored_near))
        return _rounded_at_random(name, array, random, HALF_ROUNDING / CHANGE)

    runs = [{name: _to_bytes(array, steps[name]) if steps[name] else _to_half(array)
             for name, array in _run(step, changed).items()} for changed in _changed(step, known, seed, change)]
    budgets = {}
    for name in step.writes:
        large = _large(case, name, known[name])
        rounding = 0.5 * steps[name] / large if steps[name] else HALF_ROUNDING
        budgets[name] = _budget(known[name], [run[name] for run in runs], rounding, large,
                                DECIDED_IN_BYTES if in_bytes else DECIDED)
    return budgets


def byte_step(case: Case, name: str, array: Array) -> float:
    """Return the step at which 8 bits keep an array's numbers; 0 where its numbers are not of that kind."""
    spec = case.specs[name]
    if array.dtype.kind != "f" or spec.unit != "1" or spec.alone or not np.isfinite(array).all():
        return 0.0
    if large_value(array) < LEAST_IN_BYTES or np.abs(array).max(initial=0.0) > 1.0:
        return 0.0
    return BYTE if array.min(initial=0.0) >= 0.0 else SIGNED_BYTE


def chained_budgets(case: Case, known: Arrays, seed: int) -> dict[str, Budget]:
    """Return the budget of each array when every stage reads the rounded outputs of those before it."""
    runs: list[dict[str, Array]] = []
    for number in range(RUNS):
        random = np.random.default_rng([seed, number])
        chain = {name: stored(array) for name, array in case.given.items()}
        for step in case.stages:
            if is_estimate(case, step):
                continue
            changed = {name: array if name in step.exact else _rounded_at_random(name, array, random)
                       for name, array in as_read(chain, step.reads, np.float64).items()}
            chain.update(_run(step, changed))
        runs.append(chain)
    written = [name for step in case.stages for name in step.writes]
    estimates = {name for step in case.stages if is_estimate(case, step) for name in step.writes}
    return {name: NO_BUDGET if name in estimates else
            _budget(known[name], [run[name] for run in runs], ROUNDING, _large(case, name, known[name]))
            for name in written}


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


def _changed(
    step: Stage, known: Arrays, seed: int, change: Callable[[str, Array, np.random.Generator], Array]
) -> Iterator[dict[str, Array]]:
    exact = as_read(known, step.reads, np.float64)
    for number in range(RUNS):
        random = np.random.default_rng([seed, number])
        yield {name: array if name in step.exact else change(name, array, random) for name, array in exact.items()}


def _run(step: Stage, inputs: Arrays) -> dict[str, Array]:
    made = step.run(inputs, np.float64)
    return {name: stored(made[name]) for name in step.writes}


def _rounded_at_random(
    _: str, array: Array, random: np.random.Generator, rounding: float = ROUNDING
) -> Array:
    if array.dtype.kind != "f":
        return array
    return np.asarray(array * (1.0 + rounding * CHANGE * random.uniform(-1.0, 1.0, array.shape)))


def _to_half(array: Array) -> Array:
    if array.dtype.kind != "f":
        return array
    with np.errstate(over="ignore", under="ignore"):
        return array.astype(np.float16).astype(np.float32)


def _to_bytes(array: Array, step: float) -> Array:
    least = 0.0 if step == BYTE else -1.0
    return (step * np.rint(np.clip(array, least, 1.0) / step)).astype(np.float32)


def _large(case: Case, name: str, expected: Array) -> float:
    return 0.0 if case.specs[name].alone or expected.dtype.kind != "f" else large_value(expected)


def _bound(expected: Array, runs: list[Array], large: float) -> Bound:
    if any(run.shape != expected.shape for run in runs):
        return Bound(np.zeros(expected.shape, np.float32), np.ones(expected.shape, np.bool_))
    off = np.max([distance(run, expected) for run in runs], axis=0, initial=0.0)
    if expected.dtype.kind != "f":
        return Bound(np.zeros(expected.shape, np.float32), off > 0)
    magnitude = np.where(np.isfinite(expected), np.abs(expected), 0.0).astype(np.float64)
    masked = off > np.maximum(DECIDED * large, DECIDED * magnitude)
    limit = SAFETY * (off + ROUNDING * (magnitude + large)) + FLUSHED
    return Bound(np.where(masked, 0.0, limit).astype(np.float32), masked)


def _budget(
    expected: Array, runs: list[Array], rounding: float, large: float, decided: float = DECIDED
) -> Budget:
    same = [run for run in runs if run.shape == expected.shape]
    if not same or expected.size == 0:
        return Budget(0.0, large, 1.0 if expected.size else 0.0)
    off = np.array([distance(run, expected) for run in same])
    if expected.dtype.kind != "f":
        return Budget(0.0, 0.0, _outliers(off > 0, expected.size))
    size = np.where(np.isfinite(expected), np.abs(expected), 0.0).astype(np.float64) + large
    share = np.divide(off, size, out=np.where(off > 0, np.inf, 0.0), where=size > 0)
    usual = share[share < decided]
    relative = SAFETY * (rounding + (float(np.quantile(usual, USUAL)) if usual.size else 0.0))
    return Budget(relative, large, _outliers(share > relative, expected.size))


def _outliers(out: Array, size: int) -> float:
    """Return the share of outliers to allow: SAFETY times that seen, and never none where some were."""
    worst = int(out.reshape(len(out), -1).sum(axis=1).max())
    return min(1.0, SAFETY * worst / size)


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
