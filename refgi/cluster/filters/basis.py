"""The basis of the series: sines and cosines of each texel's depth, and the scale of depths (Sec. 4.1, 6).

On a scale from the nearest to the farthest of what a map holds, even in ratios of distances, the same few terms tell
more of occluders from what they shade. S_k = sin(c_k t), C_k = cos(c_k t), c_k = (2k - 1) pi come by turning on by 2 pi
t. The published textures keep 8 bits of them, which puts V off by 0.0059 at most with 4 terms, and 16 of the products
with t. `mirrored` texels beyond the unit disc hold what lies in the direction mirrored at the light's plane, (s, t) /
(s^2 + t^2): holding nothing they would let light leak in over the rim.
"""

import functools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from refgi.elementary import exp2, log2
from refgi.jit import kernel
from refgi.types import Array

LEAST_RATIO = 1.05  # far over near: the bias is then more than the thousandth that the step keeps before surfaces
MOST_RATIO = 2.0**20  # the same: what is nearer counts as near


class DepthScale(NamedTuple):
    """How distances become depths; or with an axis in `origin` and `slope`, those of several maps."""

    logarithmic: bool
    origin: Any  # m: what is 0 on the series' scale
    slope: Any  # depth of the series for each metre, or each octave
    most: Any  # far end: what lies beyond, and nothing at all


def joined(scales: Sequence[DepthScale]) -> DepthScale:
    """Return the scales of several maps, all of one kind, as one with an axis."""
    return scales[0]._replace(origin=np.array([scale.origin for scale in scales], np.float64),
                              slope=np.array([scale.slope for scale in scales], np.float64))


def depth_scale(kind: str, near: float, far: float, scene_far: float, most: float) -> DepthScale:
    """Return the scale of one map of distances 0 < near <= far, m; `most` is the far end of the series' range.

    "log_map" and "map" lie between these, "scene" ends at `scene_far`, m. What the map holds ends both biases below
    `most`, so that its farthest blocker still hides wholly what lies beyond; or in the middle where so few terms leave
    less.
    """
    if kind == "scene":
        return DepthScale(False, 0.0, most / scene_far, most)
    near = max(near, far / MOST_RATIO)
    far = max(far, LEAST_RATIO * near)
    top = max(2.0 * most - 1.0, most / 2.0)
    span = math.log2(far / near) if kind == "log_map" else far - near
    return DepthScale(kind == "log_map", near, top / span, most)


@kernel
def series_depths(scale: DepthScale, distance: Array, depth: Array, count: int) -> None:
    """Fill depth[:count] with t, 0 to `scale.most`, of distances, m; inf where the map is empty."""
    real = distance.dtype.type
    origin, slope, most, zero = real(scale.origin), real(scale.slope), real(scale.most), real(0.0)
    if scale.logarithmic:
        inverse = real(1.0) / origin
        for i in range(count):
            t = log2(distance[i] * inverse) * slope
            t = t if t > zero else zero
            depth[i] = t if t < most else most
    else:
        for i in range(count):
            t = (distance[i] - origin) * slope
            t = t if t > zero else zero
            depth[i] = t if t < most else most


@kernel
def series_distance(scale: DepthScale, depth: Any) -> Any:
    """Return the distance, m, that a depth t of the series stands for."""
    real = type(depth)
    along = depth / real(scale.slope)
    return real(scale.origin) * exp2(along) if scale.logarithmic else along + real(scale.origin)


STEPS = 255.0
HALF_STEP = 0.5001  # what lies half way, as means of four often do, is rounded up however it was rounded before
LEAST_NORMAL = 0x38800000, 0x3F10000000000000  # bits of 2^-14, the least half with all its 11 bits
RUN = 32  # texels of a row that are looked at together for whether the map holds anything

# sin(pi u) / u and cos(pi u) in powers of u^2, |u| <= 1/2: Taylor series to half a unit in the last place
SINE = tuple((-1) ** k * math.pi ** (2 * k + 1) / math.factorial(2 * k + 1) for k in range(12))
COSINE = tuple((-1) ** k * math.pi ** (2 * k) / math.factorial(2 * k) for k in range(13))
INSIDE = 1.5  # texels from the rim, within which the centre of a texel lies in the disc


@kernel
def eight_bits(value: Any) -> Any:
    """Return the nearest of 256 evenly spaced numbers from -1 to 1: a number of [-1, 1] in a texture of 8 bits."""
    real = type(value)
    step = np.floor((value + real(1.0)) * real(0.5 * STEPS) + real(HALF_STEP))
    return step * real(2.0 / STEPS) - real(1.0)


@kernel
def half_precision(value: Any) -> Any:
    """Return the nearest float of 16 bits, of two equally near ones the even, of a number within 65504 in size.

    By its bits, in SIMD lanes: half of what is cut off is added, less one where what stays is even; below 2^-14 by
    adding a number of that spacing, 2^-24.
    """
    if isinstance(value, np.float32):
        bits = np.float32(value).view(np.int32)
        size = np.int32(bits & np.int32(0x7FFFFFFF))
        small = (np.int32(size).view(np.float32) + np.float32(0.5)) - np.float32(0.5)
        cut = np.int32(size + np.int32(0xFFF) + (np.int32(size >> np.int32(13)) & np.int32(1))) & np.int32(-0x2000)
        chosen = np.float32(small).view(np.int32) if size < np.int32(LEAST_NORMAL[0]) else np.int32(cut)
        return np.int32(chosen | np.int32(bits & np.int32(-0x80000000))).view(np.float32)
    wide = np.float64(value).view(np.int64)
    length = wide & np.int64(0x7FFFFFFFFFFFFFFF)
    tiny = (np.int64(length).view(np.float64) + np.float64(2.0**28)) - np.float64(2.0**28)
    head = (length + np.int64((1 << 41) - 1) + ((length >> np.int64(42)) & np.int64(1))) & np.int64(-(1 << 42))
    kept = np.float64(tiny).view(np.int64) if length < np.int64(LEAST_NORMAL[1]) else head
    return np.int64(kept | (wide & np.int64(-0x8000000000000000))).view(np.float64)


@kernel
def normalise(depth: Array, scale: DepthScale, out: Array) -> None:
    """Fill `out` (n, n) with t of the distances `depth` (n, n), m; `scale.most` where the map is empty (inf)."""
    real, columns = depth.dtype.type, depth.shape[1]
    most, nothing = real(scale.most), real(np.inf)
    for i in range(depth.shape[0]):
        for first in range(0, columns, RUN):
            last, empty = min(first + RUN, columns), True
            for j in range(np.uint64(first), np.uint64(last)):
                empty &= depth[i, j] == nothing
            if empty:
                for j in range(np.uint64(first), np.uint64(last)):
                    out[i, j] = most
            else:
                series_depths(scale, depth[i, first:last], out[i, first:last], last - first)


@kernel
def sine_cosine(t: Any) -> tuple[Any, Any]:
    """Return sin(pi t), cos(pi t), t from -1/4 to 1, within 2.4e-7 (float64: 4e-16) from 0 on, else 4.5e-7 (8e-16)."""
    real = type(t)
    u = t - real(0.5)
    q = u * u
    if isinstance(t, np.float32):
        a, b = real(SINE[7]), real(COSINE[7])
        for k in (6, 5, 4, 3, 2, 1, 0):
            a, b = a * q + real(SINE[k]), b * q + real(COSINE[k])
    else:
        a, b = real(SINE[11]), real(COSINE[12])
        for k in (10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0):
            a = a * q + real(SINE[k])
        for k in (11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0):
            b = b * q + real(COSINE[k])
    return b, -(u * a)


@kernel
def turned(sine: Any, cosine: Any, by_sine: Any, by_cosine: Any) -> tuple[Any, Any]:
    """Return sine and cosine of the sum of two angles: from S_k, C_k and those of 2 pi t, S_k+1 and C_k+1."""
    return sine * by_cosine + cosine * by_sine, cosine * by_cosine - sine * by_sine


@kernel
def fill_basis(depth: Array, terms: int, quantised: bool, basis: Array, basis_z: Array) -> None:
    """Fill `basis` (n, n, 2 M) and `basis_z` (n, n, 2 M + 1) of a map of t, (n, n); quantised: 8 bits and 16."""
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            t = depth[i, j]
            sine, cosine = sine_cosine(t)
            by_sine, by_cosine = turned(sine, cosine, sine, cosine)
            for k in range(terms):
                basis[i, j, k], basis[i, j, terms + k] = sine, cosine
                basis_z[i, j, k], basis_z[i, j, terms + k] = t * sine, t * cosine
                sine, cosine = turned(sine, cosine, by_sine, by_cosine)
            basis_z[i, j, 2 * terms] = t
            if quantised:
                for c in range(2 * terms):
                    basis[i, j, c] = eight_bits(basis[i, j, c])
                for c in range(2 * terms + 1):
                    basis_z[i, j, c] = half_precision(basis_z[i, j, c])


@functools.lru_cache(maxsize=8)
def beyond_disc(size: int, mirrored: bool) -> Array:
    """Pair the texels beyond the unit disc of an n x n map with those they mirror, if any: (count, 2) int32."""
    if not mirrored:
        return np.zeros((0, 2), np.int32)
    centres = (np.arange(size) + 0.5) * 2 / size - 1
    s, t = np.meshgrid(centres, centres)
    rho = np.hypot(s, t)
    beyond = np.flatnonzero(rho.ravel() > 1)
    scale = np.minimum(1 / rho.ravel()[beyond], 1 - INSIDE / size) / rho.ravel()[beyond]
    column, row = (((x.ravel()[beyond] * scale + 1) * size / 2).astype(np.int64) for x in (s, t))
    return np.stack([beyond, row * size + column], axis=1).astype(np.int32)


@kernel
def fill_beyond(pairs: Array, depth: Array) -> None:
    """Copy depths of a map (n, n) to the texels beyond the unit disc, by pairs (count, 2) of `beyond_disc`."""
    flat = depth.reshape(-1)
    for k in range(len(pairs)):
        flat[np.uint64(pairs[k, 0])] = flat[np.uint64(pairs[k, 1])]
