"""Diffuse reflectance where a ray meets a surface: its material's, times the texture at that very point.

Paths sample points, so textures are looked up between the texels of the image itself, without any footprint; what a
pixel or a light's map means over is meant over by the paths. Scenes without textures compile none of it.
"""

from typing import Any

from numba import types

from refgi.jit import by_type
from refgi.scene.texture.lookup import coordinates_at, point_sample
from refgi.truth.paths import row


def diffuse_at(textures: Any, surfaces: Any, triangle: int, y: tuple[float, float, float]) -> Any:
    """Return the diffuse reflectance at a point of a triangle.

    `textures`: those of `surfaces`, which choose what is compiled. `y`: the point, m. Result: three numbers.
    """
    return _painted(textures, surfaces, triangle, y) if textures is not None else _plain(
        textures, surfaces, triangle, y)


def _plain(textures: Any, surfaces: Any, triangle: Any, y: Any) -> Any:  # noqa: ARG001
    return row(surfaces.diffuse, surfaces.material_of_face[triangle])


def _painted(textures: Any, surfaces: Any, triangle: Any, y: Any) -> Any:
    material = surfaces.material_of_face[triangle]
    r, g, b = row(surfaces.diffuse, material)
    texture = textures.of_material[material]
    if texture >= 0:
        u, v = coordinates_at(surfaces.vertices, surfaces.faces, surfaces.uv, triangle, y[0], y[1], y[2])
        p, q, s = point_sample(textures, texture, u, v)
        r, g, b = r * p, g * q, b * s
    return r, g, b


@by_type(diffuse_at)
def _by_type(textures: Any, surfaces: Any, triangle: Any, y: Any) -> Any:  # noqa: ARG001
    return _plain if isinstance(textures, types.NoneType) else _painted
