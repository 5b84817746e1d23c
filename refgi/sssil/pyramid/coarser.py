"""A level made from the next finer one, four texels at a time."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.sssil.level import Level
from refgi.sssil.pyramid.closest import before

Array = npt.NDArray[Any]


@kernel(parallel=True)
def fill_coarser_level(fine: Level, height: int, width: int, level: Level) -> None:
    """Fill a level with the texels of the finer one that are nearest to the eye.

    Parameters
    ----------
    fine : Level
        The level to start from.
    height, width : int
        Of the picture.
    level : Level
        The result.
    """
    for i in prange(level.area.shape[0]):
        fill_row(fine, height, width, np.int64(i), level)


@kernel
def fill_row(fine: Level, height: int, width: int, i: int, level: Level) -> None:
    """Fill one row of a level.

    Parameters
    ----------
    fine : Level
        The level to start from.
    height, width : int
        Of the picture.
    i : int
        The row.
    level : Level
        The result.
    """
    real = level.area.dtype.type
    for j in range(level.area.shape[1]):
        r, c = closest_child(fine.depth, fine.pixel, width, i, j)
        seen = fine.pixel[r, c] >= 0
        for axis in range(3):
            level.position[axis, i, j] = fine.position[axis, r, c]
            level.normal[axis, i, j] = fine.normal[axis, r, c]
            level.radiance[axis, i, j] = fine.radiance[axis, r, c]
        level.depth[i, j] = fine.depth[r, c]
        level.pixel[i, j] = fine.pixel[r, c]
        share = pixels_covered(level.number, i, j, height, width) / pixels_covered(fine.number, r, c, height, width)
        level.area[i, j] = fine.area[r, c] * real(share) if seen else real(0.0)


@kernel
def closest_child(depth: Array, pixel: Array, width: int, i: int, j: int) -> tuple[int, int]:
    """Return row and column of the finer texel that a texel takes over.

    Parameters
    ----------
    depth : (h, w) ndarray
        Of the finer level, m.
    pixel : (h, w) ndarray of int32
        Which pixels of the picture the finer texels show.
    width : int
        Of the picture.
    i, j : int
        The texel.

    Returns
    -------
    tuple of 2 ints
        One of the four, or fewer at the picture's edge.
    """
    rows, columns = depth.shape
    row, column = 2 * i, 2 * j
    for child in range(1, 4):
        r, c = 2 * i + child // 2, 2 * j + child % 2
        if r < rows and c < columns:
            off_centre = abs(2 * (pixel[r, c] % width) + 1 - width)
            other = abs(2 * (pixel[row, column] % width) + 1 - width)
            if before(depth[r, c], off_centre, pixel[r, c], depth[row, column], other, pixel[row, column]):
                row, column = r, c
    return row, column


@kernel
def pixels_covered(number: int, i: int, j: int, height: int, width: int) -> int:
    """Return how many pixels of the picture a texel covers.

    Parameters
    ----------
    number : int
        Level k: 2^k x 2^k pixels, cut at the picture's edge.
    i, j : int
        The texel.
    height, width : int
        Of the picture.

    Returns
    -------
    int
        At least 1.
    """
    side = 1 << number
    return min(side, height - i * side) * min(side, width - j * side)
