"""Light vertices: directly lit surface points, found by fresh rays from every light; the senders of the light side.

Phi = rho I(l) Omega for a spot or point light, rho E_perp A_perp for a directional one (papers' calibrated radiometry):
no cosine and no distance. Points come in sets, one for each set of rays. Lobes, in place of diffuse parts, are what
cells of light are made of (`refgi.truth.lobe_cells`).
"""

from typing import NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.radiometry import DIRECTIONAL, lobe_norm, radiant_intensity
from refgi.rays import MISS, Tracer
from refgi.scene import DirectionalLight, Light, LightTable
from refgi.truth.light_grid import LightRays
from refgi.truth.paths import CHUNK, diffuse_at, row
from refgi.truth.surfaces import Surfaces, face_normal, height_above, shading_normal
from refgi.types import Array

SMALLEST = 1e-12
BLOCK = 32  # points; sets are padded to whole ones


class LightVertices(NamedTuple):
    """Senders, as float32 arrays."""

    position: Array  # (3, n), m
    axis: Array  # (3, n) unit vector of the emission: shading normal, or mirror direction of a lobe
    normal: Array  # (3, n) shading normal
    facing: Array  # (3, n) face normal on the side of the light
    power: Array  # (n,) largest channel of Phi / pi, W/sr
    colour: Array  # (3, n) Phi / pi over `power`
    exponent: Array  # (n,) of cos around the axis: 1 for the diffuse part
    peak: Array  # (n,) pattern on the axis: 1, or (P + 1) / (2 K)
    bound: Array  # (n,) largest geometry term left to the light side, 1/m^2; for lobes of receivers: `with_areas`
    ray: Array  # (n,) int32: which ray found it, counted through the lights


class PointSets(NamedTuple):
    """Sets of light vertices, each padded with dark points to whole blocks."""

    points: LightVertices
    starts: Array  # (sets, 2) int64, in blocks: first one, one past the last


def closest_of(tracer: Tracer, rays: LightRays) -> tuple[Array, Array]:
    """Return what each ray of a light finds: triangle (n,) int32, and distance from the lamp (n,) float32, m."""
    # a lamp may lie in a surface: start just beyond it
    beyond = tracer.offsets(rays.origins)
    origins = (rays.origins + beyond[:, None] * rays.directions).astype(np.float32)
    directions = rays.directions.astype(np.float32)
    count = len(origins)
    triangle_id, distance = np.empty(count, np.int32), np.empty(count, np.float32)
    tracer.fill_closest(origins, directions, np.full(count, np.inf, np.float32), triangle_id, distance)
    distance += beyond.astype(np.float32)
    return triangle_id, distance


def light_vertices(surfaces: Surfaces, lights: LightTable, k: int, rays: LightRays, hits: tuple[Array, Array],
                   bound: float, *, lobes: bool = False) -> LightVertices:
    """Make light vertices of what one light's rays found.

    `surfaces`: the scene's triangles and materials. `hits`: of `closest_of`. `bound`: largest geometry term in units of
    1 / footprint; inf for no bound. `lobes`: in place of diffuse parts. Result: in the order of the rays; power 0 where
    a ray finds nothing that reflects so.
    """
    count = len(hits[0])
    points = _allocate(count)
    points.ray[:] = np.arange(k * count, (k + 1) * count)
    _fill_vertices(surfaces, lights, k, (rays.origins, rays.directions, *hits, rays.weight), (rays.measure, bound),
                   lobes, points)
    return points


def join(parts: list[LightVertices], sets: int, per_set: int) -> PointSets:
    """Sort the light vertices of several lights into their sets, each padded with dark points to whole blocks.

    `sets`: sets of rays that each light has sent.
    """
    together = parts[0] if len(parts) == 1 else LightVertices(
        *(np.concatenate(fields, axis=-1) for fields in zip(_allocate(0), *parts, strict=True)))
    bright = np.flatnonzero(together.power)
    group = (together.ray // per_set % sets)[bright]
    counts = np.bincount(group, minlength=sets)
    blocks = np.concatenate([[0], np.cumsum(-(-counts // BLOCK))])
    order = np.argsort(group, kind="stable")
    place = np.arange(len(order)) + np.repeat(blocks[:-1] * BLOCK - (np.cumsum(counts) - counts), counts)
    points = _allocate(int(blocks[-1]) * BLOCK)
    _copy_vertices(together, bright[order], place, points)
    return PointSets(points, np.stack([blocks[:-1], blocks[1:]], axis=1))


def with_areas(points: LightVertices, light: Light, measure: float) -> LightVertices:
    """Return light vertices of one light with, in place of the bound, the area that a ray would stand for at each.

    `measure`: of a ray when they are spread evenly, sr or m^2. Result: Omega d^2 / <g.l>, m^2, one of a light that the
    face is edge-on to as large as float32 allows.
    """
    if isinstance(light, DirectionalLight):
        toward, square = -np.asarray(light.direction, np.float64)[:, None], np.ones(1)
        toward = toward / np.linalg.norm(toward)
    else:
        toward = np.asarray(light.position, np.float64)[:, None] - points.position
        square = (toward**2).sum(axis=0)
        toward = toward / np.sqrt(np.maximum(square, SMALLEST))
    cosine = np.maximum((toward * points.facing).sum(axis=0), 0)
    area = measure * square / np.maximum(cosine, SMALLEST)
    return points._replace(bound=np.where(points.power > 0, area, 0).astype(np.float32))


def _allocate(count: int) -> LightVertices:
    position, axis, normal, facing, colour = (np.zeros((3, count), np.float32) for _ in range(5))
    power, exponent, peak, bound = (np.zeros(count, np.float32) for _ in range(4))
    return LightVertices(position, axis, normal, facing, power, colour, exponent, peak, bound,
                         np.zeros(count, np.int32))


@kernel
def _copy_vertices(source: LightVertices, order: Array, place: Array, points: LightVertices) -> None:
    for k in range(len(order)):
        i, j = order[k], place[k]
        for c in range(3):
            points.position[c, j] = source.position[c, i]
            points.axis[c, j] = source.axis[c, i]
            points.normal[c, j] = source.normal[c, i]
            points.facing[c, j] = source.facing[c, i]
            points.colour[c, j] = source.colour[c, i]
        points.power[j], points.exponent[j], points.peak[j] = source.power[i], source.exponent[i], source.peak[i]
        points.bound[j], points.ray[j] = source.bound[i], source.ray[i]


@kernel(parallel=True)
def _fill_vertices(surfaces: Surfaces, lights: LightTable, k: int, hits: tuple[Array, Array, Array, Array, Array],
                   scale: tuple[float, float], lobes: bool, points: LightVertices) -> None:
    """Fill the diffuse part of ray i, or its lobe, at i; dark ones keep a power of 0."""
    count = len(hits[2])
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _fill_span(surfaces, lights, k, hits, scale, lobes, points, (chunk * CHUNK, min(count, chunk * CHUNK + CHUNK)))


@kernel
def _fill_span(surfaces: Surfaces, lights: LightTable, k: int, hits: tuple[Array, Array, Array, Array, Array],
               scale: tuple[float, float], lobes: bool, points: LightVertices, span: tuple[int, int]) -> None:
    origins, directions, triangle_id, distances, weights = hits
    measure, bound = scale
    for i in range(span[0], span[1]):
        if triangle_id[i] == MISS:
            continue
        triangle = triangle_id[i]
        material = surfaces.material_of_face[triangle]
        d = (directions[i, 0], directions[i, 1], directions[i, 2])
        t = np.float64(distances[i])
        y = (origins[i, 0] + t * d[0], origins[i, 1] + t * d[1], origins[i, 2] + t * d[2])
        g = face_normal(surfaces, triangle, d[0], d[1], d[2])
        height = height_above(surfaces, triangle, y, g)
        y = (y[0] - height * g[0], y[1] - height * g[1], y[2] - height * g[2])
        n = shading_normal(surfaces, triangle, y, g)
        cos_in = -(n[0] * d[0] + n[1] * d[1] + n[2] * d[2])
        mirrored = (d[0] + 2 * cos_in * n[0], d[1] + 2 * cos_in * n[1], d[2] + 2 * cos_in * n[2])
        if lights.kind[k] == DIRECTIONAL:
            light, area = (lights.intensity[k, 0], lights.intensity[k, 1], lights.intensity[k, 2]), measure
        else:
            light, area = radiant_intensity(lights, k, d[0], d[1], d[2]), measure * t * t
        rho = row(surfaces.specular, material) if lobes else diffuse_at(surfaces.textures, surfaces, triangle, y)
        # Phi / pi, Phi = rho I(l) Omega
        share = measure * weights[i] / np.pi
        flux = (rho[0] * light[0] * share, rho[1] * light[1] * share, rho[2] * light[2] * share)
        power = max(flux[0], flux[1], flux[2])
        if power <= 0:
            continue
        exponent = surfaces.exponent[material] if lobes else 1.0
        points.power[i], points.exponent[i], points.bound[i] = power, exponent, bound / area
        points.peak[i] = np.pi * lobe_norm(cos_in, exponent) if lobes else 1.0
        for c in range(3):
            points.position[c, i] = y[c]
            points.axis[c, i] = mirrored[c] if lobes else n[c]
            points.normal[c, i] = n[c]
            points.facing[c, i] = g[c]
            points.colour[c, i] = flux[c] / power
