"""Lobes of senders in a pass: rays into picked cells, and directions to images in them."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.truth.camera_visibility import hidden_from_camera
from refgi.truth.cell_rays import Beside, connect, pick_cells, picks_for
from refgi.truth.cell_walk import fill_totals
from refgi.truth.lobe_cells import lobe_cells
from refgi.truth.paths import pass_through
from refgi.truth.task import Task, add_unblocked, shadow_batch, spans

Array = npt.NDArray[Any]


def with_cells(task: Task) -> Task:
    """Return a task of irradiance with cells of its senders' lobes, and what they send each receiver in all."""
    if task.lobes is not None or not task.picks or not task.scene.lights or not task.surfaces.specular.any():
        return task
    cells = lobe_cells(task.scene, task.tracer, task.surfaces, task.lights)
    totals = np.empty(len(task.receivers.pixel))
    fill_totals(cells, task.receivers, totals)
    return task._replace(cells=cells, cell_totals=totals)


def beside_of(task: Task, first: int) -> Beside | None:
    """Return what densities of lobes depend on, for rays of the receivers from `first` on; None without cells."""
    if task.cells is None or task.cell_totals is None:
        return None
    return Beside(task.cells, task.receivers, task.cell_totals, task.counts, first)


def add_cells(task: Task, seed: int, sums: Array) -> None:
    """Add what lobes of senders send, by rays into picked cells and by directions to images in them, W/m^2."""
    each, visibility = task.counts.cells + task.counts.mirrors, task.settings.visibility
    for first, last in spans(task, each):
        beside, picks, shadows = beside_of(task, first), picks_for((last - first) * each), shadow_batch((last - first) * each)
        paths, from_lights = picks.paths, np.arange(len(shadows.reach)) % each < task.counts.cells
        pick_cells(beside, (first, last), seed, task.tracer.grain, picks)
        while (paths.reach > 0).any():
            task.tracer.fill_closest(paths.origin, paths.direction, paths.reach, paths.triangle_id, paths.distance)
            connect(beside, task.surfaces, task.lights, task.tracer.grain, visibility, picks, shadows)
            hidden = hidden_from_camera(task, paths)
            if hidden is not None:
                shadows.reach[hidden] = 0
            add_unblocked(task, shadows, first, each, sums, True)
            if visibility:
                break
            paths.reach[from_lights] = 0  # what light reaches is what it meets first
            pass_through(task.surfaces, task.tracer.grain, paths)
