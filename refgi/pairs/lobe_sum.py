"""The sum over all pairs of glossy pixel light and receiver (SII Eq. 3 in Eq. 2), Phong lobes clamped to the surface.

The lobe of light p is I(w) = Phi c(P) <r . w>^P where n . w > 0, with c(P) by `lobe_norm`. The power is taken as
2^(P log2(1 - h)), h = |r - w|^2 / 2 = 1 - r . w: near the axis of a lobe of exponent 10^6 h keeps its digits and r . w
does not. Symbols as in `pair_sum`; w unit vector from light to receiver, th angle between lobe axis and normal, a the
distance from which on the exponent is whole (0: not widened), P' that after widening, s = (1 - h)^P' c(P') / c(P).
"""

import math
from typing import Any

import numpy as np

from refgi.elementary import exp2, log2p1
from refgi.jit import kernel, prange
from refgi.pairs.lobe_culling import (
    LIMIT,
    MEASURES,
    PARTS,
    bound_lobes,
    bound_part,
    bound_parts,
    bound_range,
    lobes_in_reach,
    parts_in_reach,
)
from refgi.pairs.pair_sum import (
    GROUP,
    LEAST_SQUARE,
    NX,
    ROWS,
    SUM,
    TILE,
    TOTAL,
    Clamp,
    X,
    close_lanes,
    load_light,
    load_tile,
    pair_cosines,
)
from refgi.pairs.pixel_lights import (
    CORRECTED,
    Range,
    Widening,
    lobe_norm_factor,
    widened,
)
from refgi.pairs.ranged_sum import LANES, list_chosen
from refgi.pairs.tiles import list_all
from refgi.types import Array

H, TERM, SQUARE, EXPONENT, RATIO = range(ROWS, ROWS + 5)  # further rows of a tile, of one light
AT_ONCE = 4 * GROUP  # lights that are taken from a list at once


@kernel(parallel=True)
def add_lobes(
    position: Array, normal: Array, lights: Array, clamp: Clamp, widening: Widening | None, reach: Range | None,
    listed: Array | None, irradiance: Array,
) -> None:
    """Add E = sum over glossy lights of I(w) c_x / r^2 to the irradiance of every receiver (SII Eq. 2 and 3).

    Position (m) and normal are (3, n), world space, `irradiance` (3, n), W/m^2. `lights` (13, N): position, reversed
    normal, reversed lobe axis, exponent, flux times norm. The clamp's bound applies to c_x / r^2; `widening` says how
    exponents fall near the light, None keeps them; `reach` which pairs count, and how much (procedure P3), None: all.
    `listed` (ceil(n / LANES), N) bool: lights that may count for each tile (the others must not count for any of its
    receivers); None: all may, and tiles are of TILE.
    In float32, with U = 2^-24, a term t = flux s c_x / r^2 is off by at most U (t (17 + 5 L + 6.5 P (sqrt(2 h) + h) /
    (1 - h)) + 4 flux s / r^2), where L = -P log2(1 - h): roundings of w reach h, those of the cosine c_x are absolute.
    Less than 2^-126 of the peak is 0. Within 8 U of the light's plane or 1e-3 of h = 1, where lobes of P < 1 end
    steeply, rounding may decide on which side a pair lies. A sum is off by at most 66 U of E more. Distances below
    1e-15 m count as that; above them powers of 2 in flux and length scale E to the bit.
    """
    count = position.shape[1]
    bounds = bound_lobes(lights[9], whole_from(widening))
    if reach is not None and not reach.outside:
        bound_range(bounds, reach.square, reach.scale)
    width = TILE if listed is None else LANES
    for block in prange((count + width - 1) // width):
        first = block * width
        size = min(width, count - first)
        tile = np.zeros((ROWS + 5, width), position.dtype)
        load_tile(tile, position, normal, first, size)
        if listed is None:
            _add_lights(tile, size, lights, bounds, clamp, widening, reach)
        else:
            _add_listed(tile, size, lights, bounds, clamp, widening, reach, listed, block)
        for c in range(3):
            for i in range(size):
                irradiance[c, first + i] += tile[TOTAL + c, i]


@kernel
def whole_from(widening: Widening | None) -> float:
    """Return the distance from which on exponents are sure to be whole, m."""
    if widening is None:
        return -1.0
    return 1.001 * widening.distance if widening.slope == CORRECTED else np.inf


@kernel
def _add_lights(
    tile: Array, size: int, lights: Array, bounds: Array, clamp: Clamp, widening: Widening | None, reach: Range | None,
) -> None:
    """Add all lights to the totals of a tile, group by group and in their order."""
    spheres = np.empty((4, PARTS + 1), tile.dtype)
    by_parts = bound_parts(tile, size, spheres)
    scratch, chosen = np.empty((MEASURES, GROUP), tile.dtype), np.empty(GROUP, np.int64)
    for group in range(0, lights.shape[1], GROUP):
        found = list_all(group, min(group + GROUP, lights.shape[1]), chosen)
        found = lobes_in_reach(lights, bounds, spheres, found, scratch, chosen)
        low, high = PARTS, 0
        for i in range(found):
            k, first, last = chosen[i], 0, PARTS
            if by_parts:
                first, last = parts_in_reach(lights, bounds, k, spheres, scratch)
            if first < last:
                low, high = min(low, first), max(high, last)
                lanes = np.uint64(first * (TILE // PARTS)), np.uint64(last * (TILE // PARTS))
                add_lobe(tile, lanes, lights, k, bounds[LIMIT, k], clamp, widening, reach)
        if low < high:
            close_lanes(tile, np.uint64(low * (TILE // PARTS)), np.uint64(high * (TILE // PARTS)))


@kernel
def _add_listed(
    tile: Array, size: int, lights: Array, bounds: Array, clamp: Clamp, widening: Widening | None, reach: Range | None,
    listed: Array, block: int,
) -> None:
    """Add the lights that list `block` holds to the totals of a tile of LANES, group by group and in their order."""
    lanes = np.uint64(0), np.uint64(LANES)
    spheres = np.empty((4, PARTS + 1), tile.dtype)
    scratch, chosen = np.empty((MEASURES, AT_ONCE), tile.dtype), np.empty(AT_ONCE, np.int64)
    bound_part(tile, 0, size, spheres, PARTS)
    for start in range(0, lights.shape[1], AT_ONCE):
        found = list_chosen(listed, block, start, min(start + AT_ONCE, lights.shape[1]), chosen)
        if found > 0:
            found = lobes_in_reach(lights, bounds, spheres, found, scratch, chosen)
        group = -1
        for i in range(found):
            k = chosen[i]
            if k // GROUP != group and group >= 0:
                close_lanes(tile, lanes[0], lanes[1])
            group = k // GROUP
            add_lobe(tile, lanes, lights, k, scratch[LIMIT, i], clamp, widening, reach)
        if group >= 0:
            close_lanes(tile, lanes[0], lanes[1])


@kernel
def add_lobe(
    tile: Array, lanes: Any, lights: Array, k: int, limit: Any, clamp: Clamp, widening: Widening | None,
    reach: Range | None,
) -> None:
    """Add flux s c_x / r^2 of light k to the group's sum over lanes[0] to lanes[1] - 1 (Eq. 3).

    The norm is part of the flux. From h = `limit` on the lobe counts as 0, unless it is widened.
    """
    if lobe_terms(tile, lanes, lights, k, limit, clamp, widening, reach):
        # Eq. (2)
        _sum_up(tile, lanes, lights[10, k], lights[11, k], lights[12, k])


@kernel
def lobe_terms(
    tile: Array, lanes: Any, lights: Array, k: int, limit: Any, clamp: Clamp, widening: Widening | None,
    reach: Range | None,
) -> bool:
    """Fill row TERM with s c_x / r^2 of light k (Eq. 3); return whether any is not 0: if not, it is not finished."""
    if widening is not None:
        limit = type(limit)(1.0)
    if not _fill_terms(tile, lanes, load_light(lights, k), limit, clamp.least, clamp.softness[k], clamp.bound):
        return False
    _fill_logarithm(tile, lanes)
    # Eq. (3)
    if widening is None:
        _raise_to_power(tile, lanes, lights[9, k])
    else:
        _widen(tile, lanes, lights[9, k], widening, k)
        _raise_to_powers(tile, lanes)
    if reach is None:
        _weight(tile, lanes)
    else:
        _weight_in_range(tile, lanes, reach.square[k], reach.scale[k], reach.outside)
    return True


@kernel
def _fill_terms(tile: Array, lanes: Any, light: Any, limit: Any, least: Any, softness: Any, bound: Any) -> bool:
    """Fill rows H with 1 - r . w, TERM with c_x / r^2 where the lobe reaches (both 0 elsewhere) and SQUARE with r^2.

    Return whether any TERM is not 0.
    """
    real = tile.dtype.type
    zero, half, one = real(0.0), real(0.5), real(1.0)
    x, y, z, lx, ly, lz, ax, ay, az = light
    for i in range(lanes[0], lanes[1]):
        dx, dy, dz = x - tile[X, i], y - tile[X + 1, i], z - tile[X + 2, i]
        square, cl, cx = pair_cosines(dx, dy, dz, lx, ly, lz, tile[NX, i], tile[NX + 1, i], tile[NX + 2, i])
        square = square if square > real(LEAST_SQUARE) else real(LEAST_SQUARE)
        inverse = one / math.sqrt(square)
        cx = cx * inverse
        ox, oy, oz = ax - dx * inverse, ay - dy * inverse, az - dz * inverse
        h = half * (ox * ox + oy * oy + oz * oz)
        softened = (square if square > least else least) + softness
        term = (cx if cx > zero else zero) / softened
        term = term if term < bound else bound
        away = h if cl > zero else one
        tile[H, i] = away if away < limit else zero
        tile[TERM, i] = term if away < limit else zero
        tile[SQUARE, i] = square
    reached = np.int32(0)
    for i in range(lanes[0], lanes[1]):  # apart: with the terms it would cost half as much as they do
        reached |= np.int32(tile[TERM, i] > zero)
    return bool(reached)


@kernel
def _fill_logarithm(tile: Array, lanes: Any) -> None:
    for i in range(lanes[0], lanes[1]):
        tile[H, i] = log2p1(-tile[H, i])


@kernel
def _raise_to_power(tile: Array, lanes: Any, exponent: Any) -> None:
    for i in range(lanes[0], lanes[1]):
        tile[H, i] = exp2(exponent * tile[H, i])


@kernel
def _raise_to_powers(tile: Array, lanes: Any) -> None:
    for i in range(lanes[0], lanes[1]):
        tile[H, i] = exp2(tile[EXPONENT, i] * tile[H, i]) * tile[RATIO, i]


@kernel
def _widen(tile: Array, lanes: Any, exponent: Any, widening: Widening, k: int) -> None:
    """Fill rows EXPONENT and RATIO for the receivers that are reached."""
    real = tile.dtype.type
    whole = lobe_norm_factor(widening.cos_theta[k], exponent, widening.norm)
    for i in range(lanes[0], lanes[1]):
        reached = tile[TERM, i] > real(0.0)
        tile[EXPONENT, i], tile[RATIO, i] = widened(tile[SQUARE, i], exponent, whole, widening, k, reached)


@kernel
def _weight(tile: Array, lanes: Any) -> None:
    for i in range(lanes[0], lanes[1]):
        tile[TERM, i] *= tile[H, i]


@kernel
def _weight_in_range(tile: Array, lanes: Any, square_range: Any, scale: Any, outside: bool) -> None:
    """Multiply TERM by s and max(1, I_low / B) where B >= xi I_low, by 0 elsewhere; or by 1 less that factor."""
    real = tile.dtype.type
    zero, one = real(0.0), real(1.0)
    for i in range(lanes[0], lanes[1]):
        square = tile[SQUARE, i]
        b = square_range * tile[H, i]  # (B / I_low) r^2
        factor = one if b >= square else square / b
        factor = factor if b >= scale * square else zero
        tile[TERM, i] *= tile[H, i] * (one - factor if outside else factor)


@kernel
def _sum_up(tile: Array, lanes: Any, red: Any, green: Any, blue: Any) -> None:
    for i in range(lanes[0], lanes[1]):
        tile[SUM, i] += tile[TERM, i] * red
        tile[SUM + 1, i] += tile[TERM, i] * green
        tile[SUM + 2, i] += tile[TERM, i] * blue
