"""Read a mip map for the receivers of a tile: the filter of the paper (Sec. 6).

A disc is read at level log2 of its diameter in texels, between the two levels around it and the 2 x 2 nearest texels of
each. Receivers are the SIMD lanes for levels, texels and weights, channels for sums, which are transposed in registers.
"""

from typing import Any

import numpy as np
from numba import types

from refgi.cluster.filters.pyramid import (
    CHUNK,
    DIRECT,
    EIGHT,
    LEVEL,
    MAP,
    Mip,
    add,
    add_level_0,
    load,
    scale,
    stack_array,
    store_at,
    transpose,
)
from refgi.elementary import log2p1
from refgi.jit import kernel
from refgi.types import Array

WIDEST = 4.0  # radius from which on a disc holds the whole map
FINE, COARSE, FINE_SIDE, COARSE_SIDE = range(4)  # rows of whole numbers, before LEVEL and DIRECT
# rows of weights: 4 of the finer level, 4 of the coarser, 4 of texels of the map itself; then what they are made of
X, Y, SHARE = MAP + 4, MAP + 5, MAP + 6
WHOLE, WEIGHTS, SUMS = stack_array(6, CHUNK, types.int32), stack_array(15, CHUNK), stack_array(EIGHT, EIGHT)


@kernel
def mip_means(
    mip: Mip, s: Array, t: Array, radius: Array, active: Array, count: int, with_z: bool, out: Array
) -> None:
    """Fill out (channels, lanes) with the means over the disc of each active lane among the first `count`.

    Centres and radii are in units of the map's half side; `with_z` reads all 4 M + 1 channels instead of the first 2 M.
    """
    whole, weights, sums = WHOLE(s), WEIGHTS(s), SUMS(s)
    n, top, channels = len(mip.depth), len(mip.first) - 1, 2 * mip.terms
    for start in range(0, count, CHUNK):
        lanes = min(CHUNK, count - start)
        place = slice(start, start + lanes)
        _find_levels(mip.shift, n, top, s[place], t[place], radius[place], active[place], whole, weights)
        for which in range(2):
            _find_texels(n, top, lanes, which, whole, weights)
        some, direct = _find_starts(mip.first, active[place], whole)
        if not some:
            continue
        if direct:
            _part_map(lanes, whole, weights)
        for first in range(0, channels, EIGHT):
            here = min(EIGHT, channels - first)
            _sum_up(mip.basis, first, here, lanes, whole, weights, sums, out, first, start)
            if with_z:
                _sum_up(mip.basis_z, first, here, lanes, whole, weights, sums, out, channels + first, start)
        if with_z:
            _sum_depths(mip.mean_depth, lanes, whole, weights, out, 2 * channels, start)
        if direct:
            add_level_0(mip, with_z, lanes, whole, weights, out, start)


@kernel
def _find_levels(
    shift: float, size: int, coarsest: int, s: Array, t: Array, radius: Array, active: Array, whole: Array,
    weights: Array,
) -> None:
    """Find each lane's finer level, the coarser one's share, and its place; inactive lanes read the coarsest."""
    real = s.dtype.type
    n, top, none, half, one = real(size), real(coarsest), real(0.0), real(0.5), real(1.0)
    for lane in range(len(s)):  # three loops: one would be too long for the compiler to join into SIMD lanes
        weights[SHARE, lane] = log2p1(max(none, min(real(WIDEST), radius[lane]) * n - one)) + real(shift)
    for lane in range(len(s)):
        level = min(max(none, weights[SHARE, lane]), top)
        level = level if active[lane] else top
        fine = np.int32(level)
        whole[LEVEL, lane], weights[SHARE, lane] = fine, level - real(fine)
    for lane in range(len(s)):
        x, y = (s[lane] + one) * half * n, (t[lane] + one) * half * n
        weights[X, lane], weights[Y, lane] = (x if active[lane] else none), (y if active[lane] else none)


@kernel
def _find_texels(size: int, coarsest: int, lanes: int, which: int, whole: Array, weights: Array) -> None:
    """Find the first of 2 x 2 texels on the finer (`which` 0) or coarser level, and weights that sum to its share."""
    real = weights.dtype.type
    n, top, one = np.int32(size), np.int32(coarsest), np.int32(1)
    none, half, full = real(0.0), real(0.5), real(1.0)
    texel, sides, row_1 = whole[FINE + which], whole[FINE_SIDE + which], 4 * which
    a, b, c, d = weights[row_1], weights[row_1 + 1], weights[row_1 + 2], weights[row_1 + 3]
    for lane in range(lanes):
        level = min(np.int32(whole[LEVEL, lane] + np.int32(which)), top)
        side = np.int32((n + (one << level) - one) >> level)
        shrink, last = full / real(np.int32(one << level)), real(np.int32(side - one))
        u = min(max(none, weights[X, lane] * shrink - half), last)  # 0 for NaN, whose lane reads something
        v = min(max(none, weights[Y, lane] * shrink - half), last)
        column, row = np.int32(u), np.int32(v)
        fx, fy = u - real(column), v - real(row)
        share = weights[SHARE, lane] if which else full - weights[SHARE, lane]
        above, below = share * (full - fy), share * fy
        a[lane], b[lane], c[lane], d[lane] = above * (full - fx), above * fx, below * (full - fx), below * fx
        texel[lane], sides[lane] = np.int32(row * side + column), side


@kernel
def _find_starts(first: Array, active: Array, whole: Array) -> tuple[bool, bool]:
    """Add where levels start; return whether any lane is active, and whether any reads the map itself."""
    some, direct, top = False, False, len(first) - 1
    for lane in range(len(active)):
        level = whole[LEVEL, lane]
        some |= active[lane] != 0
        direct |= level == 0
        whole[DIRECT, lane] = whole[FINE, lane]
        whole[FINE, lane] = whole[FINE, lane] + np.int32(first[level]) if level > 0 else np.int32(0)
        whole[COARSE, lane] += np.int32(first[min(level + 1, top)])
    for lane in range(len(active), -(-len(active) // EIGHT) * EIGHT):  # to a multiple of 8
        for row in range(6):
            whole[row, lane] = 0
    return some, direct


@kernel
def _part_map(lanes: int, whole: Array, weights: Array) -> None:
    """Move the finer weights of lanes that read the map itself."""
    none = weights.dtype.type(0.0)
    for k in range(4):
        for lane in range(lanes):
            weight, mapped = weights[k, lane], whole[LEVEL, lane] == 0
            weights[MAP + k, lane], weights[k, lane] = (weight if mapped else none), (none if mapped else weight)


@kernel
def _sum_up(
    levels: Array, first: int, here: int, lanes: int, whole: Array, weights: Array, sums: Array, out: Array,
    row: int, start: int,
) -> None:
    """Sum channels from `first` on over the 8 texels of each lane: `here` of them, at most 8."""
    full, none = lanes // EIGHT * EIGHT, np.int64(0)  # a bare 0 would compile a variant of its own
    _sum_eights(levels, first, here, none, full, whole, weights, out, row, start)
    if full < lanes:
        _sum_eights(levels, first, here, full, lanes, whole, weights, sums, none, -full)
        for c in range(here):
            for lane in range(full, lanes):
                out[row + c, start + lane] = sums[c, lane - full]


@kernel
def _sum_eights(
    levels: Array, first: int, here: int, begin: Any, end: int, whole: Array, weights: Array, out: Array, row: Any,
    start: int,
) -> None:
    for lane in range(begin, end, EIGHT):
        lines = transpose((
            _eight(levels, first, lane, whole, weights), _eight(levels, first, lane + 1, whole, weights),
            _eight(levels, first, lane + 2, whole, weights), _eight(levels, first, lane + 3, whole, weights),
            _eight(levels, first, lane + 4, whole, weights), _eight(levels, first, lane + 5, whole, weights),
            _eight(levels, first, lane + 6, whole, weights), _eight(levels, first, lane + 7, whole, weights),
        ))  # fmt: skip
        for c in range(EIGHT):
            if c < here:
                store_at(out, row + c, start + lane, lines[c])


@kernel
def _eight(levels: Array, first: int, lane: int, whole: Array, weights: Array) -> Any:
    width = levels.shape[1]
    a = np.int64(whole[FINE, lane]) * width + first
    b = a + np.int64(whole[FINE_SIDE, lane]) * width
    c = np.int64(whole[COARSE, lane]) * width + first
    d = c + np.int64(whole[COARSE_SIDE, lane]) * width
    above = add(scale(load(levels, a), weights[0, lane]), scale(load(levels, a + width), weights[1, lane]))
    below = add(scale(load(levels, b), weights[2, lane]), scale(load(levels, b + width), weights[3, lane]))
    fine = add(above, below)
    above = add(scale(load(levels, c), weights[4, lane]), scale(load(levels, c + width), weights[5, lane]))
    below = add(scale(load(levels, d), weights[6, lane]), scale(load(levels, d + width), weights[7, lane]))
    return add(fine, add(above, below))


@kernel
def _sum_depths(
    levels: Array, lanes: int, whole: Array, weights: Array, out: Array, row: int, start: int
) -> None:
    for lane in range(lanes):
        a, c = np.int64(whole[FINE, lane]), np.int64(whole[COARSE, lane])
        b, d = a + np.int64(whole[FINE_SIDE, lane]), c + np.int64(whole[COARSE_SIDE, lane])
        fine = (levels[a] * weights[0, lane] + levels[a + 1] * weights[1, lane]) + (
            levels[b] * weights[2, lane] + levels[b + 1] * weights[3, lane])
        coarse = (levels[c] * weights[4, lane] + levels[c + 1] * weights[5, lane]) + (
            levels[d] * weights[6, lane] + levels[d + 1] * weights[7, lane])
        out[row, start + lane] = fine + coarse
