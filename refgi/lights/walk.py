"""Pixel lights without a map: quasi-random light paths, as in instant radiosity (SII Sec. 3.7, Keller 1997).

Every place where a path meets a surface becomes a pixel light with what the surface reflects there. The first bounce
has the mean of the lights of a reflective shadow map; more bounces follow the diffuse reflection on.
"""

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.jit import kernel
from refgi.lights.shares import lamp_shares
from refgi.pairs.pixel_lights import PixelLights
from refgi.radiometry import DIRECTIONAL, POINT, orthonormal_basis, radiant_intensity
from refgi.sampling import LIGHT_PATHS, cosine_hemisphere, draws, halton
from refgi.scene.light import CAP
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rays import Tracer
    from refgi.scene import Geometry, LightTable, MaterialTable

BASES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53)  # a pair for the light and for each bounce
MOST_BOUNCES = len(BASES) // 2 - 1
TRIAL = 256  # paths of each of several lamps that tell what it lights


class PathRays(NamedTuple):
    """Where paths go next."""

    origin: Array  # (n, 3) m
    direction: Array  # (n, 3) unit vectors
    power: Array  # (n, 3) what each carries, W
    numbers: Array  # (n, d) its coordinates: two for the light, two for each bounce
    half: Array  # (n,) bool, whether it is of the second half of its lamp's paths


class PathVertices(NamedTuple):
    """Where paths met a surface at one bounce: a pixel light each."""

    position: Array  # (n, 3) m
    normal: Array  # (n, 3) unit vectors on the incident side
    flux: Array  # (n, 3) W, reflected diffusely
    lobe_flux: Array  # (n, 3) W
    lobe_axis: Array  # (n, 3) mirror directions
    lobe_exponent: Array  # (n,)
    half: Array  # (n,) bool


@stage("lights.walk")
def walk_lights(
    tracer: "Tracer", geometry: "Geometry", materials: "MaterialTable", lights: "LightTable", paths: int,
    bounces: int = 1, seed: int = 0,
) -> PixelLights:
    """Trace light paths and leave a pixel light at every bounce.

    materials: Float64.
    lights: Float64.
    paths: How many to trace, over all lamps. Of several each gets its share of the flux that `TRIAL` paths of each
        bring to surfaces; one whose trial meets nothing gets a path beyond the number, as it may light something small.
    bounces: How many surfaces each path meets, up to `MOST_BOUNCES`.
    seed: Shifts the quasi-random set modulo 1, 0 leaves it as it is; draws the lamps where there are fewer paths.
    -> PixelLights: At most paths x bounces of them, float64; those without flux are dropped.

    Raises `InputError` if there are no paths, or too many bounces.

    Paths are not ended at random: each carries on with its power times the diffuse reflectance, so the walk adds no
    noise beyond its directions. Glossy materials leave a lobe, but paths go on by diffuse reflection alone.
    """
    expect(paths >= 1, "lights", "at least one path", paths)
    expect(1 <= bounces <= MOST_BOUNCES, "bounces", f"1 to {MOST_BOUNCES}", bounces)
    used = 2 + 2 * bounces
    shift = draws(seed, LIGHT_PATHS, used).tolist() if seed else None
    vertices: list[PathVertices] = []
    for k, share, gain in _shares(tracer, geometry, materials, lights, paths, seed):
        rays = _first_rays(tracer, geometry, lights, k, halton(share, BASES[:used], shift, start=1))
        vertices += _paths(tracer, geometry, materials, rays._replace(power=rays.power * gain), bounces)
    return _pixel_lights(vertices, paths * bounces)


def _shares(
    tracer: "Tracer", geometry: "Geometry", materials: "MaterialTable", lights: "LightTable", paths: int, seed: int
) -> list[tuple[int, int, float]]:
    """Return number, paths and gain of each lamp that has any, by the flux that a trial brings to surfaces."""
    count = len(lights.kind)
    if count == 1:
        return [(0, paths, 1.0)]
    numbers = halton(TRIAL, BASES[:4], draws(seed, LIGHT_PATHS, 4, 1).tolist(), start=1)
    flux = np.zeros(count)
    for k in range(count):
        (met,) = _paths(tracer, geometry, materials, _first_rays(tracer, geometry, lights, k, numbers), 1)
        flux[k] = met.flux.sum() + met.lobe_flux.sum()
    found = [*zip(range(count), *lamp_shares(paths, flux, seed), strict=True)]
    unmet = [(k, 1, 1.0) for k in np.flatnonzero(flux == 0).tolist()] if flux.any() else []
    return sorted([*(one for one in found if one[1] > 0), *unmet])


def _first_rays(tracer: "Tracer", geometry: "Geometry", lights: "LightTable", k: int, numbers: Array) -> PathRays:
    """Return the first rays of lamp k, moved off its place: it may lie in a surface."""
    rays = _emit(lights, k, numbers, geometry)
    return rays._replace(origin=rays.origin + tracer.offsets(rays.origin)[:, None] * rays.direction)


def _paths(
    tracer: "Tracer", geometry: "Geometry", materials: "MaterialTable", rays: PathRays, bounces: int
) -> list[PathVertices]:
    """Follow paths and return their vertices at each bounce."""
    vertices = []
    for bounce in range(bounces):
        hits = tracer.closest(rays.origin, rays.direction)
        met = np.flatnonzero(hits.triangle_id >= 0)
        rays = PathRays(*(part[met] for part in rays))
        position, normal, material = _surface(geometry, hits.triangle_id[met], hits.distance[met], rays)
        opaque = (materials.ior[material] == 0)[:, None]
        power = np.where(opaque, rays.power, 0)
        mirror = rays.direction - 2 * (rays.direction * normal).sum(axis=1, keepdims=True) * normal
        diffuse = _diffuse(geometry, materials, hits.triangle_id[met], material, position)
        vertices.append(PathVertices(position, normal, power * diffuse,
                                     power * materials.specular[material], mirror, materials.exponent[material],
                                     rays.half))
        u, v = rays.numbers[:, 2 + 2 * bounce], rays.numbers[:, 3 + 2 * bounce]
        start = position + tracer.offsets(position)[:, None] * normal
        rays = PathRays(start, _cosine_directions(normal, u, v), vertices[-1].flux, rays.numbers, rays.half)
    return vertices


def _emit(lights: "LightTable", k: int, numbers: Array, geometry: "Geometry") -> PathRays:
    """Return the first rays of light k: each carries I / (density of its direction) / paths."""
    count = len(numbers)
    direction, power, half = np.empty((count, 3)), np.empty((count, 3)), np.arange(count) >= (count + k % 2) // 2
    if lights.kind[k] == DIRECTIONAL:
        low, high = geometry.bounds
        radius = geometry.diagonal / 2
        across = np.reshape(orthonormal_basis(*lights.direction[k]), (2, 3))
        disc = radius * np.sqrt(numbers[:, :1]) * _turn(numbers[:, 1])
        origin = (low + high) / 2 - 1.001 * radius * lights.direction[k] + disc @ across
        direction[:] = lights.direction[k]
        power[:] = lights.intensity[k] * (math.pi * radius**2 / count)
        return PathRays(origin, direction, power, numbers, half)
    _emit_from_point(lights, k, numbers, direction, power)
    return PathRays(np.repeat(lights.position[k][None], count, axis=0), direction, power, numbers, half)


@kernel
def _emit_from_point(lights: Any, k: int, numbers: Array, direction: Array, power: Array) -> None:
    cap = 2.0 if lights.kind[k] == POINT else lights.cone[k, CAP]  # 1 - cosine of its half-angle
    ax, ay, az = (0.0, 0.0, 1.0) if lights.kind[k] == POINT else (
        lights.direction[k, 0], lights.direction[k, 1], lights.direction[k, 2])
    tx, ty, tz, bx, by, bz = orthonormal_basis(ax, ay, az)
    weight = 2.0 * math.pi * cap / len(numbers)
    for i in range(len(numbers)):
        height = numbers[i, 0] * cap  # 1 - cosine, uniform over the cone
        z, radius, phi = 1.0 - height, math.sqrt(height * (2.0 - height)), 2.0 * math.pi * numbers[i, 1]
        x, y = radius * math.cos(phi), radius * math.sin(phi)
        wx, wy, wz = tx * x + bx * y + ax * z, ty * x + by * y + ay * z, tz * x + bz * y + az * z
        direction[i, 0], direction[i, 1], direction[i, 2] = wx, wy, wz
        red, green, blue = radiant_intensity(lights, k, wx, wy, wz)
        power[i, 0], power[i, 1], power[i, 2] = red * weight, green * weight, blue * weight


@kernel
def _cosine_directions(normal: Array, u: Array, v: Array) -> Array:
    directions = np.empty_like(normal)
    for i in range(len(normal)):
        x, y, z = cosine_hemisphere(u[i], v[i])
        tx, ty, tz, bx, by, bz = orthonormal_basis(normal[i, 0], normal[i, 1], normal[i, 2])
        directions[i, 0] = tx * x + bx * y + normal[i, 0] * z
        directions[i, 1] = ty * x + by * y + normal[i, 1] * z
        directions[i, 2] = tz * x + bz * y + normal[i, 2] * z
    return directions


def _turn(share: Array) -> Array:
    return np.stack([np.cos(2 * math.pi * share), np.sin(2 * math.pi * share)], axis=1)


def _surface(geometry: "Geometry", triangle: Array, distance: Array, rays: PathRays) -> tuple[Array, Array, Array]:
    """Return position, unit normal on the side of the face that the ray met, and material of each hit."""
    position = rays.origin + distance[:, None] * rays.direction
    faces = geometry.faces[triangle]
    corner = geometry.vertices[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    facing = normal * np.where((normal * rays.direction).sum(axis=1, keepdims=True) > 0, -1.0, 1.0)
    if geometry.vertex_normals is not None:
        # twice the areas opposite to the corners, times the face's normal
        rest = position[:, None] - corner
        share = np.stack([(np.cross(rest[:, a], rest[:, b]) * normal).sum(axis=1) for a, b in ((1, 2), (2, 0), (0, 1))])
        smooth = np.einsum("cn,nca->na", share, geometry.vertex_normals[faces])
        normal = np.where((smooth != 0).any(axis=1, keepdims=True), smooth, normal)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal *= np.where((normal * facing).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    return position, normal, geometry.material_of_face[triangle]


def _diffuse(geometry: "Geometry", materials: "MaterialTable", triangle: Array, material: Array,
             position: Array) -> Array:
    """Return the diffuse reflectance of each hit: its material's, times texture and vertex colours there."""
    diffuse = materials.diffuse[material]
    if materials.textures is not None and geometry.uv is not None:
        from refgi.scene.texture.lookup import multiply_at

        diffuse = np.array(diffuse)
        multiply_at(materials.textures.table, geometry.vertices, geometry.faces, geometry.uv, triangle,
                    material, position, diffuse)
    if geometry.colours is not None:
        from refgi.scene.texture.lookup import multiply_by_colours

        diffuse = np.array(diffuse)
        multiply_by_colours(geometry.vertices, geometry.faces, geometry.colours, triangle, position, diffuse)
    return diffuse


def _pixel_lights(vertices: list[PathVertices], drawn: int) -> PixelLights:
    joined = (np.concatenate(parts).T for parts in zip(*vertices, strict=True))
    position, normal, flux, lobe_flux, axis, exponent, half = joined
    glossy: Array = (lobe_flux != 0).any(axis=0)
    emits: Array = glossy | (flux != 0).any(axis=0)
    lights = PixelLights(position[:, emits], normal[:, emits], flux[:, emits], None, None, None, drawn,
                         half=half[emits])
    if not glossy.any():
        return lights
    return lights._replace(lobe_flux=lobe_flux[:, emits], lobe_axis=axis[:, emits], lobe_exponent=exponent[emits])
