"""Means texel by texel: what mip maps and summed areas stand for, at a cost that grows with the disc.

The disc takes the texels whose centres it holds, within the unit disc, or the one it lies in. The box is the square
around the disc, at least a texel wide; texels count by the area of them that it holds, those beyond the unit disc
too, and what of it lies beyond the map is cut off. A box with its middle beyond the map is moved to its edge.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.filters.basis import fill_basis, normalise
from refgi.jit import kernel

Array = npt.NDArray[Any]


class Brute(NamedTuple):
    """Channels of every texel of a map."""

    depth: Array  # (n, n): t
    basis: Array  # (n, n, 2 M)
    basis_z: Array  # (n, n, 2 M + 1)
    box: bool  # the square around the disc instead of the disc
    quantised: bool  # 8 bits for the basis, 16 for basis-z


def brutes(size: int, terms: int, dtype: npt.DTypeLike, *, box: bool = False, quantised: bool = False) -> Brute:
    """Make room for one map.

    Parameters
    ----------
    size : int
        Texels along a side of the map, n.
    terms : int
        M.
    dtype : dtype
        Float32 or float64.
    box : bool
        Filter over the square around the disc instead of the disc.
    quantised : bool
        Keep 8 bits of the basis and 16 of the basis-z.

    Returns
    -------
    Brute
        Arrays not yet filled.
    """
    return Brute(np.zeros((size, size), dtype), np.zeros((size, size, 2 * terms), dtype),
                 np.zeros((size, size, 2 * terms + 1), dtype), box, quantised)


@kernel
def build_brute(depth: Array, scale: float, most: float, brute: Brute) -> None:
    """Fill the channels of one map.

    Parameters
    ----------
    depth : (n, n) ndarray
        Radial distance, m; inf where nothing is seen.
    scale, most : float
        As in `basis.normalise`.
    brute : Brute
        Filled.
    """
    normalise(depth, scale, most, brute.depth)
    fill_basis(brute.depth, brute.basis.shape[2] // 2, brute.quantised, brute.basis, brute.basis_z)


@kernel
def brute_means(
    brute: Brute, s: Array, t: Array, radius: Array, wanted: Array, count: int, with_z: bool, out: Array
) -> None:
    """Read the means of the channels over a disc for each lane of a tile.

    Parameters
    ----------
    brute : Brute
        One map.
    s, t, radius : (lanes,) ndarray
        Centre and radius of the discs, in units of the map's half side.
    wanted : (lanes,) ndarray
        Lanes to read.
    count : int
        Lanes in use.
    with_z : bool
        All 4 M + 1 channels instead of the first 2 M.
    out : (channels, lanes) ndarray
        Filled where wanted.
    """
    n, channels = len(brute.depth), brute.basis.shape[2]
    real = s.dtype.type
    for i in range(count):
        if not wanted[i]:
            continue
        for c in range(2 * channels + 1 if with_z else channels):
            out[c, i] = real(0.0)
        x, y, half = _box(s[i], t[i], radius[i], n, brute.box)
        total = real(0.0)
        for row in range(max(int(np.floor(y - half)), 0), min(int(np.ceil(y + half)), n)):
            for column in range(max(int(np.floor(x - half)), 0), min(int(np.ceil(x + half)), n)):
                weight = _weight(column, row, x, y, half, n, brute.box)
                if weight > real(0.0):
                    total += weight
                    _add(brute, row, column, weight, with_z, i, out)
        if total == real(0.0):
            total = real(1.0)
            column, row = min(max(int(x), 0), n - 1), min(max(int(y), 0), n - 1)
            _add(brute, row, column, total, with_z, i, out)
        for c in range(2 * channels + 1 if with_z else channels):
            out[c, i] /= total


@kernel
def _box(s: Any, t: Any, radius: Any, n: int, box: bool) -> tuple[Any, Any, Any]:
    """Return middle and half side in texels."""
    real = type(s)
    scale = real(0.5) * real(n)
    x, y, half = (s + real(1.0)) * scale, (t + real(1.0)) * scale, radius * scale
    if box:
        x, y = min(max(x, real(0.0)), real(n)), min(max(y, real(0.0)), real(n))
        half = max(half, real(0.5))
    return x, y, half


@kernel
def _weight(column: int, row: int, x: Any, y: Any, half: Any, n: int, box: bool) -> Any:
    """Return how much a texel counts: the area in the box, or 1 with its centre in the disc and the unit disc."""
    real = type(x)
    if box:
        wide = min(real(column + 1), x + half) - max(real(column), x - half)
        high = min(real(row + 1), y + half) - max(real(row), y - half)
        return max(wide, real(0.0)) * max(high, real(0.0))
    middle = real(0.5) * real(n)
    u, v = real(column) + real(0.5), real(row) + real(0.5)
    inside = (u - x) * (u - x) + (v - y) * (v - y) <= half * half
    within = (u - middle) * (u - middle) + (v - middle) * (v - middle) <= middle * middle
    return real(1.0) if inside & within else real(0.0)


@kernel
def _add(brute: Brute, row: int, column: int, weight: Any, with_z: bool, i: int, out: Array) -> None:
    channels = brute.basis.shape[2]
    for c in range(channels):
        out[c, i] += weight * brute.basis[row, column, c]
    if with_z:
        for c in range(channels + 1):
            out[channels + c, i] += weight * brute.basis_z[row, column, c]
