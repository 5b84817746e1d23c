"""Cells of a picture's levels, their representative pixels and the list of subsplats (Nichols and Wyman 2009).

Level l has cells of 2^l x 2^l pixels, level 0 is the picture itself. Pictures of any size have such levels: cells at
the right and lower border are cut. A cell without any surface is never refined and never evaluated.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.stages import stage

Array = npt.NDArray[Any]
FRAMED = 2  # finest level whose cells have an edge to see
EDGE = 0.6  # of a cell's brightness


class Subsplats(NamedTuple):
    """The leaves of the refinement that show a surface: every such pixel lies in exactly one.

    Cells of the coarsest level follow row by row; within one, subsplats are listed depth first, which keeps
    neighbours together.
    """

    level: Array  # (n,) uint8, side of 2^level pixels
    row: Array  # (n,) int32, in the grid of its level
    column: Array  # (n,) int32
    pixel: Array  # (n,) int64, flat index of the pixel that stands for it
    leaf: tuple[Array, ...]  # (h_l, w_l) bool for levels 0 to top: the same leaves as masks
    shape: tuple[int, int]  # (h, w) of the picture

    @property
    def top(self) -> int:
        """Coarsest level."""
        return len(self.leaf) - 1

    @property
    def counts(self) -> Array:
        """Subsplats of each level, (top + 1,) int64."""
        return np.bincount(self.level, minlength=self.top + 1)


def level_shape(height: int, width: int, level: int) -> tuple[int, int]:
    """Return rows and columns of a level, cells cut by the border included.

    >>> level_shape(100, 65, 6)
    (2, 2)
    """
    return -(-height >> level), -(-width >> level)


def top_level(height: int, width: int, coarsest: int) -> int:
    """Return the coarsest level: the first whose longer side has at most `coarsest` cells (16 in the paper).

    >>> top_level(1024, 1024, 16)
    6
    """
    level = 0
    while max(level_shape(height, width, level)) > coarsest:
        level += 1
    return level


@kernel
def representative(covered: Array, level: int, i: int, j: int) -> int:
    """Return a cell's representative pixel: the one right and below of its centre, or the nearest that shows a surface.

    covered: (h, w) bool; level, i, j: the cell. Returns a flat index, -1 where the cell shows no surface.

    The paper does not say where a coarse subsplat is evaluated; a cell of an even side has no pixel in its centre.
    """
    height, width = covered.shape
    side, half = 1 << level, (1 << level) >> 1
    top, left = i * side, j * side
    row, column = min(top + half, height - 1), min(left + half, width - 1)
    found: int = row * width + column
    if covered[row, column]:
        return found
    found, nearest = -1, 2 * side * side + 1
    for y in range(top, min(top + side, height)):
        for x in range(left, min(left + side, width)):
            square = (y - row) * (y - row) + (x - column) * (x - column)
            if covered[y, x] and square < nearest:
                found, nearest = y * width + x, square
    return found


@stage("multires.representatives")
def representatives(covered: Array, top: int) -> tuple[Array, ...]:
    """Return the representative pixel of each cell of each level (E-AMS-11).

    -> tuple of (h_l, w_l) int32: Row * columns + column of the picture, of the pixel right and below of the cell's
        centre; where it shows no surface the nearest that does, the first of several; -1 where the cell shows none.
        Levels 0 to `top`.
    """
    height, width = covered.shape
    places = tuple(np.empty(level_shape(height, width, level), np.int32) for level in range(top + 1))
    for level, place in enumerate(places):
        _fill_representatives(covered, level, place)
    return places


@kernel(parallel=True)
def _fill_representatives(covered: Array, level: int, place: Array) -> None:
    for i in prange(place.shape[0]):
        for j in range(place.shape[1]):
            place[i, j] = representative(covered, level, i, j)


def level_picture(subsplats: Subsplats, *, edges: bool = True) -> Array:
    """Return the picture of the level each pixel is evaluated at, (h, w) float32: the finer, the brighter (Fig. 5).

    1 where pixels are evaluated one by one, less by equal steps for every coarser level, 0 without surface; `edges`
    darken the upper and left edge of cells of 4 x 4 pixels and more.
    """
    height, width = subsplats.shape
    picture = np.zeros((height, width), np.float32)
    for level, leaf in enumerate(subsplats.leaf):
        side = 1 << level
        cell = np.full((side, side), 1 - level / len(subsplats.leaf), np.float32)
        if edges and level >= FRAMED:
            cell[0], cell[1:, 0] = EDGE * cell[0], EDGE * cell[1:, 0]
        picture += np.kron(leaf, cell)[:height, :width]
    return picture
