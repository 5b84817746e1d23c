"""Build the mip maps of one map or of several: level 1 from the depths, then each level from the one before.

Texels are the SIMD lanes of level 1, channels those of the levels above.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.cluster.filters.basis import (
    eight_bits,
    fill_basis,
    fill_beyond,
    half_precision,
    normalise,
    sine_cosine,
    turned,
)
from refgi.cluster.filters.depth_scale import DepthScale
from refgi.cluster.filters.eight import EIGHT, add, load, scale, stack_array, store
from refgi.cluster.filters.pyramid import Mip, mip_of
from refgi.jit import kernel, prange

Array = npt.NDArray[Any]

CHUNK = 64  # texels of level 1 made at once
DEPTHS, SINES, COSINES = (stack_array(4, CHUNK) for _ in range(3))
BY_SINES, BY_COSINES = (stack_array(4, CHUNK) for _ in range(2))
MEANS = stack_array(4, CHUNK)


@kernel(parallel=True)
def build_mips(depth: Array, scales: DepthScale, several: Mip) -> None:
    """Fill the pyramids of several maps of radial distances (K, n, n), m; inf where they are empty.

    `scales.origin` and `scales.slope` are (K,) arrays; `several` has a leading axis of K at least.
    """
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
    if mip.quantised:
        _fill_rounded(mip)
    else:
        _fill_first(mip.depth, mip.terms, mip.basis, mip.basis_z, mip.mean_depth)
    side = (len(depth) + 1) // 2
    for level in range(1, len(mip.first)):
        if level > 1:
            halve(mip.basis, mip.basis_z, mip.mean_depth, mip.first[level - 1], mip.first[level], side)
            side = (side + 1) // 2
        if mip.quantised:
            _round(mip, mip.first[level], side * side)


@kernel
def _fill_first(depth: Array, terms: int, basis: Array, basis_z: Array, mean_depth: Array) -> None:
    """Fill level 1 with the means of 2 x 2 texels of the map, whose basis is kept no longer than that takes."""
    side = (len(depth) + 1) // 2
    depths, means = DEPTHS(depth), MEANS(depth)
    sines, cosines, by_sines, by_cosines = SINES(depth), COSINES(depth), BY_SINES(depth), BY_COSINES(depth)
    quarter = depth.dtype.type(0.25)
    for i in range(side):
        for start in range(0, side, CHUNK):
            lanes, texel = min(CHUNK, side - start), i * side + start
            _quarters(depth, i, start, lanes, depths)
            for four in range(4):
                for lane in range(lanes):
                    sine, cosine = sine_cosine(depths[four, lane])
                    sines[four, lane], cosines[four, lane] = sine, cosine
                    by_sines[four, lane], by_cosines[four, lane] = turned(sine, cosine, sine, cosine)
            for lane in range(lanes):
                mean_depth[texel + lane] = quarter * (
                    (depths[0, lane] + depths[1, lane]) + (depths[2, lane] + depths[3, lane]))
            for k in range(terms):
                _means(depths, sines, cosines, lanes, means)
                for lane in range(lanes):
                    basis[texel + lane, k], basis[texel + lane, terms + k] = means[0, lane], means[1, lane]
                    basis_z[texel + lane, k], basis_z[texel + lane, terms + k] = means[2, lane], means[3, lane]
                for four in range(4):
                    for lane in range(lanes):
                        sines[four, lane], cosines[four, lane] = turned(
                            sines[four, lane], cosines[four, lane], by_sines[four, lane], by_cosines[four, lane])


@kernel
def _quarters(depth: Array, i: int, start: int, lanes: int, depths: Array) -> None:
    """Part 2 x 2 texels each: those above left, above right, below left and below right."""
    last = len(depth) - 1
    for four in range(4):
        row, right = min(2 * i + four // 2, last), four % 2
        inside = min(lanes, (last + 1 - right - 2 * start + 1) // 2)
        for lane in range(inside):
            depths[four, lane] = depth[row, 2 * start + 2 * lane + right]
        if inside < lanes:  # an odd side: the last column counts twice
            depths[four, inside] = depth[row, last]


@kernel
def _means(depths: Array, sines: Array, cosines: Array, lanes: int, means: Array) -> None:
    quarter = depths.dtype.type(0.25)
    for lane in range(lanes):
        a, b, c, d = sines[0, lane], sines[1, lane], sines[2, lane], sines[3, lane]
        e, f, g, h = cosines[0, lane], cosines[1, lane], cosines[2, lane], cosines[3, lane]
        p, q, r, s = depths[0, lane], depths[1, lane], depths[2, lane], depths[3, lane]
        means[0, lane] = quarter * ((a + b) + (c + d))
        means[1, lane] = quarter * ((e + f) + (g + h))
        means[2, lane] = quarter * ((p * a + q * b) + (r * c + s * d))
        means[3, lane] = quarter * ((p * e + q * f) + (r * g + s * h))


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
def _fill_rounded(mip: Mip) -> None:
    """Fill level 1 with the means of texels of 8 and 16 bits, not yet rounded themselves."""
    n, channels = len(mip.depth), 2 * mip.terms
    basis, basis_z = np.empty((2, n, channels), mip.depth.dtype), np.empty((2, n, channels + 1), mip.depth.dtype)
    side, quarter = (n + 1) // 2, mip.depth.dtype.type(0.25)
    for i in range(side):
        fill_basis(mip.depth[2 * i : 2 * i + 2], mip.terms, True, basis, basis_z)
        below = min(2 * i + 1, n - 1) - 2 * i
        for j in range(side):
            texel, left, right = i * side + j, 2 * j, min(2 * j + 1, n - 1)
            for c in range(channels):
                mip.basis[texel, c] = quarter * (
                    (basis[0, left, c] + basis[0, right, c]) + (basis[below, left, c] + basis[below, right, c]))
                mip.basis_z[texel, c] = quarter * (
                    (basis_z[0, left, c] + basis_z[0, right, c]) + (basis_z[below, left, c] + basis_z[below, right, c]))
            c = channels
            mip.mean_depth[texel] = quarter * (
                (basis_z[0, left, c] + basis_z[0, right, c]) + (basis_z[below, left, c] + basis_z[below, right, c]))


@kernel
def _round(mip: Mip, first: int, count: int) -> None:
    for texel in range(first, first + count):
        for c in range(2 * mip.terms):
            mip.basis[texel, c] = eight_bits(mip.basis[texel, c])
            mip.basis_z[texel, c] = half_precision(mip.basis_z[texel, c])
        mip.mean_depth[texel] = half_precision(mip.mean_depth[texel])
