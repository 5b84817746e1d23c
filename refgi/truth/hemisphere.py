"""Hemisphere sampling at the receiver: cosine-distributed rays, next-event estimation (NEE) where they land.

A direction of density cos/pi that finds radiance L contributes pi L. Both estimators are combined by multiple
importance sampling (MIS) at a bounded geometry term G: the light side has min(G, b), weight min(1, b / G); here the
rest remains, weight max(0, (G - b) / G) of diffuse radiance (Kollig & Keller 2004). Without bound the weight is 1.
Lobes are weighted by how densely both estimators sample a point instead (`refgi.truth.cell_densities`).
Directions are points of a low-discrepancy sequence, scrambled anew for every series of passes and shifted by a random
word per pixel.
"""

import math
from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.shadow_rays import RayReceivers
from refgi.radiometry import DIRECTIONAL, incident_light
from refgi.rays import MISS, ray_offset
from refgi.sampling import hash_bits, sobol_owen
from refgi.scene import LightTable
from refgi.truth.cell_densities import Beside, share_beside, tops_for
from refgi.truth.paths import (
    CHUNK,
    Paths,
    Shadows,
    Sides,
    aim_at_light,
    diffuse_at,
    dot,
    hit_point,
    leaves,
    row,
    toward_light,
)
from refgi.truth.surfaces import Surfaces, around, face_cross, lift, lobe_above, lobe_pattern, shading_normal
from refgi.types import Array


@kernel
def scrambled_points(count: int, seed: int, turn: int) -> Array:
    """Return scrambled low-discrepancy points (count, 2) of the square as 32-bit words; turn by turn it goes on."""
    points = np.empty((count, 2), np.uint32)
    for i in range(count):
        for axis in range(2):
            points[i, axis] = np.uint32(sobol_owen(np.uint32(turn * count + i), axis, np.uint32(seed)) * 2.0**32)
    return points


@kernel
def cosine_direction(u: float, v: float) -> tuple[float, float, float]:
    """Return a direction of the upper hemisphere with density cos(theta) / pi, good to 1e-8 and alike everywhere.

    `u`, `v`: point of the unit square; u = sin^2 theta, v the share of the turn. Result: unit vector, z up.

    The turn is split into quarters and the series of sine and cosine up to pi/4 cut at 2e-9 (rays are float32).
    """
    quarter = math.floor(4 * v + 0.5)
    t = 2 * math.pi * (v - 0.25 * quarter)
    t2 = t * t
    sine = t * (1 - t2 / 6 * (1 - t2 / 20 * (1 - t2 / 42 * (1 - t2 / 72))))
    cosine = 1 - t2 / 2 * (1 - t2 / 12 * (1 - t2 / 30 * (1 - t2 / 56 * (1 - t2 / 90))))
    if quarter == 1 or quarter == 3:
        sine, cosine = cosine, -sine
    radius = math.sqrt(u) if quarter < 2 or quarter == 4 else -math.sqrt(u)
    return radius * cosine, radius * sine, math.sqrt(max(0.0, 1 - u))


@kernel
def shifted(points: Array, s: int, pixel: int, seed: int) -> tuple[float, float]:
    """Return point s of the square, (s, 2) uint32 in 32-bit words, shifted at random for a pixel and pass."""
    word = hash_bits(np.uint32(pixel) ^ np.uint32(seed))
    u = ((points[s, 0] ^ hash_bits(word ^ np.uint32(0x68E31DA4))) + 0.5) * 2.0**-32
    return u, ((points[s, 1] ^ hash_bits(word ^ np.uint32(0xB5297A4D))) + 0.5) * 2.0**-32


@kernel
def to_far_side(receivers: RayReceivers, r: int, above: float, grain: float) -> Any:
    """Return how far below its usual origin a ray starts: 0, m, or where it goes below the face the way through it."""
    if above > 0 or grain < 0:
        return 0.0
    return 2.0 * ray_offset(receivers.position[0, r], receivers.position[1, r], receivers.position[2, r], grain)


@kernel(parallel=True)
def send(receivers: RayReceivers, span: tuple[int, int], points: Array, seed: int, reach: float, grain: float,
         paths: Paths) -> None:
    """Send one ray for each point of the set from each receiver of a span.

    `span`: first receiver and one past the last. `points` (s, 2) uint32: the pass's point set. `seed`: random shift: a
    hash of it and the receiver's pixel. `reach`: how far to look, m. `grain`: the tracer's, m, where rays go below the
    receiver's face as well; negative: they do not. `paths`: origins, directions, reach, lengths, cosines and weights
    are filled.
    """
    count = span[1] - span[0]
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _send(receivers, span[0], (chunk * CHUNK, min(count, chunk * CHUNK + CHUNK)), points, seed, reach, grain,
              paths)


@kernel
def _send(receivers: RayReceivers, first: int, span: tuple[int, int], points: Array, seed: int, reach: float,
          grain: float, paths: Paths) -> None:
    origins, directions, reaches, travelled, cosines, _, _, weights = paths
    pixel, _, normals, facing, starts = receivers
    ray = span[0] * len(points)
    for r in range(first + span[0], first + span[1]):
        normal = (np.float64(normals[0, r]), np.float64(normals[1, r]), np.float64(normals[2, r]))
        for s in range(len(points)):
            x, y, z = cosine_direction(*shifted(points, s, pixel[r], seed))
            w = around(normal, x, y, z)
            above = facing[0, r] * w[0] + facing[1, r] * w[1] + facing[2, r] * w[2]
            reaches[ray] = reach if above > 0 or grain >= 0 else 0
            down = to_far_side(receivers, r, above, grain)
            travelled[ray] = 0
            cosines[ray] = z
            for c in range(3):
                origins[ray, c] = starts[c, r] - down * facing[c, r]
                directions[ray, c] = w[c]
                weights[ray, c] = np.pi / len(points)
            ray += 1


@kernel(parallel=True)
def gather(surfaces: Surfaces, lights: LightTable, k: int, limits: tuple[float, float, float], sides: Sides,
           paths: Paths, shadows: Shadows, beside: Beside | None) -> None:
    """Next-event estimation: write the shadow ray from each hit point to one light, and its contribution.

    `limits`: bound on G in units of 1 / footprint (0: none), measure of one light direction (sr or m^2), and the
    tracer's grain: how far rays start above faces (m). `beside`: None where lobes come by directions alone. `shadows`:
    origins, directions, reach and contribution are filled; the reach is 0 where nothing contributes.
    """
    count = len(paths.reach)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _gather(surfaces, lights, k, limits, sides, paths, shadows, beside,
                (chunk * CHUNK, min(count, chunk * CHUNK + CHUNK)))


@kernel
def _gather(surfaces: Surfaces, lights: LightTable, k: int, limits: tuple[float, float, float], sides: Sides,
            paths: Paths, shadows: Shadows, beside: Beside | None, span: tuple[int, int]) -> None:
    bound, measure, grain = limits
    if beside is not None:
        tops = tops_for(beside.cells.tree)
    directional = lights.kind[k] == DIRECTIONAL
    for ray in range(span[0], span[1]):
        triangle = paths.triangle_id[ray]
        shadows.reach[ray] = 0
        if triangle == MISS:
            continue
        material = surfaces.material_of_face[triangle]
        w, y = hit_point(paths, ray)
        # the most frequent exits first, before anything is divided or normalised
        toward = toward_light(lights, k, y)
        cross = face_cross(surfaces, triangle)
        side = dot(cross, toward)
        if not leaves(sides, y, cross, side, dot(cross, w)):
            continue
        glossy = row(surfaces.specular, material)
        has_lobe = max(glossy[0], glossy[1], glossy[2]) > 0
        least = 0.0  # pattern that the light side covers: b r^2 / <n_x.w>, as G = pattern <n_x.w> / r^2
        if bound > 0:
            length = np.float64(paths.travelled[ray]) + paths.distance[ray]
            area = measure if directional else measure * dot(toward, toward)
            least = bound * length * length / (area * paths.cosine[ray])
            if least >= 1 and not has_lobe:
                continue
        lx, ly, lz, far, red, green, blue = incident_light(lights, k, y[0], y[1], y[2])
        if max(red, green, blue) <= 0:
            continue
        light, irradiance = (lx, ly, lz), (red, green, blue)
        rho = diffuse_at(surfaces.textures, surfaces, triangle, y)
        scale = math.copysign(1 / math.sqrt(dot(cross, cross)), side)
        g = (cross[0] * scale, cross[1] * scale, cross[2] * scale)
        n = shading_normal(surfaces, triangle, y, g)
        # radiance = rho F / pi * pattern / <g.w>, F = E_perp <g.l>
        factor = dot(g, light) / (np.pi * abs(dot(g, w)))
        # pattern times the MIS weight max(0, (G - b) / G)
        diffuse, lobe = max(0.0, dot(n, w) - least), 0.0
        if has_lobe:
            lobe = lobe_above(lobe_pattern(surfaces, material, n, light, w), glossy, dot(n, w), rho)
            if beside is not None and lobe > 0:
                lobe *= share_beside(beside, tops, k, (y, g), paths, ray, (
                    dot(g, w), 1.0 if directional else dot(toward, toward), dot(g, light)))
        most = 0.0
        for c in range(3):
            contribution = paths.weight[ray, c] * factor * irradiance[c] * (rho[c] * diffuse + glossy[c] * lobe)
            most = max(most, contribution)
            shadows.contribution[ray, c] = contribution
        if most > 0:
            aim_at_light(lights, k, (y, g, toward), far, lift(surfaces, triangle, y, g, grain), grain, shadows, ray)
