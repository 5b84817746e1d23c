"""Averaged texels, where otherwise the closest pixel alone stands for all that a texel covers.

"average": position, normal, depth and radiance are means weighted by surface area, the area is the sum; so the flux
that texels send, the sum of radiance times area, is that of the pixels. "closest_average": radiance alone is a mean,
over the pixels with a surface.

A row of weighted values is one line for each quantity; neighbours are added pairwise, so that a mirrored picture has
mirrored sums.
"""

import math

import numpy as np

from refgi.jit import kernel, prange
from refgi.sssil.pyramid.view import Level, Picture, View, centre, pixel_surface
from refgi.types import Array

# lines: weight; weight times radiance, depth, position, normal
RADIANCE, DEPTH, POSITION, NORMAL, LINES = 1, 4, 5, 8, 11
TASKS = 16  # blocks of rows that threads take, whatever their number


@kernel(parallel=True)
def average_pixels(picture: Picture, view: View, by_surface: bool, level: Level, weight: Array) -> None:
    """Put means of pixels into the first level, which holds the closest ones.

    `by_surface`: area weighs and every quantity is a mean; else pixels count equally and radiance alone is one.
    `weight` (h, w) is filled with the sum of weights, m^2 or pixels.
    """
    rows = level.area.shape[0]
    for task in prange(TASKS):
        _average_pixels(picture, view, by_surface, level, weight, task * rows // TASKS, (task + 1) * rows // TASKS)


@kernel(parallel=True)
def average_texels(fine: Level, fine_weight: Array, by_surface: bool, level: Level, weight: Array) -> None:
    """Put means of a finer level into the next coarser one, which holds the closest texels; weights likewise."""
    rows = level.area.shape[0]
    for task in prange(TASKS):
        _average_texels(fine, fine_weight, by_surface, level, weight, task * rows // TASKS,
                        (task + 1) * rows // TASKS)


@kernel
def _average_pixels(
    picture: Picture, view: View, by_surface: bool, level: Level, weight: Array, first: int, end: int
) -> None:
    side, kinds = 1 << level.number, LINES if by_surface else DEPTH
    lines = np.zeros((kinds, view.width + side), weight.dtype)
    sums = np.empty((kinds, level.area.shape[1]), weight.dtype)
    for i in range(first, end):
        _clear(sums)
        for row in range(i * side, min(i * side + side, view.height)):
            _weigh_pixels(picture, view, row, by_surface, lines)
            _add(lines, view.width, level.number, sums)
        _store(sums, i, by_surface, level, weight)


@kernel
def _average_texels(
    fine: Level, fine_weight: Array, by_surface: bool, level: Level, weight: Array, first: int, end: int
) -> None:
    columns, kinds = fine.area.shape[1], LINES if by_surface else DEPTH
    lines = np.zeros((kinds, columns + 2), weight.dtype)
    sums = np.empty((kinds, level.area.shape[1]), weight.dtype)
    for i in range(first, end):
        _clear(sums)
        for row in range(2 * i, min(2 * i + 2, fine.area.shape[0])):
            _weigh_texels(fine, fine_weight, row, by_surface, lines)
            _add(lines, columns, 1, sums)
        _store(sums, i, by_surface, level, weight)


@kernel
def _weigh_pixels(picture: Picture, view: View, row: int, by_surface: bool, lines: Array) -> None:
    depth, normal, albedo, direct = picture.depth, picture.normal, picture.albedo, picture.direct
    across, down, ahead = view.across, view.down, view.ahead
    real = lines.dtype.type
    y = centre(row, view.height)
    for c in range(view.width):
        covered = depth[row, c] < np.inf
        z, x = (depth[row, c] if covered else real(0.0)), centre(c, view.width)
        rx, ry, rz = (ahead[0] + y * down[0] + x * across[0], ahead[1] + y * down[1] + x * across[1],
                      ahead[2] + y * down[2] + x * across[2])
        facing = -(normal[0, row, c] * rx + normal[1, row, c] * ry + normal[2, row, c] * rz)
        surface = real(pixel_surface(np.float64(depth[row, c]), facing, view.pixel_area))
        weight = surface if by_surface else (real(1.0) if covered else real(0.0))
        lines[0, c] = weight
        for k in range(3):
            lines[RADIANCE + k, c] = weight * (albedo[k, row, c] * direct[k, row, c] / real(math.pi))
        if by_surface:
            lines[DEPTH, c] = weight * z
            lines[POSITION, c], lines[POSITION + 1, c], lines[POSITION + 2, c] = (
                weight * real(z * rx), weight * real(z * ry), weight * real(z * rz))
            for k in range(3):
                lines[NORMAL + k, c] = weight * normal[k, row, c]


@kernel
def _weigh_texels(fine: Level, fine_weight: Array, row: int, by_surface: bool, lines: Array) -> None:
    depth, position, normal, radiance = fine.depth, fine.position, fine.normal, fine.radiance
    for c in range(fine.area.shape[1]):
        weight = fine_weight[row, c]
        lines[0, c] = weight
        for k in range(3):
            lines[RADIANCE + k, c] = weight * radiance[k, row, c]
        if by_surface:
            lines[DEPTH, c] = weight * (depth[row, c] if weight > 0.0 else weight)
            for k in range(3):
                lines[POSITION + k, c] = weight * position[k, row, c]
                lines[NORMAL + k, c] = weight * normal[k, row, c]


@kernel
def _clear(sums: Array) -> None:
    for line in range(sums.shape[0]):
        for j in range(sums.shape[1]):
            sums[line, j] = 0.0


@kernel
def _add(lines: Array, count: int, times: int, sums: Array) -> None:
    """Add neighbours to each other `times` times, then all to the sums."""
    for line in range(lines.shape[0]):
        left = count
        for _ in range(times):
            lines[line, left] = 0.0
            left = (left + 1) // 2
            for j in range(left):
                lines[line, j] = lines[line, 2 * j] + lines[line, 2 * j + 1]
        for j in range(left):
            sums[line, j] += lines[line, j]


@kernel
def _store(sums: Array, i: int, by_surface: bool, level: Level, weight: Array) -> None:
    one, zero = weight.dtype.type(1.0), weight.dtype.type(0.0)
    for j in range(sums.shape[1]):
        weight[i, j] = sums[0, j]
        if sums[0, j] > zero:  # else the closest pixel's values stay
            share = one / sums[0, j]
            for k in range(3):
                level.radiance[k, i, j] = sums[RADIANCE + k, j] * share
            if by_surface:
                level.depth[i, j] = sums[DEPTH, j] * share
                nx, ny, nz = sums[NORMAL, j], sums[NORMAL + 1, j], sums[NORMAL + 2, j]
                length = math.sqrt(nx * nx + ny * ny + nz * nz)
                for k in range(3):
                    level.position[k, i, j] = sums[POSITION + k, j] * share
                    level.normal[k, i, j] = (sums[NORMAL + k, j] / length if length > zero
                                             else level.normal[k, i, j])
