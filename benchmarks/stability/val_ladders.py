"""Ladders of val: basis and series of convolution shadow maps, mean depth of blockers, depth scale, filter widths.

Formulas are those of docs/methods/val_visibility.md: f = 1/2 + sum_k w_k sin(c_k (z - d)), w_k = 2 / c_k,
c_k = (2 k - 1) pi; z_avg = (Z / 2 - sum_k w_k (cos(c_k d) SZ_k - sin(c_k d) CZ_k)) / (1 - V); and the disc of a cone
on a stereographic map. Depths of the series are numbers of [0, 1], so its units are those of 1.
"""

import math
from typing import Any

import numpy as np

from benchmarks.stability.inputs import BLOCK, directions, sizes
from benchmarks.stability.ladder import Ladder
from benchmarks.stability.pair_ladders import each_of, filled
from refgi.cluster.filters.basis import DepthScale, fill_basis, series_depths, series_distance, sine_cosine
from refgi.cluster.visibility.csm import compare_filtered, find_penumbra
from refgi.cluster.visibility.pcf import (
    cone_tangent,
    disc,
    published_square,
    published_tangent,
    solid_angle_tangent,
)
from refgi.cluster.visibility.search_region import (
    CONSTANTS,
    DEPTH,
    GAIN,
    ON_SERIES,
    SCRATCH_ROWS,
    D,
    FilterSizing,
)
from refgi.jit import kernel
from refgi.types import Array

TERMS = 4
LEAST_BLOCKED = 0.02  # share of a search disc below which nothing blocks
CAP = math.radians(80.0)  # the widest cone


@kernel
def _to_series(x: Array, logarithmic: bool, out: Array) -> None:
    for i in range(x.shape[1]):
        series_depths(DepthScale(logarithmic, x[1, i], x[2, i], x[3, i]), x[0, i : i + 1], out[0, i : i + 1], 1)


@kernel
def _from_series(x: Array, out: Array) -> None:
    for i in range(x.shape[1]):
        out[0, i] = series_distance(DepthScale(True, x[1, i], x[2, i], 1.0), x[0, i])


@kernel
def _tangents(x: Array, out: Array) -> None:
    for i in range(x.shape[1]):
        out[0, i] = cone_tangent(x[0, i], x[1, i], x[2, i])
        out[1, i] = published_tangent(x[0, i], x[1, i], x[2, i])
        out[2, i] = solid_angle_tangent(x[0, i], x[1, i])


@kernel
def _discs(x: Array, out: Array) -> None:
    for i in range(x.shape[1]):
        out[0, i], out[1, i], out[2, i] = disc(x[0, i], x[1, i], x[2, i], x[3, i], x[4, i])
        out[3, i], out[4, i], out[5, i] = published_square(x[0, i], x[1, i], x[2, i], x[3, i], x[4, i])


def _series_weights(real: Any) -> Array:
    return np.array([2.0 / ((2 * k - 1) * math.pi) for k in range(1, TERMS + 1)], real)


def steps(x: Array) -> Array:
    """Compare each depth of row 0 with the one of row 1 by basis and series, unfiltered."""
    real, n = x.dtype.type, x.shape[1]
    basis, basis_z = np.empty((1, n, 2 * TERMS), real), np.empty((1, n, 2 * TERMS + 1), real)
    fill_basis(np.ascontiguousarray(x[1:2]), TERMS, False, basis, basis_z)
    constants, rows, out = np.zeros(CONSTANTS, real), np.zeros((SCRATCH_ROWS, n), real), np.empty((1, n), real)
    constants[GAIN], rows[ON_SERIES] = 1, x[0]
    compare_filtered(constants, _series_weights(real), np.ascontiguousarray(basis[0].T), n, np.ones(n, bool), out[0],
                     rows)
    return out


def _frequency(m: Any, k: int) -> Any:
    return (2 * k - 1) * m.pi


def step(m: Any, x: Any) -> Any:
    value = 1 / (2 + 0 * x[0])
    for k in range(1, TERMS + 1):
        c = _frequency(m, k)
        value = value + m.sin((x[1] - x[0]) * c) * (2 / c)
    return [np.minimum(np.maximum(value, 0), 1)]


def draw_depths(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return two depths of the series, 0 to 1, equal or near to one another and at the ends among them."""
    d, z = rng.random((2, BLOCK))
    near = np.clip(d + np.exp(rng.uniform(-20, 0, BLOCK)) * rng.choice([-1, 1], BLOCK), 0, 1)
    kind = rng.integers(0, 8, BLOCK)
    return np.stack([np.where(kind == 2, 0.0, d), np.select([kind == 0, kind == 1, kind == 3], [d, near, 1.0 + 0 * d],
                                                            z)])


def draw_means(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return a receiver's depth, then means of S, C, SZ, CZ of each term and of Z over two depths of any share."""
    d, share = rng.random(BLOCK), rng.random(BLOCK)
    z = np.stack([d * rng.random(BLOCK), rng.random(BLOCK)])
    angle = np.multiply.outer((2 * np.arange(1, TERMS + 1) - 1) * np.pi, z)  # (terms, 2, BLOCK)
    each = np.concatenate([np.sin(angle), np.cos(angle), z * np.sin(angle), z * np.cos(angle), z[None]])
    return np.concatenate([d[None], each[:, 0] * share + each[:, 1] * (1 - share)])


def penumbras(x: Array) -> Array:
    """Return z_avg where something blocks, on a scale on which depths of the series are metres."""
    real, n = x.dtype.type, x.shape[1]
    constants, rows = np.zeros(CONSTANTS, real), np.zeros((SCRATCH_ROWS, n), real)
    rows[D] = x[0]
    sizing = FilterSizing(False, False, False, False, False)
    find_penumbra(constants, sizing, DepthScale(False, 0.0, 1.0, 1.0), _series_weights(real),
                  np.ascontiguousarray(x[1:]), n, np.ones(n, bool), rows)
    return rows[DEPTH : DEPTH + 1].copy()


def _blocked(m: Any, x: Any) -> tuple[Any, Any]:
    """Return the share of blockers before a receiver, by the series, and the sum of their depths."""
    d, means = x[0], x[1:]
    shade, depth = 0, 0
    for k in range(TERMS):
        c = _frequency(m, k + 1)
        sine, cosine = m.sin(d * c), m.cos(d * c)  # arrays come first: 50 digits times an array is slow
        shade = shade + (cosine * means[k] - sine * means[TERMS + k]) * (2 / c)
        depth = depth + (cosine * means[2 * TERMS + k] - sine * means[3 * TERMS + k]) * (2 / c)
    half = 1 / (2 + 0 * d)
    return half - shade, half * means[4 * TERMS] - depth


def penumbra(m: Any, x: Any) -> Any:
    blocked, total = _blocked(m, x)
    found = blocked >= LEAST_BLOCKED
    mean = total / np.where(found, blocked, 1)
    return [np.where(found, np.minimum(np.maximum(mean, 0), x[0]), x[0])]


def penumbra_whole(m: Any, x: Any) -> Any:
    """Return the mean depth without limits, and what is divided by, whose own rounding decides whether it counts."""
    blocked, total = _blocked(m, x)
    mean = total / blocked
    return [np.where(abs(blocked - LEAST_BLOCKED) < 1e-5, mean * 1e7 * x[0], mean)]


def draw_scales(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return distance, nearest, depth for each octave, and the far end of a logarithmic scale."""
    near, span = sizes(rng, 1e-9, 1e9), rng.uniform(np.log2(1.05), 20, BLOCK)
    return np.stack([near * 2.0 ** (span * rng.uniform(-0.1, 1.1, BLOCK)), near, 0.8 / span, np.full(BLOCK, 0.9)])


def to_series(x: Array) -> Array:
    out = np.empty((1, x.shape[1]), x.dtype)
    _to_series(x, True, out)
    return out


def to_series_straight(x: Array) -> Array:
    out = np.empty((1, x.shape[1]), x.dtype)
    _to_series(x, False, out)
    return out


def scale(m: Any, x: Any) -> Any:
    return [np.minimum(np.maximum(m.log(x[0] / x[1]) / m.log(m.number(np.array(2.0))) * x[2], 0), x[3])]


def draw_straight(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    near, span = sizes(rng, 1e-9, 1e9), sizes(rng, 1e-3, 1e3)
    return np.stack([near * (1 + span * rng.uniform(-0.1, 1.1, BLOCK)), near, 0.8 / (near * span), np.full(BLOCK, 0.9)])


def scale_straight(m: Any, x: Any) -> Any:  # noqa: ARG001
    return [np.minimum(np.maximum((x[0] - x[1]) * x[2], 0), x[3])]


def draw_back(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    return np.stack([rng.random(BLOCK), sizes(rng, 1e-9, 1e9), 0.8 / rng.uniform(np.log2(1.05), 20, BLOCK)])


def distance(m: Any, x: Any) -> Any:
    return [x[1] * m.exp(x[0] / x[2] * m.log(m.number(np.array(2.0))))]


def draw_cones(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return size of the light, distance of receiver and of blockers, nearly as far among them."""
    d = sizes(rng, 1e-9, 1e9)
    near = np.where(rng.random(BLOCK) < 0.5, 1 - sizes(rng, 1e-7, 0.5), rng.uniform(1e-6, 1.2, BLOCK))
    return np.stack([d * sizes(rng, 1e-6, 1e3), d, d * near])


def cones(m: Any, x: Any) -> Any:
    """tan a = Delta (d - z) / (2 d z); half of arctan(2 tan a); Delta / (2 d): no wider than 80 degrees."""
    delta, d, z = x
    cap = m.tan(m.pi * 80 / 180)
    tangent = np.where(d > z, np.minimum(delta * (d - z) / (2 * d * z), cap), 0)
    return [tangent, m.tan(m.atan(2 * tangent) / 2), np.minimum(delta / (2 * d), cap)]


def draw_discs(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    w, d = directions(rng), sizes(rng, 1e-9, 1e9)
    w[2] = np.abs(w[2])
    return np.concatenate([w * d, d[None], np.minimum(sizes(rng, 1e-9, 6.0), math.tan(CAP))[None]])


def discs(m: Any, x: Any) -> Any:
    """Centre sin(theta) / (cos(theta) + cos(a)), radius sin(a) / (...); a square of alpha / pi of the texture."""
    px, py, z, d, tangent = x
    cosine = 1 / m.sqrt(1 + tangent * tangent)
    across = z + d * cosine
    half_alpha = m.atan(tangent)
    return [px / across, py / across, d * tangent * cosine / across, px / (z + d), py / (z + d), 2 * half_alpha / m.pi]


def sines(m: Any, x: Any) -> Any:
    return [m.sin(m.pi * x[0]), m.cos(m.pi * x[0])]


LADDERS = (
    Ladder("val.basis", "t 0 .. 1", lambda rng, real: draw_depths(rng, real)[1:], each_of(sine_cosine, 1, 2), sines,
           2.5, source="2.4e-7 (float64: 4e-16), as the kernel promises, of 1.2e-7 (2.2e-16)", unit="one",
           conditioned=False, lowest=-1.000001),
    Ladder("val.step", "d and z 0 .. 1, 4 terms; near, equal, at the ends", draw_depths, steps, step, 16.0,
           source="each turn adds 4 ULP to sine and cosine, of 2 k - 1 turns 2 / c_k counts: 4 TERMS", unit="one",
           conditioned=False, extended=400_000, exact=2000),
    Ladder("val.z_avg", "two depths of any share, d 0 .. 1, 4 terms", draw_means, penumbras, penumbra, 16.0,
           source="that of val.step, over the blocked share, which the condition knows",
           smooth=penumbra_whole, unit="one", extended=200_000, exact=1000, brief=BLOCK, brief_exact=40),
    Ladder("val.scale", "distances 1e-9 .. 1e9 m, ratios 1.05 .. 2^20", draw_scales, to_series, scale,
           extended=2_000_000),
    Ladder("val.scale_straight", "distances 1e-9 .. 1e9 m", draw_straight, to_series_straight, scale_straight,
           source="2 roundings of the difference and its product", conditioned=False, extended=2_000_000),
    Ladder("val.distance", "t 0 .. 1, ratios 1.05 .. 2^20", draw_back, filled(_from_series), distance,
           extended=2_000_000),
    Ladder("val.filter_width", "d 1e-9 .. 1e9 m, Delta / d 1e-6 .. 1e3, z / d 1e-6 .. 1.2", draw_cones,
           filled(_tangents, 3), cones, 8.0, source="8 roundings, each at most one ULP, of which d - z is the first",
           conditioned=False),
    Ladder("val.filter_place", "d 1e-9 .. 1e9 m, cones 1e-9 rad .. 80 degrees", draw_discs, filled(_discs, 6), discs,
           8.0, source="8 roundings, each at most one ULP", lowest=-np.inf),
)
