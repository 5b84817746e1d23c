"""One pass of the ground truth of glossy receivers: an independent, unbiased estimate of what each lobe reflects.

Paths start along the receiver's lobe, and scatter at surfaces by every lobe; light vertices share the first bounce.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.truth.camera_visibility import hidden_from_camera
from refgi.truth.cell_pass import add_cells, beside_of
from refgi.truth.hemisphere import scrambled_points
from refgi.truth.light_grid import footprint
from refgi.truth.light_pass import add_light_side
from refgi.truth.lobe_directions import gather_along_lobes, send_along_lobes
from refgi.truth.lobe_photons import lobe_photon_pass
from refgi.truth.passes import follow, scatter
from refgi.truth.paths import Paths, pass_through, paths_for
from refgi.truth.task import Task, add_unblocked, shadow_batch, spans

Array = npt.NDArray[Any]

LOBES = 1  # tells these passes' random numbers from those of irradiance


def lobe_pass(task: Task, number: int) -> Array:
    """Estimate what every receiver's lobe reflects towards the eye once.

    `task`: with lobes. `number`: which pass: its random numbers depend on this and the settings' seed alone. Returns
    (3, r) float64: radiance, W/m^2/sr.
    """
    assert task.lobes is not None
    sums = np.zeros((3, len(task.receivers.pixel)))
    words = np.random.SeedSequence([task.settings.seed, number, LOBES]).generate_state(4 + task.settings.bounces)
    if len(task.receivers.pixel):
        if task.picks:
            add_light_side(task, words[:3], sums)
        if task.cells is not None:
            add_cells(task, int(words[2]), sums)
        if task.directions:
            _add_directions(task, words, sums)
        if task.caustics is not None:
            random = np.random.default_rng([*words[:2], 1])
            sums += lobe_photon_pass(task.caustics, task, random)
    return sums


def _add_directions(task: Task, words: Array, sums: Array) -> None:
    """Add what directions along the lobes find, by its share where light vertices have the rest."""
    assert task.lobes is not None
    count = task.directions
    points = scrambled_points(count, int(words[3]))
    for first, last in spans(task, count):
        paths, density = paths_for((last - first) * count), np.empty((last - first) * count)
        send_along_lobes(task.receivers, task.lobes, (first, last), points, int(words[3]), task.grain_below, paths,
                         density)
        for bounce in range(task.settings.bounces):
            if bounce == 0:
                _follow_lobes(task, paths, density, first, sums)
                continue
            scatter(task.lobes.surfaces, task.tracer.grain, int(words[3 + bounce]), task.receivers, first, count, paths)
            follow(task, paths, first, count, 0.0, sums)


def _follow_lobes(task: Task, paths: Paths, density: Array, first: int, sums: Array) -> None:
    """Trace paths to the next surface, next-event estimation there; to every surface along them without visibility."""
    assert task.lobes is not None
    beside = None if task.cells is None else beside_of(task, first)
    while True:
        task.tracer.fill_closest(paths.origin, paths.direction, paths.reach, paths.triangle_id, paths.distance)
        hidden = hidden_from_camera(task, paths)
        for k, light in enumerate(task.scene.lights):
            measure, _ = footprint(light, task.scene.geometry, task.settings.light_grid)
            shadows = shadow_batch(len(paths.reach))
            gather_along_lobes(task.lobes, task.lights, k, (task.picks > 0, measure, task.tracer.grain),
                               task.sides, (first, task.directions), paths, density, shadows, beside)
            if hidden is not None:
                shadows.reach[hidden] = 0
            add_unblocked(task, shadows, first, task.directions, sums, True)
        if task.settings.visibility:
            return
        pass_through(task.surfaces, task.tracer.grain, paths)
        if not (paths.reach > 0).any():
            return
