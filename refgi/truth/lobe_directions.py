"""Directions drawn from a receiver's lobe, and next-event estimation (NEE) where they land.

A direction of density (P + 1) / (2 pi) <m.w>^P that finds radiance L contributes s (P + 2) / (P + 1) <n.w> L: bounded,
however sharp the lobe. Symbols: as in `refgi.truth.lobe_receivers` and `refgi.truth.surfaces`; x the receiver, y where
a direction lands, A = r^2 n_a / n_b with n_a = D <m.w>^P <g.w> / r^2, D of `density_on_axis`, and n_b = <g.l> / (Omega
d^2) for a light one of whose rays has Omega.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.lobes import lobe_direction
from refgi.pairs.shadow_rays import RayReceivers
from refgi.radiometry import DIRECTIONAL, incident_light
from refgi.rays import MISS
from refgi.scene import LightTable
from refgi.truth.cell_densities import Beside, share_beside, tops_for
from refgi.truth.hemisphere import shifted, to_far_side
from refgi.truth.lobe_receivers import SHARPEST_VERTEX, Lobes, comes_by_photons, density_on_axis
from refgi.truth.next_event import aim_at_light, toward_light
from refgi.truth.paths import CHUNK, Paths, Shadows, Sides, dot, hit_point, leaves, row
from refgi.truth.surfaces import around, face_cross, lift, lobe_above, lobe_pattern, shading_normal
from refgi.truth.textured import diffuse_at

Array = npt.NDArray[Any]


@kernel(parallel=True)
def send_along_lobes(receivers: RayReceivers, lobes: Lobes, span: tuple[int, int], points: Array, seed: int,
                     grain: float, paths: Paths, density: Array) -> None:
    """Send one ray for each point of the set along the lobe of each receiver of a span.

    `span`: first receiver and one past the last. `points` (s, 2) uint32: the pass's point set. `seed`: random shift: a
    hash of it and the receiver's pixel. `grain`: as for `send`. `paths`: origins, directions, reach, lengths, cosines
    and weights are filled. `density` (n,) float64: filled: D <m.w>^P of each direction, 1/sr; inf for a receiver that
    takes nothing from light vertices.
    """
    count = span[1] - span[0]
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _send(receivers, lobes, span[0], (chunk * CHUNK, min(count, chunk * CHUNK + CHUNK)), points, seed, grain,
              paths, density)


@kernel
def _send(receivers: RayReceivers, lobes: Lobes, first: int, span: tuple[int, int], points: Array, seed: int,
          grain: float, paths: Paths, density: Array) -> None:
    origins, directions, reaches, travelled, cosines, _, _, weights = paths
    pixel, _, normals, facing, starts = receivers
    ray, count = span[0] * len(points), len(points)
    for r in range(first + span[0], first + span[1]):
        exponent, mirror = lobes.exponent[r], (lobes.mirrored[0, r], lobes.mirrored[1, r], lobes.mirrored[2, r])
        for s in range(count):
            u, v = shifted(points, s, pixel[r], seed)
            x, y, z = lobe_direction(u, v, exponent)
            w = around(mirror, x, y, z)
            cosine = normals[0, r] * w[0] + normals[1, r] * w[1] + normals[2, r] * w[2]
            above = facing[0, r] * w[0] + facing[1, r] * w[1] + facing[2, r] * w[2]
            reaches[ray] = np.inf if (above > 0 or grain >= 0) and cosine > 0 else 0
            down = to_far_side(receivers, r, above, grain)
            travelled[ray] = 0
            cosines[ray] = cosine
            # cos^P = u^(P / (P + 1))
            density[ray] = (np.inf if exponent > SHARPEST_VERTEX else
                            density_on_axis(exponent, count) * math.exp(math.log(u) * exponent / (exponent + 1)))
            # f_s <n.w> over the density
            weight = cosine * (exponent + 2) / (exponent + 1) / count
            for c in range(3):
                origins[ray, c] = starts[c, r] - down * facing[c, r]
                directions[ray, c] = w[c]
                weights[ray, c] = lobes.specular[c, r] * weight
            ray += 1


@kernel(parallel=True)
def gather_along_lobes(lobes: Lobes, lights: LightTable, k: int, limits: tuple[bool, float, float], sides: Sides,
                       rays: tuple[int, int], paths: Paths, density: Array, shadows: Shadows,
                       beside: Beside | None) -> None:
    """Next-event estimation: write the shadow ray from each hit point to one light, and its contribution.

    `limits`: whether light vertices share the light, measure of one light direction (sr or m^2), and the tracer's
    grain. `rays`: first receiver, and rays of each. `density` (n,): as `send_along_lobes` fills it. `shadows`: origins,
    directions, reach and contribution are filled; the reach is 0 where nothing contributes. `beside`: None where
    senders' lobes come by directions alone.
    """
    count = len(paths.reach)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _gather(lobes, lights, k, limits, sides, rays, paths, density, shadows, beside,
                (chunk * CHUNK, min(count, chunk * CHUNK + CHUNK)))


@kernel
def _gather(lobes: Lobes, lights: LightTable, k: int, limits: tuple[bool, float, float], sides: Sides,
            rays: tuple[int, int], paths: Paths, density: Array, shadows: Shadows, beside: Beside | None,
            span: tuple[int, int]) -> None:
    if beside is not None:
        tops = tops_for(beside.cells.tree)
    _, measure, grain = limits
    directional, surfaces = lights.kind[k] == DIRECTIONAL, lobes.surfaces
    for ray in range(span[0], span[1]):
        triangle = paths.triangle_id[ray]
        shadows.reach[ray] = 0
        if triangle == MISS:
            continue
        w, y = hit_point(paths, ray)
        toward = toward_light(lights, k, y)
        cross = face_cross(surfaces, triangle)
        side = dot(cross, toward)
        if not leaves(sides, y, cross, side, dot(cross, w)):
            continue
        lx, ly, lz, far, red, green, blue = incident_light(lights, k, y[0], y[1], y[2])
        if max(red, green, blue) <= 0:
            continue
        light, irradiance = (lx, ly, lz), (red, green, blue)
        scale = math.copysign(1 / math.sqrt(dot(cross, cross)), side)
        g = (cross[0] * scale, cross[1] * scale, cross[2] * scale)
        cos_in, cos_out = dot(g, light), dot(g, w)
        n = shading_normal(surfaces, triangle, y, g)
        share = 1.0  # of the power heuristic: 1 / (1 + (r^2 / A)^2)
        if limits[0] and density[ray] < np.inf:
            length = np.float64(paths.travelled[ray]) + paths.distance[ray]
            a = density[ray] * cos_out * (measure if directional else measure * dot(toward, toward)) / cos_in
            ratio = length * length / a
            share = 1 / (1 + ratio * ratio) if cos_out > 0 else 0.0  # light vertices have what leaves below its face
        rho, glossy = diffuse_at(surfaces.textures, surfaces, triangle, y), row(
            surfaces.specular, surfaces.material_of_face[triangle])
        diffuse, lobe = share * max(0.0, dot(n, w)), 0.0
        if max(glossy[0], glossy[1], glossy[2]) > 0:
            material = surfaces.material_of_face[triangle]
            lobe = lobe_above(lobe_pattern(surfaces, material, n, light, w), glossy, dot(n, w), rho)
            if surfaces.exponent[material] >= lobes.photon_exponent:
                by_photons = comes_by_photons(lobes.exponent[rays[0] + ray // rays[1]], surfaces.exponent[material])
                lobe = 0.0 if by_photons else lobe
            elif beside is not None and lobe > 0:
                lobe *= share_beside(beside, tops, k, (y, g), paths, ray, (
                    cos_out, 1.0 if directional else dot(toward, toward), cos_in))
        factor, most = cos_in / (np.pi * abs(cos_out)), 0.0
        for c in range(3):
            # radiance = rho F / pi * pattern / <g.w>, F = E_perp <g.l>
            contribution = paths.weight[ray, c] * factor * irradiance[c] * (rho[c] * diffuse + glossy[c] * lobe)
            most = max(most, contribution)
            shadows.contribution[ray, c] = contribution
        if most > 0:
            aim_at_light(lights, k, (y, g, toward), far, lift(surfaces, triangle, y, g, grain), grain, shadows, ray)
