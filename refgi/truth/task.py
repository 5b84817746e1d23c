"""Inputs of every pass of the ground truth, and batches of its shadow rays."""

import math
from typing import NamedTuple

import numpy as np

from refgi.pairs.shadow_rays import RayReceivers, add_unoccluded
from refgi.rays import Tracer
from refgi.rsm.pool import plane
from refgi.rsm.raster.projection import Projection
from refgi.scene import LightTable, Scene
from refgi.truth.caustics import Film
from refgi.truth.cell_densities import Counts
from refgi.truth.light_grid import Density
from refgi.truth.lobe_cells import LobeCells, Lobes
from refgi.truth.paths import Shadows, Sides
from refgi.truth.result import SERIES
from refgi.truth.settings import TruthSettings
from refgi.truth.surfaces import Surfaces
from refgi.types import Array

SOFT = 8.0  # exponent up to which directions of the hemisphere do as well as those around the lights' images


class Draw(NamedTuple):
    """Random numbers of a pass."""

    shared: Array  # (4 + bounces,) uint32, of its series: two for light vertices, one for picks, one for directions
    own: Array  # as many of the pass alone: two for photons, one for cells of lobes, one for each further bounce
    turn: int  # passes of the series before: points of low discrepancy go on from there


class Group(NamedTuple):
    """Receivers that have as many directions each."""

    directions: int
    chosen: Array  # (g,) int64: which of the task's receivers
    receivers: RayReceivers


class Task(NamedTuple):
    """Inputs of a pass."""

    scene: Scene
    settings: TruthSettings
    tracer: Tracer
    surfaces: Surfaces
    lights: LightTable
    receivers: RayReceivers
    set_of: Array  # (r,) which set of light vertices each receiver picks from
    shape: tuple[int, ...]  # of the picture
    caustics: Film | None = None
    left_to_photons: float = math.inf  # exponent from which on a sender's lobe comes by photons alone
    view: Projection | None = None  # only surfaces visible in it emit; None: all do
    densities: tuple[Density | None, ...] = ()  # of each light's rays; none: even ones
    groups: tuple[Group, ...] = ()  # by directions; none: all receivers have the same
    cells: LobeCells | None = None  # of senders' lobes; None: no lobe comes by them
    lobes: Lobes | None = None  # of the receivers, where their lobes and not their irradiance are asked for

    @property
    def counts(self) -> Counts:
        """Samples of each receiver in a pass that meet senders' lobes; the light estimator knows no directions."""
        if not self.directions or not self.sides.hide:
            return Counts(self.directions, self.picks, 0)
        half, specular = self.picks // 2, self.surfaces.specular.any(axis=1)
        soft = self.surfaces.exponent[specular].max(initial=0.0) <= SOFT
        return Counts(self.directions, self.picks - half, 0 if soft else half)

    @property
    def sides(self) -> Sides:
        """Whether faces hide what lies behind them: with visibility, and where no normal differs from its face's."""
        eye = (math.nan,) * 3 if self.view is None else tuple(self.view.origin[0].tolist())
        return Sides(self.settings.visibility or not len(self.surfaces.normals), eye)

    @property
    def grain_below(self) -> float:
        """The tracer's grain where receivers see below their faces, m; -1 where they do not."""
        return -1.0 if self.sides.hide else float(self.tracer.grain)

    @property
    def picks(self) -> int:
        """Light vertices that each receiver picks in a pass."""
        return self.settings.picks_per_pass if self.lobes is None else self.settings.lobe_samples[0]

    @property
    def directions(self) -> int:
        """Directions of each receiver in a pass."""
        return self.settings.directions_per_pass if self.lobes is None else self.settings.lobe_samples[1]


def drawn(settings: TruthSettings, number: int, *kind: int) -> Draw:
    """Return the random numbers of a pass; `kind`: tells them from those of other passes."""
    shared, own = (np.random.SeedSequence([settings.seed, one, *kind]).generate_state(4 + settings.bounces)
                   for one in (number % SERIES, number))
    return Draw(shared, own, number // SERIES)


def sets_of(pixel: Array, width: int, side: int) -> Array:
    """Return which of side^2 interleaved sets of light vertices each pixel (r,), a flat index, picks from."""
    return np.asarray(pixel // width % side * side + pixel % width % side)


def spans(task: Task, per_receiver: int) -> list[tuple[int, int]]:
    """Cut the receivers into spans of at most a batch of rays: first receiver of each, and one past its last."""
    step, total = max(1, task.settings.batch // per_receiver), len(task.receivers.pixel)
    return [(first, min(first + step, total)) for first in range(0, total, step)]


def shadow_batch(count: int) -> Shadows:
    """Allocate a batch of shadow rays."""
    origin, direction, contribution = (plane((count, 3), np.float32) for _ in range(3))
    return Shadows(origin, direction, plane((count,), np.float32), plane((count,), np.bool_), contribution)


def add_unblocked(task: Task, rays: Shadows, first: int, per_receiver: int, sums: Array, visibility: bool) -> None:
    """Trace shadow rays and add the contributions of unblocked ones.

    `rays`: the rays; `blocked` is filled. `first`: receiver of the first ray. `per_receiver`: rays of each receiver.
    `sums` (3, r) float64: added to, W/m^2. `visibility`: without, no ray is blocked.
    """
    if visibility:
        task.tracer.fill_occluded(rays.origin, rays.direction, rays.reach, rays.blocked)
    else:
        np.less_equal(rays.reach, 0, out=rays.blocked)
    add_unoccluded(sums, first, len(rays.reach) // per_receiver, per_receiver, rays.blocked, rays.contribution)
