"""Mip maps of the basis (Sec. 6) as they lie in memory.

Level l halves level l - 1 by the mean of 2 x 2 texels; where the side is odd, the last row and column count twice.
Texel i of level l covers the texels i 2^l .. (i + 1) 2^l - 1 of the map, so no size drifts. The square beyond the
unit disc holds the far end, or mirrors the disc (`beyond`).

Level 0 is not stored. It would be three quarters of a pyramid and more than a core's cache, small discs alone read
it, and four depths give what four of its texels hold, to the same bits.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.filters.beyond import beyond_disc
from refgi.cluster.filters.eight import EIGHT
from refgi.jit import kernel

Array = npt.NDArray[Any]

SLACK = 4  # texels behind the last level: the right and lower neighbours of its texels, which weigh 0


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
    beyond: Array  # (count, 2) int32: texels beyond the unit disc and what they copy


def level_offsets(size: int) -> tuple[Array, int]:
    """Return where each level of a pyramid starts, levels 1 and up laid end to end.

    Parameters
    ----------
    size : int
        Texels along a side of level 0; each level has half of the one before, rounded up.

    Returns
    -------
    first : (levels,) ndarray
        Int64; 0 for level 0, which is not among them, as for level 1.
    total : int
        Texels of levels 1 and up.
    """
    sides = [size]
    while sides[-1] > 1:
        sides.append((sides[-1] + 1) // 2)
    texels = np.array([side * side for side in sides], np.int64)
    return np.maximum(np.cumsum(texels) - texels - texels[0], 0), int(texels[1:].sum())


def mips(
    count: int, size: int, terms: int, dtype: npt.DTypeLike, *, shift: float = 0.0, quantised: bool = False,
    mirrored: bool = False,
) -> Mip:
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
    mirrored : bool
        Mirror the disc in the square beyond it, which otherwise holds the far end.

    Returns
    -------
    Mip
        Arrays with a leading axis of `count`, not yet filled; padding is 0.
    """
    first, total = level_offsets(size)
    shape, width = (count, total + SLACK), -(-2 * terms // EIGHT) * EIGHT
    return Mip(np.zeros((count, size, size), dtype), np.zeros((*shape, width), dtype), np.zeros((*shape, width), dtype),
               np.zeros(shape, dtype), first, terms, shift, quantised, beyond_disc(size, mirrored))


@kernel
def mip_of(several: Mip, k: Any) -> Mip:
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
               several.terms, several.shift, several.quantised, several.beyond)
