"""Paths and shadow rays of a batch, reflectance where they meet, next-event estimation (NEE).

Parallel loops over paths only call a kernel for each chunk: Numba silently drops what a parallel loop itself
writes into arrays that it reached through a NamedTuple's attribute. Inside, scalars are loaded one by one: a row loaded
as a view counts references, and over that count threads wait for each other.

Paths sample points, so textures are looked up between the texels of the image itself, without any footprint; what a
pixel or a light's map means over is meant over by the paths. Scenes without textures or
vertex colours compile none of it.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import types

from refgi.jit import by_type, kernel, prange
from refgi.radiometry import DIRECTIONAL
from refgi.rays import MISS, STEPS, ray_offset
from refgi.rsm.pool import plane
from refgi.scene import LightTable
from refgi.scene.texture.lookup import colour_at, coordinates_at, point_sample
from refgi.truth.surfaces import Surfaces, face_normal, lift
from refgi.types import Array

CHUNK = 1024  # paths or receivers that one parallel iteration owns


class Paths(NamedTuple):
    """The moving ends of a batch of paths: one ray each, what it found, what it carries."""

    origin: Array  # (n, 3) float32, m
    direction: Array  # (n, 3) float32, unit vectors
    reach: Array  # (n,) float32, m; 0 once a path has ended
    travelled: Array  # (n,) float32: distance from the receiver to the origin, m
    cosine: Array  # (n,) float32: <n_x.w> at the receiver
    triangle_id: Array  # (n,) int32
    distance: Array  # (n,) float32
    weight: Array  # (n, 3) float32: factor from found radiance to irradiance at the receiver


class Shadows(NamedTuple):
    """Shadow rays of a batch, and the contribution of each if it is unblocked."""

    origin: Array  # (n, 3) float32
    direction: Array  # (n, 3) float32
    reach: Array  # (n,) float32
    blocked: Array  # (n,) bool
    contribution: Array  # (n, 3) float32, W/m^2


class Sides(NamedTuple):
    """On which sides of faces light leaves and arrives."""

    hide: bool  # a face hides what lies behind it; else cosines of interpolated normals alone bound a pair
    eye: tuple[float, float, float]  # of the camera that has to see an emitter, m; nan: none has to


@kernel
def dot(a: tuple[float, float, float], b: tuple[float, float, float]) -> float:
    """Return the dot product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def row(rows: Array, i: int) -> tuple[float, float, float]:
    """Return a row of three as float64 scalars; `rows` (n, 3): vectors or colours."""
    return np.float64(rows[i, 0]), np.float64(rows[i, 1]), np.float64(rows[i, 2])


@kernel
def leaves(sides: Sides, y: tuple[float, float, float], cross: tuple[float, float, float], lit: float,
           out: float) -> bool:
    """Return whether light may leave a point towards a path.

    `y`: the point, m. `cross`: along its face's normal. `lit`, `out`: how far along that the light and the path lie.
    """
    if lit * out <= 0 and (sides.hide or lit * out == 0):
        return False
    return not lit * dot(cross, (sides.eye[0] - y[0], sides.eye[1] - y[1], sides.eye[2] - y[2])) <= 0


@kernel
def hit_point(paths: Paths, ray: int) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return the unit vector back along a ray that found something, and the point it found, m."""
    t = np.float64(paths.distance[ray])
    dx, dy, dz = row(paths.direction, ray)
    ox, oy, oz = row(paths.origin, ray)
    return (-dx, -dy, -dz), (ox + t * dx, oy + t * dy, oz + t * dz)


@kernel(parallel=True)
def pass_through(surfaces: Surfaces, grain: float, paths: Paths) -> None:
    """Move each ray to the far side of what it found, with the same direction.

    `grain`: the tracer's: how far rays start above faces, m. `paths`: origins, reach and lengths are moved on; rays
    that found nothing end.
    """
    for ray in prange(len(paths.reach)):
        _pass_through(surfaces, grain, paths, ray)


@kernel
def _pass_through(surfaces: Surfaces, grain: float, paths: Paths, ray: int) -> None:
    if paths.triangle_id[ray] == MISS:
        paths.reach[ray] = 0
        return
    w, y = hit_point(paths, ray)
    g = face_normal(surfaces, paths.triangle_id[ray], w[0], w[1], w[2])  # on the side the ray leaves to
    offset = lift(surfaces, paths.triangle_id[ray], y, g, grain)
    for c in range(3):
        paths.origin[ray, c] = y[c] + offset * g[c]
    paths.travelled[ray] += paths.distance[ray]
    paths.reach[ray] -= paths.distance[ray]


def paths_for(count: int) -> Paths:
    """Allocate a batch of paths."""
    origin, direction, weight = (plane((count, 3), np.float32) for _ in range(3))
    reach, travelled, cosine, distance = (plane((count,), np.float32) for _ in range(4))
    return Paths(origin, direction, reach, travelled, cosine, plane((count,), np.int32), distance, weight)


@kernel
def aim_at_light(
    lights: LightTable, k: int, hit: tuple[Any, Any, Any], far: float, offset: float, grain: float, shadows: Shadows,
    ray: int,
) -> None:
    """Write the shadow ray from a hit point to a light.

    `hit`: the point, its face normal on the light's side, and the vector to the light. `far`: distance of the light, m.
    `offset`: how far above the face the ray starts, m. A lamp may lie in a surface itself: rays end short of it.
    """
    y, g, toward = hit
    directional = lights.kind[k] == DIRECTIONAL
    for c in range(3):
        shadows.origin[ray, c] = y[c] + offset * g[c]
        shadows.direction[ray, c] = toward[c] if directional else toward[c] - offset * g[c]
    short = ray_offset(lights.position[k, 0], lights.position[k, 1], lights.position[k, 2], grain) / far
    shadows.reach[ray] = np.inf if directional else max(0.0, 1.0 - STEPS - short)


@kernel
def toward_light(lights: LightTable, k: int, y: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the vector from a point to a light, of length 1 if that is infinitely far."""
    if lights.kind[k] == DIRECTIONAL:
        return -lights.direction[k, 0], -lights.direction[k, 1], -lights.direction[k, 2]
    return lights.position[k, 0] - y[0], lights.position[k, 1] - y[1], lights.position[k, 2] - y[2]


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
