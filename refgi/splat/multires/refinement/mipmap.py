"""Min-max and max mipmaps: where their levels lie in one array, and how a level follows from the one below it.

Levels lie one after another, each row by row, so that what holds for every cell of every level is one loop. A row of
cells of the coarsest level belongs to one thread, which fills all finer levels inside it while they are in its cache.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.splat.multires.refinement.grid import level_shape

Array = npt.NDArray[Any]

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
