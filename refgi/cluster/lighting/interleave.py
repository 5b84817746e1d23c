"""Interleaved sampling: each pixel of a block of n x n sums one light of n^2 (Sec. 6; Segovia et al. 2006).

Pixel (x, y) takes the lights i with i mod n^2 = (y mod n) n + x mod n, and each of them n^2 times. Pixels of one subset
are kept together, so that the pixels of a tile share their lights.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.pairs.blocks import block_by_block
from refgi.pairs.pair_sum import TILE

Array = npt.NDArray[Any]


class Subsets(NamedTuple):
    """Pixels with a surface, those of a subset after each other, in tiles that hold one subset each."""

    places: Array  # (n,) int64: flat indices of the pixels
    start: Array  # (subsets + 1,) int64: first pixel of each subset, and how many there are
    first: Array  # (T,) int64: first pixel of each tile
    size: Array  # (T,) int64: how many it has, 1 to TILE
    subset: Array  # (T,) int64: which lights it sums


def subsets(covered: Array, side: int) -> Subsets:
    """Sort pixels by the subset of lights that they sum.

    Parameters
    ----------
    covered : (h, w) ndarray of bool
        Whether there is a surface.
    side : int
        n, pixels along a side of a block.

    Returns
    -------
    Subsets
        Every covered pixel once; within a subset block by block (`block_by_block`).
    """
    expect(side >= 1, "interleaving", "1 or more pixels", side)
    width = covered.shape[1]
    parts = []
    for row in range(side):
        for column in range(side):
            some = np.ascontiguousarray(covered[row::side, column::side])
            y, x = np.divmod(block_by_block(some), max(1, some.shape[1]))
            parts.append((y * side + row) * width + (x * side + column))
    counts = np.array([len(part) for part in parts])
    start = np.append(0, np.cumsum(counts))
    tiles = -(-counts // TILE)
    subset = np.repeat(np.arange(len(counts)), tiles)
    first = start[subset] + (np.arange(len(subset)) - np.repeat(np.cumsum(tiles) - tiles, tiles)) * TILE
    size = np.minimum(TILE, start[subset + 1] - first)
    return Subsets(np.concatenate(parts), start, first, size, subset)
