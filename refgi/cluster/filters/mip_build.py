"""Build mip maps: level 1 from the depths, with texels as the SIMD lanes, then each level from the one before.

Where a map is empty around 8 texels, as it is nearly everywhere on many, they are all alike and copied.
"""

from typing import Any

import numpy as np
from numba import types

from refgi.cluster.filters.basis import (
    DepthScale,
    eight_bits,
    fill_beyond,
    half_precision,
    normalise,
    sine_cosine,
    turned,
)
from refgi.cluster.filters.pyramid import EIGHT, Mip, add, load, mip_of, scale, stack_array, store, transpose
from refgi.jit import kernel, prange
from refgi.types import Array

GROUPS = 8  # of 8 texels of level 1, made at once
LANES = GROUPS * EIGHT
DEPTHS, SINES, COSINES = (stack_array(4, LANES) for _ in range(3))
BY_SINES, BY_COSINES = (stack_array(4, LANES) for _ in range(2))
STARTS = stack_array(1, GROUPS, types.int64)


@kernel(parallel=True)
def build_mips(depth: Array, scales: DepthScale, several: Mip) -> None:
    """Fill the pyramids, K at least, of several maps of distances (K, n, n), m; inf where they are empty."""
    for k in prange(len(depth)):
        scale = DepthScale(scales.logarithmic, scales.origin[k], scales.slope[k], scales.most)
        build_mip(depth[k], scale, mip_of(several, np.int64(k)))


@kernel
def build_mip(depth: Array, scale: DepthScale, mip: Mip) -> None:
    """Fill one pyramid from a map of radial distances (n, n), m; inf where it is empty."""
    normalise(depth, scale, mip.depth)
    fill_beyond(mip.beyond, mip.depth)
    if len(depth) == 1:
        return
    _fill_first(mip, depth.dtype.type(scale.most))
    side = (len(depth) + 1) // 2
    for level in range(1, len(mip.first)):
        if level > 1:
            halve(mip.basis, mip.basis_z, mip.mean_depth, mip.first[level - 1], mip.first[level], side)
            side = (side + 1) // 2
        if mip.quantised:
            round_texels(mip, mip.first[level], side * side)


@kernel
def _fill_first(mip: Mip, most: Any) -> None:
    """Fill level 1 with the means of 2 x 2 texels; `most` is the depth of nothing, its own mean to the bit."""
    side, width = (len(mip.depth) + 1) // 2, mip.basis.shape[1]
    depths, starts = DEPTHS(mip.depth), STARTS(mip.depth)
    # rows of S, C, t S, t C and t; padding stays 0
    means, empty = np.zeros((2 * width + 1, LANES), mip.depth.dtype), np.empty(2 * width + 1, mip.depth.dtype)
    for four in range(4):
        for lane in range(LANES):
            depths[four, lane] = most
    _fill_means(mip, depths, means)
    for row in range(2 * width + 1):
        empty[row] = means[row, 0]
    groups = 0
    for i in range(side):
        for j in range(0, side, EIGHT):
            if _is_empty(mip.depth, i, j, most):
                _copy_empty(mip, i * side + j, min(EIGHT, side - j), empty)
                continue
            _load_group(mip.depth, i, j, depths, groups * EIGHT)
            starts[0, groups] = i * side + j
            groups += 1
            if groups == GROUPS:
                _fill_means(mip, depths, means)
                _store_groups(mip, side, starts, groups, means)
                groups = 0
    _fill_means(mip, depths, means)
    _store_groups(mip, side, starts, groups, means)


@kernel
def _is_empty(depth: Array, i: int, j: int, most: Any) -> bool:
    """Return whether the map holds nothing below 8 texels of level 1."""
    last, empty = len(depth) - 1, True
    above, below = np.uint64(2 * i), np.uint64(min(2 * i + 1, last))
    for column in range(np.uint64(2 * j), np.uint64(min(2 * j + 2 * EIGHT, last + 1))):
        empty &= (depth[above, column] == most) & (depth[below, column] == most)
    return empty


@kernel
def _copy_empty(mip: Mip, first: int, count: int, empty: Array) -> None:
    width = mip.basis.shape[1]
    for texel in range(first, first + count):
        for c in range(0, width, EIGHT):
            store(mip.basis, texel * width + c, load(empty, c))
            store(mip.basis_z, texel * width + c, load(empty, width + c))
        mip.mean_depth[texel] = empty[2 * width]


@kernel
def _load_group(depth: Array, i: int, j: int, depths: Array, lane: int) -> None:
    """Part the 2 x 2 texels of 8 texels of level 1: above left, above right, below left, below right."""
    last = len(depth) - 1
    for four in range(4):
        row, right = np.uint64(min(2 * i + four // 2, last)), 2 * j + four % 2
        for e in range(EIGHT):  # of an odd side, the last row and column count twice
            depths[four, lane + e] = depth[row, np.uint64(min(right + 2 * e, last))]


@kernel
def _fill_means(mip: Mip, depths: Array, means: Array) -> None:
    """Fill the rows of `means` (2 width + 1, LANES) from four depths of each texel; of 8 and 16 bits where asked."""
    sines, cosines, by_sines, by_cosines = SINES(depths), COSINES(depths), BY_SINES(depths), BY_COSINES(depths)
    width, terms, quarter = mip.basis.shape[1], mip.terms, depths.dtype.type(0.25)
    for four in range(4):
        for lane in range(LANES):
            sine, cosine = sine_cosine(depths[four, lane])
            sines[four, lane], cosines[four, lane] = sine, cosine
            by_sines[four, lane], by_cosines[four, lane] = turned(sine, cosine, sine, cosine)
    for k in range(terms):
        if mip.quantised:
            _average_rounded(sines, depths, means, k, width + k)
            _average_rounded(cosines, depths, means, terms + k, width + terms + k)
        else:
            _average_exact(sines, depths, means, k, width + k)
            _average_exact(cosines, depths, means, terms + k, width + terms + k)
        for four in range(4):
            for lane in range(LANES):
                sines[four, lane], cosines[four, lane] = turned(
                    sines[four, lane], cosines[four, lane], by_sines[four, lane], by_cosines[four, lane])
    for lane in range(LANES):
        a, b, c, d = depths[0, lane], depths[1, lane], depths[2, lane], depths[3, lane]
        if mip.quantised:
            a, b, c, d = half_precision(a), half_precision(b), half_precision(c), half_precision(d)
        means[2 * width, lane] = quarter * ((a + b) + (c + d))


@kernel
def _average_exact(values: Array, depths: Array, means: Array, row: int, row_z: int) -> None:
    quarter = depths.dtype.type(0.25)
    for lane in range(LANES):
        a, b, c, d = values[0, lane], values[1, lane], values[2, lane], values[3, lane]
        p, q, r, s = depths[0, lane], depths[1, lane], depths[2, lane], depths[3, lane]
        means[row, lane] = quarter * ((a + b) + (c + d))
        means[row_z, lane] = quarter * ((p * a + q * b) + (r * c + s * d))


@kernel
def _average_rounded(values: Array, depths: Array, means: Array, row: int, row_z: int) -> None:
    quarter = depths.dtype.type(0.25)
    for lane in range(LANES):
        a, b, c, d = values[0, lane], values[1, lane], values[2, lane], values[3, lane]
        means[row, lane] = quarter * ((eight_bits(a) + eight_bits(b)) + (eight_bits(c) + eight_bits(d)))
    for lane in range(LANES):
        a, b = half_precision(depths[0, lane] * values[0, lane]), half_precision(depths[1, lane] * values[1, lane])
        c, d = half_precision(depths[2, lane] * values[2, lane]), half_precision(depths[3, lane] * values[3, lane])
        means[row_z, lane] = quarter * ((a + b) + (c + d))


@kernel
def _store_groups(mip: Mip, side: int, starts: Array, groups: int, means: Array) -> None:
    """Store groups of 8 texels, fewer at the end of a row, channel by channel."""
    width = mip.basis.shape[1]
    for group in range(groups):
        texel, lane = starts[0, group], group * EIGHT
        count = min(EIGHT, side - texel % side)
        for first in range(0, width, EIGHT):
            _store_eight(mip.basis, texel * width + first, width, count, means, first * LANES + lane)
            _store_eight(mip.basis_z, texel * width + first, width, count, means, (width + first) * LANES + lane)
        for e in range(count):
            mip.mean_depth[texel + e] = means[2 * width, lane + e]


@kernel
def _store_eight(levels: Array, target: int, width: int, count: int, means: Array, source: int) -> None:
    texels = transpose((
        load(means, source), load(means, source + LANES), load(means, source + 2 * LANES),
        load(means, source + 3 * LANES), load(means, source + 4 * LANES), load(means, source + 5 * LANES),
        load(means, source + 6 * LANES), load(means, source + 7 * LANES),
    ))  # fmt: skip
    for e in range(EIGHT):
        if e < count:
            store(levels, target + e * width, texels[e])


@kernel
def halve(basis: Array, basis_z: Array, mean_depth: Array, source: int, target: int, side: int) -> None:
    """Fill a level from the one before, of `side` texels a side."""
    half, width = (side + 1) // 2, basis.shape[1]
    quarter = basis.dtype.type(0.25)
    for i in range(half):
        above, below = source + 2 * i * side, source + min(2 * i + 1, side - 1) * side
        for j in range(half):
            left, right = 2 * j, min(2 * j + 1, side - 1)
            texel = target + i * half + j
            a, b, c, d = above + left, above + right, below + left, below + right
            for first in range(0, width, EIGHT):
                _store_mean(basis, a * width + first, b * width + first, c * width + first, d * width + first,
                            texel * width + first)
                _store_mean(basis_z, a * width + first, b * width + first, c * width + first, d * width + first,
                            texel * width + first)
            mean_depth[texel] = quarter * ((mean_depth[a] + mean_depth[b]) + (mean_depth[c] + mean_depth[d]))


@kernel
def _store_mean(array: Array, a: int, b: int, c: int, d: int, target: int) -> None:
    total = add(add(load(array, a), load(array, b)), add(load(array, c), load(array, d)))
    store(array, target, scale(total, array.dtype.type(0.25)))


@kernel
def round_texels(mip: Mip, first: int, count: int) -> None:
    """Round texels of a level, from its first on, to 8 bits and half floats."""
    for texel in range(first, first + count):
        for c in range(2 * mip.terms):
            mip.basis[texel, c] = eight_bits(mip.basis[texel, c])
            mip.basis_z[texel, c] = half_precision(mip.basis_z[texel, c])
        mip.mean_depth[texel] = half_precision(mip.mean_depth[texel])
