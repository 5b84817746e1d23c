"""Vertex colours on a map: factors of the albedo where a texel's ray meets its triangle, after all other channels."""

from typing import Any, NamedTuple

import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.rsm.buffers.surfaces import cross
from refgi.rsm.buffers.texel_rays import image_ray, row_view
from refgi.rsm.raster.projection import Projection
from refgi.scene.model import Geometry
from refgi.scene.texture.lookup import Colour, colour_at

Array = npt.NDArray[Any]


class Coloured(NamedTuple):
    """Triangles and the colours of their corners."""

    vertices: Array  # (n, 3) float64, m
    faces: Array  # (m, 3) int32
    colours: Array  # (m, 3, 3) float64


def tint(
    geometry: Geometry, projection: Projection, triangle_id: Array, albedo: Array, texel: Array | None = None
) -> None:
    """Multiply albedo by the vertex colours, in place; scenes without any are left alone.

    `projection`: the maps that `triangle_id` (H, W) was drawn on. `albedo` (3, H, W), or of `texel` (n,) alone; empty
    where it is not wanted.
    """
    if geometry.colours is None or not albedo.size:
        return
    surface = Coloured(geometry.vertices, geometry.faces, geometry.colours)
    if texel is None:
        _tint_rows(surface, projection, triangle_id, albedo)
    else:
        _tint_texels(surface, projection, triangle_id, texel, albedo.reshape(3, -1))


@kernel(parallel=True)
def _tint_rows(surface: Coloured, projection: Projection, triangle_id: Array, albedo: Array) -> None:
    for row in prange(triangle_id.shape[0]):
        for column in range(triangle_id.shape[1]):
            face = triangle_id[row, column]
            if face >= 0:
                r, g, b = _colour(surface, projection, face, row, column)
                albedo[0, row, column] *= r
                albedo[1, row, column] *= g
                albedo[2, row, column] *= b


@kernel
def _tint_texels(surface: Coloured, projection: Projection, triangle_id: Array, texel: Array, albedo: Array) -> None:
    width = triangle_id.shape[1]
    for k in range(len(texel)):
        row, column = texel[k] // width, texel[k] % width
        face = triangle_id[row, column]
        if face >= 0:
            r, g, b = _colour(surface, projection, face, row, column)
            albedo[0, k] *= r
            albedo[1, k] *= g
            albedo[2, k] *= b


@kernel
def _colour(surface: Coloured, projection: Projection, face: int, row: int, column: int) -> Colour:
    """Return the colour where the ray o + t d of a texel meets its triangle: t = N . (v_0 - o) / (N . d)."""
    view, y = row_view(projection, row)
    x = ((column + 0.5) * (2.0 / projection.width) - 1.0) * projection.half[0]
    ox, oy, oz, dx, dy, dz = image_ray(projection.kind, view, x, y)
    vertices, (i, j, k) = surface.vertices, (surface.faces[face, 0], surface.faces[face, 1], surface.faces[face, 2])
    px, py, pz = vertices[i, 0], vertices[i, 1], vertices[i, 2]
    nx, ny, nz = cross(vertices[j, 0] - px, vertices[j, 1] - py, vertices[j, 2] - pz,
                       vertices[k, 0] - px, vertices[k, 1] - py, vertices[k, 2] - pz)
    t = (nx * (px - ox) + ny * (py - oy) + nz * (pz - oz)) / (nx * dx + ny * dy + nz * dz)
    return colour_at(vertices, surface.faces, surface.colours, face, ox + t * dx, oy + t * dy, oz + t * dz)
