"""Textures on a map: the albedo of the texels that show a textured material, after all other channels.

A texel's ray o + t d meets the triangle's plane where t = N . (v_0 - o) / (N . d), N its normal; texture coordinates
are affine there, u = u_o + t u_d, so they are right in perspective. They change from one texel to the next by ray
differentials on that plane (Igehy 1999): u' = u_o' + t' u_d + t u_d', where a dash is the change over one texel of the
map, exact but for the paraboloid's, which is a central difference. Neighbours on the map, and silhouettes, are not
asked.
"""

from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.rsm.buffers.surfaces import cross, image_ray, row_view
from refgi.rsm.raster.projection import PARABOLOID, Projection
from refgi.scene.model import Geometry, MaterialTable
from refgi.scene.texture.footprint import PLACE, TOGETHER, Looks, footprint_means, looks
from refgi.scene.texture.table import TextureTable
from refgi.types import Array


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
    geometry: Geometry, materials: MaterialTable, projection: Projection, triangle_id: Array, albedo: Array,
    texel: Array | None = None,
) -> None:
    """Write the albedo of texels that show a texture, in place; scenes without any are left alone.

    `projection`: the maps that `triangle_id` (H, W) was drawn on. `albedo` (3, H, W), or of `texel` (n,) alone: filled
    already where there is no texture; empty where it is not wanted.
    """
    surface = painted(geometry, materials) if albedo.size else None
    if surface is None:
        return
    if texel is None:
        _paint_rows(surface, projection, triangle_id, albedo)
    else:
        _paint_texels(surface, projection, triangle_id, texel, albedo.reshape(3, -1))


class Scratch(NamedTuple):
    """What is looked up for some texels."""

    texture: Array  # (TOGETHER,) int32: row of the table, -1 for none
    colour: Array  # (TOGETHER, 3) float32
    looks: Looks


@kernel
def _scratch() -> Any:
    return Scratch(np.empty(TOGETHER, np.int32), np.empty((TOGETHER, 3), np.float32), looks())


@kernel(parallel=True)
def _paint_rows(surface: Painted, projection: Projection, triangle_id: Array, albedo: Array) -> None:
    scratch, width = _scratch(), triangle_id.shape[1]
    for row in prange(triangle_id.shape[0]):
        for begin in range(0, width, TOGETHER):
            _paint_some(surface, projection, triangle_id, (row, begin, min(begin + TOGETHER, width)), scratch, albedo)


@kernel
def _paint_some(surface: Painted, projection: Projection, triangle_id: Array, span: tuple[int, int, int],
                scratch: Scratch, albedo: Array) -> None:
    """Write the albedo of a span of a row: its first column and one past the last.

    What texels of one triangle share is set up once a run of them.
    """
    row, begin, end = span
    of_face, of_material, column, painted = surface.material_of_face, surface.table.of_material, begin, False
    while column < end:
        face, first = triangle_id[row, column], column
        texture = of_material[of_face[face]] if face >= 0 else -1
        while column < end and triangle_id[row, column] == face:
            scratch.texture[column - begin] = texture
            column += 1
        if texture >= 0:
            painted = True
            fill_places(surface, projection, face, (row, first, column), first - begin, scratch.looks.pixel)
    if painted:
        footprint_means(surface.table, scratch.texture, end - begin, scratch.looks, scratch.colour)
        for x in range(begin, end):
            if scratch.texture[x - begin] >= 0:
                material = of_face[triangle_id[row, x]]
                for channel in range(3):
                    albedo[channel, row, x] = surface.diffuse[material, channel] * scratch.colour[x - begin, channel]


@kernel
def _paint_texels(surface: Painted, projection: Projection, triangle_id: Array, texel: Array, albedo: Array) -> None:
    """Write the albedo of some texels, with the bits of whole rows."""
    width, scratch = triangle_id.shape[1], _scratch()
    for begin in range(0, len(texel), TOGETHER):
        count = min(TOGETHER, len(texel) - begin)
        for k in range(count):
            row, column = texel[begin + k] // width, texel[begin + k] % width
            face = triangle_id[row, column]
            texture = surface.table.of_material[surface.material_of_face[face]] if face >= 0 else -1
            scratch.texture[k] = texture
            if texture >= 0:
                fill_places(surface, projection, face, (row, column, column + 1), k, scratch.looks.pixel)
        footprint_means(surface.table, scratch.texture, count, scratch.looks, scratch.colour)
        for k in range(count):
            if scratch.texture[k] >= 0:
                material = surface.material_of_face[triangle_id[texel[begin + k] // width, texel[begin + k] % width]]
                for channel in range(3):
                    albedo[channel, begin + k] = surface.diffuse[material, channel] * scratch.colour[k, channel]


@kernel
def fill_places(surface: Painted, projection: Projection, face: int, run: tuple[int, int, int], at: int,
                pixel: Array) -> None:
    """Fill the coordinates, and their changes, of a run of texels of a row that see one triangle.

    `run`: its row, first column and one past the last. `at`: which of the pixels of `Looks` the first one is.
    """
    row, first, last = run
    plane = plane_of(surface, face)
    kind, (view, y) = projection.kind, row_view(projection, row)
    step_x, step_y = projection.half[0] * (2.0 / projection.width), projection.half[1] * (2.0 / projection.height)
    if kind == PARABOLOID:
        for column in range(first, last):
            x = ((column + 0.5) * (2.0 / projection.width) - 1.0) * projection.half[0]
            here = terms(plane, image_ray(kind, view, x, y))
            left, right = image_ray(kind, view, x - 0.5 * step_x, y), image_ray(kind, view, x + 0.5 * step_x, y)
            upper, lower = image_ray(kind, view, x, y - 0.5 * step_y), image_ray(kind, view, x, y + 0.5 * step_y)
            across, down = less(terms(plane, right), terms(plane, left)), less(terms(plane, lower), terms(plane, upper))
            u, v, ux, vx, uy, vy = coordinates(here, across, down)
            put(pixel, at + column - first, u, v, ux, vx, uy, vy)
        return
    # all terms are linear in the place on the image
    middle = terms(plane, image_ray(kind, view, 0.0, y))
    slope = less(terms(plane, image_ray(kind, view, 1.0, y)), middle)
    below = less(terms(plane, image_ray(kind, view, 0.0, y + 1.0)), middle)
    across, down = scaled(slope, step_x), scaled(below, step_y)
    for column in range(first, last):
        x = ((column + 0.5) * (2.0 / projection.width) - 1.0) * projection.half[0]
        u, v, ux, vx, uy, vy = coordinates(added(middle, scaled(slope, x)), across, down)
        put(pixel, at + column - first, u, v, ux, vx, uy, vy)


@kernel
def put(pixel: Array, k: int, u: float, v: float, ux: float, vx: float, uy: float, vy: float) -> None:
    """Write the given rows of a pixel of `Looks`."""
    at = np.uint64(PLACE * TOGETHER + k)
    pixel[at], pixel[at + np.uint64(TOGETHER)], pixel[at + np.uint64(2 * TOGETHER)] = u, v, ux
    pixel[at + np.uint64(3 * TOGETHER)], pixel[at + np.uint64(4 * TOGETHER)] = vx, uy
    pixel[at + np.uint64(5 * TOGETHER)] = vy


@kernel
def plane_of(surface: Painted, face: int) -> Any:
    """Return corner v_0, normal N, u and v at v_0, and their gradients on the plane, of a triangle with edges a, b."""
    vertices, uv = surface.vertices, surface.uv
    i, j, k = surface.faces[face, 0], surface.faces[face, 1], surface.faces[face, 2]
    px, py, pz = vertices[i, 0], vertices[i, 1], vertices[i, 2]
    ax, ay, az = vertices[j, 0] - px, vertices[j, 1] - py, vertices[j, 2] - pz
    bx, by, bz = vertices[k, 0] - px, vertices[k, 1] - py, vertices[k, 2] - pz
    u0, v0, u1, v1, u2, v2 = (uv[face, 0, 0], uv[face, 0, 1], uv[face, 1, 0], uv[face, 1, 1], uv[face, 2, 0],
                              uv[face, 2, 1])
    nx, ny, nz = cross(ax, ay, az, bx, by, bz)
    scale = 1.0 / (nx * nx + ny * ny + nz * nz)
    # q . (e_2 x N) / N^2 and q . (N x e_1) / N^2 are the barycentric coordinates of v_1 and v_2 at v_0 + q
    sx, sy, sz = cross(bx, by, bz, nx, ny, nz)
    tx, ty, tz = cross(nx, ny, nz, ax, ay, az)
    us, vs, ut, vt = (u1 - u0) * scale, (v1 - v0) * scale, (u2 - u0) * scale, (v2 - v0) * scale
    return (px, py, pz, nx, ny, nz, u0, v0, us * sx + ut * tx, us * sy + ut * ty, us * sz + ut * tz,
            vs * sx + vt * tx, vs * sy + vt * ty, vs * sz + vt * tz)


@kernel
def terms(plane: Any, ray: Any) -> Any:
    """Return N . (v_0 - o) and N . d, whose quotient is t, and u and v each at o and along d."""
    px, py, pz, nx, ny, nz, u0, v0, gx, gy, gz, hx, hy, hz = plane
    ox, oy, oz, dx, dy, dz = ray
    qx, qy, qz = ox - px, oy - py, oz - pz
    return (-(nx * qx + ny * qy + nz * qz), nx * dx + ny * dy + nz * dz,
            u0 + gx * qx + gy * qy + gz * qz, gx * dx + gy * dy + gz * dz,
            v0 + hx * qx + hy * qy + hz * qz, hx * dx + hy * dy + hz * dz)


@kernel
def less(a: Any, b: Any) -> Any:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3], a[4] - b[4], a[5] - b[5]


@kernel
def added(a: Any, b: Any) -> Any:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@kernel
def scaled(a: Any, factor: float) -> Any:
    """Return a times a number."""
    return a[0] * factor, a[1] * factor, a[2] * factor, a[3] * factor, a[4] * factor, a[5] * factor


@kernel
def coordinates(here: Any, across: Any, down: Any) -> Any:
    """Return u and v where a ray meets a plane, and their changes, from the terms of the ray and their two changes."""
    inverse = 1.0 / here[1]
    t = here[0] * inverse
    # t = A / F, so t' = (A' - t F') / F; u = u_o + t u_d
    tx, ty = (across[0] - t * across[1]) * inverse, (down[0] - t * down[1]) * inverse
    return (here[2] + t * here[3], here[4] + t * here[5],
            across[2] + tx * here[3] + t * across[3], across[4] + tx * here[5] + t * across[5],
            down[2] + ty * here[3] + t * down[3], down[4] + ty * here[5] + t * down[5])
