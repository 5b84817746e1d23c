"""One pass of the ground truth: an independent, unbiased estimate of every receiver's one-bounce irradiance."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.truth.caustics import photon_pass
from refgi.truth.hemisphere import gather, scrambled_points, send
from refgi.truth.light_grid import footprint
from refgi.truth.light_pass import add_light_side
from refgi.truth.paths import Paths
from refgi.truth.scattering import pass_through, scatter
from refgi.truth.seen import aim_paths
from refgi.truth.task import Task, settle, shadow_batch, spans

Array = npt.NDArray[Any]


# A lobe may point below an interpolated horizon: K is 1/2 no more, but <r.w>^P / K stays below 18 for K >= 1e-12.
BELOW_HORIZON = 9.0


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
            add_light_side(task, words[:3], sums)
        if task.settings.directions_per_pass:
            _hemisphere(task, words, sums)
        if task.caustics is not None:
            random = np.random.default_rng([*words[:2], 1])
            photons = photon_pass(task.caustics, task.tracer, task.lights, task.settings.photons, random)
            sums += photons[:, task.to.pixel]
    return sums


def _hemisphere(task: Task, words: Array, sums: Array) -> None:
    """Add what cosine-distributed directions find, beyond the bound where the light side has the rest."""
    count = task.settings.directions_per_pass
    points, reach = scrambled_points(count, int(words[3])), _reach(task)
    for first, last in spans(task, count):
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
            shadows = shadow_batch(len(paths.reach))
            gather(task.surfaces, task.lights, k, (bound, measure, task.tracer.grain), paths, shadows)
            if unseen is not None:
                shadows.reach[unseen] = 0
            settle(task, shadows, first, count, sums, True)
        if task.settings.visibility:
            return
        pass_through(task.surfaces, task.tracer.grain, paths)
        if not (paths.reach > 0).any():
            return


def _unseen(task: Task, paths: Paths) -> Array | None:
    """Return which paths end where the camera does not see; None where that does not matter."""
    if task.view is None:
        return None
    rays = shadow_batch(len(paths.reach))
    aim_paths(task.view, task.surfaces, task.tracer.grain, paths, rays)
    task.tracer.fill_occluded(rays.origin, rays.direction, rays.reach, rays.blocked)
    return rays.blocked


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


def _paths(count: int) -> Paths:
    origin, direction, weight = (np.empty((count, 3), np.float32) for _ in range(3))
    reach, travelled, cosine, distance = (np.empty(count, np.float32) for _ in range(4))
    return Paths(origin, direction, reach, travelled, cosine, np.empty(count, np.int32), distance, weight)
