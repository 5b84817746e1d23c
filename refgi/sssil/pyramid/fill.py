"""Levels filled with the nearest surfaces (Sec. 4): the first from pixels, further ones from four texels each.

The first level takes position, normal, radiance and sample area (Eq. 2) in one pass over the picture.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.sssil.pyramid.closest import choose_pixels, choose_texels
from refgi.sssil.pyramid.view import Level, Picture, View, centre, pixel_surface, three

Array = npt.NDArray[Any]

FIRST_TASKS = 32  # blocks of rows that threads take, whatever their number
COARSER_TASKS = 16  # blocks of rows that threads take, whatever their number


@kernel(parallel=True)
def fill_first_level(picture: Picture, view: View, level: Level) -> None:
    """Fill the first level, whose texels cover 2^k x 2^k pixels, with the pixels nearest to the eye."""
    rows = level.area.shape[0]
    for task in prange(FIRST_TASKS):
        _fill_first_rows(picture, view, level, task * rows // FIRST_TASKS, (task + 1) * rows // FIRST_TASKS)


@kernel
def _fill_first_rows(picture: Picture, view: View, level: Level, first: int, end: int) -> None:
    """Fill the rows `first` to `end` - 1 of the first level."""
    side, columns = 1 << level.number, level.area.shape[1]
    nearest = np.empty(view.width + side, picture.depth.dtype)
    row, chosen = np.empty(view.width + side, np.int32), np.empty(columns, np.int32)
    for i in range(first, end):
        choose_pixels(picture.depth, i, side, nearest, row, chosen)
        for j in range(np.uint64(columns)):
            column = np.uint64(chosen[j])
            row[j] = row[column]  # the chosen column is never one before
        _copy_pixel(picture, i, row, chosen, level)
        _locate(view, i, row, chosen, level)


@kernel
def _copy_pixel(picture: Picture, i: int, row: Array, column: Array, level: Level) -> None:
    """Copy depth, normal and diffusely reflected radiance of the chosen pixels."""
    depth, normal, albedo, direct = picture.depth, picture.normal, picture.albedo, picture.direct
    to_depth, to_pixel, to_normal, to_radiance = level.depth, level.pixel, level.normal, level.radiance
    real, width = depth.dtype.type, depth.shape[1]
    zero, pi = real(0.0), real(math.pi)
    for j in range(np.uint64(to_depth.shape[1])):
        r, c = np.uint64(row[j]), np.uint64(column[j])
        covered = depth[r, c] < np.inf
        to_depth[i, j] = depth[r, c]
        to_pixel[i, j] = row[j] * width + column[j] if covered else -1
        for axis in range(3):
            to_normal[axis, i, j] = normal[axis, r, c] if covered else zero
        for axis in range(3):
            to_radiance[axis, i, j] = albedo[axis, r, c] * direct[axis, r, c] / pi if covered else zero


@kernel
def _locate(view: View, i: int, row: Array, column: Array, level: Level) -> None:
    """Find the positions of texels and the surface areas that they stand for."""
    height, width, side = view.height, view.width, 1 << level.number
    depth, normal, position, area = level.depth, level.normal, level.position, level.area
    (ax, ay, az), (dx, dy, dz), (fx, fy, fz) = three(view.across), three(view.down), three(view.ahead)
    rows, pixel_area, at = min(side, height - i * side), view.pixel_area, np.uint64(i)
    for j in range(np.uint64(area.shape[1])):
        x, y = centre(column[j], width), centre(row[j], height)
        z = np.float64(depth[at, j])
        rx, ry, rz = (fx + y * dx) + x * ax, (fy + y * dy) + x * ay, (fz + y * dz) + x * az
        facing = -normal[0, at, j] * rx - normal[1, at, j] * ry - normal[2, at, j] * rz
        covered = z < np.inf
        position[0, at, j] = z * rx if covered else 0.0
        position[1, at, j] = z * ry if covered else 0.0
        position[2, at, j] = z * rz if covered else 0.0
        area[at, j] = rows * side * pixel_surface(z, facing, pixel_area)
    last = area.shape[1] - 1
    area[i, last] = area[i, last] / side * (width - last * side)


@kernel(parallel=True)
def fill_coarser_level(fine: Level, height: int, width: int, level: Level) -> None:
    """Fill a level with the finer one's texels nearest to the eye; `height` and `width` are of the picture."""
    rows = level.area.shape[0]
    for task in prange(COARSER_TASKS):
        _fill_coarser_rows(fine, height, width, level, task * rows // COARSER_TASKS, (task + 1) * rows // COARSER_TASKS)


@kernel
def _fill_coarser_rows(fine: Level, height: int, width: int, level: Level, first: int, end: int) -> None:
    """Fill the rows `first` to `end` - 1 of a coarser level."""
    columns = fine.area.shape[1]
    nearest, best_texel = np.empty(columns + 1, fine.depth.dtype), np.empty((3, columns + 1), np.int32)
    chosen = np.empty(level.area.shape[1], np.int32)
    for i in range(first, end):
        choose_texels(fine.depth, fine.pixel, i, width, nearest, best_texel, chosen)
        _copy_texel(fine, i, best_texel[0], chosen, level)
        _scale_area(fine, i, best_texel[0], chosen, height, width, level)


@kernel
def _copy_texel(fine: Level, i: int, row: Array, column: Array, level: Level) -> None:
    """Copy all planes of the chosen texels."""
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
def _scale_area(fine: Level, i: int, row: Array, column: Array, height: int, width: int, level: Level) -> None:
    """Scale areas from the pixels of the finer texel to those of the coarser one."""
    area, real = level.area, level.area.dtype.type
    last, last_row = area.shape[1] - 1, i == area.shape[0] - 1
    for j in range(np.uint64(area.shape[1])):
        area[i, j] = real(4.0) * area[i, j]
    for j in range(0 if last_row else last, last + 1):  # cut by the picture's edge
        r, c = row[column[j]], column[j]
        pixels = _pixels_covered(level.number, i, j, height, width)
        area[i, j] = fine.area[r, c] * real(pixels / _pixels_covered(fine.number, r, c, height, width))


@kernel
def _pixels_covered(number: int, i: int, j: int, height: int, width: int) -> int:
    """Return how many pixels texel (i, j) of level `number` covers: 2^k x 2^k, cut at the picture's edge."""
    side = 1 << number
    return min(side, height - i * side) * min(side, width - j * side)
