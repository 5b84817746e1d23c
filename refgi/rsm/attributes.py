"""The second pass: attributes of what each texel sees, from the triangle's plane and the texel's ray in float64.

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
from refgi.rsm.projection import ORTHOGRAPHIC, PARABOLOID, Projection

Array = npt.NDArray[Any]


class Wanted(NamedTuple):
    """Which channels a pass fills; the others' planes are empty."""

    depth: bool
    distance: bool
    position: bool
    normal: bool
    albedo: bool
    material_id: bool


class Planes(NamedTuple):
    """Where a pass writes, in the buffer's type; zero before."""

    depth: Array  # (H, W) m: axial in perspective and orthographic maps, else distance
    distance: Array  # (H, W) m: from the centre of projection; orthographic: the depth
    position: Array  # (3, H, W) m, world space
    normal: Array  # (3, H, W) unit vector on the side that is seen
    albedo: Array  # (3, H, W) diffuse reflectance
    material_id: Array  # (H, W) int32


class Surface(NamedTuple):
    """What the triangles are made of."""

    vertices: Array  # (n, 3) float64, m
    faces: Array  # (m, 3) int32
    normals: Array  # (n, 3) float64, or (0, 3): the faces' normals count
    material_of_face: Array  # (m,) int32
    diffuse: Array  # (materials, 3)


@kernel
def texel_ray(projection: Projection, row: int, column: int) -> tuple[float, float, float, float, float, float]:
    """Return the ray through a texel centre of the stacked maps.

    Parameters
    ----------
    projection : Projection
        The maps.
    row, column : int
        Texel of the stacked maps.

    Returns
    -------
    tuple of 6 floats
        Origin (m) and direction in world space; the direction's length is one unit of depth.
    """
    view, v = _row_view(projection, row)
    u = ((column + 0.5) * (2.0 / projection.width) - 1.0) * projection.half[0]
    return _ray(projection.kind, view, u, v)


@kernel
def _row_view(projection: Projection, row: int) -> Any:
    """Return origin, right, down and forward of a row's map as 12 floats, and the row's image coordinate."""
    m = row // projection.height
    v = ((row - m * projection.height + 0.5) * (2.0 / projection.height) - 1.0) * projection.half[1]
    o, f = projection.origin, projection.frame
    return (o[m, 0], o[m, 1], o[m, 2], f[m, 0, 0], f[m, 0, 1], f[m, 0, 2], f[m, 1, 0], f[m, 1, 1], f[m, 1, 2],
            f[m, 2, 0], f[m, 2, 1], f[m, 2, 2]), v  # fmt: skip


@kernel
def _ray(kind: int, view: Any, u: float, v: float) -> tuple[float, float, float, float, float, float]:
    """Return origin and direction at image coordinates (u, v)."""
    ox, oy, oz, rx, ry, rz, qx, qy, qz, fx, fy, fz = view
    if kind == ORTHOGRAPHIC:
        return ox + u * rx + v * qx, oy + u * ry + v * qy, oz + u * rz + v * qz, fx, fy, fz
    ahead = 1.0
    if kind == PARABOLOID:
        scale = 1.0 / (1.0 + u * u + v * v)
        ahead = (1.0 - u * u - v * v) * scale
        u, v = 2.0 * u * scale, 2.0 * v * scale
    return ox, oy, oz, u * rx + v * qx + ahead * fx, u * ry + v * qy + ahead * fy, u * rz + v * qz + ahead * fz


@kernel
def _cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> tuple[float, float, float]:
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@kernel
def _towards(nx: float, ny: float, nz: float, tx: float, ty: float, tz: float) -> tuple[float, float, float]:
    """Return the unit vector along n on the side of t; along t where n has no length."""
    square = nx * nx + ny * ny + nz * nz
    if not square > 0.0:
        nx, ny, nz = tx, ty, tz
        square = nx * nx + ny * ny + nz * nz
    scale = math.copysign(1.0 / math.sqrt(square), nx * tx + ny * ty + nz * tz)
    return nx * scale, ny * scale, nz * scale


@kernel
def _weight(ray: Any, ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> Any:
    """Return d . (a x b), relative to the ray's origin: a barycentric coordinate up to the common factor d . N."""
    ox, oy, oz, dx, dy, dz = ray
    cx, cy, cz = _cross(ax - ox, ay - oy, az - oz, bx - ox, by - oy, bz - oz)
    return dx * cx + dy * cy + dz * cz


@kernel(parallel=True)
def resolve(
    surface: Surface, projection: Projection, triangle_id: Array, wanted: Wanted, planes: Planes, workers: int
) -> None:
    """Fill the wanted planes at every texel that sees a triangle.

    Parameters
    ----------
    surface : Surface
        The triangles.
    projection : Projection
        The maps that `triangle_id` was drawn on.
    triangle_id : (H, W) ndarray
        Triangle at each texel, -1 for none.
    wanted : Wanted
        Which planes to fill.
    planes : Planes
        The result.
    workers : int
        Threads; rows are dealt to them in turn.
    """
    for worker in prange(workers):
        _resolve_rows(surface, projection, triangle_id, wanted, planes, worker, workers)


@kernel
def _resolve_rows(
    surface: Surface, projection: Projection, triangle_id: Array, wanted: Wanted, planes: Planes, first: int, step: int
) -> None:
    """Fill every `step`-th row from `first` on.

    Inside the loop over columns functions get scalars only: arrays would cost atomic reference counts.
    """
    vertices, faces, shading, diffuse = surface.vertices, surface.faces, surface.normals, surface.diffuse
    height, width = triangle_id.shape
    smooth = len(shading) > 0 and wanted.normal
    across = 2.0 / projection.width
    for row in range(first, height, step):
        view, v = _row_view(projection, row)
        last, material, i, j, k = -1, 0, 0, 0, 0
        ix, iy, iz, jx, jy, jz, kx, ky, kz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        gx, gy, gz, nx, ny, nz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for column in range(width):
            face = triangle_id[row, column]
            if face < 0:
                if wanted.depth:
                    planes.depth[row, column] = np.inf
                if wanted.distance:
                    planes.distance[row, column] = np.inf
                if wanted.material_id:
                    planes.material_id[row, column] = -1
                continue
            ray = _ray(projection.kind, view, ((column + 0.5) * across - 1.0) * projection.half[0], v)
            ox, oy, oz, dx, dy, dz = ray
            if face != last:
                last, material = face, surface.material_of_face[face]
                i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
                ix, iy, iz = vertices[i, 0], vertices[i, 1], vertices[i, 2]
                jx, jy, jz = vertices[j, 0], vertices[j, 1], vertices[j, 2]
                kx, ky, kz = vertices[k, 0], vertices[k, 1], vertices[k, 2]
                gx, gy, gz = _cross(jx - ix, jy - iy, jz - iz, kx - ix, ky - iy, kz - iz)
                nx, ny, nz = _towards(gx, gy, gz, -dx, -dy, -dz)  # a triangle shows one side to a projection
            facing = dx * gx + dy * gy + dz * gz
            t = ((ix - ox) * gx + (iy - oy) * gy + (iz - oz) * gz) / facing
            if wanted.depth:
                planes.depth[row, column] = t
            if wanted.distance:
                planes.distance[row, column] = t * math.sqrt(dx * dx + dy * dy + dz * dz)
            if wanted.position:
                planes.position[0, row, column] = ox + t * dx
                planes.position[1, row, column] = oy + t * dy
                planes.position[2, row, column] = oz + t * dz
            if wanted.normal:
                sx, sy, sz = nx, ny, nz
                if smooth:
                    a = _weight(ray, jx, jy, jz, kx, ky, kz) / facing
                    b = _weight(ray, kx, ky, kz, ix, iy, iz) / facing
                    c = 1.0 - a - b
                    sx = a * shading[i, 0] + b * shading[j, 0] + c * shading[k, 0]
                    sy = a * shading[i, 1] + b * shading[j, 1] + c * shading[k, 1]
                    sz = a * shading[i, 2] + b * shading[j, 2] + c * shading[k, 2]
                    sx, sy, sz = _towards(sx, sy, sz, nx, ny, nz)
                planes.normal[0, row, column], planes.normal[1, row, column] = sx, sy
                planes.normal[2, row, column] = sz
            if wanted.albedo:
                planes.albedo[0, row, column] = diffuse[material, 0]
                planes.albedo[1, row, column] = diffuse[material, 1]
                planes.albedo[2, row, column] = diffuse[material, 2]
            if wanted.material_id:
                planes.material_id[row, column] = material
