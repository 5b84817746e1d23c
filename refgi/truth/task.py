"""Inputs of every pass of the ground truth, and batches of its shadow rays."""

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
    """Inputs of a pass."""

    scene: Scene
    settings: TruthSettings
    tracer: Tracer
    surfaces: Surfaces
    lights: LightTable
    receivers: Receivers
    set_of: Array  # (r,) which set of light vertices each receiver picks from
    caustics: Film | None = None
    view: Projection | None = None  # only surfaces visible in it emit; None: all do
    densities: tuple[Density | None, ...] = ()  # of each light's rays; none: even ones


def sets_of(pixel: Array, width: int, side: int) -> Array:
    """Return which of side^2 sets of light vertices each pixel picks from, interleaved.

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
    step, total = max(1, task.settings.batch // per_receiver), len(task.receivers.pixel)
    return [(first, min(first + step, total)) for first in range(0, total, step)]


def shadow_batch(count: int) -> Shadows:
    """Allocate a batch of shadow rays.

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


def add_unblocked(task: Task, rays: Shadows, first: int, per_receiver: int, sums: Array, visibility: bool) -> None:
    """Trace shadow rays and add the contributions of unblocked ones.

    Parameters
    ----------
    task : Task
        With the tracer.
    rays : Shadows
        The rays; `blocked` is filled.
    first : int
        Receiver of the first ray.
    per_receiver : int
        Rays of each receiver.
    sums : (3, r) float64 ndarray
        Added to, W/m^2.
    visibility : bool
        Without, no ray is blocked.
    """
    if visibility:
        task.tracer.fill_occluded(rays.origin, rays.direction, rays.reach, rays.blocked)
    else:
        np.less_equal(rays.reach, 0, out=rays.blocked)
    add_free(sums, first, len(rays.reach) // per_receiver, per_receiver, rays.blocked, rays.contribution)
