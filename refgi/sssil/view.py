"""Mip levels as arrays, the view rays of pixels, sample area (HSS Sec. 3.1, Eq. 2; Sec. 4), and averaged texels.

``ds = z^2 4 tan(f_h / 2) tan(f_v / 2) dP / (W H) cos(alpha) / cos(beta)``; for the ray d of length 1 along the view
direction the ratio of the cosines is 1 / -n.d. At silhouettes one below a millionth, rounding, counts as that. The
paper calls beta the angle at the "receiving" surface; it is the sample's own. Averages weigh by area, so that the flux
of texels is that of pixels, or radiance alone by pixels; neighbours are added pairwise: mirrored pictures, mirrored
sums.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.rsm.raster.projection import Projection
from refgi.types import Array

ROUNDING = 1e-12  # of a tangent: 90 degrees in radians are not quite 90 degrees
GRAZING = 1e-6  # least ratio of the cosines: below, it is rounding of a float32 normal


class Level(NamedTuple):
    """One mip level of what a camera sees, 1 / 2^number of full resolution; without a surface all is 0, `pixel` -1.

    Positions are relative to the eye, along the axes of the world: a sum over pairs knows differences and scalar
    products alone, so the view is not rotated. At level k texel (row, column) covers the pixels from 2^k row and
    2^k column on, as many of its 2^k x 2^k as the picture has.
    """

    number: int  # k: 0 is full resolution
    position: Array  # (3, h, w) from the eye, m
    depth: Array  # (h, w) along the view direction, m; inf where there is no surface
    normal: Array  # (3, h, w) unit vectors, on the visible side
    radiance: Array  # (3, h, w) diffusely reflected direct light, W/m^2/sr
    area: Array  # (h, w) surface that the texel stands for, m^2
    pixel: Array  # (h, w) int32 pixel of full resolution whose position and normal these are, row * width + column

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.area.shape[0], self.area.shape[1]


class Picture(NamedTuple):
    """G-buffer and direct light at full resolution, all of one dtype."""

    depth: Array  # (H, W) along the view direction, m; inf where there is no surface
    normal: Array  # (3, H, W) unit vectors on the visible side
    albedo: Array  # (3, H, W) diffuse reflectance
    direct: Array  # (3, H, W) direct irradiance, W/m^2


class View(NamedTuple):
    """A camera's picture of `height` x `width` pixels; vectors along the axes of the world.

    The ray through a point of the picture at (x, y) in [-1, 1]^2 is ``ahead + x across + y down``; its length along
    the view direction is 1, so that depth times ray is the point that is seen, from the eye.
    """

    height: int
    width: int
    across: Array  # (3,) float64: half the picture's width at depth 1, to the right
    down: Array  # (3,) float64: half its height
    ahead: Array  # (3,) float64 unit vector
    pixel_area: float  # of a pixel at depth 1, on a plane parallel to the picture


def view_of(projection: Projection, as_published: frozenset[str] = frozenset()) -> View:
    """Return a camera's view rays and the area of a pixel; "hss_tan_f": by fields of view as Eq. 3 prints them."""
    right, down, ahead = projection.frame[0]
    horizontal, vertical = (float(half) for half in projection.half)
    tangents = horizontal * vertical
    if "hss_tan_f" in as_published:
        for half in (horizontal, vertical):
            degrees = math.degrees(2 * math.atan(half))
            expect(half < 1.0 - ROUNDING, "as_published 'hss_tan_f'", "a field of view of less than 90 degrees",
                   f"{degrees:.5g}")
        # tan f = 2 t / (1 - t^2) with t = tan(f / 2)
        tangents *= 4 / ((1 - horizontal * horizontal) * (1 - vertical * vertical))
    pixel_area = 4 * tangents / (projection.width * projection.height)
    return View(projection.height, projection.width, right * horizontal, down * vertical, ahead, pixel_area)


@kernel
def centre(index: Any, count: int) -> float:
    """Return a pixel's centre between the picture's edges, -1 to 1; the mirrored pixel has exactly its negative."""
    return float((2 * index + 1 - count) / count)


@kernel
def pixel_surface(depth: float, facing: float, pixel_area: float) -> float:
    """Return the surface that a pixel shows, ds of Eq. 2 with dP = 1, m^2; `facing` is -n.d; 0 where it is not."""
    covered = (depth < np.inf) & (facing > 0.0)
    z = depth if covered else 0.0
    # Eq. (2)
    return float(z * z * pixel_area / max(facing, GRAZING))


@kernel
def three(vector: Array) -> tuple[float, float, float]:
    """Return a vector as numbers, which stores to arrays cannot change."""
    return vector[0], vector[1], vector[2]


# lines: weight; weight times radiance, depth, position, normal
RADIANCE, DEPTH, POSITION, NORMAL, LINES = 1, 4, 5, 8, 11
TASKS = 16  # blocks of rows that threads take, whatever their number


@kernel(parallel=True)
def average_pixels(picture: Picture, view: View, by_surface: bool, level: Level, weight: Array) -> None:
    """Put means of pixels into the first level, of all quantities `by_surface`, else radiance; weights' sums."""
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
