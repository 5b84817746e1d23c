"""What the texels of a triangle have in common, and the rays through texels' centres that meet it.

With q = v0 - o for the centre of projection o, e1 = v1 - v0, e2 = v2 - v0 and N = e1 x e2, a ray o + t d meets the
triangle's plane at t = q . N / (d . N). There the barycentric coordinates of v1 and v2 are, times d . N,

    b1 (d . N) = d . (e2 x q),    b2 (d . N) = d . (q x e1),

so the interpolated normal of corner normals n0, n1, n2 is, times d . N, an affine function of what varies over texels:

- rays from one centre:  d . M,           M = N n0 + (e2 x q) (n1 - n0) + (q x e1) (n2 - n0),
- parallel rays:         K + (o - v0) . M,   M = (e2 x d) (n1 - n0) + (d x e1) (n2 - n0),   K = (d . N) n0.

Corners enter by differences of 1, not of 2 factors of their distance, so small triangles far away keep their digits.

Of a triangle seen edge-on d . N is rounding and t anything, so t is kept within what the corners have.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel
from refgi.rsm.raster.projection import ORTHOGRAPHIC, PARABOLOID, Projection
from refgi.types import Array

BATCH = 64  # triangles described at once
# columns of `Records.fixed`: corner v0; N; unit normal on the visible side; least and greatest t; M by axis; K
CORNER, PLANE, NORMAL, RANGE, MIXED, CONSTANT, COLUMNS = 0, 3, 6, 9, 11, 20, 23
INPUTS = 18  # rows of a batch: corners and their normals


class Surface(NamedTuple):
    """What the triangles are made of."""

    vertices: Array  # (n, 3) float64, m
    faces: Array  # (m, 3) int32
    normals: Any  # (n, 3) float64; None: the faces' normals count
    material_of_face: Array  # (m,) int32
    diffuse: Array  # (3, materials + 1), the last one black


class Records(NamedTuple):
    """Triangles that some texels of one map see; record 0 is that of texels that see nothing."""

    face: Array  # (n,) int32: triangle; -1: none
    fixed: Array  # (n, COLUMNS) float64
    batch: Array  # ((INPUTS + COLUMNS) BATCH,) float64: scratch, triangles as lanes


@kernel
def cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> tuple[float, float, float]:
    """Return a x b."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@kernel
def barycentric_axes(v0: Any, v1: Any, v2: Any, origin: Any) -> Any:
    """Return e2 x q and q x e1: their products with a ray's direction are b1 and b2, times d . N.

    `v0`, `v1`, `v2`: corners. `origin`: of the ray. All are tuples of 3 floats, world space, m.
    """
    (x, y, z), (ox, oy, oz) = v0, origin
    qx, qy, qz = x - ox, y - oy, z - oz
    first = cross(v2[0] - x, v2[1] - y, v2[2] - z, qx, qy, qz)
    return first, cross(qx, qy, qz, v1[0] - x, v1[1] - y, v1[2] - z)


@kernel
def describe(
    surface: Surface, normals: Array | None, projection: Projection, m: int, count: int, records: Records
) -> None:
    """Fill the records of triangles that map `m` sees.

    `normals`: those of `surface`; an argument of its own, so that kernels of flat scenes have no code for them.
    `count`: one past the last record. `records`: `face` is read, all else is written.
    """
    batch, fixed = records.batch, records.fixed
    for base in range(1, count, BATCH):
        size = min(BATCH, count - base)
        columns = MIXED
        _gather(surface, records.face, base, size, batch)
        _orient(projection, m, batch)
        _bound(projection, m, batch)
        if normals is not None:
            columns = COLUMNS
            _gather_normals(surface.faces, normals, records.face, base, size, batch)
            if projection.kind == ORTHOGRAPHIC:
                _mix_parallel(projection, m, batch)
            else:
                _mix_central(projection, m, batch)
        for b in range(size):
            for column in range(columns):
                fixed[base + b, column] = batch[(INPUTS + column) * BATCH + b]


@kernel
def _gather(surface: Surface, face_of: Array, base: int, size: int, batch: Array) -> None:
    """Write corners: loads that wait for memory, many under way at once."""
    vertices, faces = surface.vertices, surface.faces
    for b in range(size):
        face = face_of[base + b]
        for corner in range(3):
            vertex = faces[face, corner]
            for axis in range(3):
                batch[(3 * corner + axis) * BATCH + b] = vertices[vertex, axis]


@kernel
def _gather_normals(faces: Array, normals: Array, face_of: Array, base: int, size: int, batch: Array) -> None:
    """Write normals of corners."""
    for b in range(size):
        face = face_of[base + b]
        for corner in range(3):
            vertex = faces[face, corner]
            for axis in range(3):
                batch[(9 + 3 * corner + axis) * BATCH + b] = normals[vertex, axis]


@kernel
def _orient(projection: Projection, m: int, batch: Array) -> None:
    """Write corner v0, N and the unit normal on the visible side, in SIMD lanes."""
    ox, oy, oz = projection.origin[m, 0], projection.origin[m, 1], projection.origin[m, 2]
    dx, dy, dz = projection.frame[m, 2, 0], projection.frame[m, 2, 1], projection.frame[m, 2, 2]
    central = projection.kind != ORTHOGRAPHIC
    for b in range(BATCH):
        x, y, z = batch[b], batch[BATCH + b], batch[2 * BATCH + b]
        gx, gy, gz = cross(batch[3 * BATCH + b] - x, batch[4 * BATCH + b] - y, batch[5 * BATCH + b] - z,
                            batch[6 * BATCH + b] - x, batch[7 * BATCH + b] - y, batch[8 * BATCH + b] - z)  # fmt: skip
        # from the surface to the eye; all of the plane has the eye on the same side
        tx, ty, tz = (ox - x if central else -dx), (oy - y if central else -dy), (oz - z if central else -dz)
        square = gx * gx + gy * gy + gz * gz
        flat = not square > 0.0
        nx, ny, nz = (tx if flat else gx), (ty if flat else gy), (tz if flat else gz)
        scale = math.copysign(1.0 / math.sqrt(nx * nx + ny * ny + nz * nz), nx * tx + ny * ty + nz * tz)
        at = INPUTS + CORNER
        batch[at * BATCH + b], batch[(at + 1) * BATCH + b], batch[(at + 2) * BATCH + b] = x, y, z
        at = INPUTS + PLANE
        batch[at * BATCH + b], batch[(at + 1) * BATCH + b], batch[(at + 2) * BATCH + b] = gx, gy, gz
        at, nx, ny, nz = INPUTS + NORMAL, nx * scale, ny * scale, nz * scale
        batch[at * BATCH + b], batch[(at + 1) * BATCH + b], batch[(at + 2) * BATCH + b] = nx, ny, nz


@kernel
def _bound(projection: Projection, m: int, batch: Array) -> None:
    """Write the least and greatest t of triangles' points ahead: of their corners, or 0 where rays have unit length.

    A loop of its own: called for one triangle, it would keep the caller's loop from becoming SIMD code.
    """
    ox, oy, oz = projection.origin[m, 0], projection.origin[m, 1], projection.origin[m, 2]
    dx, dy, dz = projection.frame[m, 2, 0], projection.frame[m, 2, 1], projection.frame[m, 2, 2]
    by_distance = projection.kind == PARABOLOID
    for b in range(BATCH):
        least, greatest = np.inf, 0.0
        for corner in range(3):
            at = 3 * corner * BATCH + b
            x, y, z = batch[at] - ox, batch[at + BATCH] - oy, batch[at + 2 * BATCH] - oz
            t = x * dx + y * dy + z * dz
            if by_distance:
                t = math.sqrt(x * x + y * y + z * z)
            least, greatest = min(least, t), max(greatest, t)
        batch[(INPUTS + RANGE) * BATCH + b] = 0.0 if by_distance else max(least, 0.0)
        batch[(INPUTS + RANGE + 1) * BATCH + b] = greatest


@kernel
def _mix_central(projection: Projection, m: int, batch: Array) -> None:
    """Write M of rays from one centre, in SIMD lanes."""
    ox, oy, oz = projection.origin[m, 0], projection.origin[m, 1], projection.origin[m, 2]
    for b in range(BATCH):
        x, y, z = batch[b], batch[BATCH + b], batch[2 * BATCH + b]
        ax, ay, az = batch[3 * BATCH + b], batch[4 * BATCH + b], batch[5 * BATCH + b]
        bx, by, bz = batch[6 * BATCH + b], batch[7 * BATCH + b], batch[8 * BATCH + b]
        gx, gy, gz = cross(ax - x, ay - y, az - z, bx - x, by - y, bz - z)
        (ux, uy, uz), (vx, vy, vz) = barycentric_axes((x, y, z), (ax, ay, az), (bx, by, bz), (ox, oy, oz))
        for axis in range(3):
            first = batch[(9 + axis) * BATCH + b]
            second, third = batch[(12 + axis) * BATCH + b] - first, batch[(15 + axis) * BATCH + b] - first
            at = INPUTS + MIXED + 3 * axis
            batch[at * BATCH + b] = gx * first + ux * second + vx * third
            batch[(at + 1) * BATCH + b] = gy * first + uy * second + vy * third
            batch[(at + 2) * BATCH + b] = gz * first + uz * second + vz * third


@kernel
def _mix_parallel(projection: Projection, m: int, batch: Array) -> None:
    """Write M and K of parallel rays, in SIMD lanes."""
    dx, dy, dz = projection.frame[m, 2, 0], projection.frame[m, 2, 1], projection.frame[m, 2, 2]
    for b in range(BATCH):
        x, y, z = batch[b], batch[BATCH + b], batch[2 * BATCH + b]
        ax, ay, az = batch[3 * BATCH + b] - x, batch[4 * BATCH + b] - y, batch[5 * BATCH + b] - z
        bx, by, bz = batch[6 * BATCH + b] - x, batch[7 * BATCH + b] - y, batch[8 * BATCH + b] - z
        ux, uy, uz = cross(bx, by, bz, dx, dy, dz)
        vx, vy, vz = cross(dx, dy, dz, ax, ay, az)
        gx, gy, gz = cross(ax, ay, az, bx, by, bz)
        facing = dx * gx + dy * gy + dz * gz
        for axis in range(3):
            first = batch[(9 + axis) * BATCH + b]
            second, third = batch[(12 + axis) * BATCH + b] - first, batch[(15 + axis) * BATCH + b] - first
            at = INPUTS + MIXED + 3 * axis
            batch[at * BATCH + b] = ux * second + vx * third
            batch[(at + 1) * BATCH + b] = uy * second + vy * third
            batch[(at + 2) * BATCH + b] = uz * second + vz * third
            batch[(INPUTS + CONSTANT + axis) * BATCH + b] = facing * first


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
