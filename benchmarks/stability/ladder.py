"""Oracle ladder: a scalar kernel in float32 and in float64 against its formula in longdouble and with 50 digits.

The figure is the error in units in the last place (ULP) over the condition of the inputs. With the limit n, the
condition is how far the exact formula moves when one of the inputs moves by n of its own ULP, over n ULP of the answer,
and 1 at least; so a pair whose cosine cancels is not blamed on the kernel. The move is n ULP and not the smallest,
because a formula such as |r - w|^2 grows with the square of it. Cases come in blocks; of a block, conditions are found
for those alone whose error could be the worst.
"""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import pairwise, product
from typing import Any, Literal, NamedTuple

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple

from benchmarks.stability.promise import BLOCK, DIGITS, EXTENDED, Precision, block_of, spacing
from refgi.jit import kernel
from refgi.stress.promises import Kind, Row
from refgi.types import Array

Run = Callable[[Array], Array]  # (inputs, n) -> (outputs, n), both of the type under test
Formula = Callable[[Array], Sequence[Any]]  # (inputs, n) of any precision -> (outputs, n)

SEED = 17
THREADS = 2
FIRST = 256  # cases whose condition is found first
UNITS = {"last place": "ULP", "one": "ULP of 1", "float32": "ULP of float32"}
REAL = {"float32": np.float32, "float64": np.float64}


class Ladder(NamedTuple):
    """One kernel, its inputs and its formula."""

    name: str
    domain: str
    draw: Callable[[np.random.Generator, Any], Array]  # (inputs, BLOCK) float64, for a type
    run: Run
    formula: Formula  # of refgi.literal, or written from papers and docs where that has none as precise
    limit: float = 4.0  # ULP x condition
    kind: Kind = "derived"
    source: str = "4 ULP of one input or of the answer"
    smooth: Formula | None = None  # the formula without its clamps, for the condition
    unit: Literal["last place", "one", "float32"] = "last place"  # ULP of the answer, of 1, of the answer in float32
    conditioned: bool = True  # False: the error itself is promised
    scale: Callable[[Array, Any], Any] | None = None  # unit of its own, in place of `unit`
    floor: Callable[[Array, Any], Any] | None = None  # what rounding to subnormal numbers may take
    reals: tuple[str, ...] = ("float32", "float64")
    extended: int = 1_000_000  # cases in longdouble, 0: the formula loses digits in it
    exact: int = 10_000  # with 50 digits
    brief: int = 100_000  # most in longdouble in the short form
    brief_exact: int = 200  # with 50 digits in the short form
    fixed: tuple[int, ...] = ()  # inputs that are settings, not measured: the condition leaves them alone
    lowest: float = 0.0  # no output is below it


class Worst(NamedTuple):
    """The worst of some cases."""

    figure: float
    case: int
    seed: int
    ulp: float
    condition: float
    precision: str
    bad: int  # outputs that are NaN, infinite or below the lowest
    first_bad: int
    cases: int


def inputs_of(ladder: Ladder, seed: int, block: int, real: str, count: int = BLOCK) -> Array:
    """Return the inputs of the first cases of a block, in the type under test."""
    return np.ascontiguousarray(ladder.draw(block_of(seed, block), REAL[real])[:, :count].astype(REAL[real]))


def measure(ladder: Ladder, precision: Precision, real: str, seed: int, count: int) -> Worst:
    """Return the worst of the first `count` cases of a seed."""
    blocks = range(-(-count // BLOCK))
    one = partial(_measure_block, ladder, precision, real, seed, count)
    if precision is EXTENDED and len(blocks) > 1:
        with ThreadPoolExecutor(THREADS) as pool:
            found = list(pool.map(one, blocks))
    else:
        found = [one(block) for block in blocks]
    worst = found[int(np.argmax([np.inf if np.isnan(w.figure) else w.figure for w in found]))]
    bad = sum(w.bad for w in found)
    return worst._replace(bad=bad, first_bad=next((w.first_bad for w in found if w.bad), -1), cases=count)


def _measure_block(ladder: Ladder, precision: Precision, real: str, seed: int, count: int, block: int) -> Worst:
    x = inputs_of(ladder, seed, block, real, min(BLOCK, count - block * BLOCK))
    got = ladder.run(x)
    bad = (~np.isfinite(got) | (got < ladder.lowest)).any(axis=0)
    figure, case, ulp, condition = worst_of_block(ladder, precision, real, x, got)
    first = block * BLOCK
    return Worst(figure, first + case, seed, ulp, condition, precision.name, int(bad.sum()),
                 first + int(np.argmax(bad)), x.shape[1])


def worst_of_block(ladder: Ladder, precision: Precision, real: str, x: Array,
                   got: Array) -> tuple[float, int, float, float]:
    """Return figure, place, error in ULP and condition of the worst of some cases."""
    error, unit = errors(ladder, precision, real, x, got)
    with np.errstate(invalid="ignore"):
        ulp = np.where(error == 0, 0.0, error / unit)  # (outputs, n); NaN stays
    order = np.argsort(np.where(np.isnan(ulp), np.inf, ulp).max(axis=0))[::-1]
    if not ladder.conditioned or np.isnan(ulp).any():
        where = int(np.argmax(np.isnan(ulp).any(axis=0))) if np.isnan(ulp).any() else int(order[0])
        return float(ulp[:, where].max()), where, float(ulp[:, where].max()), 1.0
    worst = (0.0, int(order[0]), 0.0, 1.0)
    for first, last in pairwise((0, FIRST, len(order))):
        chosen = order[first:last]
        chosen = chosen[~(ulp[:, chosen].max(axis=0) <= worst[0])]
        if not len(chosen):
            continue
        condition = conditions(ladder, precision, real, x[:, chosen], unit[:, chosen])
        figure = ulp[:, chosen] / condition
        place = int(np.argmax(np.where(np.isnan(figure), np.inf, figure).max(axis=0)))
        output = int(np.argmax(figure[:, place]))
        if not figure[output, place] <= worst[0]:
            worst = (float(figure[output, place]), int(chosen[place]), float(ulp[output, chosen[place]]),
                     float(condition[output, place]))
    return worst


def errors(ladder: Ladder, precision: Precision, real: str, x: Array, got: Array) -> tuple[Array, Array]:
    """Return errors and the unit they are counted in, both (outputs, n) longdouble."""
    numbers = precision.of(x)
    with np.errstate(all="ignore"):
        exact = ladder.formula(numbers)
        error = np.stack([_extended(abs(precision.of(g) - e)) for g, e in zip(got, exact, strict=True)])
        if ladder.floor is not None:
            error = np.maximum(error - _extended(ladder.floor(numbers, REAL[real])), 0)
    if ladder.scale is not None:
        return error, np.broadcast_to(_extended(ladder.scale(numbers, REAL[real])), error.shape)
    if ladder.unit == "one":
        return error, np.full_like(error, spacing(np.ones(1), REAL[real])[0])
    of = np.float32 if ladder.unit == "float32" else REAL[real]
    return error, np.stack([spacing(_extended(e), of) for e in exact])


def conditions(ladder: Ladder, precision: Precision, real: str, x: Array, unit: Array) -> Array:
    """Return the condition of each output, 1 or more."""
    formula = ladder.smooth or ladder.formula
    numbers = precision.of(x)
    most = np.zeros(unit.shape, np.longdouble)
    with np.errstate(all="ignore"):
        plain = formula(numbers)
        for i, row in enumerate(numbers):
            if i in ladder.fixed:
                continue
            step = precision.of(ladder.limit * spacing(x[i], REAL[real]).astype(np.float64))
            for sign in (-1, 1):
                moved = numbers.copy()
                moved[i] = row + sign * step
                for k, (a, b) in enumerate(zip(formula(moved), plain, strict=True)):
                    most[k] = np.fmax(most[k], _extended(abs(a - b)))
    return np.asarray(np.maximum(most / (ladder.limit * unit), 1))


def _extended(values: Any) -> Array:
    """Return numbers of either kind as longdouble; of those with more digits what float64 holds, twice over."""
    if getattr(values, "dtype", None) == np.dtype(object):
        high = values.astype(np.float64)
        rest = [float(v - h) if np.isfinite(h) else 0.0 for v, h in zip(values.ravel(), high.ravel(), strict=True)]
        return np.asarray(high.astype(np.longdouble) + np.reshape(rest, high.shape))
    return np.asarray(values, np.longdouble)


def rows(ladder: Ladder, short: bool) -> Iterable[Row]:
    """Yield a row for each type, and one that counts what is no number."""
    extended = min(ladder.extended, ladder.brief) if short else ladder.extended
    exact = min(ladder.exact, ladder.brief_exact) if short else ladder.exact
    bad, first_bad, cases = 0, (SEED, 0), 0
    for real in ladder.reals:
        found = [measure(ladder, precision, real, seed, count)
                 for precision, seed, count in ((EXTENDED, SEED, extended), (DIGITS, SEED + 1, exact)) if count]
        worst = found[int(np.argmax([np.inf if np.isnan(w.figure) else w.figure for w in found]))]
        unit = "of the unit" if ladder.scale else UNITS[ladder.unit]
        yield Row(part="kernels", property=f"{real} kernel against its formula", subject=ladder.name,
                  domain=ladder.domain, figure=worst.figure, unit=f"{unit} x condition" if ladder.conditioned else unit,
                  limit=ladder.limit, kind=ladder.kind, source=ladder.source, cases=sum(w.cases for w in found),
                  seed=worst.seed, reproduce=reproduce(ladder, worst.seed, worst.case),
                  detail="; ".join(f"{w.precision}: {w.figure:.3g} at case {w.case} of seed {w.seed}, {w.ulp:.3g} ULP, "
                                   f"condition {w.condition:.3g}" for w in found))
        cases += sum(w.cases for w in found)
        for w in found:
            first_bad = (w.seed, w.first_bad) if w.bad and not bad else first_bad
            bad += w.bad
    yield Row(part="kernels", property="NaN, infinite or too low", subject=ladder.name, domain=ladder.domain,
              figure=bad, unit="cases", limit=0, kind="exact",
              source="every case of the domain has a number for an answer", cases=cases, seed=first_bad[0],
              reproduce=reproduce(ladder, *first_bad))


def reproduce(ladder: Ladder, seed: int, case: int) -> str:
    """Return the line that shows one case."""
    return f"python -m benchmarks.stability.again kernels {ladder.name} {seed} {case}"


def each(function: Any, inputs: int, outputs: int = 1) -> Any:
    """Return a kernel that fills (outputs, n) by a function of the columns of (inputs, n)."""
    if outputs == 1:
        @kernel
        def fill(x: Array, out: Array) -> None:
            for i in range(x.shape[1]):
                out[0, i] = function(*to_fixed_tuple(x[:, i], inputs))
    else:
        @kernel
        def fill(x: Array, out: Array) -> None:
            for i in range(x.shape[1]):
                found = function(*to_fixed_tuple(x[:, i], inputs))
                for k in range(outputs):
                    out[k, i] = found[k]

    return fill


def filled(fill: Any, outputs: int = 1) -> Run:
    """Return a function of inputs that allocates what a kernel fills."""
    def run(x: Array) -> Array:
        out = np.empty((outputs, x.shape[1]), x.dtype)
        fill(x, out)
        return out

    return run


def each_of(function: Any, inputs: int, outputs: int = 1) -> Run:
    """Return `each` as a function of inputs that allocates what it fills."""
    return filled(each(function, inputs, outputs), outputs)


def unclamped(formula: Formula, *vectors: slice) -> Formula:
    """Return a product of clamped cosines with some vectors without its clamps: max(a, 0) - max(-a, 0) = a."""
    def whole(x: Array) -> Any:
        total: Any = 0
        for signs in product((1, -1), repeat=len(vectors)):
            turned = x.copy()
            for sign, rows_of_one in zip(signs, vectors, strict=True):
                turned[rows_of_one] = sign * turned[rows_of_one]
            total = total + np.prod(signs) * np.asarray(formula(turned))
        return total

    return whole
