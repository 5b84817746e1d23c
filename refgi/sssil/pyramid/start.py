"""The first level, made from the picture in one pass: position, normal, radiance and sample area of its texels."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.sssil.level import Level
from refgi.sssil.pyramid.closest import choose_among_pixels
from refgi.sssil.pyramid.sample_area import pixel_surface
from refgi.sssil.pyramid.view import View, centre

Array = npt.NDArray[Any]

TASKS = 32  # blocks of rows that are dealt to threads, whatever their number


class Picture(NamedTuple):
    """What the camera sees, at full resolution."""

    depth: Array  # (H, W) m, inf where no surface is seen
    normal: Array  # (3, H, W)
    albedo: Array  # (3, H, W)
    direct: Array  # (3, H, W) direct irradiance, W/m^2


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
    side = 1 << level.number
    room_depth = np.empty((2, side, view.width + side), picture.depth.dtype)
    room_place = np.empty((2, 2, side, view.width + side), np.int32)
    for i in range(first, end):
        choose_among_pixels(picture.depth, i, level.number, room_depth, room_place)
        _take(picture, view, i, room_depth[0, 0], room_place[0, 1, 0], level)


@kernel
def _take(picture: Picture, view: View, i: int, depth: Array, pixel: Array, level: Level) -> None:
    real = level.area.dtype.type
    height, width, side = view.height, view.width, 1 << level.number
    rows = min(side, height - i * side)
    for j in range(level.area.shape[1]):
        seen = depth[j] < np.inf
        level.depth[i, j] = depth[j]
        level.pixel[i, j] = pixel[j] if seen else -1
        row, c = pixel[j] // width, pixel[j] % width
        x, y = centre(c, width), centre(row, height)
        z = float(depth[j]) if seen else 0.0
        facing = 0.0
        for axis in range(3):
            ray = (view.ahead[axis] + y * view.down[axis]) + x * view.across[axis]
            normal = picture.normal[axis, row, c] if seen else real(0.0)
            facing -= normal * ray
            level.position[axis, i, j] = z * ray
            level.normal[axis, i, j] = normal
            reflected = picture.albedo[axis, row, c] * picture.direct[axis, row, c] * real(1 / math.pi)
            level.radiance[axis, i, j] = reflected if seen else real(0.0)
        count = rows * min(side, width - j * side)
        level.area[i, j] = count * pixel_surface(float(depth[j]), facing, view.pixel_area)
