"""The sum over the pairs of diffuse light and receiver that the threshold I_low keeps (SII Sec. 3.4, procedure P3).

A pair counts where B = I_0 cos / r^2 >= xi I_low, cos being the light's. With R_0^2 = I_0 / I_low and c_l = r cos that
is s >= xi r for s = R_0^2 c_l / r^2: no root. The test is part of the pair's arithmetic, so the picture does not depend
on which bound found the pairs. Tiles are of 8 x 8 pixels, each with lights of its own; groups are those of `pair_sum`.
"""

from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.pair_sum import (
    GROUP,
    LEAST_SQUARE,
    NX,
    ROWS,
    SUM,
    TOTAL,
    Clamp,
    X,
    close_group,
    limits_of,
    load_light,
    load_tile,
    pair_cosines,
    pair_term,
)
from refgi.pairs.pixel_lights import Range
from refgi.types import Array

LANES = 64  # receivers a list of lights belongs to
AT_ONCE = 16 * GROUP  # lights that are taken from a list at once


@kernel
def _peak_ratio(dx: Any, dy: Any, dz: Any, lx: Any, ly: Any, lz: Any, square_range: Any) -> Any:
    """Return r^2 (m^2) and s = R_0^2 c_l / r^2 (m), for which B / I_low = s / r; 0 behind the light."""
    real = type(dx)
    zero = real(0.0)
    square, cl, _ = pair_cosines(dx, dy, dz, lx, ly, lz, zero, zero, zero)
    square = square if square > real(LEAST_SQUARE) else real(LEAST_SQUARE)
    return square, square_range * ((cl if cl > zero else zero) * (real(1.0) / square))


@kernel
def reached(dx: Any, dy: Any, dz: Any, lx: Any, ly: Any, lz: Any, square_range: Any) -> Any:
    """Return whether B >= xi I_low for one pair, with `square_range` I_0 / (xi I_low), m^2; never behind the light."""
    square, s = _peak_ratio(dx, dy, dz, lx, ly, lz, square_range)
    return s * s >= square


@kernel
def range_factor(
    dx: Any, dy: Any, dz: Any, lx: Any, ly: Any, lz: Any, square_range: Any, scale: Any, outside: bool
) -> Any:
    """Return what a pair's term is multiplied by: max(1, I_low / B) where B >= xi I_low, else 0.

    `square_range` is I_0 / I_low (m^2) and `scale` xi; exactly 0 or 1 for xi = 1. With `outside`, 1 less that factor.
    """
    real = type(dx)
    zero, one = real(0.0), real(1.0)
    square, s = _peak_ratio(dx, dy, dz, lx, ly, lz, square_range)
    factor = one if s * s >= square else np.sqrt(square) / s
    factor = factor if reached(dx, dy, dz, lx, ly, lz, square_range / scale) else zero
    return one - factor if outside else factor


@kernel
def weigh_by_range(tile: Array, row: int, light: Any, square_range: Any, scale: Any, outside: bool) -> None:
    """Multiply a row of terms by what the range of a packed light makes of each pair."""
    px, py, pz, lx, ly, lz = light[0], light[1], light[2], light[3], light[4], light[5]
    for i in range(tile.shape[1]):
        dx, dy, dz = px - tile[X, i], py - tile[X + 1, i], pz - tile[X + 2, i]
        tile[row, i] *= range_factor(dx, dy, dz, lx, ly, lz, square_range, scale, outside)


@kernel(parallel=True)
def sum_pairs_in_range(
    position: Array, normal: Array, lights: Array, clamp: Clamp | None, reach: Range, listed: Array, irradiance: Array
) -> None:
    """Add up E = sum over lights of (Phi / pi) g over the pairs with B >= I_low, for every receiver.

    As `pair_sum.sum_pairs`; xi counts as 1. `listed` (ceil(n / LANES), N) bool: lights that may count for each tile;
    the others must not count for any of its receivers.
    """
    count = position.shape[1]
    for block in prange((count + LANES - 1) // LANES):
        first = block * LANES
        size = min(LANES, count - first)
        tile = np.zeros((ROWS, LANES), position.dtype)
        load_tile(tile, position, normal, first, size)
        chosen = np.empty(AT_ONCE, np.int64)
        black = lights.shape[1] - 1
        for start in range(0, black, AT_ONCE):
            found = list_chosen(listed, block, start, min(start + AT_ONCE, black), chosen)
            j = 0
            while j < found:
                a, b = chosen[j], black
                if j + 1 < found and chosen[j + 1] // GROUP == a // GROUP:
                    b = chosen[j + 1]
                j += 1 if b == black else 2
                one, two = load_light(lights, a), load_light(lights, b)
                square_a, square_b = reach.square[a], reach.square[b]
                limits_a, limits_b = limits_of(clamp, a), limits_of(clamp, b)
                for i in range(LANES):
                    receiver = tile[X, i], tile[X + 1, i], tile[X + 2, i], tile[NX, i], tile[NX + 1, i], tile[NX + 2, i]
                    g1 = _term_in_range(one, receiver, limits_a, square_a)
                    g2 = _term_in_range(two, receiver, limits_b, square_b)
                    # Eq. (2); written out: a loop over the channels would cost the compiler its even split into lanes
                    tile[SUM, i] = tile[SUM, i] + g1 * one[6] + g2 * two[6]
                    tile[SUM + 1, i] = tile[SUM + 1, i] + g1 * one[7] + g2 * two[7]
                    tile[SUM + 2, i] = tile[SUM + 2, i] + g1 * one[8] + g2 * two[8]
                if j == found or chosen[j] // GROUP != a // GROUP:
                    close_group(tile)
        for c in range(3):
            for i in range(size):
                irradiance[c, first + i] = tile[TOTAL + c, i]


@kernel(parallel=True)
def sum_weighted_pairs(
    position: Array, normal: Array, lights: Array, clamp: Clamp | None, reach: Range, listed: Array, irradiance: Array
) -> None:
    """Fill irradiance with E = sum over lights of (Phi / pi) g times the factor of `range_factor`, W/m^2.

    Arguments as for `sum_pairs_in_range`; outside the range every light must be listed.
    """
    count = position.shape[1]
    for block in prange((count + LANES - 1) // LANES):
        first = block * LANES
        size = min(LANES, count - first)
        tile = np.zeros((ROWS, LANES), position.dtype)
        load_tile(tile, position, normal, first, size)
        for group in range(0, lights.shape[1] - 1, GROUP):
            for k in range(group, min(group + GROUP, lights.shape[1] - 1)):
                if listed[block, k]:
                    one, square, xi = load_light(lights, k), reach.square[k], reach.scale[k]
                    limits = limits_of(clamp, k)
                    for i in range(LANES):
                        x, y, z, nx, ny, nz = (tile[X, i], tile[X + 1, i], tile[X + 2, i], tile[NX, i],
                                               tile[NX + 1, i], tile[NX + 2, i])
                        g = _weighted_term(one, (x, y, z, nx, ny, nz), limits, square, xi, reach.outside)
                        tile[SUM, i] = tile[SUM, i] + g * one[6]
                        tile[SUM + 1, i] = tile[SUM + 1, i] + g * one[7]
                        tile[SUM + 2, i] = tile[SUM + 2, i] + g * one[8]
            close_group(tile)
        for c in range(3):
            for i in range(size):
                irradiance[c, first + i] = tile[TOTAL + c, i]


@kernel
def list_chosen(listed: Array, block: int, first: int, last: int, chosen: Array) -> int:
    """List those of the lights first to last - 1 that tile `block` has in its list, rising; return how many."""
    row, stop, step = np.uint64(block), np.uint64(last), np.uint64(GROUP)  # unsigned, as in `load_tile`
    count = np.uint64(0)
    for group in range(np.uint64(first), stop, step):
        end = min(group + step, stop)
        some = False
        for k in range(group, end):  # in lanes; most groups hold none
            some |= listed[row, k]
        if some:
            for k in range(group, end):
                chosen[count] = k
                count += np.uint64(listed[row, k])
    return int(count)


@kernel
def _term_in_range(light: Any, receiver: Any, limits: Any, square_range: Any) -> Any:
    dx, dy, dz = light[0] - receiver[0], light[1] - receiver[1], light[2] - receiver[2]
    term = pair_term(light, receiver, limits)
    return term if reached(dx, dy, dz, light[3], light[4], light[5], square_range) else type(dx)(0.0)


@kernel
def _weighted_term(light: Any, receiver: Any, limits: Any, square_range: Any, scale: Any, outside: bool) -> Any:
    dx, dy, dz = light[0] - receiver[0], light[1] - receiver[1], light[2] - receiver[2]
    term = pair_term(light, receiver, limits)
    return term * range_factor(dx, dy, dz, light[3], light[4], light[5], square_range, scale, outside)
