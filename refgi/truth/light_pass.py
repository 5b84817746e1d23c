"""The light side of a pass: fresh light vertices from every light, picks among them, a shadow ray for each pick.

A pilot pass finds which cells of a light contribute to the picture; other passes importance-sample by it.

Rays through the centres of a fixed grid of cells find light vertices; some of the receivers pick among these as in a
pass, shadow rays included, and each unblocked pick is a contribution of its cell. The pilot depends on the scene, the
receivers and the settings alone, not on the seed. Its contributions only say where rays go: every pass divides by the
density and is unbiased whatever the pilot found, since a share of the rays stays uniform.
"""

from typing import Any

import numpy as np

from refgi.pairs.shadow_rays import RayReceivers
from refgi.rsm.pool import plane
from refgi.truth.camera_visibility import visible_vertices
from refgi.truth.light_grid import Density, cell_centres, density_of, footprint, rays_through, stratified_sets
from refgi.truth.light_side import pick, tiles
from refgi.truth.light_vertices import PointSets, closest_of, join, light_vertices, with_areas
from refgi.truth.lobe_light_side import pick_for_lobes
from refgi.truth.lobe_receivers import subset_of
from refgi.truth.paths import Shadows
from refgi.truth.task import Task, add_unblocked, shadow_batch, spans
from refgi.types import Array

CELLS = 64  # along one side of a light's grid
RECEIVERS, PICKS = 2048, 1 << 15  # sampled receivers, at most; picks of all of them together, at least


def add_light_side(task: Task, words: Array, sums: Array) -> None:
    """Add the irradiance from picked light vertices.

    `words` (3,) uint32: the pass's random numbers: two for the light vertices, one for the picks. `sums` (3, r)
    float64: added to, W/m^2.
    """
    sets, picks = fresh_points(task, np.random.default_rng(words[:2])), task.picks
    if not len(sets.points.power):
        return
    for first, last in spans(task, picks):
        rays, _ = pick_points(task, sets, (first, last), picks, int(words[2]))
        add_unblocked(task, rays, first, picks, sums, task.settings.visibility)


def fresh_points(task: Task, random: np.random.Generator) -> PointSets:
    """Trace fresh rays from every light to light vertices.

    `random`: places the rays in their cells.
    """
    n, side = task.settings.light_grid, task.settings.interleave
    count = len(task.scene.lights)
    squares = [stratified_sets(n, side, random) for _ in range(count)]
    return trace_vertices(task, squares, task.densities or (None,) * count)


def trace_vertices(task: Task, squares: list[Array], densities: tuple[Any, ...]) -> PointSets:
    """Trace rays from every light, through points of its unit square, to light vertices.

    `squares`: points of each light, in sets.
    """
    settings, sets, per_set = task.settings, len(squares[0]) if squares else 1, squares[0].shape[1] if squares else 1
    parts = []
    for k, (light, square, density) in enumerate(zip(task.scene.lights, squares, densities, strict=True)):
        rays = rays_through(light, task.scene.geometry, square.reshape(-1, 2), per_set, density)
        part = light_vertices(task.surfaces, task.lights, k, rays, closest_of(task.tracer, rays), settings.shared_bound)
        if task.lobes is not None:
            part = with_areas(part, light, footprint(light, task.scene.geometry, settings.light_grid)[0])
        parts.append(part if task.view is None else visible_vertices(task.tracer, task.view, part))
    return join(parts, sets, per_set)


def pick_points(task: Task, sets: PointSets, span: tuple[int, int], picks: int, seed: int) -> tuple[Shadows, Array]:
    """Pick light vertices for the receivers of a span.

    `span`: first receiver and one past the last. `picks`: picks of each receiver. `seed`: random shift of each
    receiver's picks. Result: shadow rays, not traced, and which point each goes to.
    """
    rays, picked = shadow_batch((span[1] - span[0]) * picks), plane(((span[1] - span[0]) * picks,), np.int32)
    written = (rays.origin, rays.direction, rays.reach, rays.contribution, picked)
    sampling = (span[0], picks, seed, np.float32(task.tracer.grain), task.sides.hide)
    if task.lobes is None:
        pick(*sets, task.receivers, tiles(task.set_of, *span), sampling, written)
    else:
        pick_for_lobes(*sets, task.receivers, task.lobes, tiles(task.set_of, *span),
                       (*sampling, float(task.directions)), written)
    return rays, picked


def pilot(task: Task) -> tuple[Density | None, ...]:
    """Estimate the density of each light's rays, in proportion to contributions.

    Result: one a light; empty for a uniform density.
    """
    lights, share = len(task.scene.lights), task.settings.uniform_share
    if share == 1 or not task.picks or not lights or not len(task.receivers.pixel):
        return ()
    centres = cell_centres(CELLS)
    cell = np.floor(centres * CELLS).astype(np.int64)
    contributions = np.zeros((lights, CELLS, CELLS))
    contributions[:, cell[:, 0], cell[:, 1]] = _contributions(task, centres).reshape(lights, -1)
    return tuple(density_of(_smooth(contribution), share) for contribution in contributions)


def _contributions(task: Task, centres: Array) -> Array:
    """Return the contribution of each pilot ray to the sampled receivers, (lights * rays,)."""
    rays = len(task.scene.lights) * len(centres)
    sets = trace_vertices(task, [centres[None]] * len(task.scene.lights), (None,) * len(task.scene.lights))
    if not len(sets.points.power):
        return np.zeros(rays)
    subset = _subset(task)
    sampled = len(subset.receivers.pixel)
    picks = max(task.picks, -(-PICKS // sampled))
    shadows, picked = pick_points(subset, sets, (0, sampled), picks, 0)
    add_unblocked(subset, shadows, 0, picks, np.zeros((3, sampled)), task.settings.visibility)
    free = ~shadows.blocked
    contribution = shadows.contribution[free].sum(axis=1, dtype=np.float64)
    return np.bincount(sets.points.ray[picked[free]], contribution, rays)


def _subset(task: Task) -> Task:
    """Return the task for a random subset of its receivers, which all pick from one set."""
    count = len(task.receivers.pixel)
    chosen = np.sort(np.random.default_rng(0).choice(count, min(count, RECEIVERS), replace=False))
    receivers = RayReceivers(*(np.ascontiguousarray(field[..., chosen]) for field in task.receivers))
    lobes = None if task.lobes is None else subset_of(task.lobes, chosen)
    return task._replace(receivers=receivers, set_of=np.zeros(len(chosen), np.int64), lobes=lobes)


def _smooth(values: Array) -> Array:
    """Average each cell with its neighbours, twice: picks are few, and illuminated areas have edges inside cells."""
    for _ in range(2):
        wide = np.pad(values, 1, mode="edge")
        values = np.mean([wide[i : i + len(values), j : j + len(values)] for i in range(3) for j in range(3)], axis=0)
    return values
