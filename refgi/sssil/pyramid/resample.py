"""Senders that keep the light: a coarse texel stands where one of four does, drawn in proportion to its flux.

A drawn texel sends the flux of all, sum of radiance times area. The chance of each is its share of that flux, the mean
of red, green and blue, so that every sum that is linear in flux (Eq. 3) has the expectation of the sum over pixels:
resampled importance sampling of one out of four. Receivers are the closest texels still (Sec. 4).

Candidates are in the order of rows. The last one that sends, of those before which less than the share u of the flux is
sent, is drawn.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.sampling import hash_bits
from refgi.sssil.crown.points import TO_UNIT, level_key, pixel_key, row_key
from refgi.sssil.pyramid.view import Level, Picture, View, centre, pixel_surface

Array = npt.NDArray[Any]

STREAM = np.uint32(0x165667B1)  # keeps draws apart from the shifts of samples, which have the same keys
TASKS = 16  # blocks of rows that threads take, whatever their number


@kernel(parallel=True)
def draw_pixels(picture: Picture, view: View, seed: int, closest: Level, drawn: Level) -> None:
    """Fill the first level of senders, whose texels cover 2^k x 2^k pixels; as `closest` where none sends."""
    rows = drawn.area.shape[0]
    for task in prange(TASKS):
        _draw_from_pixels(picture, view, seed, closest, drawn, task * rows // TASKS, (task + 1) * rows // TASKS)


@kernel(parallel=True)
def draw_texels(fine: Level, seed: int, closest: Level, drawn: Level) -> None:
    """Fill a coarser level of senders from a finer one; as `closest` where none sends."""
    rows = drawn.area.shape[0]
    for task in prange(TASKS):
        _draw_from_texels(fine, seed, closest, drawn, task * rows // TASKS, (task + 1) * rows // TASKS)


@kernel
def _draw_from_pixels(
    picture: Picture, view: View, seed: int, closest: Level, drawn: Level, first: int, end: int
) -> None:
    side, real = 1 << drawn.number, drawn.area.dtype.type
    area, flux, light, place = _scratch(view.width + side, side, drawn)
    for i in range(first, end):
        light[:] = real(0.0)
        count = min(side, view.height - i * side)
        for r in range(count):
            _weigh_pixels(picture, view, i * side + r, area[r], flux[r], light)
        _draw(area, flux, light, count, side, seed, i, place, drawn)
        for j in range(drawn.area.shape[1]):
            if place[j] < 0:
                _copy(closest, i, j, i, j, drawn)
                continue
            row, column = i * side + place[j] // side, j * side + place[j] % side
            z, x, y = picture.depth[row, column], centre(column, view.width), centre(row, view.height)
            for axis in range(3):
                ray = (view.ahead[axis] + y * view.down[axis]) + x * view.across[axis]
                drawn.position[axis, i, j] = np.float64(z) * ray
                drawn.normal[axis, i, j] = picture.normal[axis, row, column]
            drawn.pixel[i, j] = row * view.width + column


@kernel
def _draw_from_texels(fine: Level, seed: int, closest: Level, drawn: Level, first: int, end: int) -> None:
    real = drawn.area.dtype.type
    rows, columns = fine.area.shape
    area, flux, light, place = _scratch(columns + 2, 2, drawn)
    for i in range(first, end):
        light[:] = real(0.0)
        count = min(2, rows - 2 * i)
        for r in range(count):
            _weigh_texels(fine, 2 * i + r, area[r], flux[r], light)
        _draw(area, flux, light, count, 2, seed, i, place, drawn)
        for j in range(drawn.area.shape[1]):
            if place[j] < 0:
                _copy(closest, i, j, i, j, drawn)
            else:
                _copy(fine, 2 * i + place[j] // 2, 2 * j + place[j] % 2, i, j, drawn)


@kernel
def _scratch(width: int, side: int, drawn: Level) -> tuple[Array, Array, Array, Array]:
    """Return lines for area and flux of candidates, and for flux of each channel; and for what is drawn."""
    dtype = drawn.area.dtype
    return (np.zeros((side, width), dtype), np.zeros((side, width), dtype), np.zeros((3, width), dtype),
            np.empty(drawn.area.shape[1], np.int64))


@kernel
def _weigh_pixels(picture: Picture, view: View, row: int, area: Array, flux: Array, light: Array) -> None:
    """Write area and flux of a row of pixels, and add the flux of each channel to `light`."""
    depth, normal, albedo, direct = picture.depth, picture.normal, picture.albedo, picture.direct
    across, down, ahead = view.across, view.down, view.ahead
    real = area.dtype.type
    y = centre(row, view.height)
    for c in range(view.width):
        x = centre(c, view.width)
        facing = -(normal[0, row, c] * (ahead[0] + y * down[0] + x * across[0])
                   + normal[1, row, c] * (ahead[1] + y * down[1] + x * across[1])
                   + normal[2, row, c] * (ahead[2] + y * down[2] + x * across[2]))
        area[c] = real(pixel_surface(np.float64(depth[row, c]), facing, view.pixel_area))
        share = area[c] / real(math.pi)
        red, green, blue = (share * (albedo[0, row, c] * direct[0, row, c]),
                            share * (albedo[1, row, c] * direct[1, row, c]),
                            share * (albedo[2, row, c] * direct[2, row, c]))
        light[0, c], light[1, c], light[2, c] = light[0, c] + red, light[1, c] + green, light[2, c] + blue
        flux[c] = red + green + blue


@kernel
def _weigh_texels(fine: Level, row: int, area: Array, flux: Array, light: Array) -> None:
    """Write area and flux of a row of texels, and add the flux of each channel to `light`."""
    radiance = fine.radiance
    for c in range(fine.area.shape[1]):
        area[c] = fine.area[row, c]
        red, green, blue = area[c] * radiance[0, row, c], area[c] * radiance[1, row, c], area[c] * radiance[2, row, c]
        light[0, c], light[1, c], light[2, c] = light[0, c] + red, light[1, c] + green, light[2, c] + blue
        flux[c] = red + green + blue


@kernel
def _draw(
    area: Array, flux: Array, light: Array, rows: int, side: int, seed: int, i: int, place: Array, drawn: Level
) -> None:
    """Draw one of `rows` x `side` candidates for each texel of row i: its place among them, -1 where none sends.

    Area and radiance of the texels are filled: their product is the flux of all candidates.
    """
    real = area.dtype.type
    key = row_key(level_key(seed, drawn.number), i)
    for j in range(drawn.area.shape[1]):
        surface, total = real(0.0), real(0.0)
        for r in range(rows):
            for c in range(j * side, j * side + side):
                surface += area[r, c]
                total += flux[r, c]
        limit = real(hash_bits(pixel_key(key, j) ^ STREAM) * TO_UNIT) * total
        before, place[j] = real(0.0), -1
        for r in range(rows):
            for c in range(side):
                sent = flux[r, j * side + c]
                if sent > real(0.0) and before <= limit:
                    place[j] = r * side + c
                before += sent
        drawn.area[i, j] = surface
        for channel in range(3):
            sent = real(0.0)
            for c in range(j * side, j * side + side):
                sent += light[channel, c]
            drawn.radiance[channel, i, j] = sent / surface if surface > real(0.0) else real(0.0)


@kernel
def _copy(source: Level, row: int, column: int, i: int, j: int, drawn: Level) -> None:
    """Copy the surface point of a texel."""
    for axis in range(3):
        drawn.position[axis, i, j] = source.position[axis, row, column]
        drawn.normal[axis, i, j] = source.normal[axis, row, column]
    drawn.pixel[i, j] = source.pixel[row, column]
