"""Cells of a picture's levels, their pixels and subsplats, min-max mipmaps (Nichols and Wyman 2009), the error target.

Level l has cells of 2^l x 2^l pixels; those at the right and lower border are cut. A mipmap's levels lie one after
another, each row by row. A row of cells of the coarsest level belongs to one thread, which fills all finer levels.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.settings import Settings, setting
from refgi.stages import stage
from refgi.types import Array

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

    A flat index, -1 where the cell shows no surface. The paper does not say where a coarse subsplat is evaluated.
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


START, ROWS, COLUMNS = range(3)  # columns of a layout


class Mipmap(NamedTuple):
    """Least and largest values within the cells of levels 0 to top, or the largest alone (a max mip).

    Level 0 of a min-max mip is the channel as it came, on both sides. Elsewhere a cell without any surface has `low`
    inf and `high` -inf; in a max mip it has 0.
    """

    low: tuple[Array, ...]  # (h_l, w_l) or (c, h_l, w_l) for each level; () for a max mip
    high: tuple[Array, ...]
    lows: Array  # (c, n): levels 1 to top one after another, which `low` shows; (0, 0) for a max mip
    highs: Array  # (c, n)

    @property
    def top(self) -> int:
        """Coarsest level."""
        return len(self.high) - 1

    def recorded(self) -> dict[str, dict[str, Array]]:
        """Return both sides by level, without level 0, which is no cell's: what a log keeps."""
        sides = {"low": self.low, "high": self.high}
        return {side: {str(level): levels[level] for level in range(1, len(levels))} for side, levels in sides.items()}


def layout(height: int, width: int, top: int, first: int = 0) -> Array:
    """Return first element, rows and columns of levels 0 to `top`, (top + 1, 3) int64; levels below `first` are empty.

    >>> layout(4, 3, top=1).tolist()
    [[0, 4, 3], [12, 2, 2]]
    """
    shapes = np.array([level_shape(height, width, level) for level in range(top + 1)], np.int64)
    cells = shapes.prod(axis=1)
    cells[:first] = 0
    return np.column_stack([cells.cumsum() - cells, shapes])


def element_count(sizes: Array) -> int:
    """Return the number of elements of a layout's levels together."""
    start, rows, columns = sizes[-1]
    return int(start + rows * columns)


def level_views(values: Array, sizes: Array, first: int = 0) -> tuple[Array, ...]:
    """Return levels `first` to top of `values`, (..., n), as views of (..., h_l, w_l)."""
    return tuple(values[..., start : start + rows * columns].reshape(*values.shape[:-1], rows, columns)
                 for start, rows, columns in sizes[first:])


@kernel
def rows_of(strip: int, level: int, sizes: Array) -> tuple[int, int]:
    """Return the first row and one past the last of a level within one row (strip) of the coarsest level's cells."""
    along = len(sizes) - 1 - level
    return strip << along, min((strip + 1) << along, sizes[level, ROWS])


@kernel
def coarsen(strip: int, finest: int, sizes: Array, lows: Array, highs: Array) -> None:
    """Fill the levels above the finest, as far as they lie in one row (strip) of cells of the coarsest level.

    lows, highs: (n,), all levels of the least and of the largest values; `lows` is empty in a max mipmap.
    """
    for level in range(finest + 1, len(sizes)):
        below, rows, fine = sizes[level - 1]
        here, _, columns = sizes[level]
        begin, end = rows_of(strip, level, sizes)
        for i in range(begin, end):
            upper, lower, at = below + 2 * i * fine, below + min(2 * i + 1, rows - 1) * fine, here + i * columns
            if len(lows):
                _least_of_four(lows[upper : upper + fine], lows[lower : lower + fine], lows[at : at + columns])
            _most_of_four(highs[upper : upper + fine], highs[lower : lower + fine], highs[at : at + columns])


@kernel
def any_of_four(finer: Array, cells: Array) -> None:
    """Store whether any of the finer cells (0 or not) within each cell shows a surface."""
    columns = finer.shape[1]
    pairs = columns // 2
    for i in range(cells.shape[0]):
        upper, lower, out = finer[2 * i], finer[min(2 * i + 1, finer.shape[0] - 1)], cells[i]
        for j in range(pairs):
            out[j] = upper[2 * j] | upper[2 * j + 1] | lower[2 * j] | lower[2 * j + 1]
        if columns % 2:
            out[pairs] = upper[columns - 1] | lower[columns - 1]


@kernel
def _least_of_four(upper: Array, lower: Array, out: Array) -> None:
    """Store the smallest value of each 2 x 2 cells of two rows, of which the lower may be the upper again."""
    pairs = len(upper) // 2
    for j in range(pairs):
        above = upper[2 * j] if upper[2 * j] < upper[2 * j + 1] else upper[2 * j + 1]
        below = lower[2 * j] if lower[2 * j] < lower[2 * j + 1] else lower[2 * j + 1]
        out[j] = above if above < below else below
    if len(out) > pairs:
        out[pairs] = min(upper[2 * pairs], lower[2 * pairs])


@kernel
def _most_of_four(upper: Array, lower: Array, out: Array) -> None:
    """Store the largest value of each 2 x 2 cells of two rows, of which the lower may be the upper again."""
    pairs = len(upper) // 2
    for j in range(pairs):
        above = upper[2 * j] if upper[2 * j] > upper[2 * j + 1] else upper[2 * j + 1]
        below = lower[2 * j] if lower[2 * j] > lower[2 * j + 1] else lower[2 * j + 1]
        out[j] = above if above > below else below
    if len(out) > pairs:
        out[pairs] = max(upper[2 * pairs], lower[2 * pairs])


LEAST_TARGET = 1e-6  # about what rounding to float32 leaves of the full sum
MOST_CELLS = 65536  # along the longer side


@dataclasses.dataclass(frozen=True)
class ErrorTarget(Settings):
    """Subsplats refined until the picture is as near to the full sum as asked for."""

    PRINCIPAL = "target"

    target: float = setting(0.05, "RMSE to the full sum over its mean", least=LEAST_TARGET)
    coarsest: int = setting(16, "cells of the coarsest level along the longer side", least=1, most=MOST_CELLS)
