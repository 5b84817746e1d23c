"""Textures on a map: the albedo of the texels that show a textured material, after all other channels.

A texel's ray o + t d meets the triangle's plane at p; texture coordinates there are affine in p, so they are right in
perspective. Their change from one texel to the next is that of p along the plane (ray differentials, Igehy 1999):
with the normal N = e_1 x e_2 of the triangle, t' = -N . (o' + t d') / (N . d) and p' = o' + t d' + t' d, where o' and
d' are central differences over one texel of the map. Textures see nothing of the map's neighbours: silhouettes and
other triangles do not matter.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.rsm.buffers.runs import cross, image_ray, row_view
from refgi.rsm.raster.projection import Projection
from refgi.scene.model import Geometry, MaterialTable
from refgi.scene.texture.footprint import footprint_mean
from refgi.scene.texture.table import TextureTable

Array = npt.NDArray[Any]


class Painted(NamedTuple):
    """Triangles, their texture coordinates and textures, and the reflectances that these multiply."""

    vertices: Array  # (n, 3) float64, m
    faces: Array  # (m, 3) int32
    uv: Array  # (m, 3, 2) float64
    material_of_face: Array  # (m,) int32
    diffuse: Array  # (k, 3)
    table: TextureTable


def painted(geometry: Geometry, materials: MaterialTable) -> Painted | None:
    """Return what the textures of a scene multiply, None where it has none."""
    if materials.textures is None or geometry.uv is None:
        return None
    return Painted(geometry.vertices, geometry.faces, geometry.uv, geometry.material_of_face, materials.diffuse,
                   materials.textures.table)


def paint(
    geometry: Geometry, materials: MaterialTable, projection: Projection, triangle_id: Array, albedo: Array | None,
    texel: Array | None = None,
) -> None:
    """Write the albedo of texels that show a texture, in place; scenes without any are left alone.

    `projection`: the maps that `triangle_id` (H, W) was drawn on. `albedo` (3, H, W), or (3, 1, n) of `texel` (n,)
    alone: filled already where there is no texture; None where it is not wanted.
    """
    surface = painted(geometry, materials)
    if surface is None or albedo is None or albedo.size == 0:
        return
    if texel is None:
        _paint_rows(surface, projection, triangle_id, albedo)
    else:
        _paint_texels(surface, projection, triangle_id, texel, albedo)


@kernel(parallel=True)
def _paint_rows(surface: Painted, projection: Projection, triangle_id: Array, albedo: Array) -> None:
    for row in prange(triangle_id.shape[0]):
        _paint_row(surface, projection, triangle_id, row, albedo)


@kernel
def _paint_row(surface: Painted, projection: Projection, triangle_id: Array, row: int, albedo: Array) -> None:
    last, plane = -1, _plane(surface, 0)
    for column in range(triangle_id.shape[1]):
        face = triangle_id[row, column]
        if face < 0:
            continue
        material = surface.material_of_face[face]
        texture = surface.table.of_material[material]
        if texture >= 0:
            if face != last:
                last, plane = face, _plane(surface, face)
            r, g, b = _colour(surface, projection, plane, texture, row, column)
            albedo[0, row, column] = surface.diffuse[material, 0] * r
            albedo[1, row, column] = surface.diffuse[material, 1] * g
            albedo[2, row, column] = surface.diffuse[material, 2] * b


@kernel
def _paint_texels(surface: Painted, projection: Projection, triangle_id: Array, texel: Array, albedo: Array) -> None:
    width = triangle_id.shape[1]
    for k in range(len(texel)):
        row, column = texel[k] // width, texel[k] % width
        face = triangle_id[row, column]
        if face < 0:
            continue
        material = surface.material_of_face[face]
        texture = surface.table.of_material[material]
        if texture >= 0:
            r, g, b = _colour(surface, projection, _plane(surface, face), texture, row, column)
            albedo[0, 0, k] = surface.diffuse[material, 0] * r
            albedo[1, 0, k] = surface.diffuse[material, 1] * g
            albedo[2, 0, k] = surface.diffuse[material, 2] * b


@kernel
def _plane(surface: Painted, face: int) -> Any:
    """Return corner v_0, normal N, u and v at v_0, and their gradients on the triangle's plane."""
    vertices, uv = surface.vertices, surface.uv
    i, j, k = surface.faces[face, 0], surface.faces[face, 1], surface.faces[face, 2]
    px, py, pz = vertices[i, 0], vertices[i, 1], vertices[i, 2]
    ax, ay, az = vertices[j, 0] - px, vertices[j, 1] - py, vertices[j, 2] - pz
    bx, by, bz = vertices[k, 0] - px, vertices[k, 1] - py, vertices[k, 2] - pz
    nx, ny, nz = cross(ax, ay, az, bx, by, bz)
    scale = 1.0 / (nx * nx + ny * ny + nz * nz)
    # q . (e_2 x N) / N^2 and q . (N x e_1) / N^2 are the barycentric coordinates of v_1 and v_2 at v_0 + q
    sx, sy, sz = cross(bx, by, bz, nx, ny, nz)
    tx, ty, tz = cross(nx, ny, nz, ax, ay, az)
    u0, v0 = uv[face, 0, 0], uv[face, 0, 1]
    us, vs = (uv[face, 1, 0] - u0) * scale, (uv[face, 1, 1] - v0) * scale
    ut, vt = (uv[face, 2, 0] - u0) * scale, (uv[face, 2, 1] - v0) * scale
    return (px, py, pz, nx, ny, nz, u0, v0, us * sx + ut * tx, us * sy + ut * ty, us * sz + ut * tz,
            vs * sx + vt * tx, vs * sy + vt * ty, vs * sz + vt * tz)


@kernel
def _colour(surface: Painted, projection: Projection, plane: Any, texture: int, row: int, column: int) -> Any:
    """Return the texture at a texel of the map."""
    ray, across, down = ray_and_changes(projection, row, column)
    u, v, ux, vx, uy, vy = coordinates(plane, ray, across, down)
    return footprint_mean(surface.table, texture, u, v, ux, vx, uy, vy)


@kernel
def ray_and_changes(projection: Projection, row: int, column: int) -> Any:
    """Return the ray through a texel's centre, and its change over a texel along the row and down the column."""
    view, y = row_view(projection, row)
    step_x, step_y = projection.half[0] * (2.0 / projection.width), projection.half[1] * (2.0 / projection.height)
    x = ((column + 0.5) * (2.0 / projection.width) - 1.0) * projection.half[0]
    kind = projection.kind
    left, right = image_ray(kind, view, x - 0.5 * step_x, y), image_ray(kind, view, x + 0.5 * step_x, y)
    upper, lower = image_ray(kind, view, x, y - 0.5 * step_y), image_ray(kind, view, x, y + 0.5 * step_y)
    return image_ray(kind, view, x, y), _difference(right, left), _difference(lower, upper)


@kernel
def _difference(a: Any, b: Any) -> Any:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3], a[4] - b[4], a[5] - b[5]


@kernel
def coordinates(plane: Any, ray: Any, across: Any, down: Any) -> Any:
    """Return u and v where a ray meets a triangle's plane, and their change with the ray's two changes."""
    px, py, pz, nx, ny, nz, u0, v0, gx, gy, gz, hx, hy, hz = plane
    ox, oy, oz, dx, dy, dz = ray
    facing = dx * nx + dy * ny + dz * nz
    t = ((px - ox) * nx + (py - oy) * ny + (pz - oz) * nz) / facing
    qx, qy, qz = ox + t * dx - px, oy + t * dy - py, oz + t * dz - pz
    ux, vx = _along(plane, ray, t, facing, across)
    uy, vy = _along(plane, ray, t, facing, down)
    return u0 + gx * qx + gy * qy + gz * qz, v0 + hx * qx + hy * qy + hz * qz, ux, vx, uy, vy


@kernel
def _along(plane: Any, ray: Any, t: float, facing: float, change: Any) -> Any:
    """Return how u and v change as the ray changes."""
    _, _, _, nx, ny, nz, _, _, gx, gy, gz, hx, hy, hz = plane
    _, _, _, dx, dy, dz = ray
    ax, ay, az = change[0] + t * change[3], change[1] + t * change[4], change[2] + t * change[5]
    # t' = -N . (o' + t d') / (N . d)
    way = -(nx * ax + ny * ay + nz * az) / facing
    ax, ay, az = ax + way * dx, ay + way * dy, az + way * dz
    return gx * ax + gy * ay + gz * az, hx * ax + hy * ay + hz * az
