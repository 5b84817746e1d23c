"""Read a mip map for the receivers of a tile: 8 channels of a texel at once, then 8 receivers.

A disc is read at level log2 of its diameter in texels, at least 0, between the two levels around it and the 2 x 2
nearest texels of each: 8 texels with 8 weights. Where the position, levels and weights are worked out, receivers are
the SIMD lanes; where texels are summed up, the channels are; sums of 8 receivers and 8 channels are transposed in
registers.
"""

from typing import Any

import numpy as np
import numpy.typing as npt
from numba import types

from refgi.cluster.filters.basis import sine_cosine, turned
from refgi.cluster.filters.eight import EIGHT, add, load, room_of, scale, store, transpose
from refgi.cluster.filters.mip import Mip
from refgi.cluster.filters.quantise import eight_bits, half_precision
from refgi.elementary import log2
from refgi.jit import kernel

Array = npt.NDArray[Any]

CHUNK = 64  # receivers whose texels and weights are kept at once
TEXEL, SIDE, COARSE, COARSE_SIDE, LEVEL = range(5)  # rows of whole numbers
WEIGHT = 0  # first of 8 rows of weights: 4 of the finer level, 4 of the coarser
WHOLE = room_of(5, CHUNK, types.int32)
WEIGHTS = room_of(8, CHUNK)
SUMS = room_of(EIGHT, CHUNK)


@kernel
def mip_means(
    mip: Mip, s: Array, t: Array, radius: Array, wanted: Array, count: int, with_z: bool, out: Array
) -> None:
    """Read the means of the channels over a disc for each lane of a tile.

    Parameters
    ----------
    mip : Mip
        One map's pyramid.
    s, t, radius : (lanes,) ndarray
        Centre and radius of the discs, in units of the map's half side; beyond the map its edge is read.
    wanted : (lanes,) ndarray
        Lanes to read.
    count : int
        Lanes in use.
    with_z : bool
        All 4 M + 1 channels instead of the first 2 M.
    out : (channels, lanes) ndarray
        Filled where wanted; other lanes may be overwritten.
    """
    whole, weights, sums = WHOLE(s), WEIGHTS(s), SUMS(s)
    channels = 2 * mip.terms
    for start in range(0, count, CHUNK):
        lanes = min(CHUNK, count - start)
        some, direct = _place(mip, s, t, radius, wanted, start, lanes, whole, weights)
        if not some:
            continue
        for first in range(0, channels, EIGHT):
            here = min(EIGHT, channels - first)
            _sum_up(mip.basis, first, lanes, whole, weights, sums)
            _take(sums, here, lanes, out, first, start)
            if with_z:
                _sum_up(mip.basis_z, first, lanes, whole, weights, sums)
                _take(sums, here, lanes, out, channels + first, start)
        if with_z:
            _sum_depths(mip.mean_depth, lanes, whole, weights, out, 2 * channels, start)
        if direct:
            _add_map(mip, lanes, with_z, whole, weights, out, start)


@kernel
def _place(
    mip: Mip, s: Array, t: Array, radius: Array, wanted: Array, start: int, lanes: int, whole: Array, weights: Array
) -> tuple[bool, bool]:
    """Find texels and weights of each lane; return whether any is wanted, and whether any reads the map itself.

    Lanes that do not matter read the first texel.
    """
    real = s.dtype.type
    n, top = np.int32(len(mip.depth)), np.int32(len(mip.first) - 1)
    size, one, half, none = real(n), real(1.0), real(0.5), real(0.0)
    for lane in range(lanes):
        i = start + lane
        used = wanted[i] != 0
        level = log2(max(radius[i] * size, one)) + real(mip.shift)
        level = min(max(level if used else real(top), none), real(top))
        fine = np.int32(level)
        share = level - real(fine)
        coarse = min(fine + np.int32(1), top)
        x, y = (s[i] + one) * half * size, (t[i] + one) * half * size
        x, y = (x if used else none), (y if used else none)
        weights[0, lane], weights[4, lane] = one - share, share
        for which in range(2):
            l = coarse if which else fine
            side = (n + (np.int32(1) << l) - np.int32(1)) >> l
            shrink, last = one / real(np.int32(1) << l), real(side - np.int32(1))
            u, v = min(max(x * shrink - half, none), last), min(max(y * shrink - half, none), last)
            column, row = np.int32(u), np.int32(v)
            fx, fy = u - real(column), v - real(row)
            above, below = weights[4 * which, lane] * (one - fy), weights[4 * which, lane] * fy
            weights[4 * which, lane], weights[4 * which + 1, lane] = above * (one - fx), above * fx
            weights[4 * which + 2, lane], weights[4 * which + 3, lane] = below * (one - fx), below * fx
            whole[2 * which, lane], whole[2 * which + 1, lane] = row * side + column, side
        whole[LEVEL, lane] = fine
    some, direct = False, False
    for lane in range(lanes):
        some |= wanted[start + lane] != 0
        direct |= whole[LEVEL, lane] == 0
    return some, direct
