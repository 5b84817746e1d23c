"""Lobes of senders in a pass: rays into picked cells, and directions to images in them."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.truth.camera_visibility import hidden_from_camera
from refgi.truth.cell_connect import connect
from refgi.truth.cell_densities import Beside
from refgi.truth.cell_rays import pick_cells, picks_for
from refgi.truth.lobe_cells import lobe_cells
from refgi.truth.paths import pass_through
from refgi.truth.task import Task, add_unblocked, shadow_batch, spans

Array = npt.NDArray[Any]


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
