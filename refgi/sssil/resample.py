"""Senders that keep the light: a coarse texel stands where one of four does, drawn in proportion to its flux.

It sends the flux of all. The chance of each is its share of that flux, the mean of red, green and blue, so that every
sum that is linear in flux (Eq. 3) has the expectation of the sum over pixels. Receivers are the closest texels still
(Sec. 4). Of candidates in the order of rows the last that sends with less than the share u before it is drawn.
"""

import math
from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.sampling import hash_bits
from refgi.sssil.pattern import TO_UNIT, level_key, pixel_key, row_key
from refgi.sssil.view import Level, Picture, View, centre, pixel_surface, three
from refgi.types import Array

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
        _copy_pixels(picture, view, i, side, place, closest, drawn)


@kernel
def _copy_pixels(picture: Picture, view: View, i: int, side: int, place: Array, closest: Level, drawn: Level) -> None:
    """Copy the surface points of the drawn pixels of row i."""
    depth, normal, to_position, to_normal = picture.depth, picture.normal, drawn.position, drawn.normal
    (ax, ay, az), (dx, dy, dz), (fx, fy, fz) = three(view.across), three(view.down), three(view.ahead)
    bits, height, width = drawn.number, view.height, view.width
    whole = _copy_of_four(picture, view, i, place, closest, drawn) if side == 2 and 2 * i + 1 < height else 0
    for j in range(whole, place.size):
        if place[j] < 0:
            _copy(closest, i, j, i, j, drawn)
            continue
        row, column = i * side + (place[j] >> bits), j * side + (place[j] & (side - 1))
        z, x, y = np.float64(depth[row, column]), centre(column, width), centre(row, height)
        to_position[0, i, j] = z * ((fx + y * dx) + x * ax)
        to_position[1, i, j] = z * ((fy + y * dy) + x * ay)
        to_position[2, i, j] = z * ((fz + y * dz) + x * az)
        for axis in range(3):
            to_normal[axis, i, j] = normal[axis, row, column]
        drawn.pixel[i, j] = row * width + column


@kernel
def _copy_of_four(picture: Picture, view: View, i: int, place: Array, closest: Level, drawn: Level) -> int:
    """Copy those of texels that cover 2 x 2 pixels, all four read for SIMD lanes; return how many there are."""
    (ax, ay, az), (dx, dy, dz), (fx, fy, fz) = three(view.across), three(view.down), three(view.ahead)
    depth, normal, position, pixel = picture.depth, picture.normal, drawn.position, drawn.pixel
    to_normal, first, second, row = drawn.normal, closest.position, closest.normal, np.uint64(i)
    above, height, width, one = np.uint64(2 * i), view.height, view.width, np.uint64(1)
    below, whole = above + one, width // 2
    for j in range(np.uint64(whole)):
        left, kept = j + j, place[j]
        right, drawn_one, is_lower, is_right = left + one, kept >= 0, kept >= 2, (kept & 1) == 1
        a, b, c, d = depth[above, left], depth[above, right], depth[below, left], depth[below, right]
        z = np.float64((d if is_right else c) if is_lower else (b if is_right else a))
        at_row, at_column = 2 * i + (1 if is_lower else 0), np.int64(left) + (1 if is_right else 0)
        x, y = centre(at_column, width), centre(at_row, height)
        rx, ry, rz = (fx + y * dx) + x * ax, (fy + y * dy) + x * ay, (fz + y * dz) + x * az
        position[0, row, j] = z * rx if drawn_one else np.float64(first[0, row, j])
        position[1, row, j] = z * ry if drawn_one else np.float64(first[1, row, j])
        position[2, row, j] = z * rz if drawn_one else np.float64(first[2, row, j])
        pixel[row, j] = at_row * width + at_column if drawn_one else closest.pixel[row, j]
    for axis in range(3):
        for j in range(np.uint64(whole)):
            left, kept = j + j, place[j]
            right = left + one
            a, b = normal[axis, above, left], normal[axis, above, right]
            c, d = normal[axis, below, left], normal[axis, below, right]
            upper, lower = b if (kept & 1) == 1 else a, d if (kept & 1) == 1 else c
            to_normal[axis, row, j] = (lower if kept >= 2 else upper) if kept >= 0 else second[axis, row, j]
    return whole


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
    (ax, ay, az), (dx, dy, dz), (fx, fy, fz) = three(view.across), three(view.down), three(view.ahead)
    real, width, pixel_area, r = area.dtype.type, view.width, view.pixel_area, np.uint64(row)
    y = centre(row, view.height)
    for c in range(np.uint64(width)):
        x = centre(np.int64(c), width)
        facing = -(normal[0, r, c] * (fx + y * dx + x * ax) + normal[1, r, c] * (fy + y * dy + x * ay)
                   + normal[2, r, c] * (fz + y * dz + x * az))
        area[c] = real(pixel_surface(np.float64(depth[r, c]), facing, pixel_area))
    pi = real(math.pi)
    for c in range(np.uint64(width)):
        share = area[c] / pi
        red, green, blue = (share * (albedo[0, r, c] * direct[0, r, c]), share * (albedo[1, r, c] * direct[1, r, c]),
                            share * (albedo[2, r, c] * direct[2, r, c]))
        light[0, c], light[1, c], light[2, c] = light[0, c] + red, light[1, c] + green, light[2, c] + blue
        flux[c] = red + green + blue


@kernel
def _weigh_texels(fine: Level, row: int, area: Array, flux: Array, light: Array) -> None:
    """Write area and flux of a row of texels, and add the flux of each channel to `light`."""
    radiance, of, r = fine.radiance, fine.area, np.uint64(row)
    for c in range(np.uint64(of.shape[1])):
        area[c] = of[r, c]
        red, green, blue = area[c] * radiance[0, r, c], area[c] * radiance[1, r, c], area[c] * radiance[2, r, c]
        light[0, c], light[1, c], light[2, c] = light[0, c] + red, light[1, c] + green, light[2, c] + blue
        flux[c] = red + green + blue


@kernel
def _draw(
    area: Array, flux: Array, light: Array, rows: int, side: int, seed: int, i: int, place: Array, drawn: Level
) -> None:
    """Draw one of `rows` x `side` candidates for each texel of row i: its place among them, -1 where none sends."""
    key = row_key(level_key(seed, drawn.number), i)
    if side == 2 and rows == 2:  # a constant stride is loaded in SIMD lanes
        _draw_of_four(area, flux, light, key, i, place, drawn)
        return
    real = area.dtype.type
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
def _draw_of_four(
    area: Array, flux: Array, light: Array, key: Any, i: int, place: Array, drawn: Level
) -> None:
    """Draw one of 2 x 2 candidates for each texel of row i, as `_draw` does."""
    real, row, one = area.dtype.type, np.uint64(i), np.uint64(1)
    zero, to_area, to_radiance = real(0.0), drawn.area, drawn.radiance
    for j in range(np.uint64(place.size)):
        left = j + j
        right = left + one
        a, b, c, d = flux[0, left], flux[0, right], flux[1, left], flux[1, right]
        limit = real(hash_bits(pixel_key(key, np.uint32(j)) ^ STREAM) * TO_UNIT) * (a + b + c + d)
        chosen = np.int64(0) if a > zero else np.int64(-1)
        chosen = np.int64(1) if (b > zero) & (a <= limit) else chosen
        chosen = np.int64(2) if (c > zero) & (a + b <= limit) else chosen
        place[j] = np.int64(3) if (d > zero) & (a + b + c <= limit) else chosen
    for j in range(np.uint64(place.size)):
        left = j + j
        right = left + one
        surface = area[0, left] + area[0, right] + area[1, left] + area[1, right]
        to_area[row, j] = surface
        for channel in range(3):
            mean = (light[channel, left] + light[channel, right]) / surface
            to_radiance[channel, row, j] = mean if surface > zero else zero


@kernel
def _copy(source: Level, row: int, column: int, i: int, j: int, drawn: Level) -> None:
    """Copy the surface point of a texel."""
    for axis in range(3):
        drawn.position[axis, i, j] = source.position[axis, row, column]
        drawn.normal[axis, i, j] = source.normal[axis, row, column]
    drawn.pixel[i, j] = source.pixel[row, column]
