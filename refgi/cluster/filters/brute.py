"""Brute-force prefilter: means texel by texel, at a cost that grows with the disc; the reference of the mip map.

The disc takes the texels whose centres it holds, within the unit disc, or the one it lies in. The box is the square
around the disc, at least a texel wide; texels count by the area of them that it holds, those beyond the unit disc
too, and what of it lies beyond the map is cut off. A box with its middle beyond the map is moved to its edge. Sums
are float64 for any map.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import types

from refgi.cluster.filters.basis import beyond_disc, fill_basis, fill_beyond, normalise
from refgi.cluster.filters.depth_scale import DepthScale
from refgi.cluster.filters.eight import stack_array
from refgi.cluster.settings import MOST_TERMS
from refgi.jit import kernel

Array = npt.NDArray[Any]

SUMS = stack_array(1, 4 * MOST_TERMS + 1, types.float64)


class Brute(NamedTuple):
    """Channels of every texel of a map."""

    depth: Array  # (n, n): t
    basis: Array  # (n, n, 2 M)
    basis_z: Array  # (n, n, 2 M + 1)
    box: bool  # the square around the disc instead of the disc
    quantised: bool  # 8 bits for the basis, 16 for basis-z
    beyond: Array  # (count, 2) int32: texels beyond the unit disc and what they copy


def brutes(
    size: int, terms: int, dtype: npt.DTypeLike, *, box: bool = False, quantised: bool = False, mirrored: bool = False
) -> Brute:
    """Allocate the filters of one map of n x n texels with M terms, not yet filled.

    `box` filters over the square around the disc instead of the disc; `quantised` keeps 8 bits of the basis and 16 of
    the basis-z; `mirrored` mirrors the disc in the square beyond it, which otherwise holds the far end; boxes alone
    look there.
    """
    return Brute(np.zeros((size, size), dtype), np.zeros((size, size, 2 * terms), dtype),
                 np.zeros((size, size, 2 * terms + 1), dtype), box, quantised, beyond_disc(size, mirrored))


@kernel
def build_brute(depth: Array, scale: DepthScale, brute: Brute) -> None:
    """Fill the channels of one map of radial distances, (n, n), m; inf where it is empty."""
    normalise(depth, scale, brute.depth)
    fill_beyond(brute.beyond, brute.depth)
    fill_basis(brute.depth, brute.basis.shape[2] // 2, brute.quantised, brute.basis, brute.basis_z)


@kernel
def brute_means(
    brute: Brute, s: Array, t: Array, radius: Array, active: Array, count: int, with_z: bool, out: Array
) -> None:
    """Fill out (channels, lanes) with the means over the disc of each active lane; as `mip.mip_means`."""
    n, channels = len(brute.depth), brute.basis.shape[2]
    real, sums = s.dtype.type, SUMS(s)[0]
    used = 2 * channels + 1 if with_z else channels
    for i in range(count):
        if not active[i]:
            continue
        for c in range(used):
            sums[c] = 0.0
        x, y, half = _box(s[i], t[i], radius[i], n, brute.box)
        total = 0.0
        for row in range(max(int(np.floor(y - half)), 0), min(int(np.ceil(y + half)), n)):
            for column in range(max(int(np.floor(x - half)), 0), min(int(np.ceil(x + half)), n)):
                weight = _weight(column, row, x, y, half, n, brute.box)
                if weight > 0.0:
                    total += weight
                    _add(brute, row, column, weight, with_z, sums)
        if total == 0.0:
            total = 1.0
            column, row = min(max(int(x), 0), n - 1), min(max(int(y), 0), n - 1)
            _add(brute, row, column, total, with_z, sums)
        for c in range(used):
            out[c, i] = real(sums[c] / total)


@kernel
def _box(s: float, t: float, radius: float, n: int, box: bool) -> tuple[float, float, float]:
    """Return middle and half side in texels."""
    x, y, half = 0.5 * n * (s + 1.0), 0.5 * n * (t + 1.0), 0.5 * n * radius
    if box:
        x, y, half = min(max(x, 0.0), 1.0 * n), min(max(y, 0.0), 1.0 * n), max(half, 0.5)
    return x, y, half


@kernel
def _weight(column: int, row: int, x: float, y: float, half: float, n: int, box: bool) -> float:
    """Return how much a texel counts: the area in the box, or 1 with its centre in the disc and the unit disc."""
    if box:
        wide = min(column + 1.0, x + half) - max(1.0 * column, x - half)
        high = min(row + 1.0, y + half) - max(1.0 * row, y - half)
        return max(wide, 0.0) * max(high, 0.0)
    middle, u, v = 0.5 * n, column + 0.5, row + 0.5
    inside = (u - x) * (u - x) + (v - y) * (v - y) <= half * half
    within = (u - middle) * (u - middle) + (v - middle) * (v - middle) <= middle * middle
    return 1.0 if inside & within else 0.0


@kernel
def _add(brute: Brute, row: int, column: int, weight: float, with_z: bool, sums: Array) -> None:
    channels = brute.basis.shape[2]
    for c in range(channels):
        sums[c] += weight * brute.basis[row, column, c]
    if with_z:
        for c in range(channels + 1):
            sums[channels + c] += weight * brute.basis_z[row, column, c]
