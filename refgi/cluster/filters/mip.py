"""A mip map of the basis, read between its texels and levels (Sec. 6): the filter of the paper.

Level l halves level l - 1 by the mean of 2 x 2 texels; where the side is odd, the last row and column count twice.
Texel i of level l covers the texels i 2^l .. (i + 1) 2^l - 1 of the map, so no size drifts. A disc is read at level
log2 of its diameter in texels, between the two next levels and the 2 x 2 nearest texels of each. Beyond the edge of
the map the edge goes on; the square beyond the unit disc holds the far end.

Level 0 is not stored: its texels are the largest part of a pyramid and are computed from the depth where they are
read, to the same bits.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.filters.basis import fill_basis, normalise, sine_cosine
from refgi.cluster.filters.quantise import eight_bits, half_precision
from refgi.elementary import log2
from refgi.jit import kernel, prange

Array = npt.NDArray[Any]

LANES = 8  # channels of a texel are padded to a multiple of it, with zeros


class Mip(NamedTuple):
    """One map's pyramid, or with a leading axis those of several."""

    depth: Array  # (n, n): t
    basis: Array  # (texels, 2 M padded): S_k, C_k of levels 1 and up
    basis_z: Array  # (texels, 2 M padded): t S_k, t C_k
    mean_depth: Array  # (texels,): means of t
    first: Array  # (levels,) int64: first texel of each level; of no use for level 0
    terms: int  # M
    shift: float  # added to every level that is read
    quantised: bool  # 8 bits for the basis, 16 for basis-z


def mips(count: int, size: int, terms: int, dtype: npt.DTypeLike, *, shift: float = 0.0, quantised: bool = False) -> Mip:
    """Make room for the pyramids of several maps.

    Parameters
    ----------
    count : int
        Maps.
    size : int
        Texels along a side of a map, n.
    terms : int
        M.
    dtype : dtype
        Float32 or float64.
    shift : float
        Added to the level of every read; 0 as published, negative for a narrower filter.
    quantised : bool
        Keep 8 bits of the basis and 16 of the basis-z on every level.

    Returns
    -------
    Mip
        Arrays with a leading axis of `count`, not yet filled; padding is 0.
    """
    sides = [size]
    while sides[-1] > 1:
        sides.append((sides[-1] + 1) // 2)
    texels = np.array([side * side for side in sides])
    first = np.cumsum(texels) - texels - texels[0]
    total, width = max(int(texels[1:].sum()), 1), -(-2 * terms // LANES) * LANES
    return Mip(np.zeros((count, size, size), dtype), np.zeros((count, total, width), dtype),
               np.zeros((count, total, width), dtype), np.zeros((count, total), dtype), first, terms, shift, quantised)


@kernel
def mip_of(several: Mip, k: int) -> Mip:
    """Return one of several pyramids.

    Parameters
    ----------
    several : Mip
        With a leading axis.
    k : int
        Which.

    Returns
    -------
    Mip
        Views of that pyramid.
    """
    return Mip(several.depth[k], several.basis[k], several.basis_z[k], several.mean_depth[k], several.first,
               several.terms, several.shift, several.quantised)


@kernel
def build_mip(depth: Array, scale: float, most: float, mip: Mip) -> None:
    """Fill one pyramid.

    Parameters
    ----------
    depth : (n, n) ndarray
        Radial distance, m; inf where nothing is seen.
    scale, most : float
        As in `basis.normalise`.
    mip : Mip
        Filled.
    """
    normalise(depth, scale, most, mip.depth)
    n = len(mip.depth)
    terms = mip.terms
    basis, basis_z = np.empty((n, n, 2 * terms), depth.dtype), np.empty((n, n, 2 * terms + 1), depth.dtype)
    fill_basis(mip.depth, terms, mip.quantised, basis, basis_z)
    quarter = depth.dtype.type(0.25)
    side = n
    for level in range(1, len(mip.first)):
        half = (side + 1) // 2
        source, target = mip.first[level - 1], mip.first[level]
        for i in range(half):
            for j in range(half):
                i1, j1 = min(2 * i + 1, side - 1), min(2 * j + 1, side - 1)
                texel = target + i * half + j
                for c in range(2 * terms + 1):
                    if level == 1:
                        z = (basis_z[2 * i, 2 * j, c] + basis_z[2 * i, j1, c]) + (basis_z[i1, 2 * j, c] + basis_z[i1, j1, c])
                        v = z
                        if c < 2 * terms:
                            v = (basis[2 * i, 2 * j, c] + basis[2 * i, j1, c]) + (basis[i1, 2 * j, c] + basis[i1, j1, c])
                    else:
                        a, b = source + 2 * i * side + 2 * j, source + 2 * i * side + j1
                        e, f = source + i1 * side + 2 * j, source + i1 * side + j1
                        v = z = depth.dtype.type(0.0)
                        if c == 2 * terms:
                            z = (mip.mean_depth[a] + mip.mean_depth[b]) + (mip.mean_depth[e] + mip.mean_depth[f])
                        else:
                            z = (mip.basis_z[a, c] + mip.basis_z[b, c]) + (mip.basis_z[e, c] + mip.basis_z[f, c])
                            v = (mip.basis[a, c] + mip.basis[b, c]) + (mip.basis[e, c] + mip.basis[f, c])
                    v, z = quarter * v, quarter * z
                    if mip.quantised:
                        v, z = eight_bits(v), half_precision(z)
                    if c == 2 * terms:
                        mip.mean_depth[texel] = z
                    else:
                        mip.basis[texel, c], mip.basis_z[texel, c] = v, z
        side = half


@kernel(parallel=True)
def build_mips(depth: Array, scale: Array, most: float, several: Mip) -> None:
    """Fill the pyramids of several maps.

    Parameters
    ----------
    depth : (K, n, n) ndarray
        Radial distances, m; inf where nothing is seen.
    scale : (K,) ndarray
        As in `basis.normalise`.
    most : float
        The same.
    several : Mip
        Filled; with a leading axis of K at least.
    """
    for k in prange(len(depth)):
        build_mip(depth[k], scale[k], most, mip_of(several, np.int64(k)))


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
        Filled where wanted; what it held is lost in row 0 of all lanes.
    """
    n, terms, top = len(mip.depth), mip.terms, len(mip.first) - 1
    real = s.dtype.type
    for i in range(count):
        level = log2(max(radius[i] * real(n), real(1.0))) + real(mip.shift)
        out[0, i] = min(max(level, real(0.0)), real(top))
    for i in range(count):
        if not wanted[i]:
            continue
        level = out[0, i]
        fine = min(int(level), max(top - 1, 0))
        share = level - real(fine)
        for c in range(4 * terms + 1 if with_z else 2 * terms):
            out[c, i] = real(0.0)
        _add(mip, fine, s[i], t[i], real(1.0) - share, with_z, i, out)
        if share > real(0.0):
            _add(mip, fine + 1, s[i], t[i], share, with_z, i, out)


@kernel
def _add(mip: Mip, level: int, s: Any, t: Any, weight: Any, with_z: bool, i: int, out: Array) -> None:
    n, terms = len(mip.depth), mip.terms
    real = type(s)
    side = (n + (1 << level) - 1) >> level
    scale = real(0.5) * real(n) / real(1 << level)
    x = min(max((s + real(1.0)) * scale - real(0.5), real(0.0)), real(side - 1))
    y = min(max((t + real(1.0)) * scale - real(0.5), real(0.0)), real(side - 1))
    j, r = int(x), int(y)
    fx, fy = x - real(j), y - real(r)
    for tap in range(4):
        row, column = min(r + tap // 2, side - 1), min(j + tap % 2, side - 1)
        w = weight * (fy if tap // 2 else real(1.0) - fy) * (fx if tap % 2 else real(1.0) - fx)
        if level == 0:
            z = mip.depth[row, column]
            sine, cosine = sine_cosine(z)
            turn_sine, turn_cosine = (sine + sine) * cosine, (cosine - sine) * (cosine + sine)
            for k in range(terms):
                a, b, az, bz = sine, cosine, z * sine, z * cosine
                if mip.quantised:
                    a, b, az, bz = eight_bits(a), eight_bits(b), half_precision(az), half_precision(bz)
                out[k, i] += w * a
                out[terms + k, i] += w * b
                if with_z:
                    out[2 * terms + k, i] += w * az
                    out[3 * terms + k, i] += w * bz
                sine, cosine = sine * turn_cosine + cosine * turn_sine, cosine * turn_cosine - sine * turn_sine
            if with_z:
                out[4 * terms, i] += w * (half_precision(z) if mip.quantised else z)
        else:
            texel = mip.first[level] + row * side + column
            for c in range(2 * terms):
                out[c, i] += w * mip.basis[texel, c]
                if with_z:
                    out[2 * terms + c, i] += w * mip.basis_z[texel, c]
            if with_z:
                out[4 * terms, i] += w * mip.mean_depth[texel]
