"""The light side of a pass: fresh lit points from every light, picks among them, a shadow ray for each pick.

The pilot: which cells of a light give light to the picture, so that passes send their rays there more often.

Rays through the centres of a fixed grid of cells find lit points; some of the receivers pick among these as in a pass,
shadow rays included, and each free pick is a contribution of its cell. The pilot depends on the scene, the receivers
and the settings alone, not on the seed. Its contributions only say where rays go: every pass divides by the density and
is unbiased whatever the pilot found, since a share of the rays stays uniform.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.pairs.shadow_rays import Receivers
from refgi.truth.light_grid import Density, cell_centres, density_of, rays_through, stratified_sets
from refgi.truth.light_side import pick, tiles
from refgi.truth.lit_points import PointSets, join, trace_lit_points
from refgi.truth.paths import Shadows
from refgi.truth.seen import seen_points
from refgi.truth.task import Task, settle, shadow_batch, spans

Array = npt.NDArray[Any]
CELLS = 64  # along one side of a light's grid
RECEIVERS, PICKS = 2048, 1 << 15  # that are asked, at most; picks of all of them together, at least


def add_light_side(task: Task, words: Array, sums: Array) -> None:
    """Add what picked lit points send.

    Parameters
    ----------
    task : Task
        What to compute.
    words : (3,) uint32 ndarray
        The pass's random numbers: two for the lit points, one for the picks.
    sums : (3, r) float64 ndarray
        Added to, W/m^2.
    """
    sets, picks = fresh_points(task, np.random.default_rng(words[:2])), task.settings.picks
    if not len(sets.points.power):
        return
    for first, last in spans(task, picks):
        rays, _ = pick_points(task, sets, (first, last), picks, int(words[2]))
        settle(task, rays, first, picks, sums, task.settings.visibility)


def fresh_points(task: Task, random: np.random.Generator) -> PointSets:
    """Send fresh rays from every light and return what they light.

    Parameters
    ----------
    task : Task
        What to compute.
    random : numpy.random.Generator
        Places the rays in their cells.

    Returns
    -------
    PointSets
        Of all lights.
    """
    n, side = task.settings.light_grid, task.settings.interleave
    count = len(task.scene.lights)
    return lit_points(task, [stratified_sets(n, side, random) for _ in range(count)], task.densities or (None,) * count)


def lit_points(task: Task, squares: list[Array], densities: tuple[Any, ...]) -> PointSets:
    """Send rays from every light through points of its unit square and return what they light.

    Parameters
    ----------
    task : Task
        What to compute.
    squares : list of (sets, n, 2) ndarray
        Points of each light, in sets.
    densities : tuple of Density or None
        Of each light.

    Returns
    -------
    PointSets
        Of all lights.
    """
    settings, sets, per_set = task.settings, len(squares[0]) if squares else 1, squares[0].shape[1] if squares else 1
    parts = []
    for k, (light, square, density) in enumerate(zip(task.scene.lights, squares, densities, strict=True)):
        rays = rays_through(light, task.scene.geometry, square.reshape(-1, 2), per_set, density)
        part = trace_lit_points(task.tracer, task.surfaces, task.lights, k, rays, settings.shared_bound)
        parts.append(part if task.view is None else seen_points(task.tracer, task.view, part))
    return join(parts, sets, per_set)


def pick_points(task: Task, sets: PointSets, span: tuple[int, int], picks: int, seed: int) -> tuple[Shadows, Array]:
    """Let the receivers of a span pick lit points.

    Parameters
    ----------
    task : Task
        Names the receivers.
    sets : PointSets
        Lit points.
    span : tuple of 2 ints
        First receiver and one past the last.
    picks : int
        Picks of each receiver.
    seed : int
        Random shift of each receiver's picks.

    Returns
    -------
    Shadows, (n,) int32 ndarray
        Shadow rays, not traced, and which point each goes to.
    """
    rays, picked = shadow_batch((span[1] - span[0]) * picks), np.empty((span[1] - span[0]) * picks, np.int32)
    pick(*sets, task.to, tiles(task.set_of, *span), (span[0], picks, seed, np.float32(task.tracer.grain)),
         (rays.origin, rays.direction, rays.reach, rays.worth, picked))
    return rays, picked


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
