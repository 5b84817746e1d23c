"""Caustics: light that reaches what the camera sees through mirror-like lobes and glass, traced from the lights.

Each pass sends fresh photons from every light. A photon that meets a mirror-like lobe or glass goes on from there;
wherever it lands after at least one such bounce it counts for the pixel that sees this point. The flux dPhi of a photon
landing at y with the camera at distance D covers a pixel of solid angle W by E = dPhi <g.v> / (D^2 W), v towards the
camera: so a pixel holds the mean of the irradiance over its footprint, without any search radius, and nothing else is
approximated (glass is clear and smooth, its Fresnel reflection chosen at random; chains end after 16 bounces).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.radiometry import inverse_fraction, lobe_direction, radiant_intensity
from refgi.rays import MISS, Tracer, ray_offset
from refgi.rsm.buffers.solid_angle import texel_solid_angles
from refgi.rsm.raster.projection import camera_projection, project
from refgi.sampling import uniform
from refgi.scene import DirectionalLight, LightTable, Scene, material_table
from refgi.truth.light_grid import light_rays
from refgi.truth.paths import CHUNK
from refgi.truth.surfaces import Surfaces, around, face_cross, face_normal, height_above, shading_normal, surfaces
from refgi.types import Array

MIRROR_EXPONENT = 100.0  # lobes from here on count as mirror-like: half of their flux lies within 7 degrees
SHARP_LOBE = 3e4  # half of its flux lies within 0.4 degrees: sharper than cells of light on curved surfaces
LONGEST_CHAIN = 16


class Film(NamedTuple):
    """The pixels that photons are splatted to."""

    scene: Scene
    shape: tuple[int, int]  # rows and columns of the picture
    solid_angle: Array  # (h, w) of each pixel, sr
    mirrors: Surfaces  # with only the mirror-like lobes
    ior: Array  # (k,) by material; 0: opaque
    longest: int  # surfaces that a photon meets


class Photons(NamedTuple):
    """A batch of photons on their way."""

    origin: Array  # (n, 3) float32, m
    direction: Array  # (n, 3) float32
    reach: Array  # (n,) float32; 0 once a photon is gone
    triangle_id: Array  # (n,) int32
    distance: Array  # (n,) float32
    flux: Array  # (n, 3) float64, W
    landed: Array  # (n, 3) float64: where it met a surface, m
    towards: Array  # (n, 3) float64: face normal there, on the side it came from


def film(scene: Scene, shape: tuple[int, int], least_exponent: float = MIRROR_EXPONENT, *,
         longest: int | None = None, even_empty: bool = False) -> Film | None:
    """Prepare a film for photons, or return None for a scene without mirror or glass.

    `shape`: rows and columns of the picture. `least_exponent`: lobes from here on count as mirrors. `longest`: surfaces
    that a photon meets at most, `LONGEST_CHAIN` where absent; at 2, one bounce, glass is opaque. `even_empty`: make one
    where there is neither, on which no photon lands.
    """
    table = material_table(scene.materials)
    mirrors = surfaces(scene)._replace(uv=None, textures=None, colours=None)
    mirrors.diffuse[:] = 0
    mirrors.specular[table.exponent < least_exponent] = 0
    if longest == 2:
        table.ior[:] = 0
    if not (mirrors.specular.any() or table.ior.any() or even_empty):
        return None
    solid_angle = texel_solid_angles(camera_projection(scene.camera, shape[1], shape[0]))
    return Film(scene, shape, solid_angle, mirrors, table.ior, LONGEST_CHAIN if longest is None else longest)


def photon_pass(film: Film, tracer: Tracer, lights: LightTable, photons: int, random: np.random.Generator) -> Array:
    """Trace one pass of photons and splat them to pixels.

    `photons`: from each light; the largest square number up to it is sent. Returns (3, h w) float64: irradiance, W/m^2.
    """
    irradiance = np.zeros((3, film.solid_angle.size))
    side = math.isqrt(photons)
    for k, light in enumerate(film.scene.lights):
        rays = light_rays(light, film.scene.geometry, random.random((side * side, 2)))
        batch = photons_of(rays.origins + tracer.offsets(rays.origins)[:, None] * rays.directions, rays.directions)
        power_of(lights, k, isinstance(light, DirectionalLight), rays.measure, rays.directions, batch.flux)
        for bounce in range(film.longest):
            tracer.fill_closest(batch.origin, batch.direction, batch.reach, batch.triangle_id, batch.distance)
            words = random.integers(2**32, size=len(batch.reach), dtype=np.uint32)
            landing = (batch.triangle_id != MISS) & (bounce > 0)
            arriving = batch.flux[landing]
            reflect(film.mirrors, film.ior, tracer.grain, words, batch)
            _splat(film, tracer, batch.landed[landing], batch.towards[landing], arriving, irradiance)
            if not (batch.reach > 0).any():
                break
    return irradiance


def photons_of(origins: Array, directions: Array) -> Photons:
    """Allocate photons without flux that start out; `origins`, `directions` (n, 3): m, unit vectors."""
    count = len(origins)
    return Photons(origins.astype(np.float32), directions.astype(np.float32), np.full(count, np.inf, np.float32),
                   np.empty(count, np.int32), np.empty(count, np.float32), *(np.zeros((count, 3)) for _ in range(3)))


@kernel
def power_of(lights: LightTable, k: int, directional: bool, measure: float, directions: Array, flux: Array) -> None:
    """Fill the flux (n, 3) of each ray of a light, W."""
    for i in range(len(flux)):
        if directional:
            for c in range(3):
                flux[i, c] = lights.intensity[k, c] * measure
        else:
            power = radiant_intensity(lights, k, directions[i, 0], directions[i, 1], directions[i, 2])
            for c in range(3):
                flux[i, c] = power[c] * measure


def _splat(film: Film, tracer: Tracer, landed: Array, normals: Array, flux: Array, irradiance: Array) -> None:
    """Splat photons to the pixels that see where they landed, in their order."""
    pixel, density, visible = seen(film, tracer, landed, normals)
    for c in range(3):
        irradiance[c] += np.bincount(pixel, flux[visible, c] * density, irradiance.shape[1])


def seen(film: Film, tracer: Tracer, landed: Array, normals: Array) -> tuple[Array, Array, Array]:
    """Return which photons the camera sees land.

    `landed` (n, 3): where, m. `normals` (n, 3): the faces', on the side they came from. Returns (k,) int64, (k,), (n,)
    bool: flat index of the pixel and share of the flux per area, 1/m^2, of each visible one; and which they are.
    """
    camera = film.scene.camera
    view = np.subtract(camera.eye, landed)
    row, column, _ = project(camera_projection(camera, film.shape[1], film.shape[0]), landed.T)
    cosine = (view * normals).sum(axis=1) / np.linalg.norm(view, axis=1)
    visible = ~np.isnan(row) & (cosine > 0)
    starts = landed[visible] + tracer.offsets(landed[visible])[:, None] * normals[visible]
    reach, blocked = np.ones(len(starts), np.float32), np.empty(len(starts), np.bool_)
    tracer.fill_occluded(starts.astype(np.float32), (camera.eye - starts).astype(np.float32), reach, blocked)
    visible[np.flatnonzero(visible)[blocked]] = False
    at = np.floor(row[visible]).astype(np.int64), np.floor(column[visible]).astype(np.int64)
    # E = dPhi <g.v> / (D^2 W)
    density = cosine[visible] / ((view[visible] ** 2).sum(axis=1) * film.solid_angle[at])
    return at[0] * film.shape[1] + at[1], density, visible


@kernel(parallel=True)
def reflect(mirrors: Surfaces, ior: Array, grain: float, words: Array, photons: Photons) -> None:
    """Write where photons landed, and reflect or refract those on a mirror-like lobe or glass.

    `mirrors`: the scene with only its mirror-like lobes. `ior` (k,): index of refraction by material, 0 where opaque.
    `grain`: the tracer's: how far rays start above faces, m. `words` (n,) uint32: random numbers. `photons`: moved on;
    glass keeps the flux, a lobe sends on its share.
    """
    count = len(photons.reach)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _reflect(mirrors, ior, grain, words, photons, chunk * CHUNK, min(count, chunk * CHUNK + CHUNK))


@kernel
def _reflect(mirrors: Surfaces, ior: Array, grain: float, words: Array, photons: Photons, low: int,
             high: int) -> None:
    for i in range(low, high):
        triangle = photons.triangle_id[i]
        photons.reach[i] = 0
        if triangle == MISS:
            continue
        t = np.float64(photons.distance[i])
        d = (np.float64(photons.direction[i, 0]), np.float64(photons.direction[i, 1]),
             np.float64(photons.direction[i, 2]))
        y = (photons.origin[i, 0] + t * d[0], photons.origin[i, 1] + t * d[1], photons.origin[i, 2] + t * d[2])
        g = face_normal(mirrors, triangle, d[0], d[1], d[2])
        height = height_above(mirrors, triangle, y, g)
        y = (y[0] - height * g[0], y[1] - height * g[1], y[2] - height * g[2])
        for c in range(3):
            photons.landed[i, c] = y[c]
            photons.towards[i, c] = g[c]
        material = mirrors.material_of_face[triangle]
        n = shading_normal(mirrors, triangle, y, g)
        if ior[material] > 0:
            w, share = _through_glass(n, d, _outside(mirrors, triangle, g), ior[material], words[i]), 1.0
        else:
            share = max(mirrors.specular[material, 0], mirrors.specular[material, 1], mirrors.specular[material, 2])
            if share <= 0:
                continue
            w, share = _off_lobe(n, g, d, mirrors.exponent[material], words[i])
        length = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
        side = math.copysign(ray_offset(y[0], y[1], y[2], grain), w[0] * g[0] + w[1] * g[1] + w[2] * g[2])
        for c in range(3):
            if ior[material] == 0:
                photons.flux[i, c] *= share * mirrors.specular[material, c]
            photons.origin[i, c] = y[c] + side * g[c]
            photons.direction[i, c] = w[c] / length
        photons.reach[i] = np.inf if share > 0 else 0


@kernel
def _outside(mirrors: Surfaces, triangle: int, g: tuple[float, float, float]) -> bool:
    """Return whether g is the side that a triangle's vertex order calls outside."""
    x, y, z = face_cross(mirrors, triangle)
    return bool(x * g[0] + y * g[1] + z * g[2] > 0)


@kernel
def _through_glass(n: tuple[float, float, float], d: tuple[float, float, float], entering: bool, ior: float,
                   word: Any) -> tuple[float, float, float]:
    """Return the direction behind or off a smooth surface of glass, chosen by Fresnel's reflectance."""
    ratio = 1 / ior if entering else ior
    cos_in = -(n[0] * d[0] + n[1] * d[1] + n[2] * d[2])
    sin2 = ratio * ratio * (1 - cos_in * cos_in)
    cos_out = math.sqrt(max(0.0, 1 - sin2))
    along = (ratio * cos_in - cos_out) / (ratio * cos_in + cos_out)  # perpendicular polarisation
    across = (cos_in - ratio * cos_out) / (cos_in + ratio * cos_out)
    if sin2 >= 1 or uniform(word) < (along * along + across * across) / 2:
        return d[0] + 2 * cos_in * n[0], d[1] + 2 * cos_in * n[1], d[2] + 2 * cos_in * n[2]
    bend = ratio * cos_in - cos_out
    return ratio * d[0] + bend * n[0], ratio * d[1] + bend * n[1], ratio * d[2] + bend * n[2]


@kernel
def _off_lobe(n: tuple[float, float, float], g: tuple[float, float, float], d: tuple[float, float, float],
              exponent: float, word: Any) -> tuple[tuple[float, float, float], float]:
    """Return a direction of a lobe and 1 / K, or 0 where it points below the surface."""
    u, v = uniform(word), uniform(word ^ np.uint32(0xB5297A4D))
    cos_in = -(n[0] * d[0] + n[1] * d[1] + n[2] * d[2])
    mirror = (d[0] + 2 * cos_in * n[0], d[1] + 2 * cos_in * n[1], d[2] + 2 * cos_in * n[2])
    x, y, z = lobe_direction(u, v, exponent)
    w = around(mirror, x, y, z)
    above = min(w[0] * g[0] + w[1] * g[1] + w[2] * g[2], w[0] * n[0] + w[1] * n[1] + w[2] * n[2])
    return w, inverse_fraction(cos_in, exponent) if above > 0 else 0.0
