"""Lobes of senders in a pass: rays into picked cells, directions to images in them, and what they find, connected.

Symbols: as in `refgi.truth.cell_densities`.
"""

import math
from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.radiometry import DIRECTIONAL, incident_light, radiant_intensity
from refgi.rays import MISS, far_offset, ray_offset
from refgi.scene import LightTable
from refgi.truth.cell_densities import (
    Beside,
    Tops,
    direction_density,
    found_for,
    image_density,
    near_density,
    point_of,
    rays_beside,
    response,
    tops_for,
)
from refgi.truth.cell_rays import Picks, pick_cells, picks_for
from refgi.truth.cell_walk import CHUNK, on_face
from refgi.truth.light_pass import hidden_from_camera
from refgi.truth.lobe_cells import lobe_cells
from refgi.truth.paths import Shadows, aim_at_light, dot, hit_point, pass_through, row, toward_light
from refgi.truth.surfaces import Surfaces, face_normal, height_above, lift, lobe_pattern, shading_normal
from refgi.truth.task import Task, add_unblocked, shadow_batch, spans
from refgi.types import Array


@kernel(parallel=True)
def connect(beside: Beside, surfaces: Surfaces, lights: LightTable, grain: float, visibility: bool, picks: Picks,
            shadows: Shadows) -> None:
    """Write the shadow ray that is left of each pick, and what the lobe at the point that it found sends.

    From there to the receiver for b, one of no length without `visibility`; to the light for c. `shadows`: origins,
    directions, reach and contribution are filled; the reach is 0 where nothing arrives.
    """
    count = len(picks.light)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _connect_span(beside, surfaces, lights, grain, visibility, picks, shadows, chunk * CHUNK,
                      min(count, chunk * CHUNK + CHUNK))


@kernel
def _connect_span(beside: Beside, surfaces: Surfaces, lights: LightTable, grain: float, visibility: bool, picks: Picks,
                  shadows: Shadows, low: int, high: int) -> None:
    each, tops = beside.counts.cells + beside.counts.mirrors, tops_for(beside.cells.tree)
    for ray in range(low, high):
        shadows.reach[ray] = 0
        triangle, r = picks.paths.triangle_id[ray], beside.first + ray // each
        if picks.paths.reach[ray] > 0 and triangle != MISS and _has_lobe(surfaces, triangle):
            if ray % each < beside.counts.cells:
                _connect_to_receiver(beside, r, surfaces, lights, grain, visibility, picks, tops, shadows, ray)
            else:
                _connect_to_light(beside, r, surfaces, lights, grain, picks, tops, shadows, ray)


@kernel
def _connect_to_receiver(beside: Beside, r: int, surfaces: Surfaces, lights: LightTable, grain: float,
                         visibility: bool, picks: Picks, tops: Tops, shadows: Shadows, ray: int) -> None:
    triangle, k, receivers = picks.paths.triangle_id[ray], picks.light[ray], beside.receivers
    back, y = hit_point(picks.paths, ray)
    g = face_normal(surfaces, triangle, -back[0], -back[1], -back[2])
    height = height_above(surfaces, triangle, y, g)
    y = (y[0] - height * g[0], y[1] - height * g[1], y[2] - height * g[2])
    way, n = subtract(y, point_of(receivers.position, r)), point_of(receivers.normal, r)
    length = math.sqrt(dot(way, way))
    if length == 0 or dot(n, way) <= 0:
        return
    if beside.hide and (dot(g, way) >= 0 or dot(point_of(receivers.facing, r), way) <= 0):
        return
    w = (way[0] / length, way[1] / length, way[2] / length)
    toward, power = toward_light(lights, k, y), row(lights.intensity, k)
    if lights.kind[k] != DIRECTIONAL:
        power = radiant_intensity(lights, k, -toward[0], -toward[1], -toward[2])
    mirror, chance, image = np.int64(picks.mirror[ray]), picks.mirror_chance[ray], 0.0
    if beside.counts.mirrors > 0 and not on_face(beside.cells, picks.cell[ray], y, g):
        found = found_for(beside, k, y, g, r, tops)
        mirror, chance = found.mirror, found.mirror_chance
    if mirror >= 0 and beside.counts.mirrors > 0:
        image = beside.counts.mirrors * chance * image_density(beside, k, mirror, r, w)
    cosine, lobes = dot(n, w), beside.lobes
    near = beside.counts.directions * direction_density(lobes, r, w, cosine)
    total = near_density(near, image, (-dot(g, w), dot(toward, toward), dot(g, back)))
    total += picks.density[ray] * length * length
    if _fill_lobe(surfaces, triangle, (y, g, back, w), response(lobes, r, w, cosine), power, total, shadows, ray):
        offset = ray_offset(y[0], y[1], y[2], grain) + far_offset(way[0], way[1], way[2])
        for c in range(3):
            shadows.origin[ray, c] = receivers.origin[c, r]
            shadows.direction[ray, c] = y[c] + offset * g[c] - receivers.origin[c, r] if visibility else 0.0
        shadows.reach[ray] = 1


@kernel
def _connect_to_light(beside: Beside, r: int, surfaces: Surfaces, lights: LightTable, grain: float, picks: Picks,
                      tops: Tops, shadows: Shadows, ray: int) -> None:
    triangle, k, receivers = picks.paths.triangle_id[ray], picks.light[ray], beside.receivers
    back, y = hit_point(picks.paths, ray)
    toward = toward_light(lights, k, y)
    g = face_normal(surfaces, triangle, -toward[0], -toward[1], -toward[2])
    lx, ly, lz, far, red, green, blue = incident_light(lights, k, y[0], y[1], y[2])
    if dot(g, back) <= 0 or max(red, green, blue) <= 0:
        return
    found = found_for(beside, k, y, g, r, tops)
    if found.mirror != picks.mirror[ray]:
        return
    w, square = (-back[0], -back[1], -back[2]), dot(toward, toward)
    cosine = dot(point_of(receivers.normal, r), w)
    length = np.float64(picks.paths.travelled[ray]) + picks.paths.distance[ray]
    total = rays_beside(beside, k, found, r, (w, cosine, length), (dot(g, back), square, dot(g, (lx, ly, lz))))
    power = (red * square, green * square, blue * square)
    received = response(beside.lobes, r, w, cosine)
    if _fill_lobe(surfaces, triangle, (y, g, (lx, ly, lz), w), received, power, total, shadows, ray):
        aim_at_light(lights, k, (y, g, toward), far, lift(surfaces, triangle, y, g, grain), grain, shadows, ray)


@kernel
def _has_lobe(surfaces: Surfaces, triangle: int) -> bool:
    glossy = row(surfaces.specular, surfaces.material_of_face[triangle])
    return max(glossy[0], glossy[1], glossy[2]) > 0


@kernel
def subtract(a: tuple[float, float, float], b: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def _fill_lobe(surfaces: Surfaces, triangle: int, sender: Any, received: float, power: Any, total: float,
               shadows: Shadows, ray: int) -> bool:
    """Fill rho I pattern / (pi r^2) over all densities, `total` r^2, times `received`; return whether that is light.

    `sender`: the point, its face normal, towards the light, and the direction from the receiver. `power`: I, W/sr.
    """
    y, g, light, w = sender
    material = surfaces.material_of_face[triangle]
    n, glossy = shading_normal(surfaces, triangle, y, g), row(surfaces.specular, material)
    pattern = lobe_pattern(surfaces, material, n, light, (-w[0], -w[1], -w[2]))
    most = 0.0
    for c in range(3):
        shadows.contribution[ray, c] = glossy[c] * power[c] * pattern * received / (np.pi * total) if total > 0 else 0.0
        most = max(most, shadows.contribution[ray, c])
    return most > 0


def with_cells(task: Task) -> Task:
    """Return a task with cells of its senders' lobes."""
    if not task.picks or not task.scene.lights or not task.surfaces.specular.any():
        return task
    return task._replace(cells=lobe_cells(task.scene, task.tracer, task.surfaces, task.lights))


def beside_of(task: Task, first: int) -> Beside:
    """Return what densities of lobes depend on, for rays of the receivers from `first` on."""
    assert task.cells is not None
    return Beside(task.cells, task.receivers, task.lobes, task.counts, first, task.sides.hide)


def add_cells(task: Task, seed: int, sums: Array) -> None:
    """Add what lobes of senders send, by rays into picked cells and by directions to images in them.

    `sums` (3, r): irradiance, W/m^2, or with lobes of the receivers radiance, W/m^2/sr.
    """
    lobes = task.lobes
    found = sums if lobes is None else np.zeros_like(sums)
    each, visibility = task.counts.cells + task.counts.mirrors, task.settings.visibility
    for first, last in spans(task, each):
        beside, count = beside_of(task, first), (last - first) * each
        picks, shadows = picks_for(count), shadow_batch(count)
        paths, from_lights = picks.paths, np.arange(count) % each < task.counts.cells
        pick_cells(beside, (first, last), seed, task.tracer.grain, picks)
        while (paths.reach > 0).any():
            task.tracer.fill_closest(paths.origin, paths.direction, paths.reach, paths.triangle_id, paths.distance)
            connect(beside, task.surfaces, task.lights, task.tracer.grain, visibility, picks, shadows)
            hidden = hidden_from_camera(task, paths)
            if hidden is not None:
                shadows.reach[hidden] = 0
            add_unblocked(task, shadows, first, each, found, visibility or task.counts.mirrors > 0)
            if visibility:
                break
            paths.reach[from_lights] = 0  # what light reaches is what it meets first
            pass_through(task.surfaces, task.tracer.grain, paths)
    if lobes is not None:
        sums += lobes.specular * found
