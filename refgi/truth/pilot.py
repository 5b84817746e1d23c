"""The pilot: which cells of a light give light to the picture, so that passes send their rays there more often.

Rays through the centres of a fixed grid of cells find lit points; some of the receivers pick among these as in a pass,
shadow rays included, and each free pick is a contribution of its cell. The pilot depends on the scene, the receivers
and the settings alone, not on the seed. Its contributions only say where rays go: every pass divides by the density and
is unbiased whatever the pilot found, since a share of the rays stays uniform.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.pairs.shadow_rays import Receivers
from refgi.truth.density import Density, density_of
from refgi.truth.light_grid import cell_centres
from refgi.truth.light_pass import lit_points, pick_points
from refgi.truth.task import Task, settle

Array = npt.NDArray[Any]

CELLS = 64  # along one side of a light's grid
RECEIVERS, PICKS = 2048, 1 << 15  # that are asked, at most; picks of all of them together, at least


def pilot(task: Task) -> tuple[Density | None, ...]:
    """Find where the rays of each light are to go.

    Parameters
    ----------
    task : Task
        What to compute.

    Returns
    -------
    tuple of Density or None
        One a light; empty where the rays are to go evenly.
    """
    lights, share = len(task.scene.lights), task.settings.uniform_share
    if share == 1 or not task.settings.picks_per_pass or not lights or not len(task.to.pixel):
        return ()
    centres = cell_centres(CELLS)
    cell = np.floor(centres * CELLS).astype(np.int64)
    contributions = np.zeros((lights, CELLS, CELLS))
    contributions[:, cell[:, 0], cell[:, 1]] = _contributions(task, centres).reshape(lights, -1)
    return tuple(density_of(_smooth(contribution), share) for contribution in contributions)


def _contributions(task: Task, centres: Array) -> Array:
    """Return what each pilot ray gives to the receivers that are asked, (lights * rays,)."""
    rays = len(task.scene.lights) * len(centres)
    sets = lit_points(task, [centres[None]] * len(task.scene.lights), (None,) * len(task.scene.lights))
    if not len(sets.points.power):
        return np.zeros(rays)
    some = _some(task)
    asked = len(some.to.pixel)
    picks = max(task.settings.picks, -(-PICKS // asked))
    shadows, picked = pick_points(some, sets, (0, asked), picks, 0)
    settle(some, shadows, 0, picks, np.zeros((3, asked)), task.settings.visibility)
    free = ~shadows.blocked
    worth = shadows.worth[free].sum(axis=1, dtype=np.float64)
    return np.bincount(sets.points.ray[picked[free]], worth, rays)


def _some(task: Task) -> Task:
    """Return the task for some of its receivers, which all pick from one set."""
    count = len(task.to.pixel)
    chosen = np.sort(np.random.default_rng(0).choice(count, min(count, RECEIVERS), replace=False))
    to = Receivers(*(np.ascontiguousarray(field[..., chosen]) for field in task.to))
    return task._replace(to=to, set_of=np.zeros(len(chosen), np.int64))


def _smooth(values: Array) -> Array:
    """Average each cell with its neighbours, twice: picks are few and lit areas have edges inside cells."""
    for _ in range(2):
        wide = np.pad(values, 1, mode="edge")
        values = np.mean([wide[i : i + len(values), j : j + len(values)] for i in range(3) for j in range(3)], axis=0)
    return values
