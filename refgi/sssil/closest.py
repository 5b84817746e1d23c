"""Levels filled with the surfaces nearest to the eye (Sec. 4): from pixels, then from four texels each.

Of equally near ones it is that nearest to the picture's vertical centre line, then the upper, then the left: mirrored
pictures have mirrored levels, made at once or level by level. The best of each column is found first, as SIMD lanes.
"""

import math
from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.sssil.view import Level, Picture, View, centre, pixel_surface, three
from refgi.types import Array

NO_PIXEL = 2**31 - 1  # beyond the picture's edge


@kernel
def choose_pixels(depth: Array, i: int, side: int, nearest: Array, row: Array, chosen: Array) -> None:
    """Choose the nearest pixel for each texel of row i, `chosen` (w,) columns; scratch of (W + side,)."""
    height, width = depth.shape
    first, columns = np.int32(i * side), np.uint64(width)
    for c in range(columns):
        nearest[c] = depth[first, c]
        row[c] = first
    for r in range(first + 1, min(first + side, height)):
        for c in range(columns):
            lower = depth[r, c] < nearest[c]
            nearest[c] = depth[r, c] if lower else nearest[c]
            row[c] = np.int32(r) if lower else row[c]
    for c in range(width, width + side):
        nearest[c] = np.inf
    before_centre = width // (2 * side)
    past_centre = (width + 2 * side - 1) // (2 * side)
    _choose_columns(nearest, side, 0, before_centre, side - 1, -1, chosen)
    _choose_columns(nearest, side, past_centre, len(chosen), 0, 1, chosen)
    for j in range(before_centre, past_centre):
        chosen[j] = _best_across_centre(nearest, row, j * side, min(j * side + side, width), width)


@kernel
def _choose_columns(nearest: Array, side: int, first: int, end: int, start: int, step: int, chosen: Array) -> None:
    """Choose from column `start` of each texel on, which is next to the centre line, away from it."""
    if side == 2:  # a constant stride is loaded in SIMD lanes
        for k in range(np.uint64(end - first)):
            j = k + np.uint64(first)
            left = np.uint64(2) * j
            right = left + np.uint64(1)
            is_right = (nearest[right] <= nearest[left]) if step < 0 else (nearest[right] < nearest[left])
            chosen[j] = np.int32(left) + (np.int32(1) if is_right else np.int32(0))
        return
    for texel in range(first, end):
        best = texel * side + start
        for away in range(1, side):
            c = texel * side + start + away * step
            best = c if nearest[c] < nearest[best] else best
        chosen[texel] = best


@kernel
def _best_across_centre(nearest: Array, row: Array, first: int, end: int, width: int) -> int:
    """Return the best column of a texel that the centre line crosses."""
    best = first
    for c in range(first + 1, end):
        if is_nearer(nearest[c], abs(2 * c + 1 - width), row[c] * width + c,
                  nearest[best], abs(2 * best + 1 - width), row[best] * width + best):
            best = c
    return best


@kernel
def choose_texels(
    depth: Array, pixel: Array, i: int, width: int, nearest: Array, best_texel: Array, chosen: Array
) -> None:
    """Choose one of four texels of the finer level, (h, w), for each texel of row i, `chosen` columns.

    Scratch: `nearest` (w + 1,), least depth of each column; `best_texel` (3, w + 1), its row, its pixel's distance from
    the centre line, and that pixel. `width` is the picture's.
    """
    rows, columns = depth.shape
    row, off_centre, best = best_texel[0], best_texel[1], best_texel[2]
    upper, lower = np.int32(2 * i), np.int32(min(2 * i + 1, rows - 1))
    for c in range(np.uint64(columns)):
        above, below = pixel[upper, c], pixel[lower, c]
        from_centre, other = _off_centre(above, width), _off_centre(below, width)
        is_lower = is_nearer(depth[lower, c], other, below, depth[upper, c], from_centre, above)
        nearest[c] = depth[lower, c] if is_lower else depth[upper, c]
        row[c] = lower if is_lower else upper
        off_centre[c] = other if is_lower else from_centre
        best[c] = below if is_lower else above
    nearest[columns], off_centre[columns], best[columns] = np.inf, NO_PIXEL, NO_PIXEL
    for j in range(np.uint64(len(chosen))):
        left = np.uint64(2) * j
        right = left + np.uint64(1)
        is_right = is_nearer(nearest[right], off_centre[right], best[right],
                             nearest[left], off_centre[left], best[left])
        chosen[j] = np.int32(left) + (np.int32(1) if is_right else np.int32(0))


@kernel
def _off_centre(pixel: Any, width: int) -> Any:
    """Return how many half pixels a pixel lies beside the centre line; a division of integers has no SIMD form."""
    row = np.floor((pixel + 0.5) / width)
    return np.int32(abs(2.0 * (pixel - row * width) + 1.0 - width))


@kernel
def is_nearer(
    depth: Any, off_centre: int, pixel: int, other_depth: Any, other_off_centre: int, other_pixel: int
) -> bool:
    """Return whether a pixel goes before another, never both: by depth, distance from the centre line, place."""
    earlier = (off_centre < other_off_centre) | ((off_centre == other_off_centre) & (pixel < other_pixel))
    return bool((depth < other_depth) | ((depth == other_depth) & earlier))


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
