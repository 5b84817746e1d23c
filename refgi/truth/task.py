"""What every pass of the ground truth works on, and batches of its rays."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.pairs.shadow_rays import Receivers, add_free
from refgi.rays import Tracer
from refgi.rsm.raster.projection import Projection
from refgi.scene import LightTable, Scene
from refgi.truth.caustics import Film
from refgi.truth.light_grid import Density
from refgi.truth.paths import Shadows
from refgi.truth.settings import TruthSettings
from refgi.truth.surfaces import Surfaces

Array = npt.NDArray[Any]


class Task(NamedTuple):
    """Everything a pass works on."""

    scene: Scene
    settings: TruthSettings
    tracer: Tracer
    surfaces: Surfaces
    lights: LightTable
    to: Receivers
    set_of: Array  # (r,) which set of lit points each receiver picks from
    caustics: Film | None = None
    view: Projection | None = None  # only what it sees emits; None: everything does
    densities: tuple[Density | None, ...] = ()  # of each light's rays; none: even ones


def sets_of(pixel: Array, width: int, side: int) -> Array:
    """Return which of side^2 sets of lit points each pixel picks from: neighbours take turns.

    Parameters
    ----------
    pixel : (r,) ndarray
        Flat index into the picture.
    width : int
        Of the picture, pixels.
    side : int
        Pixels along one side of the pattern.

    Returns
    -------
    (r,) ndarray
        Numbers of sets.
    """
    return np.asarray(pixel // width % side * side + pixel % width % side)


def spans(task: Task, per_receiver: int) -> list[tuple[int, int]]:
    """Cut the receivers into spans of at most a batch of rays.

    Parameters
    ----------
    task : Task
        Names receivers and batch.
    per_receiver : int
        Rays of each receiver.

    Returns
    -------
    list of tuple of 2 ints
        First receiver of each span and one past its last.
    """
    step, total = max(1, task.settings.batch // per_receiver), len(task.to.pixel)
    return [(first, min(first + step, total)) for first in range(0, total, step)]


def shadow_batch(count: int) -> Shadows:
    """Make room for a batch of shadow rays.

    Parameters
    ----------
    count : int
        Rays.

    Returns
    -------
    Shadows
        Not filled.
    """
    return Shadows(np.empty((count, 3), np.float32), np.empty((count, 3), np.float32), np.empty(count, np.float32),
                   np.empty(count, np.bool_), np.empty((count, 3), np.float32))


def settle(task: Task, rays: Shadows, first: int, per_receiver: int, sums: Array, visibility: bool) -> None:
    """Trace shadow rays and add what the free ones are worth.

    Parameters
    ----------
    task : Task
        Whose tracer is asked.
    rays : Shadows
        The rays; `blocked` is filled.
    first : int
        Receiver of the first ray.
    per_receiver : int
        Rays of each receiver.
    sums : (3, r) float64 ndarray
        Added to, W/m^2.
    visibility : bool
        Without, every ray is free.
    """
    if visibility:
        task.tracer.fill_occluded(rays.origin, rays.direction, rays.reach, rays.blocked)
    else:
        np.less_equal(rays.reach, 0, out=rays.blocked)
    add_free(sums, first, len(rays.reach) // per_receiver, per_receiver, rays.blocked, rays.worth)
