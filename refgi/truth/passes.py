"""One pass of the ground truth: an independent, unbiased estimate of every receiver's one-bounce irradiance."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.rays import Tracer
from refgi.rsm.projection import Projection
from refgi.scene import LightTable, Scene
from refgi.shadowed import Receivers, add_free
from refgi.truth.caustics import Film, photon_pass
from refgi.truth.hemisphere import gather, scrambled_points, send
from refgi.truth.light_grid import footprint, light_rays
from refgi.truth.light_side import pick
from refgi.truth.lit_points import LitPoints, join, trace_lit_points
from refgi.truth.paths import Paths, Shadows
from refgi.truth.scattering import pass_through, scatter
from refgi.truth.seen import aim_paths, seen_points
from refgi.truth.settings import TruthSettings
from refgi.truth.surfaces import Surfaces

Array = npt.NDArray[Any]


# A lobe may point below an interpolated horizon: K is 1/2 no more, but <r.w>^P / K stays below 18 for K >= 1e-12.
BELOW_HORIZON = 9.0


class Task(NamedTuple):
    """Everything a pass works on."""

    scene: Scene
    settings: TruthSettings
    tracer: Tracer
    surfaces: Surfaces
    lights: LightTable
    to: Receivers
    caustics: Film | None = None
    view: Projection | None = None  # only what it sees emits; None: everything does


def one_pass(task: Task, number: int) -> Array:
    """Estimate every receiver's irradiance once.

    Parameters
    ----------
    task : Task
        What to compute.
    number : int
        Which pass: its random numbers depend on this and the settings' seed alone.

    Returns
    -------
    (3, r) ndarray of float64
        Irradiance, W/m^2.
    """
    sums = np.zeros((3, len(task.to.pixel)))
    words = np.random.SeedSequence([task.settings.seed, number]).generate_state(4 + task.settings.bounces)
    if len(task.to.pixel):
        if task.settings.picks_per_pass:
            _light_side(task, words, sums)
        if task.settings.directions_per_pass:
            _hemisphere(task, words, sums)
        if task.caustics is not None:
            random = np.random.default_rng([*words[:2], 1])
            photons = photon_pass(task.caustics, task.tracer, task.lights, task.settings.photons, random)
            sums += photons[:, task.to.pixel]
    return sums


def _light_side(task: Task, words: Array, sums: Array) -> None:
    """Add what picked lit points send."""
    points = lit_points(task, np.random.default_rng(words[:2]))
    if not points.power.any():
        return
    picks, glossy = task.settings.picks, bool((points.exponent > 1).any() or (points.peak > 1).any())
    for first, last in _spans(task, picks):
        rays = _shadows((last - first) * picks)
        pick(points, task.to, (first, last), picks, int(words[2]), glossy, np.float32(task.tracer.grain),
             (rays.origin, rays.direction, rays.reach, rays.worth))
        _settle(task, rays, first, picks, sums, task.settings.visibility)


def lit_points(task: Task, random: np.random.Generator) -> LitPoints:
    """Send fresh rays from every light and return what they light.

    Parameters
    ----------
    task : Task
        What to compute.
    random : numpy.random.Generator
        Places the rays in their cells.

    Returns
    -------
    LitPoints
        Of all lights, in whole blocks.
    """
    n, geometry = task.settings.light_grid, task.scene.geometry
    parts = [trace_lit_points(task.tracer, task.surfaces, task.lights, k,
                              light_rays(light, geometry, random.random((n * n, 2))), task.settings.shared_bound)
             for k, light in enumerate(task.scene.lights)]
    return join(parts if task.view is None else [seen_points(task.tracer, task.view, part) for part in parts])


def _hemisphere(task: Task, words: Array, sums: Array) -> None:
    """Add what cosine-distributed directions find, beyond the bound where the light side has the rest."""
    count = task.settings.directions_per_pass
    points, reach = scrambled_points(count, int(words[3])), _reach(task)
    for first, last in _spans(task, count):
        paths = _paths((last - first) * count)
        send(task.to, (first, last), points, int(words[3]), reach, paths)
        for bounce in range(task.settings.bounces):
            if bounce:
                scatter(task.surfaces, task.tracer.grain, int(words[3 + bounce]), task.to, first, count, paths)
            _follow(task, paths, first, count, task.settings.shared_bound if bounce == 0 else 0.0, sums)


def _follow(task: Task, paths: Paths, first: int, count: int, bound: float, sums: Array) -> None:
    """Trace paths to the next surface and add its light; to every surface along them where nothing blocks."""
    while True:
        task.tracer.fill_closest(paths.origin, paths.direction, paths.reach, paths.triangle_id, paths.distance)
        unseen = _unseen(task, paths)
        for k, light in enumerate(task.scene.lights):
            measure, _ = footprint(light, task.scene.geometry, task.settings.light_grid)
            shadows = _shadows(len(paths.reach))
            gather(task.surfaces, task.lights, k, (bound, measure, task.tracer.grain), paths, shadows)
            if unseen is not None:
                shadows.reach[unseen] = 0
            _settle(task, shadows, first, count, sums, True)
        if task.settings.visibility:
            return
        pass_through(task.surfaces, task.tracer.grain, paths)
        if not (paths.reach > 0).any():
            return


def _unseen(task: Task, paths: Paths) -> Array | None:
    """Return which paths end where the camera does not see; None where that does not matter."""
    if task.view is None:
        return None
    rays = _shadows(len(paths.reach))
    aim_paths(task.view, task.surfaces, task.tracer.grain, paths, rays)
    task.tracer.fill_occluded(rays.origin, rays.direction, rays.reach, rays.blocked)
    return rays.blocked


def _settle(task: Task, rays: Shadows, first: int, per_receiver: int, sums: Array, visibility: bool) -> None:
    """Trace shadow rays and add what the free ones are worth."""
    if visibility:
        task.tracer.fill_occluded(rays.origin, rays.direction, rays.reach, rays.blocked)
    else:
        np.less_equal(rays.reach, 0, out=rays.blocked)
    add_free(sums, first, len(rays.reach) // per_receiver, per_receiver, rays.blocked, rays.worth)


def _reach(task: Task) -> float:
    """Return how far a receiver must look: beyond, the geometry term stays below the bound."""
    bound, surfaces = task.settings.shared_bound, task.surfaces
    if bound == 0 or task.settings.bounces > 1:
        return np.inf
    most = max((footprint(light, task.scene.geometry, task.settings.light_grid)[1] for light in task.scene.lights),
               default=0.0)
    peak = float((surfaces.exponent + 1)[surfaces.specular.any(axis=1)].max(initial=1.0))  # of (P + 1) / (2 K)
    if len(surfaces.normals):
        peak *= BELOW_HORIZON
    return float(np.sqrt(peak * most / bound))


def _spans(task: Task, per_receiver: int) -> list[tuple[int, int]]:
    step, total = max(1, task.settings.batch // per_receiver), len(task.to.pixel)
    return [(first, min(first + step, total)) for first in range(0, total, step)]


def _shadows(count: int) -> Shadows:
    return Shadows(np.empty((count, 3), np.float32), np.empty((count, 3), np.float32), np.empty(count, np.float32),
                   np.empty(count, np.bool_), np.empty((count, 3), np.float32))


def _paths(count: int) -> Paths:
    origin, direction, weight = (np.empty((count, 3), np.float32) for _ in range(3))
    reach, travelled, cosine, distance = (np.empty(count, np.float32) for _ in range(4))
    return Paths(origin, direction, reach, travelled, cosine, np.empty(count, np.int32), distance, weight)
