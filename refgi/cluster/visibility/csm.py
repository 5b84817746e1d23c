"""Convolution shadow maps (CSM): the soft shadow of one area light by a filtered series (Sec. 4.1, 4.2).

Receivers are the SIMD lanes. Three passes over a tile surround two reads of the filtered map: where each receiver
looks for blockers; their mean depth, and the penumbra's filter; the filtered comparison.

Symbols: d distance of the receiver from the area light's centre (m); d' = t(d) - b on the series' scale; S_k, C_k,
SZ_k, CZ_k, Z means of sin(c_k z), cos(c_k z), of their products with z, and of z; w_k weights of the series.
"""

from typing import Any, NamedTuple

from refgi.cluster.filters.basis import DepthScale, series_depths, series_distance, sine_cosine
from refgi.cluster.filters.prefilter import filter_means
from refgi.cluster.visibility.pcf import cone_tangent, published_tangent
from refgi.cluster.visibility.search_region import (
    BIAS,
    COSINE,
    DEPTH,
    EXTENT,
    GAIN,
    NEAREST,
    ON_SERIES,
    RADIUS,
    SEARCH_BIAS,
    SHADE,
    SINE,
    STEP_COSINE,
    STEP_SINE,
    D,
    FilterSizing,
    S,
    Scratch,
    T,
    X,
    count_true,
    find_search_regions,
    place_filters,
)
from refgi.jit import kernel
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

    Each receiver's V depends on nothing but its own position, whatever tile it is in. The second read is half of the
    cost; where few have blockers, these move together for it. `active` is overwritten, with nothing but True.
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

    z_avg is the distance at (Z/2 - sum_k w_k (cos(c_k d') SZ_k - sin(c_k d') CZ_k)) / (1 - V) of the series' scale,
    where V is that of the search disc: on a logarithmic scale, the blockers' geometric mean. `means`
    (>= 4 M + 1, >= size) holds S, C, SZ, CZ for each k, then Z. Fills `rows` S to RADIUS, ON_SERIES, and DEPTH with
    z_avg (m), d where there is no blocker; those receivers leave `pending`.
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
    for i in range(size):
        blocked = half - rows[SHADE, i]
        found = pending[i] & (blocked >= real(LEAST_BLOCKED))
        pending[i] = found
        d = rows[D, i]
        # Sec. 4.1: z_avg
        depth = (half * means[4 * terms, i] - rows[DEPTH, i]) / blocked if found else rows[ON_SERIES, i]
        depth = min(max(series_distance(scale, depth), near), d) if found else d
        rows[DEPTH, i] = depth
        extent = rows[EXTENT, i]
        # Sec. 4.2: alpha = arctan(p cos(beta) / d)
        rows[RADIUS, i] = published_tangent(extent, d, depth) if sizing.alpha else cone_tangent(extent, d, depth)
    place_filters(sizing.alpha_over_pi, size, rows)
    return count_true(pending, size)


@kernel
def compare_filtered(
    constants: Array, weight: Array, means: Array, size: int, pending: Array, visible: Array, rows: Array
) -> None:
    """Compare depths under the penumbra's filter (Sec. 4.1).

    V = 1/2 + sum_k w_k (cos(c_k d') S_k - sin(c_k d') C_k), in [0, 1], where `pending`; `means` (>= 2 M, >= size)
    holds S, then C, for each k.
    """
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
