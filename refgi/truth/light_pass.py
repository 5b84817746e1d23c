"""The light side of a pass: fresh light vertices from every light, picks among them, a shadow ray for each pick.

A pilot pass finds which cells of a light contribute, other passes importance-sample by it: rays through the centres of
a fixed grid of cells, and each unblocked pick of some of the receivers counts for its cell. It depends on the scene,
the receivers and the settings alone, not on the seed, and only says where rays go: every pass divides by the density,
and a share of the rays stays uniform.

A screen-space method knows no emitters but those inside the camera's picture, on the side that faces the eye, with
nothing between. With only these the truth is what it can reach at best.
"""

from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.shadow_rays import RayReceivers
from refgi.rays import MISS, Tracer, ray_offset
from refgi.rsm.pool import plane
from refgi.rsm.raster.projection import Projection, texel_of
from refgi.truth.light_grid import Density, cell_centres, density_of, footprint, rays_through, stratified_sets
from refgi.truth.light_side import pick, tiles
from refgi.truth.light_vertices import LightVertices, PointSets, closest_of, join, light_vertices, with_areas
from refgi.truth.lobe_cells import subset_of
from refgi.truth.lobe_light_side import pick_for_lobes
from refgi.truth.paths import CHUNK, Paths, Shadows, dot, hit_point
from refgi.truth.surfaces import Surfaces, face_normal, lift
from refgi.truth.task import Draw, Task, add_unblocked, shadow_batch, spans
from refgi.types import Array


@kernel
def aim_at_eye(view: Projection, offset: float, y: tuple[float, float, float], g: tuple[float, float, float],
               rays: tuple[Array, Array, Array], ray: int) -> None:
    """Write the ray from a point to the eye.

    `offset`: how far along g the ray starts, m. `y`: the point, m. `g`: unit face normal on the side that emits.
    `rays`: origins and directions (n, 3) and reach (n,), float32: filled at `ray`; the reach is 1, or 0 where the point
    lies outside the picture or that side faces away.
    """
    origins, directions, reach = rays
    eye = (view.origin[0, 0], view.origin[0, 1], view.origin[0, 2])
    toward = (eye[0] - y[0], eye[1] - y[1], eye[2] - y[2])
    row, _, _ = texel_of(view, y[0], y[1], y[2])
    for c in range(3):
        origins[ray, c] = y[c] + offset * g[c]
        directions[ray, c] = toward[c] - offset * g[c]
    reach[ray] = 1 if dot(toward, g) > 0 and not np.isnan(row) else 0


def visible_vertices(tracer: Tracer, view: Projection, points: LightVertices) -> LightVertices:
    """Return the light vertices that are visible to a camera, in their order."""
    count = len(points.power)
    origins, directions = np.empty((count, 3), np.float32), np.empty((count, 3), np.float32)
    reach, blocked = np.empty(count, np.float32), np.empty(count, np.bool_)
    _aim_points(view, tracer.grain, points.position, points.facing, (origins, directions, reach))
    tracer.fill_occluded(origins, directions, reach, blocked)
    return LightVertices(*(part[..., ~blocked] for part in points))


@kernel
def _aim_points(view: Projection, grain: float, position: Array, facing: Array,
                rays: tuple[Array, Array, Array]) -> None:
    for i in range(position.shape[1]):
        y = (np.float64(position[0, i]), np.float64(position[1, i]), np.float64(position[2, i]))
        g = (np.float64(facing[0, i]), np.float64(facing[1, i]), np.float64(facing[2, i]))
        aim_at_eye(view, ray_offset(y[0], y[1], y[2], grain), y, g, rays, i)


@kernel(parallel=True)
def aim_paths(view: Projection, surfaces: Surfaces, grain: float, paths: Paths, rays: Shadows) -> None:
    """Write a ray to the eye from each surface that paths found.

    `grain`: the tracer's: how far rays start above faces, m. `rays`: origins, directions and reach are filled; the
    reach is 0 where nothing was hit or it cannot be visible.
    """
    count = len(paths.reach)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        _aim_paths(view, surfaces, grain, paths, rays, (chunk * CHUNK, min(count, chunk * CHUNK + CHUNK)))


@kernel
def _aim_paths(view: Projection, surfaces: Surfaces, grain: float, paths: Paths, rays: Shadows,
               span: tuple[int, int]) -> None:
    written = (rays.origin, rays.direction, rays.reach)
    for ray in range(span[0], span[1]):
        rays.reach[ray] = 0
        if paths.triangle_id[ray] != MISS:
            _, y = hit_point(paths, ray)
            g = face_normal(surfaces, paths.triangle_id[ray], y[0] - view.origin[0, 0], y[1] - view.origin[0, 1],
                            y[2] - view.origin[0, 2])  # on the eye's side; `leaves` asks whether that is the light's
            aim_at_eye(view, lift(surfaces, paths.triangle_id[ray], y, g, grain), y, g, written, ray)


def hidden_from_camera(task: Task, paths: Paths) -> Array | None:
    """Return which paths end at points that the camera does not see; None where that does not matter."""
    if task.view is None:
        return None
    rays = shadow_batch(len(paths.reach))
    aim_paths(task.view, task.surfaces, task.tracer.grain, paths, rays)
    task.tracer.fill_occluded(rays.origin, rays.direction, rays.reach, rays.blocked)
    return rays.blocked


CELLS = 64  # along one side of a light's grid
RECEIVERS, PICKS = 2048, 1 << 15  # sampled receivers, at most; picks of all of them together, at least


def add_light_side(task: Task, draw: Draw, sums: Array) -> None:
    """Add the irradiance from picked light vertices; `sums` (3, r) float64: added to, W/m^2."""
    sets, picks = fresh_points(task, np.random.default_rng(draw.shared[:2]), draw.turn), task.picks
    if not len(sets.points.power):
        return
    for first, last in spans(task, picks):
        rays, _ = pick_points(task, sets, (first, last), picks, int(draw.shared[2]), draw.turn)
        add_unblocked(task, rays, first, picks, sums, task.settings.visibility)


def fresh_points(task: Task, random: np.random.Generator, turn: int = 0) -> PointSets:
    """Trace fresh rays from every light to light vertices; `random`, `turn`: place the rays in their cells."""
    n, side = task.settings.light_grid, task.settings.interleave
    count = len(task.scene.lights)
    squares = [stratified_sets(n, side, random, turn) for _ in range(count)]
    return trace_vertices(task, squares, task.densities or (None,) * count)


def trace_vertices(task: Task, squares: list[Array], densities: tuple[Any, ...]) -> PointSets:
    """Trace rays from every light, through points of its unit square in sets, to light vertices."""
    settings, sets, per_set = task.settings, len(squares[0]) if squares else 1, squares[0].shape[1] if squares else 1
    parts = []
    for k, (light, square, density) in enumerate(zip(task.scene.lights, squares, densities, strict=True)):
        rays = rays_through(light, task.scene.geometry, square.reshape(-1, 2), per_set, density)
        part = light_vertices(task.surfaces, task.lights, k, rays, closest_of(task.tracer, rays), settings.shared_bound)
        if task.lobes is not None:
            part = with_areas(part, light, footprint(light, task.scene.geometry, settings.light_grid)[0])
        parts.append(part if task.view is None else visible_vertices(task.tracer, task.view, part))
    return join(parts, sets, per_set)


def pick_points(task: Task, sets: PointSets, span: tuple[int, int], picks: int, seed: int,
                turn: int = 0) -> tuple[Shadows, Array]:
    """Pick light vertices for the receivers of a span.

    `span`: first receiver and one past the last. `picks`: picks of each receiver. `seed`, `turn`: random shift of each
    receiver's picks. Result: shadow rays, not traced, and which point each goes to.
    """
    rays, picked = shadow_batch((span[1] - span[0]) * picks), plane(((span[1] - span[0]) * picks,), np.int32)
    written = (rays.origin, rays.direction, rays.reach, rays.contribution, picked)
    sampling = (span[0], picks, seed, turn, np.float32(task.tracer.grain), task.sides.hide)
    if task.lobes is None:
        pick(*sets, task.receivers, tiles(task.set_of, *span), sampling, written)
    else:
        pick_for_lobes(*sets, task.receivers, task.lobes, tiles(task.set_of, *span),
                       (*sampling, float(task.directions)), written)
    return rays, picked


def pilot(task: Task) -> tuple[Density | None, ...]:
    """Estimate the density of each light's rays, in proportion to contributions; empty for a uniform one."""
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
