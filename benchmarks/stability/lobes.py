"""Ladders of Phong lobes: gap, power, norms to exponents of 1e20, a term of the sum, drawn directions; mean norms.

Formulas are those of docs/radiometry.md: the lobe c <r . w>^P with c = (P + 1) / (2 pi K). For P of a million and more
K = 1 - erfc(sqrt(-(a - 1/4) ln(1 - c^2))) / 2, a = (P + 1) / 2; below it is an incomplete beta function. Those of
refgi.literal take K from a quadrature in float64, which is not exact enough, and the power from the cosine.

About the horizon the continued fraction of a norm loses digits: some P/3 ULP, as its terms are 1 less almost 1. That is
rounding, to either side alike; a fraction which is cut too early, or a wrong term, is off to one side.
"""

from typing import Any

import numpy as np

from benchmarks.stability.ladder import Ladder, each_of
from benchmarks.stability.promise import (
    BLOCK,
    DIGITS,
    Case,
    Promise,
    across,
    around,
    complementary_error,
    directions,
    dot,
    incomplete_beta,
    pi_of,
    sizes,
    some,
)
from refgi.jit import kernel
from refgi.literal.pairs import LEAST_SHARE
from refgi.pairs.lobe_culling import LIMIT, bound_lobes
from refgi.pairs.lobe_sum import EXPONENT, RATIO, add_lobe
from refgi.pairs.pair_sum import NX, SUM, Clamp, X
from refgi.radiometry import lobe_direction, lobe_gap, lobe_norm, lobe_power
from refgi.types import Array

ROWS = max(EXPONENT, RATIO) + 1
SHARP, SHARPEST = 1e6, 1e20
SMALLEST, STEP = 2.0**-126, 2.0**-149  # a lobe below this share of its peak is 0; of subnormal float32 numbers
EDGE = 8 * 2.0**-24  # of the light's plane, within which rounding may decide


norms = each_of(lobe_norm, 2)


@kernel
def _terms(lights: Array, to: Array, limits: Array, clamp: Any, tile: Array, out: Array) -> None:
    for i in range(lights.shape[1]):
        for row in range(6):
            tile[row, 0] = to[row, i]
        tile[SUM, 0] = 0
        add_lobe(tile, (np.uint64(0), np.uint64(1)), lights, i, limits[i], clamp, None, None)
        out[0, i] = tile[SUM, 0]


def draw_gaps(rng: np.random.Generator, real: Any) -> Array:
    w = directions(rng)
    return np.concatenate([around(rng, w, real), w * sizes(rng, 1e-15, 1e9)])


def gap(x: Any) -> Any:
    off = x[:3] - x[3:6] / np.sqrt(dot(x[3:6], x[3:6]))
    return [dot(off, off) / 2]


def draw_powers(rng: np.random.Generator, real: Any) -> Array:
    """Return gaps and exponents, most of whose product is 1e-3 to 200: where the power is neither 0 nor 1."""
    exponent = sizes(rng, 1e-3, 1e8 if real is np.float32 else 1e20)
    gaps = np.minimum(np.exp(rng.uniform(np.log(1e-3), np.log(200), BLOCK)) / exponent, rng.uniform(0, 1, BLOCK))
    gaps = np.where(rng.random(BLOCK) < 0.1, rng.uniform(0, 2, BLOCK), gaps)
    return np.stack([some(rng, gaps, 0.0), some(rng, exponent, 0.0)])


def power(x: Any) -> Any:
    inside = np.where(x[0] < 1, x[0], 0 * x[0])
    return [np.where(x[0] < 1, np.exp(x[1] * np.log1p(-inside)), 0 * x[0])]


def flushed(x: Any, real: Any) -> Any:
    """Return what a power below the smallest normal number may lose: all of it."""
    tiny = float(np.finfo(real).tiny)
    return np.where(power(x)[0] < 2 * tiny, tiny, 0.0)


def draw_norms(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return cosines from 1 down to where 1e-11 of the lobe is left above the surface, and exponents."""
    exponent = some(rng, sizes(rng, 1e-3, 1e4), 0.0)
    near = np.exp(rng.uniform(np.log(1e-9), 0, BLOCK)) * rng.choice([-1.0, 1.0], BLOCK)
    edge = near * 5 / np.sqrt(exponent + 25)
    cosine = np.select([kind := rng.integers(0, 4, BLOCK) == 0, kind == 1], [np.ones(BLOCK), rng.random(BLOCK)], edge)
    below = -np.minimum(5 / np.sqrt(exponent + 25), 0.999)
    return np.stack([np.maximum(cosine, below), exponent])


def norm(x: Any) -> Any:
    """(P + 1) / (2 pi K), K = 1 - I / 2; I the regularised incomplete beta function of sin^2, (P + 1) / 2 and 1/2."""
    return _normed(x, incomplete_beta(np.maximum(1 - x[0] * x[0], 0), (x[1] + 1) / 2) / 2)


def _normed(x: Any, half: Any) -> Any:
    fraction = np.where(x[0] >= 0, 1 - half, half)
    return [np.where(fraction > LEAST_SHARE, (x[1] + 1) / (2 * pi_of(x) * fraction), 0 * x[0])]


def draw_sharp(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return cosines within the width of the lobe off the horizon, to where 1e-11 of it is left, and exponents."""
    exponent = sizes(rng, SHARP, SHARPEST)
    near = np.exp(rng.uniform(np.log(1e-6), np.log(6.6), BLOCK)) * rng.choice([-1.0, 1.0], BLOCK)
    return np.stack([near / np.sqrt(exponent), exponent])


def sharp_norm(x: Any) -> Any:
    return _normed(x, complementary_error(np.sqrt(((x[1] + 1) / 2 - 0.25) * -np.log1p(-x[0] * x[0]))) / 2)


def draw_middle(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return cosines about the horizon and exponents of some thousand to a million."""
    exponent = sizes(rng, 1e3, 0.999e6)
    cosine = rng.uniform(-5, 5, BLOCK) / np.sqrt(exponent)
    return np.stack([cosine, exponent])


def draw_terms(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return d, reversed normal and axis of the light, normal of the receiver and P: mostly where the lobe is seen."""
    w = directions(rng)
    exponent = sizes(rng, 1e-3, 1e8)
    gap = np.minimum(np.exp(rng.uniform(np.log(1e-3), np.log(50), BLOCK)) / exponent, rng.uniform(0, 1, BLOCK))
    side = across(rng, w)
    axis = w * (1 - gap) + side * np.sqrt(gap * (2 - gap))
    normals = directions(rng), directions(rng)
    normals = [n * np.sign((n * w).sum(axis=0)) for n in normals]
    return np.concatenate([w * sizes(rng, 1e-6, 1e6), normals[0], axis, normals[1], exponent[None]])


def terms(x: Array) -> Array:
    n, real = x.shape[1], x.dtype.type
    lights = np.concatenate([x[:9], x[12:], np.ones((3, n), real)])
    to = np.concatenate([np.zeros((3, n), real), x[9:12]])
    assert (X, NX) == (0, 3)
    out, tile = np.empty((1, n), real), np.zeros((ROWS, 1), real)
    limits = bound_lobes(np.ascontiguousarray(x[12]), -1.0)[LIMIT]
    _terms(lights, to, limits, Clamp(real(0), np.zeros(n, real), real(np.inf)), tile, out)
    return out


def _shape(x: Any) -> Any:
    d = x[:3]
    square = dot(d, d)
    length = np.sqrt(square)
    off = x[6:9] - d / length
    h = dot(off, off) / 2
    inside = np.where(h < 1, h, 0 * h)
    above = dot(d, x[3:6]) / length
    power = np.where((h < 1) & (above > 0), np.exp(x[12] * np.log1p(-inside)), 0 * h)
    return square, h, above, power, np.maximum(dot(d, x[9:12]) / length, 0)


def term(x: Any) -> Any:
    square, _, _, power, cosine = _shape(x)
    return [power * cosine / square]


def term_bound(x: Any, real: Any) -> Any:  # noqa: ARG001
    """What `add_lobes` promises of a float32 term; beyond it what is lost among subnormal numbers."""
    square, h, _, power, cosine = _shape(x)
    h = np.minimum(h, 0 * h + 0.999)  # of the numbers' own kind
    value = power * cosine / square
    rounding = value * (17 + 5 * -x[12] * np.log1p(-h) / np.log(2 + 0 * h) + 6.5 * x[12] * (
        np.sqrt(2 * h) + h) / (1 - h)) + 4 * power / square
    return rounding * 2.0**-24 + 2 * SMALLEST / square + 4 * STEP


def undecided(x: Any, real: Any) -> Any:  # noqa: ARG001
    """Whether rounding may decide on which side of the light's plane or of h = 1 a pair lies: then nothing counts."""
    _, h, above, _, _ = _shape(x)
    return np.where((abs(above) < EDGE) | (abs(h - 1) < 1e-3), np.inf, 0.0)


def draw_samples(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return points of the unit square, those near u = 0 and u = 1 among them, and exponents."""
    u = rng.random(BLOCK)
    kind = rng.integers(0, 4, BLOCK)
    small = sizes(rng, 1e-300, 0.5)
    u = np.select([kind == 0, kind == 1], [small, 1 - np.minimum(sizes(rng, 1e-16, 0.5), 0.5)], np.maximum(u, 1e-18))
    exponent = np.where(rng.random(BLOCK) < 0.02, 0.0, sizes(rng, 1e-3, SHARPEST))
    return np.stack([u, rng.random(BLOCK), exponent])


def sample(x: Any) -> Any:
    gap = 1 - np.exp(np.log(x[0]) / (x[2] + 1))
    across_axis, phi = np.sqrt(gap * (2 - gap)), 2 * pi_of(x) * x[1]
    return [across_axis * np.cos(phi), across_axis * np.sin(phi), 1 - gap]


def sample_unit(x: Any, real: Any) -> Any:  # noqa: ARG001
    """One ULP of the length across the axis for what lies across it, of 1 for what lies along it."""
    gap = 1 - np.exp(np.log(x[0]) / (x[2] + 1))
    side = np.sqrt(gap * (2 - gap)) * 2.0**-52
    return np.stack([side, side, 0 * gap + 2.0**-52])


SAMPLES = 100
SIGMAS = 6.0


def bias(rng: np.random.Generator) -> Case:
    """Return by how many of its standard errors the mean error of some norms of almost one exponent is off 0."""
    middle = 10 ** rng.uniform(2, 4.5)
    exponent = middle * rng.uniform(1, 1.5, SAMPLES)
    widths = 1.7 + 0.2 * rng.random(SAMPLES)  # of the lobe off the horizon: there the fraction has the most terms
    x = np.stack([-widths / np.sqrt(exponent), exponent])
    got = norms(x)[0]
    exact = norm(DIGITS.of(x))[0]
    error = np.array([float(DIGITS.of(np.array([g]))[0] / e - 1) for g, e in zip(got, exact, strict=True)])
    error /= 2.0**-52 * (1 + exponent / 3)
    deviation = float(error.std(ddof=1)) / np.sqrt(SAMPLES)
    return Case(abs(float(error.mean())) / deviation, f"exponents {middle:.0f} and more: mean {error.mean():.3g} "
                                                      f"(1 + P / 3) ULP, standard error {deviation:.2g}")


LADDERS = (
    Ladder("lobe.gap", "r 1e-15 .. 1e9 m, any direction, 1 ULP off, opposite", draw_gaps, each_of(lobe_gap, 6), gap,
           12.0,
           source="6.5 roundings of the unit vector and 5 of its square, each at most one ULP", extended=2_000_000),
    Ladder("lobe.power", "P 0 .. 1e8 (float64: 1e20), gap 0 .. 2", draw_powers, each_of(lobe_power, 2), power,
           floor=flushed, extended=4_000_000),
    Ladder("lobe.norm", "P 0 .. 1e4, cosine 1 .. where K is 1e-11", draw_norms, norms, norm,
           reals=("float32",), extended=0, exact=2000),
    Ladder("lobe.norm64", "P 0 .. 1e4, cosine 1 .. where K is 1e-11", draw_norms, norms, norm, 5300.0,
           "observed x 2", "2615 ULP: a continued fraction of sqrt(P) steps", conditioned=False, reals=("float64",),
           extended=0, exact=2000),
    Ladder("lobe.norm_sharp", "P 1e6 .. 1e20, to 6.6 widths of the lobe off the horizon", draw_sharp, norms,
           sharp_norm, 12.0, source="12 roundings of the exponent, erfc and the norm", extended=0, exact=4000),
    Ladder("lobe.norm_middle", "P 1e3 .. 1e6, to 5 widths of the lobe off the horizon", draw_middle, norms,
           norm, reals=("float32",), extended=0, exact=1000, brief_exact=40),
    Ladder("lobe.term", "P 1e-3 .. 1e8, r 1e-6 .. 1e6 m, mostly where the lobe is seen", draw_terms, terms, term, 1.0,
           source="the bound that add_lobes promises", conditioned=False, scale=term_bound, floor=undecided,
           reals=("float32",), extended=2_000_000, brief=BLOCK),
    Ladder("lobe.sample", "u 1e-300 .. 1 - 1e-16, P 0 .. 1e20", draw_samples, each_of(lobe_direction, 3, 3), sample,
           12.0, source="4 roundings of 1 - z and its root, 2 of an angle of up to 2 pi, sine and cosine",
           conditioned=False, scale=sample_unit, reals=("float64",), extended=0, lowest=-1.000001, brief_exact=1000),
)
PROMISES = (
    Promise("lobe.norm_bias", "float64 norms, mean error", "lobe.norm", "P 100 .. 45,000, 1.7 to 1.9 widths of the "
            "lobe below the horizon", bias, "standard errors", SIGMAS, "statistics",
            "6 standard errors of 100 values: 200 such means pass it once in 100,000 runs", 200, 8),
)
