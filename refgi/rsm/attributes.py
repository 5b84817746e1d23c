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
    """Where a pass writes, in the buffer's type; background already filled in."""

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
    m = row // projection.height
    u = ((column + 0.5) * (2.0 / projection.width) - 1.0) * projection.half[0]
    v = ((row - m * projection.height + 0.5) * (2.0 / projection.height) - 1.0) * projection.half[1]
    origin, frame = projection.origin, projection.frame
    ox, oy, oz = origin[m, 0], origin[m, 1], origin[m, 2]
    if projection.kind == ORTHOGRAPHIC:
        ox += u * frame[m, 0, 0] + v * frame[m, 1, 0]
        oy += u * frame[m, 0, 1] + v * frame[m, 1, 1]
        oz += u * frame[m, 0, 2] + v * frame[m, 1, 2]
        return ox, oy, oz, frame[m, 2, 0], frame[m, 2, 1], frame[m, 2, 2]
    ahead = 1.0
    if projection.kind == PARABOLOID:
        scale = 1.0 / (1.0 + u * u + v * v)
        ahead = (1.0 - u * u - v * v) * scale
        u, v = 2.0 * u * scale, 2.0 * v * scale
    dx = u * frame[m, 0, 0] + v * frame[m, 1, 0] + ahead * frame[m, 2, 0]
    dy = u * frame[m, 0, 1] + v * frame[m, 1, 1] + ahead * frame[m, 2, 1]
    dz = u * frame[m, 0, 2] + v * frame[m, 1, 2] + ahead * frame[m, 2, 2]
    return ox, oy, oz, dx, dy, dz


@kernel
def _cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> tuple[float, float, float]:
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@kernel
def _plane(vertices: Array, i: int, j: int, k: int) -> tuple[float, float, float]:
    """Return the normal of a triangle scaled by twice its area."""
    x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
    ax, ay, az = vertices[j, 0] - x, vertices[j, 1] - y, vertices[j, 2] - z
    return _cross(ax, ay, az, vertices[k, 0] - x, vertices[k, 1] - y, vertices[k, 2] - z)


@kernel
def _weight(vertices: Array, j: int, k: int, ray: Any) -> float:
    """Return d . (v_j x v_k): the barycentric coordinate of the third vertex up to a common factor."""
    ox, oy, oz, dx, dy, dz = ray
    cx, cy, cz = _cross(
        vertices[j, 0] - ox, vertices[j, 1] - oy, vertices[j, 2] - oz,
        vertices[k, 0] - ox, vertices[k, 1] - oy, vertices[k, 2] - oz,
    )  # fmt: skip
    return dx * cx + dy * cy + dz * cz


@kernel
def _unit_towards(nx: float, ny: float, nz: float, tx: float, ty: float, tz: float) -> tuple[float, float, float]:
    """Return the unit vector along n on the side of t; t itself where n has no length."""
    square = nx * nx + ny * ny + nz * nz
    if not square > 0.0:
        nx, ny, nz = tx, ty, tz
        square = nx * nx + ny * ny + nz * nz
    scale = math.copysign(1.0 / math.sqrt(square), nx * tx + ny * ty + nz * tz)
    return nx * scale, ny * scale, nz * scale


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
    """Fill every `step`-th row from `first` on."""
    vertices, faces = surface.vertices, surface.faces
    height, width = triangle_id.shape
    smooth = len(surface.normals) > 0
    for row in range(first, height, step):
        last, i, j, k = -1, 0, 0, 0
        gx, gy, gz = 0.0, 0.0, 0.0
        for column in range(width):
            face = triangle_id[row, column]
            if face < 0:
                continue
            ray = texel_ray(projection, row, column)
            ox, oy, oz, dx, dy, dz = ray
            if face != last:
                last = face
                i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
                gx, gy, gz = _plane(vertices, i, j, k)
            facing = dx * gx + dy * gy + dz * gz
            ahead = (vertices[i, 0] - ox) * gx + (vertices[i, 1] - oy) * gy + (vertices[i, 2] - oz) * gz
            t = ahead / facing
            if wanted.depth:
                planes.depth[row, column] = t
            if wanted.distance:
                planes.distance[row, column] = t * math.sqrt(dx * dx + dy * dy + dz * dz)
            if wanted.position:
                planes.position[0, row, column] = ox + t * dx
                planes.position[1, row, column] = oy + t * dy
                planes.position[2, row, column] = oz + t * dz
            if wanted.normal:
                nx, ny, nz = _unit_towards(gx, gy, gz, -dx, -dy, -dz)
                if smooth:
                    bi = _weight(vertices, j, k, ray) / facing
                    bj = _weight(vertices, k, i, ray) / facing
                    bk = 1.0 - bi - bj
                    shading = surface.normals
                    sx = bi * shading[i, 0] + bj * shading[j, 0] + bk * shading[k, 0]
                    sy = bi * shading[i, 1] + bj * shading[j, 1] + bk * shading[k, 1]
                    sz = bi * shading[i, 2] + bj * shading[j, 2] + bk * shading[k, 2]
                    nx, ny, nz = _unit_towards(sx, sy, sz, nx, ny, nz)
                planes.normal[0, row, column] = nx
                planes.normal[1, row, column] = ny
                planes.normal[2, row, column] = nz
            if wanted.albedo or wanted.material_id:
                material = surface.material_of_face[face]
                if wanted.albedo:
                    planes.albedo[0, row, column] = surface.diffuse[material, 0]
                    planes.albedo[1, row, column] = surface.diffuse[material, 1]
                    planes.albedo[2, row, column] = surface.diffuse[material, 2]
                if wanted.material_id:
                    planes.material_id[row, column] = material
