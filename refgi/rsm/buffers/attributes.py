"""Attribute resolve, the second pass of rasterization: position, normal and albedo of each texel, in float64.

Every texel of every projection has a ray: an origin o and a direction d, where d reaches depth 1 (planar maps) or has
unit length (paraboloid). With v_i relative to o and N = (v1 - v0) x (v2 - v0) the hit is o + t d,
t = v0 . N / (d . N), and t is the depth itself. Positions therefore lie on the ray and on the plane to float64
rounding, before the cast to the buffer's type. Interpolated normals use barycentric coordinates
b_i = d . (v_j x v_k) / (d . N).
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.rsm.buffers.runs import (
    Rows,
    Runs,
    Surface,
    allocate_runs,
    cross,
    describe_runs,
    find_runs,
    image_ray,
    row_view,
    runs_at,
    towards,
)
from refgi.rsm.raster.projection import Projection

Array = npt.NDArray[Any]

STRIP = 8  # rows resolved at once: their runs stay in cache


class ChannelMask(NamedTuple):
    """Which channels a pass fills; the others' planes are empty."""

    depth: bool
    distance: bool
    position: bool
    normal: bool
    albedo: bool
    material_id: bool


class Planes(NamedTuple):
    """Where a pass writes, in the buffer's type."""

    depth: Array  # (H, W) m: axial in perspective and orthographic maps, else distance
    distance: Array  # (H, W) m: from the centre of projection; orthographic: the depth
    position: Array  # (3, H, W) m, world space
    normal: Array  # (3, H, W) unit vector on the visible side
    albedo: Array  # (3, H, W) diffuse reflectance
    material_id: Array  # (H, W) int32


@kernel(parallel=True)
def resolve(
    surface: Surface, projection: Projection, triangle_id: Array, channels: ChannelMask, planes: Planes, workers: int
) -> None:
    """Fill the planes of the chosen channels.

    `projection`: the maps that `triangle_id` was drawn on. `triangle_id` (H, W): triangle at each texel, -1 for none.
    `channels`: which planes to fill. `workers`: threads; strips of rows are assigned to them round-robin.
    """
    for worker in prange(workers):
        _resolve_rows(surface, projection, triangle_id, channels, planes, worker, workers)


@kernel
def _resolve_rows(
    surface: Surface, projection: Projection, triangle_id: Array, channels: ChannelMask, planes: Planes, first: int,
    step: int,
) -> None:
    """Fill every `step`-th strip of rows from strip `first` on.

    Triangles are looked up once a run of texels. The rest is the same arithmetic for all texels of a row, free of
    branches, in SIMD lanes. Strips, because each call with arrays costs atomic reference counts, which threads share.
    """
    height, width = triangle_id.shape
    runs = allocate_runs(STRIP, width)
    for top in range(first * STRIP, height, step * STRIP):
        rows = (top, min(top + STRIP, height))
        _fill_rows(surface, projection, find_runs(triangle_id, rows, runs), runs, rows, channels, planes)


@kernel
def resolve_at(
    surface: Surface, projection: Projection, triangle_id: Array, texel: Array, channels: ChannelMask, planes: Planes
) -> None:
    """Fill the planes of the chosen channels at some texels, with the bits that `resolve` gives there.

    `projection`: the maps that `triangle_id` was drawn on. `triangle_id` (H, W): triangle at each texel, -1 for none.
    `texel` (n,): texels of the flattened maps. `channels`: which planes to fill. `planes`: the result, n rows of one
    texel.
    """
    runs = allocate_runs(len(texel), 1)
    _fill_rows(surface, projection, runs_at(triangle_id, texel, runs), runs, (0, len(texel)), channels, planes)


@kernel
def _fill_rows(
    surface: Surface, projection: Projection, count: int, runs: Runs, rows: Rows, channels: ChannelMask, planes: Planes
) -> None:
    """Fill some rows of the planes; `count` is one past the last run."""
    describe_runs(surface, projection, count, runs)
    if channels.depth or channels.distance or channels.position:
        _intersect(projection, rows, runs, channels, planes)
    _write_constant(rows, runs, channels, planes)
    if len(surface.normals) > 0 and channels.normal:
        _interpolate(surface, projection, rows, runs, planes.normal)


@kernel
def _intersect(projection: Projection, rows: Rows, runs: Runs, channels: ChannelMask, planes: Planes) -> None:
    """Write t, the length of t d and the point o + t d of each texel: inf, inf and 0 without surface."""
    across, half, kind = 2.0 / projection.width, projection.half[0], projection.kind
    slot, fixed, width = runs.slot, runs.fixed, runs.slot.shape[1]
    line, hit = np.empty((6, width)), np.empty((4, width))
    for row in range(rows[0], rows[1]):
        y = row - rows[0]
        view, v = row_view(projection, runs.row[y])
        middle = runs.column[y] + 0.5
        for x in range(width):
            run = np.uint64(slot[y, x])
            line[0, x], line[1, x], line[2, x] = fixed[run, 0], fixed[run, 1], fixed[run, 2]
            line[3, x], line[4, x], line[5, x] = fixed[run, 3], fixed[run, 4], fixed[run, 5]
        for x in range(width):
            ox, oy, oz, dx, dy, dz = image_ray(kind, view, ((x + middle) * across - 1.0) * half, v)
            gx, gy, gz = line[3, x], line[4, x], line[5, x]
            facing = dx * gx + dy * gy + dz * gz
            t = ((line[0, x] - ox) * gx + (line[1, x] - oy) * gy + (line[2, x] - oz) * gz) / facing
            covered = slot[y, x] > 0
            hit[0, x] = t if covered else np.inf
            hit[1, x] = ox + t * dx if covered else 0.0
            hit[2, x] = oy + t * dy if covered else 0.0
            hit[3, x] = oz + t * dz if covered else 0.0
        if channels.distance:
            for x in range(width):
                _, _, _, dx, dy, dz = image_ray(kind, view, ((x + middle) * across - 1.0) * half, v)
                planes.distance[row, x] = hit[0, x] * math.sqrt(dx * dx + dy * dy + dz * dz)
        _store_hits(hit, row, channels, planes)


@kernel
def _store_hits(hit: Array, row: int, channels: ChannelMask, planes: Planes) -> None:
    """Round depths and points of a row to the buffer's type."""
    if channels.depth:
        for x in range(hit.shape[1]):
            planes.depth[row, x] = hit[0, x]
    if channels.position:
        for axis in range(3):
            for x in range(hit.shape[1]):
                planes.position[axis, row, x] = hit[1 + axis, x]


@kernel
def _write_constant(rows: Rows, runs: Runs, channels: ChannelMask, planes: Planes) -> None:
    """Write along each run what is the same all along it."""
    slot, fixed, corner = runs.slot, runs.fixed, runs.corner
    normal, albedo = planes.normal, planes.albedo
    for row in range(rows[0], rows[1]):
        y = row - rows[0]
        if channels.normal:
            for x in range(slot.shape[1]):
                run = np.uint64(slot[y, x])
                normal[0, row, x], normal[1, row, x], normal[2, row, x] = fixed[run, 6], fixed[run, 7], fixed[run, 8]
        if channels.albedo:
            for x in range(slot.shape[1]):
                run = np.uint64(slot[y, x])
                albedo[0, row, x], albedo[1, row, x], albedo[2, row, x] = fixed[run, 9], fixed[run, 10], fixed[run, 11]
        if channels.material_id:
            for x in range(slot.shape[1]):
                planes.material_id[row, x] = corner[np.uint64(slot[y, x]), 3]


@kernel
def _barycentric(ray: Any, ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> Any:
    """Return d . (a x b), relative to the ray's origin: a barycentric coordinate up to the common factor d . N."""
    ox, oy, oz, dx, dy, dz = ray
    cx, cy, cz = cross(ax - ox, ay - oy, az - oz, bx - ox, by - oy, bz - oz)
    return dx * cx + dy * cy + dz * cz


@kernel
def _interpolate(surface: Surface, projection: Projection, rows: Rows, runs: Runs, normal: Array) -> None:
    """Replace face normals by interpolated ones, on the same side."""
    vertices, faces, shading, fixed = surface.vertices, surface.faces, surface.normals, runs.fixed
    for row in range(rows[0], rows[1]):
        y = row - rows[0]
        view, v = row_view(projection, runs.row[y])
        middle = runs.column[y] + 0.5
        for x in range(normal.shape[2]):
            run = runs.slot[y, x]
            if run == 0:
                continue
            face = runs.start[run, 0]
            i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
            u = ((x + middle) * (2.0 / projection.width) - 1.0) * projection.half[0]
            ray = image_ray(projection.kind, view, u, v)
            gx, gy, gz = fixed[run, 3], fixed[run, 4], fixed[run, 5]
            facing = ray[3] * gx + ray[4] * gy + ray[5] * gz
            ix, iy, iz = vertices[i, 0], vertices[i, 1], vertices[i, 2]
            jx, jy, jz = vertices[j, 0], vertices[j, 1], vertices[j, 2]
            kx, ky, kz = vertices[k, 0], vertices[k, 1], vertices[k, 2]
            a = _barycentric(ray, jx, jy, jz, kx, ky, kz) / facing
            b = _barycentric(ray, kx, ky, kz, ix, iy, iz) / facing
            c = 1.0 - a - b
            sx = a * shading[i, 0] + b * shading[j, 0] + c * shading[k, 0]
            sy = a * shading[i, 1] + b * shading[j, 1] + c * shading[k, 1]
            sz = a * shading[i, 2] + b * shading[j, 2] + c * shading[k, 2]
            nx, ny, nz = towards(gx, gy, gz, -ray[3], -ray[4], -ray[5])
            normal[0, row, x], normal[1, row, x], normal[2, row, x] = towards(sx, sy, sz, nx, ny, nz)
