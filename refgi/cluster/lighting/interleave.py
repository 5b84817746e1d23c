"""Interleaved sampling: each pixel of a block of n x n sums one light of n^2 (Sec. 6; Segovia et al. 2006).

Pixel (x, y) takes the lights i with i mod n^2 = (y mod n) n + x mod n, and each of them n^2 times. Pixels of one subset
are kept together, so that the pixels of a tile share their lights.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.pairs.blocks import BLOCK
from refgi.pairs.pair_sum import TILE

Array = npt.NDArray[Any]

MOST = 64  # pixels along a side of a block
FIRST, SIZE, SUBSET = 0, 1, 2  # rows of tiles


class Subsets(NamedTuple):
    """Pixels with a surface, those of a subset after each other, in tiles that hold one subset each."""

    places: Array  # (n,) int64: flat indices of the pixels
    start: Array  # (subsets + 1,) int64: first pixel of each subset, and how many there are
    tiles: Array  # (3, T) int64: first pixel of each tile, how many it has (1 to TILE), and its subset


def subsets(covered: Array, side: int) -> Subsets:
    """Sort pixels by the subset of lights that they sum.

    Parameters
    ----------
    covered : (h, w) ndarray of bool
        Whether there is a surface.
    side : int
        n, pixels along a side of a block; 1 to 64.

    Returns
    -------
    Subsets
        Every covered pixel once; those of a subset by blocks of `BLOCK` x `BLOCK` of them.

    Raises
    ------
    InputError
        If the side is out of range.
    """
    expect(1 <= side <= MOST, "interleaving", f"1 to {MOST} pixels", side)
    covered = np.ascontiguousarray(covered)
    counts = np.empty(side * side, np.int64)
    _count(covered, side, counts)
    start = np.append(0, np.cumsum(counts))
    places = np.empty(start[-1], np.int64)
    _fill(covered, side, start, places)
    tiles = -(-counts // TILE)
    subset = np.repeat(np.arange(len(counts)), tiles)
    first = start[subset] + (np.arange(len(subset)) - np.repeat(np.cumsum(tiles) - tiles, tiles)) * TILE
    return Subsets(places, start, np.stack([first, np.minimum(TILE, start[subset + 1] - first), subset]))


@kernel(parallel=True)
def _count(covered: Array, side: int, counts: Array) -> None:
    height, width = covered.shape
    for subset in prange(side * side):
        count = 0
        for row in range(np.int64(subset) // side, height, side):
            for column in range(np.int64(subset) % side, width, side):
                count += covered[row, column]
        counts[subset] = count


@kernel(parallel=True)
def _fill(covered: Array, side: int, start: Array, places: Array) -> None:
    height, width = covered.shape
    step = side * BLOCK
    for subset in prange(side * side):
        place = start[subset]
        for top in range(np.int64(subset) // side, height, step):
            for left in range(np.int64(subset) % side, width, step):
                for row in range(top, min(top + step, height), side):
                    for column in range(left, min(left + step, width), side):
                        if covered[row, column]:
                            places[place] = row * width + column
                            place += 1


@kernel(parallel=True)
def take(plane: Array, parts: Subsets, values: Array) -> None:
    """Copy three channels into the order of subsets.

    Parameters
    ----------
    plane : (3, h w) ndarray
        Of a picture.
    parts : Subsets
        The order.
    values : (3, n) ndarray
        Filled.
    """
    tiles, places = parts.tiles, parts.places
    for t in prange(tiles.shape[1]):
        for c in range(3):
            for i in range(tiles[FIRST, t], tiles[FIRST, t] + tiles[SIZE, t]):
                values[c, i] = plane[c, places[i]]


@kernel(parallel=True)
def put(values: Array, parts: Subsets, factor: Any, plane: Array) -> None:
    """Copy three channels, times a factor, back into the order of a picture.

    Parameters
    ----------
    values : (3, n) ndarray
        In the order of subsets.
    parts : Subsets
        That order.
    factor : float
        n^2: how many subsets each stands for.
    plane : (3, h w) ndarray
        Of a picture; changed where there is a surface.
    """
    tiles, places = parts.tiles, parts.places
    for t in prange(tiles.shape[1]):
        for c in range(3):
            for i in range(tiles[FIRST, t], tiles[FIRST, t] + tiles[SIZE, t]):
                plane[c, places[i]] = values[c, i] * factor
