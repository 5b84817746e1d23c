"""The first level, made from the picture in one pass: position, normal, radiance and sample area of its texels.

A level made from the next finer one, four texels at a time.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.sssil.level import Level, Picture
from refgi.sssil.pyramid.closest import choose_pixels, choose_texels
from refgi.sssil.pyramid.view import View, centre, pixel_surface

Array = npt.NDArray[Any]

FIRST_TASKS = 32  # blocks of rows that are dealt to threads, whatever their number
COARSER_TASKS = 16  # blocks of rows that are dealt to threads, whatever their number


@kernel(parallel=True)
def fill_first_level(picture: Picture, view: View, level: Level) -> None:
    """Fill the first level with the pixels nearest to the eye.

    Parameters
    ----------
    picture : Picture
        What is seen.
    view : View
        Its rays.
    level : Level
        The result; its number says how many pixels a texel covers.
    """
    rows = level.area.shape[0]
    for task in prange(FIRST_TASKS):
        fill_first_rows(picture, view, level, task * rows // FIRST_TASKS, (task + 1) * rows // FIRST_TASKS)


@kernel
def fill_first_rows(picture: Picture, view: View, level: Level, first: int, end: int) -> None:
    """Fill the rows `first` to `end` - 1 of the first level.

    Parameters
    ----------
    picture : Picture
        What is seen.
    view : View
        Its rays.
    level : Level
        The result.
    first, end : int
        Rows.
    """
    side, columns = 1 << level.number, level.area.shape[1]
    nearest = np.empty(view.width + side, picture.depth.dtype)
    row, chosen = np.empty(view.width + side, np.int32), np.empty(columns, np.int32)
    for i in range(first, end):
        choose_pixels(picture.depth, i, side, nearest, row, chosen)
        for j in range(np.uint64(columns)):
            column = np.uint64(chosen[j])
            row[j] = row[column]  # the chosen column is never one before
        _take_pixel(picture, i, row, chosen, level)
        _place(view, i, row, chosen, level)


@kernel
def _take_pixel(picture: Picture, i: int, row: Array, column: Array, level: Level) -> None:
    """Copy what the chosen pixels show."""
    depth, normal, albedo, direct = picture.depth, picture.normal, picture.albedo, picture.direct
    to_depth, to_pixel, to_normal, to_radiance = level.depth, level.pixel, level.normal, level.radiance
    real, width = depth.dtype.type, depth.shape[1]
    zero, pi = real(0.0), real(math.pi)
    for j in range(np.uint64(to_depth.shape[1])):
        r, c = np.uint64(row[j]), np.uint64(column[j])
        seen = depth[r, c] < np.inf
        to_depth[i, j] = depth[r, c]
        to_pixel[i, j] = row[j] * width + column[j] if seen else -1
        for axis in range(3):
            to_normal[axis, i, j] = normal[axis, r, c] if seen else zero
        for axis in range(3):
            to_radiance[axis, i, j] = albedo[axis, r, c] * direct[axis, r, c] / pi if seen else zero


@kernel
def _place(view: View, i: int, row: Array, column: Array, level: Level) -> None:
    """Find where the texels' surfaces are and how much of them they stand for."""
    height, width, side = view.height, view.width, 1 << level.number
    depth, normal, position, area = level.depth, level.normal, level.position, level.area
    (ax, ay, az), (dx, dy, dz), (fx, fy, fz) = _three(view.across), _three(view.down), _three(view.ahead)
    rows, pixel_area, at = min(side, height - i * side), view.pixel_area, np.uint64(i)
    for j in range(np.uint64(area.shape[1])):
        x, y = centre(column[j], width), centre(row[j], height)
        z = np.float64(depth[at, j])
        rx, ry, rz = (fx + y * dx) + x * ax, (fy + y * dy) + x * ay, (fz + y * dz) + x * az
        facing = -normal[0, at, j] * rx - normal[1, at, j] * ry - normal[2, at, j] * rz
        seen = z < np.inf
        position[0, at, j] = z * rx if seen else 0.0
        position[1, at, j] = z * ry if seen else 0.0
        position[2, at, j] = z * rz if seen else 0.0
        area[at, j] = rows * side * pixel_surface(z, facing, pixel_area)
    last = area.shape[1] - 1
    area[i, last] = area[i, last] / side * (width - last * side)


@kernel
def _three(vector: Array) -> tuple[float, float, float]:
    """Return a vector as numbers, which stores to arrays cannot change."""
    return vector[0], vector[1], vector[2]


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
    for task in prange(COARSER_TASKS):
        fill_coarser_rows(fine, height, width, level, task * rows // COARSER_TASKS, (task + 1) * rows // COARSER_TASKS)


@kernel
def fill_coarser_rows(fine: Level, height: int, width: int, level: Level, first: int, end: int) -> None:
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
        _take_texel(fine, i, place[0], chosen, level)
        _enlarge(fine, i, place[0], chosen, height, width, level)


@kernel
def _take_texel(fine: Level, i: int, row: Array, column: Array, level: Level) -> None:
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
