"""exp2, log2 and log2p1 for every float32 there is, pow and the float64 forms for hostile numbers.

All 2^32 bit patterns pass the float32 kernels, block by block on both cores, against the next wider type; the wider
functions themselves are held against 50 digits. The short form takes every 4099th pattern.
"""

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from benchmarks.stability.ladder import THREADS, Ladder, each, filled
from benchmarks.stability.promise import BLOCK, any_size
from refgi.elementary import exp2, log2, log2p1, pow
from refgi.jit import kernel
from refgi.stress.promises import Row
from refgi.types import Array

PATTERNS = 1 << 16  # of bits in a block
STRIDE = 4099  # of the short form: prime, so that all low bits are seen
PROMISED = {"exp2": 1.3, "log2": 0.6, "log2p1": 3.0}  # ULP, in the docstrings of refgi/elementary
TINY, LARGEST = float(np.finfo(np.float32).tiny), 2.0**128
UNIT = 2.0 ** (np.maximum(np.arange(256), 1) - 150.0)  # ULP of a float32 by its exponent's bits


FILL = {"exp2": each(exp2, 1), "log2": each(log2, 1), "log2p1": each(log2p1, 1)}
POW = each(pow, 2)
EXACT = {"exp2": np.exp2, "log2": np.log2, "log2p1": lambda x: np.log1p(x) * (1 / np.log(x.dtype.type(2)))}


class Worst(NamedTuple):
    """Largest error in ULP of some patterns, where, how many answers were of the wrong kind, and where the first."""

    ulp: float
    bits: int
    wrong: int
    wrong_bits: int
    cases: int


def of_patterns(name: str, bits: Array, fill: Any = None) -> Worst:
    """Return the worst of some bit patterns; what is 0, infinite or NaN must be so exactly."""
    x = bits.view(np.float32)[None]
    if name == "log2p1":
        kept = np.isfinite(x[0]) & (x[0] > -1)
        bits, x = bits[kept], x[:, kept]
    if not len(bits):
        return Worst(0.0, 0, 0, 0, 0)
    got = np.empty_like(x)
    (fill or FILL[name])(x, got)
    with np.errstate(all="ignore"):
        expected = EXACT[name](x[0].astype(np.float64))
    ulp, place, wrong, first = _compare(got[0], expected, name == "exp2", UNIT)
    return Worst(ulp, int(bits[place]), wrong, int(bits[first]), len(bits))


@kernel
def _compare(got: Array, expected: Array, flushes: bool, unit: Array) -> tuple[float, int, int, int]:
    """Return the largest error in ULP and its place, the number of wrong special answers and the place of the first.

    What `flushes` is 0 below the smallest normal number and infinite from 2^128 on.
    """
    worst, place, wrong, first = 0.0, 0, 0, 0
    for i in range(len(got)):
        answer, exact = got[i], expected[i]
        if flushes:
            exact = 0.0 if exact < TINY else (np.inf if exact >= LARGEST else exact)
        if exact != exact or exact == 0.0 or abs(exact) == np.inf:
            if answer != exact and (answer == answer or exact == exact):
                first = i if wrong == 0 else first
                wrong += 1
        else:
            exponent = np.float32(abs(exact)).view(np.int32) >> np.int32(23)
            ulp = abs(answer - exact) / unit[exponent]
            ulp = ulp if ulp == ulp else np.inf
            if ulp > worst:
                worst, place = ulp, i
    return worst, place, wrong, first


def whole_range(name: str, stride: int, fill: Any = None, patterns: int = 1 << 32) -> Worst:
    """Return the worst of every `stride`-th bit pattern."""
    def block(first: int) -> Worst:
        bits = np.arange(first, min(first + PATTERNS * stride, patterns), stride, dtype=np.uint32)
        return of_patterns(name, bits, fill)

    with ThreadPoolExecutor(THREADS) as pool:
        found = list(pool.map(block, range(0, patterns, PATTERNS * stride)))
    worst = max(found, key=lambda w: w.ulp)
    return Worst(worst.ulp, worst.bits, sum(w.wrong for w in found),
                 next((w.wrong_bits for w in found if w.wrong), 0), sum(w.cases for w in found))


def rows(name: str, short: bool) -> Iterable[Row]:
    """Yield error and wrong special answers of one float32 function."""
    worst = whole_range(name, STRIDE if short else 1)
    domain = "every float32" if name != "log2p1" else "every finite float32 above -1"
    domain = f"{domain}, each {STRIDE}th" if short else domain

    def line(bits: int) -> str:
        return f"python -m benchmarks.stability.again kernels {name}.all 0 {bits}"

    yield Row(part="kernels", property="float32 kernel against its formula", subject=f"{name}.all", domain=domain,
              figure=worst.ulp, unit="ULP", limit=PROMISED[name], kind="derived",
              source="the promise of refgi/elementary, without a condition", cases=worst.cases,
              reproduce=line(worst.bits))
    yield Row(part="kernels", property="0, infinity and NaN where they belong", subject=f"{name}.all", domain=domain,
              figure=worst.wrong, unit="cases", limit=0, kind="exact", source="refgi/elementary", cases=worst.cases,
              reproduce=line(worst.wrong_bits))


def draw_exponents(rng: np.random.Generator, real: Any) -> Array:
    """Return exponents whose powers are normal numbers, whole ones and tiny ones among them."""
    most = float(np.finfo(real).maxexp)
    x = rng.uniform(2 - most, most - 1e-3, BLOCK)
    kind = rng.integers(0, 4, BLOCK)
    return np.select([kind == 0, kind == 1], [np.floor(x), x * np.exp(rng.uniform(-80, 0, BLOCK))], x)[None]


def draw_positive(rng: np.random.Generator, real: Any) -> Array:
    x = np.abs(any_size(rng, real))
    near = 1 + np.exp(rng.uniform(-36, -1, BLOCK)) * rng.choice([-1, 1], BLOCK)
    near = np.where(rng.random(BLOCK) < 0.3, rng.uniform(0.7, 1.42, BLOCK), near)  # all of the polynomial's range
    return np.where(rng.random(BLOCK) < 0.4, near, np.maximum(x, float(np.finfo(real).smallest_subnormal)))[None]


def draw_above_minus_one(rng: np.random.Generator, real: Any) -> Array:
    x = any_size(rng, real)
    near = -1 + np.exp(rng.uniform(-15, 0, BLOCK))
    small = np.exp(rng.uniform(-80, 0, BLOCK)) * rng.choice([-0.9, 0.9], BLOCK)
    kind = rng.integers(0, 3, BLOCK)
    return np.select([kind == 0, kind == 1], [near, small], np.where(x > -1, x, -x))[None]


def draw_powers(rng: np.random.Generator, real: Any) -> Array:
    """Return bases and exponents whose powers are normal numbers, bases next to 1 among them."""
    x = draw_positive(rng, real)[0].astype(real).astype(float)
    x = np.where(x == 1, 2.0, x)
    most = float(np.finfo(real).maxexp) - 2
    return np.stack([x, rng.uniform(-most, most, BLOCK) * np.exp(rng.uniform(-5, 0, BLOCK)) / np.log2(x)])


def _ladder(name: str, draw: Any, fill: Any, formula: Any, limit: float, reals: tuple[str, ...]) -> Ladder:
    return Ladder(name, "all sizes, subnormal numbers and numbers next to 1 among them", draw, filled(fill), formula,
                  limit, source="the promise of refgi/elementary, without a condition", conditioned=False, reals=reals,
                  extended=0, brief_exact=2000, lowest=-np.inf)


BOTH = ("float32", "float64")
LADDERS = (
    _ladder("exp2", draw_exponents, FILL["exp2"], lambda x: [np.exp2(x[0])], 1.3, BOTH),
    _ladder("log2", draw_positive, FILL["log2"], lambda x: [np.log2(x[0])], 0.6, BOTH),
    _ladder("log2p1", draw_above_minus_one, FILL["log2p1"], lambda x: [np.log1p(x[0]) / np.log(0 * x[0] + 2)], 3.0,
            BOTH),
    _ladder("pow32", draw_powers, POW, lambda x: [x[0] ** x[1]], 2.5, ("float32",)),
    _ladder("pow64", draw_powers, POW, lambda x: [x[0] ** x[1]], 15.0, ("float64",)),
)
