"""Search regions of the blocker search (Sec. 4.1, 4.2), and the depth comparison as a Fourier series.

step(z - d) becomes f_M(d, z) = 1/2 + 2 sum_k (L_k / c_k) sin(c_k (z - d)), whose mean over a filter needs the means of
sin(c_k z) and cos(c_k z) alone; c_k = (2k - 1) pi, L_k = exp(-A (k / M)^2), w_k = 2 L_k / c_k, b bias. Receivers are
the SIMD lanes; the rows of a tile's scratch hold what one pass leaves to the next.
"""

import functools
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.filters.basis import DepthScale, depth_scale
from refgi.cluster.maps import BACKWARD, ShadowMaps
from refgi.cluster.settings import Csm, DepthScaleName, Pcss, ValSettings
from refgi.cluster.visibility.pcf import cone_tangent, disc, farthest_tangent, published_square, solid_angle_tangent
from refgi.jit import kernel
from refgi.types import Array

NEARLY_ALL = 0.95  # of the way from 1/2 to the top: where a series that never reaches 1 counts as lit
SCAN = 64  # samples per term that find the first crossing; the series has at most one per half wave of its last term


class Series(NamedTuple):
    """A series and the scale of depths it is meant for."""

    weight: Array  # (M,) float64: w_k, rescaled where that is asked for
    first: float  # b*: the first z - d at which f_M is 1
    search_bias: float  # b of the blocker search
    bias: float  # b of the final comparison
    range: float  # depth of the farthest point; all depths lie in [0, range]
    gain: float  # V = gain * f_M, cut to [0, 1]


def frequencies(terms: int) -> Array:
    """Return c_k = (2k - 1) pi, (M,), angular frequencies on the series' scale of depths."""
    return (2.0 * np.arange(1, terms + 1) - 1.0) * np.pi


def weights(terms: int, attenuation: float = 0.0) -> Array:
    """Return w_k = 2 L_k / c_k, L_k = exp(-A (k / M)^2), (M,); A = 0 is the plain series, which overshoots 9 %."""
    damping = np.exp(-attenuation * (np.arange(1, terms + 1) / terms) ** 2)
    # Sec. 4.1: f(d, z) = 1/2 + 2 sum_k (1 / c_k) sin(c_k (z - d)), c_k = (2k - 1) pi
    return np.asarray(2.0 * damping / frequencies(terms))


def above_half(difference: npt.ArrayLike, weight: Array) -> Array:
    """Return f_M - 1/2 = sum_k w_k sin(c_k (z - d)) of differences z - d on the series' scale (> 0 is lit)."""
    return np.asarray(np.sin(np.multiply.outer(difference, frequencies(len(weight)))) @ weight)


def plateau(weight: Array) -> float:
    """Return the f_M - 1/2 that a damped series makes of fully lit: its mean from near its top to the mirror image."""
    c, start = frequencies(len(weight)), first_lit(weight)
    # the integral of w sin(c u) over [b, 1 - b], as cos(c (1 - b)) = -cos(c b)
    return float((2.0 * weight / c * np.cos(c * start)).sum() / (1.0 - 2.0 * start))


def first_lit(weight: Array) -> float:
    """Return b*, the first z - d at which the series is 1, about 0.305 / M; below 1: 95 % of the way to its top."""
    from scipy.optimize import brentq  # here, as methods that cast no such shadows need none of it

    u = np.linspace(0.0, 0.5, SCAN * len(weight) + 1)
    values = above_half(u, weight)
    level = min(0.5, NEARLY_ALL * float(values.max()))
    k = int(np.argmax(values >= level))
    return float(brentq(lambda x: float(above_half(x, weight)) - level, u[k - 1], u[k], xtol=1e-15, rtol=1e-14))


@functools.lru_cache(maxsize=64)
def _known(terms: int, attenuation: float, rescale: str, bias: float | None) -> Series:
    weight = weights(terms, attenuation)
    if rescale == "plateau":
        weight = weight / min(1.0, 2.0 * plateau(weight))
    first = first_lit(weight)
    gain, own = (2.0, 0.0) if rescale == "scale2" else (1.0, first)
    search, final = (first, own) if bias is None else (bias, bias)
    weight.setflags(write=False)
    return Series(weight, first, search, final, 1.0 - first - max(first, search), gain)


def series(settings: Csm) -> Series:
    """Return the series that settings ask for: weights, biases and the range of depths.

    The range [0, 1 - 2 b*] keeps biased differences b* away from the series' other crossing at 1. Sec. 4.1 says nothing
    of a bias; b* is the least that makes lit receivers fully lit. "scale2" compares without bias and doubles; its
    search keeps b*. "plateau" stretches a damped series about 1/2 until its plateau is 1.
    """
    return _known(settings.terms, settings.attenuation, settings.rescale, settings.bias)


# rows of a tile's scratch
X, Y, Z, D, EXTENT = 0, 1, 2, 3, 4  # receiver in the map's frame, its distance, the light's size towards it; m
S, T, RADIUS = 5, 6, 7  # the disc it searches or filters, in [-1, 1] units
SINE, COSINE, STEP_SINE, STEP_COSINE = 8, 9, 10, 11  # of c_k d' for the current k, of 2 pi d'
SHADE, DEPTH = 12, 13  # sums over k; the latter becomes z_avg, m
ON_SERIES = 14  # t(d), the receiver's distance on the series' scale
SCRATCH_ROWS = 15
# places in the constants of an area light
CENTER, FRAME, DELTA, NEAREST, SEARCH_BIAS, BIAS, GAIN = 0, 3, 12, 13, 14, 15, 16
CONSTANTS = 17


class Scratch(NamedTuple):
    """Scratch of one tile of receivers."""

    pending: Array  # (TILE,) bool: receivers that may be shadowed
    rows: Array  # (SCRATCH_ROWS, TILE)
    means: Array  # (channels, TILE): of the filtered map; no rows for unfiltered ones


class FilterSizing(NamedTuple):
    """How filters are sized."""

    alpha: bool  # the printed angle of the penumbra
    alpha_over_pi: bool  # squares of side alpha / pi
    solid_angle: bool  # the search of blockers half-way
    foreshortened: bool  # the light's size as the receiver sees it
    axial: bool  # depths are those along the axis to the receiver, not distances


def filter_sizing(settings: ValSettings) -> FilterSizing:
    """Return how settings size filters, a flag each: `as_published`, `area.foreshortened`, `blocker_depth`."""
    published, kind = settings.as_published, settings.visibility
    return FilterSizing("val_alpha" in published, "val_alpha_over_pi" in published,
                        "val_search_solid_angle" in published, settings.area.foreshortened,
                        isinstance(kind, Pcss) and kind.blocker_depth == "axial")


def light_constants(
    maps: ShadowMaps, k: int, delta: float, chain: Series | None = None, behind: bool = False
) -> Array:
    """Return the constants of one area light and its map, ahead or `behind`, that kernels read."""
    constants = np.zeros(CONSTANTS, maps.depth.dtype)
    near = maps.near if maps.near_behind is None or not behind else maps.near_behind
    constants[CENTER : CENTER + 3] = maps.center[k]
    constants[FRAME : FRAME + 9] = (BACKWARD @ maps.frame[k] if behind else maps.frame[k]).ravel()
    constants[DELTA], constants[NEAREST] = delta, near[k]
    if chain is not None:
        constants[SEARCH_BIAS], constants[BIAS], constants[GAIN] = chain.search_bias, chain.bias, chain.gain
    return constants


def scale_of(maps: ShadowMaps, k: int, kind: DepthScaleName, chain: Series, behind: bool = False) -> DepthScale:
    """Return the scale on which depths of one map that holds something, ahead or `behind`, are compared."""
    near, far = (maps.near_behind, maps.far_behind) if behind else (maps.near, maps.far)
    assert near is not None
    assert far is not None
    return depth_scale(kind, float(near[k]), float(far[k]), float(maps.scene_far[k]), chain.range)


@kernel
def find_search_regions(
    constants: Array, sizing: FilterSizing, points: Array, size: int, active: Array, pending: Array, visible: Array,
    rows: Array,
) -> int:
    """Find the disc in which each active receiver searches for blockers; return how many may be shadowed.

    Receivers behind the area light's plane see it whole (Sec. 5.1), those nearer than the nearest depth as well.
    """
    real = points.dtype.type
    zero, one, near, delta = real(0.0), real(1.0), constants[NEAREST], constants[DELTA]
    cx, cy, cz = constants[CENTER], constants[CENTER + 1], constants[CENTER + 2]
    rx, ry, rz = constants[FRAME], constants[FRAME + 1], constants[FRAME + 2]
    dx, dy, dz = constants[FRAME + 3], constants[FRAME + 4], constants[FRAME + 5]
    fx, fy, fz = constants[FRAME + 6], constants[FRAME + 7], constants[FRAME + 8]
    for i in range(size):
        px, py, pz = points[0, i] - cx, points[1, i] - cy, points[2, i] - cz
        d = math.sqrt(px * px + py * py + pz * pz)
        x, y, z = px * rx + py * ry + pz * rz, px * dx + py * dy + pz * dz, px * fx + py * fy + pz * fz
        ahead = active[i] & (z > zero) & (d > near)
        pending[i] = ahead
        visible[i] = one
        d = d if ahead else one
        z = z if ahead else one
        extent = delta * math.sqrt(z / d) if sizing.foreshortened else delta
        rows[X, i], rows[Y, i], rows[Z, i], rows[D, i], rows[EXTENT, i] = x, y, z, d, extent
        if sizing.solid_angle:
            rows[RADIUS, i] = solid_angle_tangent(extent, d)
        else:
            rows[RADIUS, i] = farthest_tangent(extent, d, near) if sizing.axial else cone_tangent(extent, d, near)
    place_filters(sizing.alpha_over_pi, size, rows)
    return count_true(pending, size)


@kernel
def place_filters(squares: bool, size: int, rows: Array) -> None:
    """Turn the tangents of cones in row RADIUS into rows S to RADIUS, or squares of side alpha / pi."""
    if squares:
        for i in range(size):
            where = published_square(rows[X, i], rows[Y, i], rows[Z, i], rows[D, i], rows[RADIUS, i])
            rows[S, i], rows[T, i], rows[RADIUS, i] = where
    else:
        for i in range(size):  # without a call of the library of C, these are SIMD lanes
            where = disc(rows[X, i], rows[Y, i], rows[Z, i], rows[D, i], rows[RADIUS, i])
            rows[S, i], rows[T, i], rows[RADIUS, i] = where


@kernel
def count_true(flags: Array, size: int) -> int:
    """Return how many of the first `size` flags are set."""
    count = 0
    for i in range(size):
        count += 1 if flags[i] else 0
    return count
