"""Rays of texels, and runs: stretches of a row's texels with the same triangle, whose data is loaded once a run."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.rsm.raster.projection import ORTHOGRAPHIC, PARABOLOID, Projection

Array = npt.NDArray[Any]
Rows = tuple[int, int]  # first row of the planes and one past the last

ALBEDO = 9  # first of its columns in `Runs.fixed`


@kernel
def texel_ray(projection: Projection, row: int, column: int) -> tuple[float, float, float, float, float, float]:
    """Return the ray through a texel centre of the stacked maps.

    `row`, `column`: texel of the stacked maps. Result: origin (m) and direction in world space; the direction's length
    is one unit of depth.
    """
    view, v = row_view(projection, row)
    u = ((column + 0.5) * (2.0 / projection.width) - 1.0) * projection.half[0]
    return image_ray(projection.kind, view, u, v)


@kernel
def row_view(projection: Projection, row: int) -> Any:
    """Return what the rays of a row have in common.

    `row`: row of the stacked maps. Result: origin, right, down and forward of the row's map; the row's coordinate on
    the image plane.
    """
    m = row // projection.height
    v = ((row - m * projection.height + 0.5) * (2.0 / projection.height) - 1.0) * projection.half[1]
    o, f = projection.origin, projection.frame
    return (o[m, 0], o[m, 1], o[m, 2], f[m, 0, 0], f[m, 0, 1], f[m, 0, 2], f[m, 1, 0], f[m, 1, 1], f[m, 1, 2],
            f[m, 2, 0], f[m, 2, 1], f[m, 2, 2]), v  # fmt: skip


@kernel
def image_ray(kind: int, view: Any, u: float, v: float) -> tuple[float, float, float, float, float, float]:
    """Return origin and direction at a point of the image plane.

    `kind`: kind of the projection. `view`: as `row_view` gives it. `u`, `v`: coordinates on the image plane.
    """
    ox, oy, oz, rx, ry, rz, qx, qy, qz, fx, fy, fz = view
    if kind == ORTHOGRAPHIC:
        return ox + u * rx + v * qx, oy + u * ry + v * qy, oz + u * rz + v * qz, fx, fy, fz
    ahead = 1.0
    if kind == PARABOLOID:
        scale = 1.0 / (1.0 + u * u + v * v)
        ahead = (1.0 - u * u - v * v) * scale
        u, v = 2.0 * u * scale, 2.0 * v * scale
    return ox, oy, oz, u * rx + v * qx + ahead * fx, u * ry + v * qy + ahead * fy, u * rz + v * qz + ahead * fz


class Surface(NamedTuple):
    """What the triangles are made of."""

    vertices: Array  # (n, 3) float64, m
    faces: Array  # (m, 3) int32
    normals: Array  # (n, 3) float64, or (0, 3): the faces' normals count
    material_of_face: Array  # (m,) int32
    diffuse: Array  # (materials, 3)


class Runs(NamedTuple):
    """Stretches of texels with one triangle, in some rows of texels; run 0 is all texels without surface."""

    row: Array  # (rows,) int32: row on the maps
    column: Array  # (rows,) int32: column of the first texel
    slot: Array  # (rows, texels) uint32: run of each texel
    start: Array  # (n, 3) int32: triangle, row and first column of each run on the maps
    fixed: Array  # (n, 12) float64: corner v_0, N, normal on the visible side, albedo
    corner: Array  # (n, 4) int32: vertices, material


@kernel
def cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> tuple[float, float, float]:
    """Return a x b."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@kernel
def towards(nx: float, ny: float, nz: float, tx: float, ty: float, tz: float) -> tuple[float, float, float]:
    """Return the unit vector along n on the side of t; along t where n has no length."""
    square = nx * nx + ny * ny + nz * nz
    if not square > 0.0:
        nx, ny, nz = tx, ty, tz
        square = nx * nx + ny * ny + nz * nz
    scale = math.copysign(1.0 / math.sqrt(square), nx * tx + ny * ty + nz * tz)
    return nx * scale, ny * scale, nz * scale


@kernel
def allocate_runs(rows: int, texels: int) -> Any:
    """Allocate the runs of some rows.

    `rows`, `texels`: rows, and texels of each. Result: run 0 is that of texels that see nothing.
    """
    most = rows * texels + 1
    return Runs(np.empty(rows, np.int32), np.empty(rows, np.int32), np.empty((rows, texels), np.uint32),
                np.empty((most, 3), np.int32), np.zeros((most, 12)), np.full((most, 4), -1, np.int32))  # fmt: skip


@kernel
def find_runs(triangle_id: Array, rows: Rows, runs: Runs) -> int:
    """Find the runs of whole rows.

    `triangle_id` (H, W): triangle at each texel, -1 for none. `rows`: first row and one past the last. `runs`: receives
    where they lie. Result: how many there are, run 0 included.
    """
    slot, start, count = runs.slot, runs.start, 1
    for row in range(rows[0], rows[1]):
        last, run, y = -1, 0, row - rows[0]
        runs.row[y], runs.column[y] = row, 0
        for x in range(triangle_id.shape[1]):
            face = triangle_id[row, x]
            if face != last:
                last, run = face, 0
                if face >= 0:
                    run = count
                    start[run, 0], start[run, 1], start[run, 2] = face, row, x
                    count += 1
            slot[y, x] = run
    return count


@kernel
def runs_at(triangle_id: Array, texel: Array, runs: Runs) -> int:
    """Find the runs that some texels belong to, one for each.

    `triangle_id` (H, W): triangle at each texel, -1 for none. `texel` (n,): texels of the flattened maps. `runs`:
    receives where they lie, for n rows of one texel. Result: how many there are, run 0 included.
    """
    slot, start, count, width = runs.slot, runs.start, 1, triangle_id.shape[1]
    for y in range(len(texel)):
        row, x = texel[y] // width, texel[y] % width
        runs.row[y], runs.column[y], slot[y, 0] = row, x, 0
        face = triangle_id[row, x]
        if face >= 0:
            while x > 0 and triangle_id[row, x - 1] == face:
                x -= 1
            slot[y, 0] = count
            start[count, 0], start[count, 1], start[count, 2] = face, row, x
            count += 1
    return count


@kernel
def describe_runs(surface: Surface, projection: Projection, count: int, runs: Runs) -> None:
    """Write what is the same all along each run but run 0.

    `count`: one past the last run. `runs`: `start` is read, `fixed` and `corner` are written.
    """
    vertices, faces, diffuse, start, fixed = surface.vertices, surface.faces, surface.diffuse, runs.start, runs.fixed
    corner = runs.corner
    # loads that wait for memory in loops of their own, where many are under way at once
    for run in range(1, count):
        face = start[run, 0]
        corner[run, 0], corner[run, 1], corner[run, 2] = faces[face, 0], faces[face, 1], faces[face, 2]
        corner[run, 3] = surface.material_of_face[face]
    for run in range(1, count):
        i, j, k = corner[run, 0], corner[run, 1], corner[run, 2]
        for axis in range(3):
            fixed[run, axis] = vertices[i, axis]
            fixed[run, 3 + axis] = vertices[j, axis]
            fixed[run, 6 + axis] = vertices[k, axis]
    for run in range(1, count):
        ix, iy, iz = fixed[run, 0], fixed[run, 1], fixed[run, 2]
        gx, gy, gz = cross(fixed[run, 3] - ix, fixed[run, 4] - iy, fixed[run, 5] - iz,
                            fixed[run, 6] - ix, fixed[run, 7] - iy, fixed[run, 8] - iz)  # fmt: skip
        _, _, _, dx, dy, dz = texel_ray(projection, start[run, 1], start[run, 2])
        nx, ny, nz = towards(gx, gy, gz, -dx, -dy, -dz)  # a triangle shows one side to a projection
        fixed[run, 3], fixed[run, 4], fixed[run, 5] = gx, gy, gz
        fixed[run, 6], fixed[run, 7], fixed[run, 8] = nx, ny, nz
        for channel in range(3):
            fixed[run, ALBEDO + channel] = diffuse[corner[run, 3], channel]
