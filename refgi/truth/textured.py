"""Diffuse reflectance where a ray meets a surface: its material's, times texture and vertex colours at that very point.

Paths sample points, so textures are looked up between the texels of the image itself, without any footprint; what a
pixel or a light's map means over is meant over by the paths. Scenes without textures or
vertex colours compile none of it.
"""

from typing import Any

from numba import types

from refgi.jit import by_type, kernel
from refgi.scene.texture.lookup import colour_at, coordinates_at, point_sample
from refgi.truth.paths import row


def diffuse_at(textures: Any, surfaces: Any, triangle: int, y: tuple[float, float, float]) -> Any:
    """Return the diffuse reflectance at a point of a triangle.

    `textures`: those of `surfaces`, which choose what is compiled. `y`: the point, m. Result: three numbers.
    """
    return _chosen(textures is not None, surfaces.colours is not None)(textures, surfaces, triangle, y)


def _chosen(painted: bool, tinted: bool) -> Any:
    return ((_painted_and_tinted if tinted else _painted) if painted else (_tinted if tinted else _plain))


def _plain(textures: Any, surfaces: Any, triangle: Any, y: Any) -> Any:  # noqa: ARG001
    return row(surfaces.diffuse, surfaces.material_of_face[triangle])


def _painted(textures: Any, surfaces: Any, triangle: Any, y: Any) -> Any:
    return _times_texture(textures, surfaces, triangle, y, row(surfaces.diffuse, surfaces.material_of_face[triangle]))


def _tinted(textures: Any, surfaces: Any, triangle: Any, y: Any) -> Any:  # noqa: ARG001
    return _times_colours(surfaces, triangle, y, row(surfaces.diffuse, surfaces.material_of_face[triangle]))


def _painted_and_tinted(textures: Any, surfaces: Any, triangle: Any, y: Any) -> Any:
    diffuse = row(surfaces.diffuse, surfaces.material_of_face[triangle])
    return _times_texture(textures, surfaces, triangle, y, _times_colours(surfaces, triangle, y, diffuse))


@kernel
def _times_texture(textures: Any, surfaces: Any, triangle: int, y: Any, diffuse: Any) -> Any:
    texture = textures.of_material[surfaces.material_of_face[triangle]]
    if texture < 0:
        return diffuse
    u, v = coordinates_at(surfaces.vertices, surfaces.faces, surfaces.uv, triangle, y[0], y[1], y[2])
    r, g, b = point_sample(textures, texture, u, v)
    return diffuse[0] * r, diffuse[1] * g, diffuse[2] * b


@kernel
def _times_colours(surfaces: Any, triangle: int, y: Any, diffuse: Any) -> Any:
    r, g, b = colour_at(surfaces.vertices, surfaces.faces, surfaces.colours, triangle, y[0], y[1], y[2])
    return diffuse[0] * r, diffuse[1] * g, diffuse[2] * b


@by_type(diffuse_at)
def _by_type(textures: Any, surfaces: Any, triangle: Any, y: Any) -> Any:  # noqa: ARG001
    colours = surfaces.types[surfaces.fields.index("colours")]
    return _chosen(not isinstance(textures, types.NoneType), not isinstance(colours, types.NoneType))
