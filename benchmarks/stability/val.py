"""Ladders of val: basis and series of convolution shadow maps, mean depth of blockers, depth scale, filter widths.

Formulas of scales, widths and discs are those of refgi.literal. Its series have frequencies of float64; here they are
those of docs/methods/val_visibility.md: f = 1/2 + sum_k w_k sin(c_k (z - d)), w_k = 2 / c_k, c_k = (2 k - 1) pi;
z_avg = (Z / 2 - sum_k w_k (cos(c_k d) SZ_k - sin(c_k d) CZ_k)) / (1 - V). Depths of the series are numbers of [0, 1],
so its units are those of 1.
"""

import math
from functools import partial
from typing import Any

import numpy as np

from benchmarks.stability.ladder import Ladder, each_of
from benchmarks.stability.promise import BLOCK, around, directions, dot, pi_of, sizes
from refgi.cluster.filters.basis import DepthScale, fill_basis, series_depths, series_distance, sine_cosine
from refgi.cluster.rounds import linear
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
from refgi.literal.val_maps import series_depth
from refgi.literal.val_series import LEAST_BLOCKED
from refgi.literal.val_series import series_distance as distance_of_series
from refgi.literal.val_visibility import STEEPEST, half_angle, square
from refgi.literal.val_visibility import disc as disc_of_cone
from refgi.types import Array

TERMS = 4


@kernel
def _to_series(x: Array, logarithmic: bool, out: Array) -> None:
    for i in range(x.shape[1]):
        series_depths(DepthScale(logarithmic, x[1, i], x[2, i], x[3, i]), x[0, i : i + 1], out[0, i : i + 1], 1)


@kernel
def _from_series(t: Any, origin: Any, slope: Any) -> Any:
    return series_distance(DepthScale(True, origin, slope, 1.0), t)


@kernel
def _tangents(size: Any, d: Any, z: Any) -> Any:
    return cone_tangent(size, d, z), published_tangent(size, d, z), solid_angle_tangent(size, d)


@kernel
def _discs(x: Any, y: Any, z: Any, d: Any, tangent: Any) -> Any:
    s, t, radius = disc(x, y, z, d, tangent)
    return s, t, radius, *published_square(x, y, z, d, tangent)


@kernel
def _angle(ax: Any, ay: Any, az: Any, bx: Any, by: Any, bz: Any) -> Any:
    zero = ax - ax
    return linear(zero, zero, zero, ax, ay, az, bx, by, bz, zero, zero + 1)


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


def step(x: Any) -> Any:
    value = 0.5 + 0 * x[0]
    for k in range(1, TERMS + 1):
        c = (2 * k - 1) * pi_of(x)
        value = value + np.sin((x[1] - x[0]) * c) * (2 / c)
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


def _blocked(x: Any) -> tuple[Any, Any]:
    """Return the share of blockers before a receiver, by the series, and the sum of their depths."""
    d, means = x[0], x[1:]
    shade, depth = 0, 0
    for k in range(TERMS):
        c = (2 * k + 1) * pi_of(x)
        sine, cosine = np.sin(d * c), np.cos(d * c)  # arrays come first: 50 digits times an array is slow
        shade = shade + (cosine * means[k] - sine * means[TERMS + k]) * (2 / c)
        depth = depth + (cosine * means[2 * TERMS + k] - sine * means[3 * TERMS + k]) * (2 / c)
    return 0.5 - shade, 0.5 * means[4 * TERMS] - depth


def penumbra(x: Any) -> Any:
    blocked, total = _blocked(x)
    found = blocked >= LEAST_BLOCKED
    mean = total / np.where(found, blocked, 1)
    return [np.where(found, np.minimum(np.maximum(mean, 0), x[0]), x[0])]


def penumbra_whole(x: Any) -> Any:
    """Return the mean depth without limits, and what is divided by, whose own rounding decides whether it counts."""
    blocked, total = _blocked(x)
    mean = total / blocked
    return [np.where(abs(blocked - LEAST_BLOCKED) < 1e-5, mean * 1e7 * x[0], mean)]


def draw_scales(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return distance, nearest, depth for each octave, and the far end of a logarithmic scale."""
    near, span = sizes(rng, 1e-9, 1e9), rng.uniform(np.log2(1.05), 20, BLOCK)
    return np.stack([near * 2.0 ** (span * rng.uniform(-0.1, 1.1, BLOCK)), near, 0.8 / span, np.full(BLOCK, 0.9)])


def to_series(logarithmic: bool, x: Array) -> Array:
    out = np.empty((1, x.shape[1]), x.dtype)
    _to_series(x, logarithmic, out)
    return out


def scale(logarithmic: bool, x: Any) -> Any:
    return [series_depth(x[0, :, None, None], x[1], x[2], x[3, :, None, None], logarithmic).ravel()]


def draw_straight(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    near, span = sizes(rng, 1e-9, 1e9), sizes(rng, 1e-3, 1e3)
    return np.stack([near * (1 + span * rng.uniform(-0.1, 1.1, BLOCK)), near, 0.8 / (near * span), np.full(BLOCK, 0.9)])


def draw_back(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    return np.stack([rng.random(BLOCK), sizes(rng, 1e-9, 1e9), 0.8 / rng.uniform(np.log2(1.05), 20, BLOCK)])


def distance(x: Any) -> Any:
    return [distance_of_series(x[0, :, None, None], x[1], x[2], logarithmic=True).ravel()]


def draw_cones(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    """Return size of the light, distance of receiver and of blockers, nearly as far among them."""
    d = sizes(rng, 1e-9, 1e9)
    near = np.where(rng.random(BLOCK) < 0.5, 1 - sizes(rng, 1e-7, 0.5), rng.uniform(1e-6, 1.2, BLOCK))
    return np.stack([d * sizes(rng, 1e-6, 1e3), d, d * near])


def cones(x: Any) -> Any:
    """Tangents of the cone, of half of twice its tangent as printed, and of the cone for blockers half-way."""
    delta, d, z = x
    cone, halfway = (np.tan(half_angle(delta, d, at) + 0 * d) for at in (z, d / 2))
    return [cone, np.tan(np.arctan(2 * cone) / 2), halfway]


def draw_discs(rng: np.random.Generator, real: Any) -> Array:  # noqa: ARG001
    w, d = directions(rng), sizes(rng, 1e-9, 1e9)
    w[2] = np.abs(w[2])
    return np.concatenate([w * d, d[None], np.minimum(sizes(rng, 1e-9, 6.0), math.tan(STEEPEST))[None]])


def discs(x: Any) -> Any:
    a = np.arctan(x[4])
    return np.concatenate([disc_of_cone(x[:3], x[3], a).T, square(x[:3], x[3], a).T])


def draw_normals(rng: np.random.Generator, real: Any) -> Array:
    n = directions(rng)
    m = around(rng, n, real)
    tilt = 10.0 ** rng.uniform(-16, 0, BLOCK)
    m = np.where(rng.random(BLOCK) < 0.3, n + tilt * directions(rng), m)
    return np.concatenate([n, rng.choice([-1.0, 1.0], BLOCK) * m / np.sqrt((m * m).sum(axis=0))])


def angle(x: Any) -> Any:
    aside = np.cross(x[:3], x[3:], axis=0)
    return [np.arctan2(np.sqrt(dot(aside, aside)), dot(x[:3], x[3:]))]


LADDERS = (
    Ladder("val.basis", "t 0 .. 1", lambda rng, real: draw_depths(rng, real)[1:], each_of(sine_cosine, 1, 2),
           lambda x: [np.sin(pi_of(x) * x[0]), np.cos(pi_of(x) * x[0])],
           2.5, source="2.4e-7 (float64: 4e-16), as the kernel promises, of 1.2e-7 (2.2e-16)", unit="one",
           conditioned=False, lowest=-1.000001),
    Ladder("val.step", "d and z 0 .. 1, 4 terms; near, equal, at the ends", draw_depths, steps, step, 16.0,
           source="each turn adds 4 ULP to sine and cosine, of 2 k - 1 turns 2 / c_k counts: 4 TERMS", unit="one",
           conditioned=False, extended=400_000, exact=2000),
    Ladder("val.z_avg", "two depths of any share, d 0 .. 1, 4 terms", draw_means, penumbras, penumbra, 16.0,
           source="that of val.step, over the blocked share, which the condition knows",
           smooth=penumbra_whole, unit="one", extended=200_000, exact=1000, brief=BLOCK, brief_exact=40),
    Ladder("val.scale", "distances 1e-9 .. 1e9 m, ratios 1.05 .. 2^20", draw_scales, partial(to_series, True),
           partial(scale, True), extended=2_000_000),
    Ladder("val.scale_straight", "distances 1e-9 .. 1e9 m", draw_straight, partial(to_series, False),
           partial(scale, False), source="2 roundings of the difference and its product", conditioned=False,
           extended=2_000_000),
    Ladder("val.distance", "t 0 .. 1, ratios 1.05 .. 2^20", draw_back, each_of(_from_series, 3), distance,
           extended=2_000_000),
    Ladder("val.filter_width", "d 1e-9 .. 1e9 m, Delta / d 1e-6 .. 1e3, z / d 1e-6 .. 1.2", draw_cones,
           each_of(_tangents, 3, 3), cones, 8.0, conditioned=False,
           source="8 roundings, each at most one ULP, of which d - z is the first"),
    Ladder("val.filter_place", "d 1e-9 .. 1e9 m, cones 1e-9 rad .. 80 degrees", draw_discs, each_of(_discs, 5, 6),
           discs, 8.0, source="8 roundings, each at most one ULP", lowest=-np.inf),
    Ladder("val.angle", "unit normals any way, 1e-16 .. 1 rad from along and opposite", draw_normals,
           each_of(_angle, 6), angle, 5.0, source="1e-15, as the kernel promises, and a rounding of both inputs",
           unit="one", conditioned=False, reals=("float64",)),
)
