"""Convolution shadow maps (CSM): the soft shadow of one area light by a filtered series (VAL Sec. 4.1, 4.2).

Receivers are the SIMD lanes. Three passes over a tile surround two reads of the filtered map: where each receiver looks
for blockers; their mean depth, and the penumbra's filter; the filtered comparison. d' = t(d) - b is the receiver's
depth on the series' scale; S_k, C_k, SZ_k, CZ_k, Z are means of the channels, w_k weights of the series.
"""

from typing import Any, NamedTuple

import numpy as np

from refgi.cluster.filters import prefilter as filters
from refgi.cluster.filters.basis import DepthScale, series_depths, series_distance, sine_cosine
from refgi.cluster.filters.basis import depth_scale as scale_of_map
from refgi.cluster.filters.prefilter import filter_means
from refgi.cluster.settings import Csm, DepthScaleName
from refgi.cluster.visibility.pcf import cone_tangent, published_tangent
from refgi.cluster.visibility.search_region import (
    BIAS,
    CONSTANTS,
    COSINE,
    DEPTH,
    EXTENT,
    GAIN,
    NEAREST,
    ON_SERIES,
    RADIUS,
    SCRATCH_ROWS,
    SEARCH_BIAS,
    SHADE,
    SINE,
    STEP_COSINE,
    STEP_SINE,
    D,
    FilterSizing,
    S,
    Scratch,
    Series,
    T,
    X,
    count_true,
    find_search_regions,
    place_filters,
)
from refgi.cluster.visibility.search_region import series as series_of
from refgi.cluster.visibility.steps import Places, lanes, planes, put, put_penumbra
from refgi.jit import kernel
from refgi.stages import stage
from refgi.types import Array

DENSE = 0.75  # share of the lanes from which on moving them together costs more than it saves
LEAST_BLOCKED = 0.02  # of the search disc: less is the series' ripple, not a blocker


class CsmShadow(NamedTuple):
    """One filtered map and the series."""

    constants: Array  # of `light_constants`
    sizing: FilterSizing
    scale: DepthScale  # of the filtered map
    weight: Array  # (M,) w_k, in the dtype of the receivers
    filters: Any  # Mip or Brute


@kernel
def csm_tile(
    shadow: CsmShadow, points: Array, facing: Array, size: int, active: Array, visible: Array, scratch: Scratch  # noqa: ARG001
) -> None:
    """Fill V of the active ones of `size` receivers, (>= 3, >= size), world space, m; 1 elsewhere.

    The second read is half of the cost; where few have blockers, these move together for it. `active` is overwritten.
    """
    constants, weight, pending, rows, means = (shadow.constants, shadow.weight, scratch.pending, scratch.rows,
                                               scratch.means)
    if find_search_regions(constants, shadow.sizing, points, size, active, pending, visible, rows) == 0:
        return
    filter_means(shadow.filters, rows[S], rows[T], rows[RADIUS], pending, size, True, means)
    count = find_penumbra(constants, shadow.sizing, shadow.scale, weight, means, size, pending, rows)
    if count >= DENSE * size:
        filter_means(shadow.filters, rows[S], rows[T], rows[RADIUS], pending, size, False, means)
        compare_filtered(constants, weight, means, size, pending, visible, rows)
    elif count > 0:
        _compact(size, pending, active, rows)
        filter_means(shadow.filters, rows[S], rows[T], rows[RADIUS], active, count, False, means)
        compare_filtered(constants, weight, means, count, active, rows[X], rows)
        _expand(rows[X], size, pending, visible)


@kernel
def find_penumbra(
    constants: Array, sizing: FilterSizing, scale: DepthScale, weight: Array, means: Array, size: int, pending: Array,
    rows: Array,
) -> int:
    """Find the mean depth of blockers and the filter whose size follows from it; return how many have blockers.

    z_avg is the distance at (Z/2 - sum_k w_k (cos(c_k d') SZ_k - sin(c_k d') CZ_k)) / (1 - V) of the series' scale.
    Fills `rows` S to RADIUS, ON_SERIES, and DEPTH with z_avg (m), d without a blocker; those receivers leave `pending`.
    """
    real = rows.dtype.type
    half, near = real(0.5), constants[NEAREST]
    terms = len(weight)
    series_depths(scale, rows[D], rows[ON_SERIES], size)
    start_series(constants[SEARCH_BIAS], size, rows)
    for k in range(terms):
        w = weight[k]
        for i in range(size):
            sine, cosine = rows[SINE, i], rows[COSINE, i]
            rows[SHADE, i] += w * (cosine * means[k, i] - sine * means[terms + k, i])
            rows[DEPTH, i] += w * (cosine * means[2 * terms + k, i] - sine * means[3 * terms + k, i])
            rows[SINE, i] = sine * rows[STEP_COSINE, i] + cosine * rows[STEP_SINE, i]
            rows[COSINE, i] = cosine * rows[STEP_COSINE, i] - sine * rows[STEP_SINE, i]
    for i in range(size):  # four loops: one would be too long for the compiler to join into SIMD lanes
        pending[i] = pending[i] & (half - rows[SHADE, i] >= real(LEAST_BLOCKED))
    for i in range(size):
        # Sec. 4.1: z_avg
        depth = (half * means[4 * terms, i] - rows[DEPTH, i]) / (half - rows[SHADE, i])
        rows[DEPTH, i] = depth if pending[i] else rows[ON_SERIES, i]
    for i in range(size):
        d = rows[D, i]
        depth = min(max(series_distance(scale, rows[DEPTH, i]), near), d)
        rows[DEPTH, i] = depth if pending[i] else d
    for i in range(size):
        extent, d, depth = rows[EXTENT, i], rows[D, i], rows[DEPTH, i]
        # Sec. 4.2: alpha = arctan(p cos(beta) / d)
        rows[RADIUS, i] = published_tangent(extent, d, depth) if sizing.alpha else cone_tangent(extent, d, depth)
    place_filters(sizing.alpha_over_pi, size, rows)
    return count_true(pending, size)


@kernel
def compare_filtered(
    constants: Array, weight: Array, means: Array, size: int, pending: Array, visible: Array, rows: Array
) -> None:
    """Compare depths: V = 1/2 + sum_k w_k (cos(c_k d') S_k - sin(c_k d') C_k) under the penumbra's filter."""
    real = rows.dtype.type
    zero, one, half, gain, terms = real(0.0), real(1.0), real(0.5), constants[GAIN], len(weight)
    start_series(constants[BIAS], size, rows)
    for k in range(terms):
        w = weight[k]
        for i in range(size):
            sine, cosine = rows[SINE, i], rows[COSINE, i]
            # Sec. 4.1: f_M(d, z), each product of d and z under the filter
            rows[SHADE, i] += w * (cosine * means[k, i] - sine * means[terms + k, i])
            rows[SINE, i] = sine * rows[STEP_COSINE, i] + cosine * rows[STEP_SINE, i]
            rows[COSINE, i] = cosine * rows[STEP_COSINE, i] - sine * rows[STEP_SINE, i]
    for i in range(size):
        value = gain * (half + rows[SHADE, i])
        value = min(max(value, zero), one)
        visible[i] = value if pending[i] else visible[i]


@kernel
def start_series(bias: Any, size: int, rows: Array) -> None:
    """Fill rows SINE to DEPTH: sin(pi d'), cos(pi d') of d' = t(d) - bias, their step of 2 pi d', and empty sums."""
    zero, one, two = rows.dtype.type(0.0), rows.dtype.type(1.0), rows.dtype.type(2.0)
    for i in range(size):
        sine, cosine = sine_cosine(rows[ON_SERIES, i] - bias)
        rows[SINE, i], rows[COSINE, i] = sine, cosine
        rows[STEP_SINE, i], rows[STEP_COSINE, i] = two * sine * cosine, one - two * sine * sine
        rows[SHADE, i], rows[DEPTH, i] = zero, zero


@kernel
def _compact(size: int, pending: Array, first: Array, rows: Array) -> None:
    """Move the pending receivers to the first lanes, in place, and flag these."""
    count = 0
    for i in range(size):
        rows[ON_SERIES, count], rows[RADIUS, count] = rows[ON_SERIES, i], rows[RADIUS, i]
        rows[S, count], rows[T, count] = rows[S, i], rows[T, i]
        first[count] = True
        count += pending[i]


@kernel
def _expand(some: Array, size: int, pending: Array, visible: Array) -> None:
    count = 0
    for i in range(size):
        visible[i] = some[count] if pending[i] else visible[i]
        count += pending[i]


@stage("cluster.series", kept=False)
def series(terms: int, attenuation: float, rescale: Any, fixed: float | None) -> tuple[Array, Array, Array]:
    """Return weights and biases of f_M, and the far end of its depths (VAL Sec. 4.1, E-VAL-02, 03, 05).

    terms: M.
    attenuation: A of the terms' attenuation.
    rescale {"none", "scale2", "plateau"}: What undoes it.
    fixed: Both biases; None: where f_M is 1 for the first time.
    -> weight (term,): w_k = 2 / c_k, c_k = (2k - 1) pi.
    -> bias (search comparison,): b* of the search and of the comparison, where f_M is 1 for the first time.
    -> end (one,): 1 - 2 b*, the depth of what is farthest.
    """
    chain = series_of(Csm(terms, bias=fixed, attenuation=attenuation, rescale=rescale))
    return np.array(chain.weight), np.array([chain.search_bias, chain.bias]), np.array([chain.range])


@stage("cluster.depth_scale", kept=False)
def depth_scale(
    near: Array, far: Array, scene_far: Array, end: Array, kind: DepthScaleName
) -> tuple[Array, Array]:
    """Find the scale on which the depths of each map are compared (E-VAL-05).

    near (area light,): Least distance on each map, m; inf on an empty one.
    far (area light,): Greatest one, m.
    scene_far (area light,): To the farthest place there is, m.
    end (one,): Depth of what is farthest.
    kind: Octaves or metres between what a map holds; metres up to the scene's end.
    -> origin (area light,): Distance of depth 0, m; 0 for empty maps.
    -> slope (area light,): Depths per octave of distance or per metre; 0 on empty maps.
    """
    none = DepthScale(False, 0.0, 0.0, 0.0)
    scales = [scale_of_map(kind, float(a), float(b), float(c), float(end[0])) if np.isfinite(a) else none
              for a, b, c in zip(near, far, scene_far, strict=True)]
    return np.array([one.origin for one in scales]), np.array([one.slope for one in scales])


@stage("cluster.csm_penumbra", kept=False)
def csm_penumbra(
    places: Places, origin: Array, slope: Array, end: Array, weight: Array, bias: Array, pending: Array, means: Array,
    logarithmic: bool, alpha: bool, squares: bool, foreshortened: bool,
) -> tuple[Array, Array, Array, Array]:
    """Find blockers' mean depth in the search disc, and the penumbra's disc (VAL Sec. 4.1, E-VAL-02, 04, 07).

    origin, slope (area light,): Scale of the series on each map.
    end (one,): Depth of what is farthest.
    weight (term,): w_k.
    bias (search comparison,): b*.
    pending (area light, h, w) bool: Who searches.
    means (area light, channel, h, w): Means of the channels over the search disc.
    logarithmic: Whether depths are octaves.
    alpha: The angle of the penumbra as printed.
    squares, foreshortened: As for the search.
    -> shaded (area light, h, w) bool: Whether there are blockers; V is 1 elsewhere.
    -> z_avg (area light, h, w): Mean distance of the blockers, m; 0 where not shaded.
    -> region (area light, s t radius, h, w): Disc of the penumbra, [-1, 1] units; 0 where none.
    -> t (area light, h, w): Depth of the pixel on the series' scale.
    """
    shaded, z_avg, region, t = planes(places, kind=np.bool_), planes(places), planes(places, 3), planes(places)
    sizing = FilterSizing(alpha, squares, False, foreshortened, False)
    chain = Series(weight, 0.0, float(bias[0]), float(bias[1]), float(end[0]), 1.0)
    for lane in lanes(places, sizing, means.shape[1], chain):
        flags, rows = lane.scratch.pending, lane.scratch.rows
        flags[:] = pending[lane.k].reshape(-1)
        asked, here = flags.copy(), np.ascontiguousarray(means[lane.k]).reshape(means.shape[1], -1)
        scale = DepthScale(logarithmic, float(origin[lane.k]), float(slope[lane.k]), float(end[0]))
        find_penumbra(lane.constants, sizing, scale, weight, here, lane.pixels, flags, rows)
        put_penumbra(lane, shaded, z_avg, region)
        put(t, lane.k, rows[ON_SERIES], asked)
    return shaded, z_avg, region, t


@stage("cluster.csm", kept=False)
def csm(
    shaded: Array, t: Array, means: Array, weight: Array, bias: Array, gain: float, hard: Array | None
) -> Array:
    """Compare depths: V = gain (1/2 + sum w_k (cos(c_k d') S_k - sin(c_k d') C_k)) (VAL Sec. 4.1, E-VAL-02).

    shaded (area light, h, w) bool: Whether there are blockers.
    t (area light, h, w): Depth of the pixel on the series' scale; d' = t - b.
    means (area light, channel, h, w): Means S, C over the penumbra's disc.
    weight (term,): w_k.
    bias (search comparison,): b*.
    gain: 2 where a damped series is doubled.
    hard (area light, h, w): V of area lights without extent, where there are some.
    -> (area light, h, w): V, 0 hidden to 1 seen; 1 behind the light's plane, on empty maps, without surface.
    """
    made = np.ones(shaded.shape, t.dtype) if hard is None else np.array(hard)
    constants = np.zeros(CONSTANTS, t.dtype)
    constants[BIAS], constants[GAIN] = bias[1], gain
    for k, flags in enumerate(shaded.reshape(len(shaded), -1)):
        rows, visible = np.zeros((SCRATCH_ROWS, len(flags)), t.dtype), np.ones(len(flags), t.dtype)
        rows[ON_SERIES] = t[k].reshape(-1)
        here = np.ascontiguousarray(means[k]).reshape(means.shape[1], -1)
        compare_filtered(constants, weight, here, len(flags), flags, visible, rows)
        made[k].reshape(-1)[flags] = visible[flags]
    return made


def visibility_of_map(
    places: Places, depth: Array, far: Array, scene_far: Array, found: tuple[Array, Array], kind: Csm,
    chain: tuple[Array, Array, Array], sizing: FilterSizing, hard: Array | None,
) -> Array:
    """Return V by one map of each area light, made by steps; `found`: who searches, and where."""
    weight, bias, end = chain
    logarithmic, by_mips = kind.depth_scale == "log_map", kind.prefilter == "mip"
    in_bytes = kind.quantisation == "published"
    origin, slope = depth_scale(places.near, far, scene_far, end, kind.depth_scale)
    t = filters.map_depths(depth, origin, slope, end, logarithmic, by_mips)
    basis = filters.basis(t, kind.terms, in_bytes)
    levels = filters.mip_levels(basis, in_bytes) if by_mips else {}

    def means(pending: Array, region: Array, weighed: bool) -> Array:
        if by_mips:
            return filters.mip_means(pending, region, basis, levels, t if in_bytes else None, kind.terms, weighed)
        mean = filters.box_means if sizing.alpha_over_pi else filters.disc_means
        return mean(pending, region, basis, kind.terms, weighed)

    shaded, _, region, t_pixel = csm_penumbra(
        places, origin, slope, end, weight, bias, found[0], means(*found, weighed=True), logarithmic, sizing.alpha,
        sizing.alpha_over_pi, sizing.foreshortened)
    return csm(shaded, t_pixel, means(shaded, region, weighed=False), weight, bias, series_of(kind).gain, hard)
