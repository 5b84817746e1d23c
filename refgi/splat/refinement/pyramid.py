"""Where the levels of a mip lie in one array, and how a level follows from the one below it.

Levels lie one after another, each row by row, so that what holds for every cell of every level is one loop. A row of
cells of the coarsest level belongs to one thread, which makes all finer levels inside it while they are in its cache.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.splat.refinement.grid import level_shape

Array = npt.NDArray[Any]

START, ROWS, COLUMNS = range(3)  # columns of a layout


def layout(height: int, width: int, top: int, first: int = 0) -> Array:
    """Return where each level lies.

    Parameters
    ----------
    height, width : int
        Size of the picture.
    top : int
        Coarsest level.
    first : int
        Finest level that is kept; those below it take no room.

    Returns
    -------
    (top + 1, 3) ndarray of int64
        First element, rows and columns of levels 0 to `top`.

    Examples
    --------
    >>> layout(4, 3, 1).tolist()
    [[0, 4, 3], [12, 2, 2]]
    """
    shapes = np.array([level_shape(height, width, level) for level in range(top + 1)], np.int64)
    cells = shapes.prod(axis=1)
    cells[:first] = 0
    return np.column_stack([cells.cumsum() - cells, shapes])


def room(sizes: Array) -> int:
    """Return how many elements the levels of a layout take together.

    Parameters
    ----------
    sizes : (top + 1, 3) ndarray
        The layout.

    Returns
    -------
    int
        Elements.
    """
    start, rows, columns = sizes[-1]
    return int(start + rows * columns)


def views(values: Array, sizes: Array, first: int = 0) -> tuple[Array, ...]:
    """Return the levels as arrays that share the memory of `values`.

    Parameters
    ----------
    values : (..., n) ndarray
        All levels.
    sizes : (top + 1, 3) ndarray
        Their layout.
    first : int
        Finest level that is kept.

    Returns
    -------
    tuple of (..., h_l, w_l) ndarray
        Levels `first` to `top`.
    """
    return tuple(values[..., start : start + rows * columns].reshape(*values.shape[:-1], rows, columns)
                 for start, rows, columns in sizes[first:])


@kernel
def least_of_four(upper: Array, lower: Array, out: Array) -> None:
    """Store the smallest value of each 2 x 2 cells of two rows.

    Parameters
    ----------
    upper, lower : (2 n or 2 n - 1,) ndarray
        Neighbouring rows of a level; the same one twice at its lower border.
    out : (n,) ndarray
        A row of the next coarser level.
    """
    pairs = len(upper) // 2
    for j in range(pairs):
        above = upper[2 * j] if upper[2 * j] < upper[2 * j + 1] else upper[2 * j + 1]
        below = lower[2 * j] if lower[2 * j] < lower[2 * j + 1] else lower[2 * j + 1]
        out[j] = above if above < below else below
    if len(out) > pairs:
        out[pairs] = min(upper[2 * pairs], lower[2 * pairs])


@kernel
def most_of_four(upper: Array, lower: Array, out: Array) -> None:
    """Store the largest value of each 2 x 2 cells of two rows.

    Parameters
    ----------
    upper, lower : (2 n or 2 n - 1,) ndarray
        Neighbouring rows of a level; the same one twice at its lower border.
    out : (n,) ndarray
        A row of the next coarser level.
    """
    pairs = len(upper) // 2
    for j in range(pairs):
        above = upper[2 * j] if upper[2 * j] > upper[2 * j + 1] else upper[2 * j + 1]
        below = lower[2 * j] if lower[2 * j] > lower[2 * j + 1] else lower[2 * j + 1]
        out[j] = above if above > below else below
    if len(out) > pairs:
        out[pairs] = max(upper[2 * pairs], lower[2 * pairs])
