"""Ladders of pairs: SII Eq. 2 with each of its clamps, Phong lobes (Eq. 3), offsets of rays.

Formulas are those of docs/methods/sii.md and docs/radiometry.md: E = Phi / pi c_l c_x / r^4 with cosines times r, the
lobe c <r . w>^P with c = (P + 1) / (2 pi K).
"""

from typing import Any

import numpy as np
from numba.np.unsafe.ndarray import to_fixed_tuple

from benchmarks.stability.inputs import BLOCK, around, directions, sizes, some
from benchmarks.stability.ladder import Ladder
from benchmarks.stability.maths import dot
from refgi.jit import kernel
from refgi.pairs.pair_sum import clamped_term, geometry_term
from refgi.radiometry import lobe_gap, lobe_norm, lobe_power
from refgi.rays.watertight import far_offset, ray_offset
from refgi.types import Array

NEAREST, FARTHEST = 1.01e-15, 1e9  # m
ROUNDINGS = "14 roundings, each at most one ULP: 5 of r^2, each of which counts twice, 2 divisions, 2 products"
LEAST = 1e-12  # of a lobe above the surface, below which it counts as dark: docs/radiometry.md
PAIR = "r 1e-15 .. 1e9 m and 0; normals any way, 1 ULP off, grazing, opposite"


@kernel
def _clamped(x: Array, out: Array) -> None:
    for i in range(x.shape[1]):
        out[0, i] = clamped_term(x[0, i], x[1, i], x[2, i], x[3, i], x[4, i], x[5, i], x[6, i], x[7, i], x[8, i],
                                 (x[9, i], x[10, i], x[11, i]))


@kernel
def _offsets(x: Array, out: Array) -> None:
    for i in range(x.shape[1]):
        out[0, i] = ray_offset(x[0, i], x[1, i], x[2, i], x[3, i])
        out[1, i] = far_offset(x[0, i], x[1, i], x[2, i])


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


def filled(fill: Any, outputs: int = 1) -> Any:
    """Return a function of inputs that allocates what a kernel fills."""
    def run(x: Array) -> Array:
        out = np.empty((outputs, x.shape[1]), x.dtype)
        fill(x, out)
        return out

    return run


def each_of(function: Any, inputs: int, outputs: int = 1) -> Any:
    """Return `each` as a function of inputs that allocates what it fills."""
    return filled(each(function, inputs, outputs), outputs)


norms = each_of(lobe_norm, 2)


def draw_pairs(rng: np.random.Generator, real: Any) -> Array:
    """Return d, reversed normal of the light and normal of the receiver, (9, BLOCK)."""
    w = directions(rng)
    r = some(rng, sizes(rng, NEAREST, FARTHEST), 0.0)
    return np.concatenate([r * w, around(rng, w, real), around(rng, w, real)])


def draw_clamps(rng: np.random.Generator, real: Any) -> Array:
    """Return pairs with a bound, a least distance, a softness, or all of them near the pair's own numbers."""
    pairs = draw_pairs(rng, real)
    square = np.maximum((pairs[:3] ** 2).sum(axis=0), NEAREST**2)
    kind = rng.integers(0, 4, BLOCK)
    near = np.exp(rng.uniform(-6, 6, (3, BLOCK)))
    limits = np.stack([np.where((kind == 0) | (kind == 3), near[0] * square, 0),
                       np.where((kind == 1) | (kind == 3), near[1] * square, 0),
                       np.where((kind == 2) | (kind == 3), near[2] / square, 1e38)])
    return np.concatenate([pairs, limits])


def _parts(x: Any) -> Any:
    d = x[:3]
    square = dot(d, d)
    return np.where(square > 0, square, 1), dot(d, x[3:6]), dot(d, x[6:9])


def term(m: Any, x: Any) -> Any:  # noqa: ARG001
    square, light, receiver = _parts(x)
    return [np.maximum(light, 0) * np.maximum(receiver, 0) / (square * square)]


def term_unclamped(m: Any, x: Any) -> Any:  # noqa: ARG001
    square, light, receiver = _parts(x)
    return [light * receiver / (square * square)]


def clamped(m: Any, x: Any) -> Any:  # noqa: ARG001
    square, light, receiver = _parts(x)
    below = square * (np.maximum(square, x[9]) + x[10])
    return [np.minimum(np.maximum(light, 0) * np.maximum(receiver, 0) / below, x[11])]


def clamped_smooth(m: Any, x: Any) -> Any:  # noqa: ARG001
    square, light, receiver = _parts(x)
    return [light * receiver / (square * (np.maximum(square, x[9]) + x[10]))]


def draw_gaps(rng: np.random.Generator, real: Any) -> Array:
    w = directions(rng)
    return np.concatenate([around(rng, w, real), w * sizes(rng, 1e-15, 1e9)])


def gap(m: Any, x: Any) -> Any:
    length = m.sqrt(dot(x[3:6], x[3:6]))
    off = [r - w / length for r, w in zip(x[:3], x[3:6], strict=True)]
    return [dot(off, off) / 2]


def draw_powers(rng: np.random.Generator, real: Any) -> Array:
    """Return gaps and exponents, most of whose product is 1e-3 to 200: where the power is neither 0 nor 1."""
    exponent = sizes(rng, 1e-3, 1e8 if real is np.float32 else 1e20)
    gaps = np.minimum(np.exp(rng.uniform(np.log(1e-3), np.log(200), BLOCK)) / exponent, rng.uniform(0, 1, BLOCK))
    gaps = np.where(rng.random(BLOCK) < 0.1, rng.uniform(0, 2, BLOCK), gaps)
    return np.stack([some(rng, gaps, 0.0), some(rng, exponent, 0.0)])


def power(m: Any, x: Any) -> Any:
    inside = np.where(x[0] < 1, x[0], 0)
    return [np.where(x[0] < 1, m.exp(x[1] * m.log1p(-inside)), 0 * x[0])]


def flushed(m: Any, x: Any, real: Any) -> Any:
    """Return what a power below the smallest normal number may lose: all of it."""
    tiny = float(np.finfo(real).tiny)
    return np.where(power(m, x)[0] < 2 * m.number(np.float64(tiny)), tiny, 0.0)


def draw_norms(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return cosines from 1 down to where 1e-11 of the lobe is left above the surface, and exponents."""
    exponent = some(rng, sizes(rng, 1e-3, 1e4), 0.0)
    near = np.exp(rng.uniform(np.log(1e-9), 0, BLOCK)) * rng.choice([-1.0, 1.0], BLOCK)
    edge = near * 5 / np.sqrt(exponent + 25)
    cosine = np.select([kind := rng.integers(0, 4, BLOCK) == 0, kind == 1], [np.ones(BLOCK), rng.random(BLOCK)], edge)
    below = -np.minimum(5 / np.sqrt(exponent + 25), 0.999)
    return np.stack([np.maximum(cosine, below), exponent])


def norm(m: Any, x: Any) -> Any:
    """(P + 1) / (2 pi K), K = 1 - I / 2; I the regularised incomplete beta function of sin^2, (P + 1) / 2 and 1/2."""
    half = m.beta(np.maximum(1 - x[0] * x[0], 0), (x[1] + 1) / 2) / 2
    fraction = np.where(x[0] >= 0, 1 - half, half)
    return [np.where(fraction > LEAST, (x[1] + 1) / (2 * m.pi * fraction), 0 * x[0])]


def draw_offsets(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    sign = rng.choice([-1.0, 1.0], (3, BLOCK))
    return np.stack([*(some(rng, sizes(rng, 1e-30, 1e30) * s, 0.0) for s in sign), sizes(rng, 1e-30, 1e30)])


def offset(m: Any, x: Any) -> Any:
    """4 U of the sum of sizes and of the grain, U = 2^-24 (docs/truth.md)."""
    steps = m.number(np.float64(4 * 2.0**-24))
    length = abs(x[0]) + abs(x[1]) + abs(x[2])
    return [steps * (length + x[3]), steps * length]


LADDERS = (
    Ladder("eq2.term", PAIR, draw_pairs, each_of(geometry_term, 9), term, 14.0, source=ROUNDINGS, smooth=term_unclamped,
           extended=10_000_000),
    Ladder("eq2.clamped", f"{PAIR}; bound, least distance and softness within e^6 of the pair's", draw_clamps,
           filled(_clamped), clamped, 16.0, source=f"{ROUNDINGS}, 2 more of the clamp", smooth=clamped_smooth,
           extended=4_000_000),
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
    Ladder("ray.offset", "coordinates 0, 1e-30 .. 1e30 m", draw_offsets, filled(_offsets, 2), offset),
)
