"""exp2, log2, log2p1 and pow against NumPy in the next wider type; pairs of numbers against fractions and mpmath."""

import itertools
import math
import re
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest

from refgi import elementary
from refgi.elementary import exp2, log2, log2p1, pow
from refgi.elementary.twofold import (
    add,
    length_across,
    length_along,
    multiply,
    root,
    sine_cosine_digits,
    two_product,
    two_sum,
    twofold,
)
from refgi.jit import kernel

WIDER = {np.float32: np.float64, np.float64: np.longdouble}
# units in the last place, as promised in the docstrings; the last is what float64's 11 more bits of log2 leave of
# powers near the ends of its range
ULP = {"exp2": 1.3, "log2": 0.6, "log2p1": 3.0, "pow": 2.5}
ULP_POW_DOUBLE = 15.0
STRIDE = 127  # through all bit patterns of float32: 66,000 of every binade; coprime with 2
ENDS = (0.0, -0.0, 1.0, 0.5, 2.0, 3.0, 1e-40, 1e-30, 1e30, -1e-40, -1.0, -2.5, math.inf, -math.inf, math.nan)


@kernel
def fill_exp2(x, out):
    for i in range(x.shape[0]):
        out[i] = exp2(x[i])


@kernel
def fill_log2(x, out):
    for i in range(x.shape[0]):
        out[i] = log2(x[i])


@kernel
def fill_log2p1(x, out):
    for i in range(x.shape[0]):
        out[i] = log2p1(x[i])


@kernel
def fill_pow(x, y, out):
    for i in range(x.shape[0]):
        out[i] = pow(x[i], y[i])


EXACT = {"exp2": np.exp2, "log2": np.log2, "log2p1": lambda x: np.log1p(x) / np.log(x.dtype.type(2)), "pow": np.power}
FILL = {"exp2": fill_exp2, "log2": fill_log2, "log2p1": fill_log2p1, "pow": fill_pow}


def worst_ulp(name, *arguments):
    """Return the largest error in units in the last place; what is 0, infinite or NaN must be so exactly."""
    real = arguments[0].dtype.type
    got = np.empty_like(arguments[0])
    FILL[name](*arguments, got)
    with np.errstate(all="ignore"):
        expected = EXACT[name](*(x.astype(WIDER[real]) for x in arguments))
        if name in ("exp2", "pow"):  # no subnormal results
            expected[np.abs(expected) < np.finfo(real).tiny] = 0
        rounded = expected.astype(real)
        off = np.abs(got - expected) / np.spacing(np.abs(rounded)).astype(expected.dtype)
    finite = np.isfinite(rounded) & (rounded != 0)
    np.testing.assert_array_equal(got[~finite], rounded[~finite])
    return float(off[finite].max(initial=0))


def every_float32():
    """Yield all of float32 in steps of STRIDE, positive and negative, with its subnormals, infinities and NaNs."""
    for first in range(0, 1 << 32, 1 << 28):
        yield np.arange(first + first % STRIDE, first + (1 << 28), STRIDE, dtype=np.uint32).view(np.float32)


@pytest.mark.parametrize("name", ["exp2", "log2", "log2p1"])
def test_over_the_whole_of_float32(name):
    worst = 0.0
    for x in every_float32():
        inside = x[(x > -1) & (x < np.inf)] if name == "log2p1" else x
        worst = max(worst, worst_ulp(name, inside) if len(inside) else 0)
    assert worst < ULP[name]


@pytest.mark.parametrize(("name", "first"), [("exp2", -0.5), ("exp2", 0.5), ("exp2", -64.0), ("log2", 0.5),
                                             ("log2", 1.0), ("log2p1", -0.5), ("log2p1", -0.25), ("log2p1", 0.25)])
def test_every_float32_of_some_binades(name, first):
    x = (np.float32(first).view(np.int32) + np.arange(1 << 23, dtype=np.int32)).view(np.float32)
    assert worst_ulp(name, x) < ULP[name]


def test_float64_over_its_range():
    spread = np.concatenate([sign * np.geomspace(1e-300, 1e300, 1 << 18) for sign in (1, -1)])
    near_one = 1 + np.concatenate([sign * np.geomspace(1e-16, 0.5, 1 << 18) for sign in (1, -1)])
    ends = np.array([x for x in ENDS if abs(x) != 1e-40])
    for x in (spread, np.linspace(-1100, 1100, 1 << 19), ends, np.geomspace(5e-324, 1e-300, 1 << 12)):
        assert worst_ulp("exp2", x) < ULP["exp2"]
    for x in (np.abs(spread), near_one, ends, np.geomspace(5e-324, 1e-300, 1 << 12)):
        assert worst_ulp("log2", x) < ULP["log2"]
    for x in (spread[spread > -1], near_one - 1, 1e-16 - near_one / 2):
        assert worst_ulp("log2p1", x) < ULP["log2p1"]


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_powers_in_the_domain_of_lobes(real):
    """Bases in (0, 1], exponents 0 to 1e6, close to 1 where large exponents leave something."""
    limit = ULP["pow"] if real is np.float32 else ULP_POW_DOUBLE
    rng = np.random.default_rng(1)
    exponents = np.concatenate([np.zeros(9), 10 ** rng.uniform(-6, 6, 1 << 18), rng.integers(0, 10**6, 1 << 18)])
    for bases in (1 - rng.random(len(exponents)), 1 - 10 ** rng.uniform(-7, 0, len(exponents)),
                  np.exp2(-rng.uniform(0, 130, len(exponents)) / np.maximum(exponents, 1e-3))):
        assert worst_ulp("pow", np.maximum(bases, 1e-7).astype(real), exponents.astype(real)) < limit


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_powers_of_anything(real):
    limit = ULP["pow"] if real is np.float32 else ULP_POW_DOUBLE
    rng, kind = np.random.default_rng(2), (np.uint32 if real is np.float32 else np.uint64)
    any_bits = [rng.integers(0, np.iinfo(kind).max, 1 << 19, dtype=kind).view(real) for _ in range(2)]
    largest = math.log2(np.finfo(real).max)
    bases = np.exp2(rng.uniform(-largest, largest, 1 << 19)).astype(real)
    near_one = np.exp2(rng.choice([-1, 1], 1 << 19) * rng.uniform(1e-3, 1, 1 << 19)).astype(real)
    up_to_the_ends = rng.uniform(-largest, largest, 1 << 19)
    for x, y in ((np.abs(any_bits[0]), any_bits[1]), (bases, up_to_the_ends / np.log2(bases)),
                 (near_one, up_to_the_ends / np.log2(near_one))):
        assert worst_ulp("pow", x, y.astype(real)) < limit


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_powers_where_they_are_least_exact(real):
    """Bases next to the root of 1/2 or of 2, where log2 x is reduced least, and powers near the ends of the range."""
    limit = ULP["pow"] if real is np.float32 else ULP_POW_DOUBLE
    rng, end = np.random.default_rng(4), math.log2(np.finfo(real).max)
    for low, high in ((0.7071, 0.716), (1.395, 1.4143)):
        bases = rng.uniform(low, high, 1 << 20).astype(real)
        powers = rng.choice([-1, 1], 1 << 20) * rng.uniform(0.95, 1 - 3 / end, 1 << 20) * end
        assert worst_ulp("pow", bases, (powers / np.log2(bases.astype(float))).astype(real)) < limit
    # the worst of some 20 million that were tried
    worst = {np.float32: (0.7087001, -254.74376), np.float64: (0.7096380602280149, -2041.0244728444075)}[real]
    assert 0.85 * limit < worst_ulp("pow", *(np.array([one], real) for one in worst)) < limit


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_ends(real):
    x = np.array(ENDS, real)
    for name in ("exp2", "log2"):
        assert worst_ulp(name, x) <= 1
    whole = np.arange(-1022 if real is np.float64 else -126, 1024 if real is np.float64 else 128).astype(real)
    assert worst_ulp("exp2", whole) == 0
    assert worst_ulp("log2", np.ldexp(np.ones_like(whole), whole.astype(np.int32))) == 0


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_ends_of_pow(real):
    """What IEEE 754 says of powers, but for bases below 0 and NaN: those are NaN."""
    x, y = (np.array(part, real) for part in zip(*itertools.product(ENDS, ENDS), strict=True))
    zero_to_negative = (x == 0) & (y < 0)
    usual = ~np.isnan(x) & (x >= 0) & ~np.isnan(y) & ~zero_to_negative
    assert worst_ulp("pow", x[usual], y[usual]) < 2
    got = np.empty_like(x)
    fill_pow(x, y, got)
    assert np.isnan(got[np.isnan(x) | (x < 0) | np.isnan(y)]).all()
    assert (got[zero_to_negative & ~np.isnan(y)] == np.inf).all()


def test_docstrings_and_docs_promise_these_limits():
    for name, limit in ULP.items():
        stated = [float(number) for number in re.findall(r"Within ([0-9.]+)", getattr(elementary, name).__doc__)]
        assert stated == [limit]
    assert f"float64: {ULP_POW_DOUBLE:g}" in elementary.pow.__doc__
    table = (Path(__file__).parents[2] / "docs/methods/sii_sum.md").read_text(encoding="utf-8")
    row = table.split("| `exp2` | `log2` | `log2p1` | `pow` |")[1].splitlines()[2]
    assert [float(cell) for cell in row.strip("|").split("|")] == list(ULP.values())


def test_plain_python_answers_too():
    assert (exp2(3.0), log2(8.0), log2p1(1.0), pow(2.0, 0.5)) == (8.0, 3.0, 1.0, math.sqrt(2))


BOUND = Fraction(1, 2**100)  # as promised in the docstrings
DIGITS = 1e-58


def numbers(count, seed=1):
    rng = np.random.default_rng(seed)
    return (rng.choice([-1, 1], count) * rng.random(count) * 10 ** rng.uniform(-6, 6, count)).tolist()


def pairs(count, seed=2):
    return [two_sum(x, y * 2**-55) for x, y in zip(numbers(count, seed), numbers(count, seed + 1), strict=True)]


def exact(pair):
    return Fraction(pair[0]) + Fraction(pair[1])


def test_sums_and_products_lose_nothing():
    for x, y in zip(numbers(2000), numbers(2000, 5), strict=True):
        assert exact(two_sum(x, y)) == Fraction(x) + Fraction(y)
        assert exact(two_product(x, y)) == Fraction(x) * Fraction(y)
        assert two_sum(x, y)[0] == x + y
        assert two_product(x, y)[0] == x * y


def test_sums_products_and_roots_of_pairs():
    for x, y in zip(pairs(2000), pairs(2000, 7), strict=True):
        assert abs(exact(add(x, y)) - exact(x) - exact(y)) <= BOUND * max(abs(exact(x)), abs(exact(y)))
        product = exact(x) * exact(y)
        assert abs(exact(multiply(x, y)) - product) <= BOUND * abs(product)
        square = multiply(x, x)
        with mpmath.workdps(60):
            expected = mpmath.sqrt(mpmath.mpf(square[0]) + mpmath.mpf(square[1]))
            found = root(square)
            assert abs(mpmath.mpf(found[0]) + mpmath.mpf(found[1]) - expected) <= 2.0**-100 * expected
    assert root((0.0, 0.0)) == (0.0, 0.0)


def test_lengths_along_and_across_of_nearly_parallel_vectors():
    rng = np.random.default_rng(3)
    for _ in range(500):
        axis = rng.normal(size=3)
        d = axis * 10 ** rng.uniform(-3, 3) + rng.normal(size=3) * 10 ** rng.uniform(-12, 0)
        with mpmath.workdps(60):
            a, b = ([mpmath.mpf(float(c)) for c in vector] for vector in (d, axis))
            along = sum(p * q for p, q in zip(a, b, strict=True))
            cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
            across = mpmath.sqrt(sum(c * c for c in cross))
            for function, expected in ((length_along, along), (length_across, across)):
                high, low = function(tuple(map(float, d)), tuple(map(float, axis)))
                limit = 2.0**-100 * np.linalg.norm(d) * np.linalg.norm(axis)
                assert abs(mpmath.mpf(high) + mpmath.mpf(low) - expected) <= limit


@pytest.mark.parametrize("angle", [0.0, 1e-7, 1e-3, 0.5, 1.0, 1.5707963])
def test_digits_of_sines_and_cosines(angle):
    with mpmath.workdps(80):
        for digits, expected in zip(sine_cosine_digits(angle), (mpmath.sin(angle), mpmath.cos(angle)), strict=True):
            assert abs(mpmath.mpf(str(digits)) - expected) <= DIGITS
            high, low = twofold(digits)
            assert abs(mpmath.mpf(high) + mpmath.mpf(low) - expected) <= 2.0**-104 * abs(expected)
