"""One pass of the ground truth of glossy receivers: directions of their lobes, photons on them, and the rest.

Paths start along the receiver's lobe, and scatter at surfaces by every lobe; light vertices share the first bounce.

A direction of density (P + 1) / (2 pi) <m.w>^P that finds radiance L contributes s (P + 2) / (P + 1) <n.w> L: bounded,
however sharp the lobe. Symbols: as in `refgi.truth.lobe_cells` and `refgi.truth.surfaces`; x the receiver, y where
a direction lands, A = r^2 n_a / n_b with n_a = D <m.w>^P <g.w> / r^2, D of `density_on_axis`, and n_b = <g.l> / (Omega
d^2) for a light one of whose rays has Omega.

As `refgi.truth.caustics`, a photon of flux dPhi that lands in a pixel of solid angle W, the camera at distance D, gives
the irradiance E = dPhi <g.v> / (D^2 W) across the face; the pixel's lobe makes f_s(w, w_o) E <n.w> / <g.w> of it, with
normal and lobe at the pixel's centre. Photons of a single lobe that the receivers' own directions meet do not count.

Symbols: v towards the camera, g face normal where the photon lands, n the pixel's normal, w against the photon's way.
"""

import math
from collections.abc import Callable

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.shadow_rays import RayReceivers
from refgi.radiometry import DIRECTIONAL, incident_light, lobe_direction, lobe_gap, lobe_power, receiver_norm
from refgi.rays import MISS
from refgi.scene import DirectionalLight, LightTable
from refgi.truth.caustics import Film, photons_of, power_of, reflect, seen
from refgi.truth.cell_densities import Beside, share_beside, tops_for
from refgi.truth.cell_pass import add_cells, beside_of
from refgi.truth.hemisphere import scrambled_points, shifted, to_far_side
from refgi.truth.light_grid import light_rays
from refgi.truth.light_pass import add_light_side
from refgi.truth.lobe_cells import SHARPEST_VERTEX, Lobes, comes_by_photons, density_on_axis
from refgi.truth.passes import follow, scatter
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
    paths_for,
    row,
    toward_light,
)
from refgi.truth.surfaces import around, face_cross, lift, lobe_above, lobe_pattern, shading_normal
from refgi.truth.task import Draw, Task, drawn, spans
from refgi.types import Array


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


def lobe_photon_pass(film: Film, task: Task, random: np.random.Generator) -> Array:
    """Trace one pass of photons and reflect them by the lobes of the pixels they land in.

    `task`: with lobes. Returns (3, r) float64: radiance, W/m^2/sr.
    """
    assert task.lobes is not None
    radiance = np.zeros((3, len(task.receivers.pixel)))
    receiver_of = np.full(film.solid_angle.size, -1, np.int64)
    receiver_of[task.receivers.pixel] = np.arange(len(task.receivers.pixel))
    side, tracer, normals = math.isqrt(task.settings.photons), task.tracer, task.receivers.normal
    material_of_face = film.mirrors.material_of_face
    for k, light in enumerate(film.scene.lights):
        rays = light_rays(light, film.scene.geometry, random.random((side * side, 2)))
        batch = photons_of(rays.origins + tracer.offsets(rays.origins)[:, None] * rays.directions, rays.directions)
        power_of(task.lights, k, isinstance(light, DirectionalLight), rays.measure, rays.directions, batch.flux)
        lobe = np.zeros(len(batch.reach))  # exponent of the one lobe that a photon has met; inf after anything else
        for bounce in range(film.longest):
            tracer.fill_closest(batch.origin, batch.direction, batch.reach, batch.triangle_id, batch.distance)
            words = random.integers(2**32, size=len(batch.reach), dtype=np.uint32)
            found = batch.triangle_id != MISS
            landing = found & (bounce > 0)
            arriving, way = batch.flux[landing], -batch.direction[landing].astype(np.float64)
            reflect(film.mirrors, film.ior, tracer.grain, words, batch)
            if bounce:
                at, density, visible = seen(film, tracer, batch.landed[landing], batch.towards[landing])
                _reflect_to_eye(task.lobes, normals, receiver_of[at], arriving[visible] * density[:, None],
                                way[visible], batch.towards[landing][visible], lobe[landing][visible], radiance)
            material = material_of_face[np.where(found, batch.triangle_id, 0)]
            lobe[:] = film.mirrors.exponent[material] if bounce == 0 else np.inf
            lobe[film.ior[material] > 0] = np.inf
            if not (batch.reach > 0).any():
                break
    return radiance


@kernel
def _reflect_to_eye(lobes: Lobes, normals: Array, receiver: Array, irradiance: Array, way: Array, facing: Array,
                    sender: Array, radiance: Array) -> None:
    """Add what lobes make of photons, in their order; -1: no receiver. `irradiance` (n, 3): across the faces, W/m^2."""
    for i in range(len(receiver)):
        r = receiver[i]
        if r < 0 or not comes_by_photons(lobes.exponent[r], sender[i]):
            continue
        length = math.sqrt(way[i, 0] ** 2 + way[i, 1] ** 2 + way[i, 2] ** 2)
        x, y, z = way[i, 0] / length, way[i, 1] / length, way[i, 2] / length
        cosine = normals[0, r] * x + normals[1, r] * y + normals[2, r] * z
        across = facing[i, 0] * x + facing[i, 1] * y + facing[i, 2] * z
        if cosine <= 0 or across <= 0:
            continue
        gap = lobe_gap(lobes.mirrored[0, r], lobes.mirrored[1, r], lobes.mirrored[2, r], x, y, z)
        factor = receiver_norm(lobes.exponent[r]) * lobe_power(gap, lobes.exponent[r]) * cosine / across
        for c in range(3):
            radiance[c, r] += lobes.specular[c, r] * factor * irradiance[i, c]


LOBES = 1  # tells these passes' random numbers from those of irradiance


def lobe_pass(task: Task, number: int) -> Array:
    """Estimate what every receiver's lobe reflects towards the eye once.

    `task`: with lobes. `number`: which pass: its random numbers depend on this and the settings' seed alone. Returns
    (3, r) float64: radiance, W/m^2/sr.
    """
    assert task.lobes is not None
    sums = np.zeros((3, len(task.receivers.pixel)))
    draw = drawn(task.settings, number, LOBES)
    if len(task.receivers.pixel):
        if task.picks:
            add_light_side(task, draw, sums)
        if task.cells is not None:
            add_cells(task, int(draw.own[2]), sums)
        if task.directions:
            _add_directions(task, draw, sums)
        if task.caustics is not None:
            random = np.random.default_rng([*draw.own[:2], 1])
            sums += lobe_photon_pass(task.caustics, task, random)
    return sums


def _add_directions(task: Task, draw: Draw, sums: Array) -> None:
    """Add what directions along the lobes find, by its share where light vertices have the rest."""
    assert task.lobes is not None
    count, seed = task.directions, int(draw.shared[3])
    points = scrambled_points(count, seed, draw.turn)
    for first, last in spans(task, count):
        paths, density = paths_for((last - first) * count), np.empty((last - first) * count)
        send_along_lobes(task.receivers, task.lobes, (first, last), points, seed, task.grain_below, paths, density)
        for bounce in range(task.settings.bounces):
            if bounce:
                scatter(task.lobes.surfaces, task.tracer.grain, int(draw.own[3 + bounce]), task.receivers, first, count,
                        paths)
            follow(task, paths, first, count, 0.0, sums,
                   gathered=None if bounce else _gatherer(task, paths, density, first))


def _gatherer(task: Task, paths: Paths, density: Array, first: int) -> Callable[[int, float, Shadows], None]:
    """Return next-event estimation of what directions along the lobes find, towards one light."""
    assert task.lobes is not None
    lobes, beside = task.lobes, None if task.cells is None else beside_of(task, first)
    return lambda k, measure, shadows: gather_along_lobes(
        lobes, task.lights, k, (task.picks > 0, measure, task.tracer.grain), task.sides, (first, task.directions),
        paths, density, shadows, beside)
