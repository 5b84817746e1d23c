"""The first level, made from the picture in one pass: position, normal, radiance and sample area of its texels."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.sssil.level import Level
from refgi.sssil.pyramid.closest import choose_pixels
from refgi.sssil.pyramid.picture import Picture
from refgi.sssil.pyramid.sample_area import pixel_surface
from refgi.sssil.pyramid.view import View, centre

Array = npt.NDArray[Any]

TASKS = 32  # blocks of rows that are dealt to threads, whatever their number


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
    for task in prange(TASKS):
        fill_rows(picture, view, level, task * rows // TASKS, (task + 1) * rows // TASKS)


@kernel
def fill_rows(picture: Picture, view: View, level: Level, first: int, end: int) -> None:
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
        _take(picture, i, row, chosen, level)
        _place(view, i, row, chosen, level)


@kernel
def _take(picture: Picture, i: int, row: Array, column: Array, level: Level) -> None:
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
