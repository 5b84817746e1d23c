"""A level made from the next finer one, four texels at a time."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.sssil.level import Level
from refgi.sssil.pyramid.closest import choose_texels

Array = npt.NDArray[Any]

TASKS = 16  # blocks of rows that are dealt to threads, whatever their number


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
    rows = level.area.shape[0]
    for task in prange(TASKS):
        fill_rows(fine, height, width, level, task * rows // TASKS, (task + 1) * rows // TASKS)


@kernel
def fill_rows(fine: Level, height: int, width: int, level: Level, first: int, end: int) -> None:
    """Fill the rows `first` to `end` - 1 of a level.

    Parameters
    ----------
    fine : Level
        The level to start from.
    height, width : int
        Of the picture.
    level : Level
        The result.
    first, end : int
        Rows.
    """
    columns = fine.area.shape[1]
    nearest, place = np.empty(columns + 1, fine.depth.dtype), np.empty((3, columns + 1), np.int32)
    chosen = np.empty(level.area.shape[1], np.int32)
    for i in range(first, end):
        choose_texels(fine.depth, fine.pixel, i, width, nearest, place, chosen)
        _take(fine, i, place[0], chosen, level)
        _enlarge(fine, i, place[0], chosen, height, width, level)


@kernel
def _take(fine: Level, i: int, row: Array, column: Array, level: Level) -> None:
    """Copy what the chosen texels show."""
    depth, pixel, area = fine.depth, fine.pixel, fine.area
    position, normal, radiance = fine.position, fine.normal, fine.radiance
    to_depth, to_pixel, to_area = level.depth, level.pixel, level.area
    to_position, to_normal, to_radiance = level.position, level.normal, level.radiance
    for j in range(np.uint64(to_depth.shape[1])):
        c = np.uint64(column[j])
        r = np.uint64(row[c])
        to_depth[i, j] = depth[r, c]
        to_pixel[i, j] = pixel[r, c]
        to_area[i, j] = area[r, c]
        for axis in range(3):
            to_position[axis, i, j] = position[axis, r, c]
        for axis in range(3):
            to_normal[axis, i, j] = normal[axis, r, c]
        for axis in range(3):
            to_radiance[axis, i, j] = radiance[axis, r, c]


@kernel
def _enlarge(fine: Level, i: int, row: Array, column: Array, height: int, width: int, level: Level) -> None:
    """Let a texel stand for all of its pixels, not those of the finer one alone."""
    area, real = level.area, level.area.dtype.type
    last, last_row = area.shape[1] - 1, i == area.shape[0] - 1
    for j in range(np.uint64(area.shape[1])):
        area[i, j] = real(4.0) * area[i, j]
    for j in range(0 if last_row else last, last + 1):  # cut by the picture's edge
        r, c = row[column[j]], column[j]
        covered = pixels_covered(level.number, i, j, height, width)
        area[i, j] = fine.area[r, c] * real(covered / pixels_covered(fine.number, r, c, height, width))


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
