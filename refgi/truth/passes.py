"""One pass of the ground truth: an unbiased estimate of every receiver's one-bounce irradiance.

At a surface a path passes through (without visibility), or scatters by the surface's reflection.

What the bound leaves to directions lies near lit surfaces: in corners nearly all of its variance, elsewhere nothing.
A pilot sends two directions from every second receiver, twice; the difference tells the standard deviation s of each
block of 8 x 8 pixels, averaged with its neighbours'. A block then gets n = N s / rms(s) directions, as a power of two:
least error for so many rays. The pilot does not depend on the seed and leaves no receiver without directions: passes
stay unbiased whatever it found.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.shadow_rays import RayReceivers
from refgi.radiometry import inverse_fraction, lobe_direction
from refgi.rays import MISS
from refgi.sampling import hash_bits, uniform
from refgi.truth.caustics import photon_pass
from refgi.truth.cell_densities import Beside
from refgi.truth.cell_pass import add_cells, beside_of
from refgi.truth.hemisphere import cosine_direction, gather, scrambled_points, send
from refgi.truth.light_grid import footprint
from refgi.truth.light_pass import add_light_side, hidden_from_camera
from refgi.truth.paths import Paths, Shadows, diffuse_at, dot, hit_point, pass_through, paths_for, row
from refgi.truth.result import blocks_of
from refgi.truth.surfaces import Surfaces, around, face_normal, lift, shading_normal
from refgi.truth.task import Draw, Group, Task, add_unblocked, drawn, shadow_batch, spans
from refgi.types import Array


@kernel(parallel=True)
def scatter(surfaces: Surfaces, grain: float, seed: int, receivers: RayReceivers, first: int, per_receiver: int,
            paths: Paths) -> None:
    """Send each path on from the surface it hit, by that surface's BRDF.

    `grain`: the tracer's: how far rays start above faces, m. `seed`: random numbers: a hash of it, the receiver's pixel
    and the path's number there. `first`: receiver of the first path. `per_receiver`: paths of each receiver. `paths`:
    origins, directions, reach and weights are renewed; paths that found nothing or a black surface end.

    One of the two parts is chosen by its largest reflectance, with probability p. With v the way back, the diffuse
    part sends on a cosine-distributed direction around the face normal g with weight rho <n.v> / (<g.v> p), the lobe a
    direction around the mirror direction of v with density (P + 1) / (2 pi) cos^P and weight rho <g.w> / (K <g.v> p),
    K for light that comes from w.
    """
    for ray in prange(len(paths.reach)):
        pixel = receivers.pixel[first + ray // per_receiver]
        word = hash_bits(hash_bits(np.uint32(pixel) ^ np.uint32(seed)) + np.uint32(ray % per_receiver))
        _scatter(surfaces, grain, word, paths, ray)


@kernel
def _scatter(surfaces: Surfaces, grain: float, word: Any, paths: Paths, ray: int) -> None:
    triangle = paths.triangle_id[ray]
    paths.reach[ray] = 0
    if triangle == MISS:
        return
    material = surfaces.material_of_face[triangle]
    back, y = hit_point(paths, ray)
    rho, glossy = diffuse_at(surfaces.textures, surfaces, triangle, y), row(surfaces.specular, material)
    most, most_glossy = max(rho[0], rho[1], rho[2]), max(glossy[0], glossy[1], glossy[2])
    if most + most_glossy <= 0:
        return
    u, v = uniform(word ^ np.uint32(0x68E31DA4)), uniform(word ^ np.uint32(0xB5297A4D))
    chance = most / (most + most_glossy)
    g = face_normal(surfaces, triangle, -back[0], -back[1], -back[2])
    n = shading_normal(surfaces, triangle, y, g)
    cos_g, cos_n = dot(g, back), dot(n, back)
    if cos_g <= 0 or cos_n <= 0:
        return
    if uniform(word ^ np.uint32(0x1B56C4E9)) < chance:
        x0, x1, x2 = cosine_direction(u, v)
        w = around(g, x0, x1, x2)
        part, factor = rho, cos_n / (cos_g * chance)
    else:
        exponent = surfaces.exponent[material]
        mirror = (2 * cos_n * n[0] - back[0], 2 * cos_n * n[1] - back[1], 2 * cos_n * n[2] - back[2])
        x0, x1, x2 = lobe_direction(u, v, exponent)
        w = around(mirror, x0, x1, x2)
        part, factor = glossy, dot(g, w) * inverse_fraction(dot(n, w), exponent) / (cos_g * (1 - chance))
    if dot(g, w) <= 0 or factor <= 0:
        return
    paths.reach[ray] = np.inf
    offset = lift(surfaces, triangle, y, g, grain)
    for c in range(3):
        paths.origin[ray, c] = y[c] + offset * g[c]
        paths.direction[ray, c] = w[c]
        paths.weight[ray, c] *= part[c] * factor


def one_pass(task: Task, number: int) -> Array:
    """Estimate every receiver's irradiance once.

    `number`: which pass: its random numbers depend on this and the settings' seed alone. Returns (3, r) float64:
    irradiance, W/m^2.
    """
    sums = np.zeros((3, len(task.receivers.pixel)))
    draw = drawn(task.settings, number)
    if len(task.receivers.pixel):
        if task.settings.picks_per_pass:
            add_light_side(task, draw, sums)
        if task.cells is not None:
            add_cells(task, int(draw.own[2]), sums)
        if task.settings.directions_per_pass:
            _hemisphere(task, draw, sums)
        if task.caustics is not None:
            random = np.random.default_rng([*draw.own[:2], 1])
            photons = photon_pass(task.caustics, task.tracer, task.lights, task.settings.photons, random)
            sums += photons[:, task.receivers.pixel]
    return sums


def _hemisphere(task: Task, draw: Draw, sums: Array) -> None:
    """Add the hemisphere estimator, by its MIS weight where the light side has the rest."""
    if not task.groups:
        add_directions(task, task.settings.directions_per_pass, draw, sums)
    for group in task.groups:
        found = np.zeros((3, len(group.chosen)))
        add_directions(task._replace(receivers=group.receivers), group.directions, draw, found)
        sums[:, group.chosen] += found


def add_directions(task: Task, count: int, draw: Draw, sums: Array) -> None:
    """Add what so many directions of each receiver find."""
    seed, reach = int(draw.shared[3]), directions_reach(task)
    points = scrambled_points(count, seed, draw.turn)
    for first, last in spans(task, count):
        paths = paths_for((last - first) * count)
        send(task.receivers, (first, last), points, seed, reach, task.grain_below, paths)
        for bounce in range(task.settings.bounces):
            if bounce:
                scatter(task.surfaces, task.tracer.grain, int(draw.own[3 + bounce]), task.receivers, first, count,
                        paths)
            beside = beside_of(task, first) if bounce == 0 and task.cells is not None else None
            follow(task, paths, first, count, task.settings.shared_bound if bounce == 0 else 0.0, sums, beside)


def follow(task: Task, paths: Paths, first: int, count: int, bound: float, sums: Array,
           beside: Beside | None = None, gathered: Callable[[int, float, Shadows], None] | None = None) -> None:
    """Trace paths to the next surface, next-event estimation there; to every surface along them without visibility.

    `gathered`: fills shadow rays to a light of some measure, in place of `gather`.
    """
    while True:
        task.tracer.fill_closest(paths.origin, paths.direction, paths.reach, paths.triangle_id, paths.distance)
        hidden = hidden_from_camera(task, paths)
        for k, light in enumerate(task.scene.lights):
            measure, _ = footprint(light, task.scene.geometry, task.settings.light_grid)
            shadows = shadow_batch(len(paths.reach))
            if gathered is not None:
                gathered(k, measure, shadows)
            else:
                gather(task.surfaces, task.lights, k, (bound, measure, task.tracer.grain), task.sides, paths, shadows,
                       beside)
            if hidden is not None:
                shadows.reach[hidden] = 0
            add_unblocked(task, shadows, first, count, sums, True)
        if task.settings.visibility:
            return
        pass_through(task.surfaces, task.tracer.grain, paths)
        if not (paths.reach > 0).any():
            return


def directions_reach(task: Task) -> float:
    """Return the length of hemisphere rays: beyond, the geometry term stays below the bound; lobes know none."""
    bound, surfaces = task.settings.shared_bound, task.surfaces
    if bound == 0 or task.settings.bounces > 1 or surfaces.specular.any():
        return np.inf
    most = max((footprint(light, task.scene.geometry, task.settings.light_grid)[1] for light in task.scene.lights),
               default=0.0)
    return float(np.sqrt(most / bound))


PILOT, EVERY = 2, 2  # directions of each half, of every second receiver
FEWEST, MOST = 0.125, 8.0  # of N


def directions_shared_out(task: Task) -> tuple[Group, ...]:
    """Return groups of receivers with as many directions each; none where all have the same.

    Only where directions are short: there the light side has nearly all light.
    """
    count, pixel = task.settings.directions_per_pass, task.receivers.pixel
    if task.lobes is not None or not count or not len(pixel) or np.isinf(directions_reach(task)):
        return ()
    sampled = task._replace(receivers=_some(task.receivers, np.arange(0, len(pixel), EVERY)))
    halves = np.zeros((2, 3, len(sampled.receivers.pixel)))
    for half, words in zip(halves, np.random.SeedSequence(0).generate_state(8).reshape(2, 4), strict=True):
        add_directions(sampled, PILOT, Draw(words, words, 0), half)
    block, grid = blocks_of(pixel, task.shape)
    sums = [_with_neighbours(np.bincount(block[::EVERY], weights, grid[0] * grid[1]).reshape(grid))
            for weights in (((halves[0] - halves[1]) ** 2).mean(axis=0), None)]
    deviation = np.sqrt(sums[0] / np.maximum(sums[1], 1)).ravel()[block]
    rms = np.sqrt((deviation**2).mean())
    share = np.clip(deviation / rms, FEWEST, MOST) if rms > 0 else np.full(len(block), FEWEST)
    counts = 2 ** np.rint(np.log2(np.maximum(count * share, 1))).astype(np.int64)
    return tuple(Group(int(n), chosen, _some(task.receivers, chosen))
                 for n in np.unique(counts) for chosen in (np.flatnonzero(counts == n),))


def _some(receivers: RayReceivers, chosen: Array) -> RayReceivers:
    return RayReceivers(*(np.ascontiguousarray(field[..., chosen]) for field in receivers))


def _with_neighbours(values: Array) -> Array:
    """Return the sum over each value and the eight around it."""
    wide = np.pad(values.astype(np.float64), 1)
    rows, columns = values.shape
    return np.asarray(sum(wide[i : i + rows, j : j + columns] for i in range(3) for j in range(3)))
