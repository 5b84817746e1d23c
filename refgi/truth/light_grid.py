"""Stratified directions of a light: n x n cells of equal probability, one jittered ray in each.

Without a density each ray stands for the same solid angle or area, exactly; with one, for that over
the density at its place. The cells are ordered along a Hilbert curve: neighbours in the list are neighbours on the
surfaces they reach, which is what makes systematic picks even.

Piecewise constant densities over the unit square, for importance sampling: uniform points are warped to them.

q_ij is the probability of cell (i, j) of an m x m grid. The first coordinate follows the marginal sum_j q_ij, the
second q_ij / sum_j q_ij within row i; both are linear inside a cell, so a point stands for 1 / (m^2 q_ij) of a uniform
one.
"""

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.sampling import ONE_ULP_BELOW_1, hilbert_order
from refgi.scene import DirectionalLight, Geometry, Light
from refgi.truth.light_square import fill_rays, light_squares

Array = npt.NDArray[Any]


class Density(NamedTuple):
    """A density over the unit square."""

    cells: Array  # (m, m) float64 probabilities, all > 0, first coordinate first; their sum is 1
    rows: Array  # (m + 1,) cumulated sums over the first coordinate, from 0 to 1
    columns: Array  # (m, m + 1) cumulated shares along the second coordinate of each row, from 0 to 1


def density_of(contribution: Array, uniform_share: float) -> Density:
    """Make a density of contributions, mixed with a uniform one.

    `contribution` (m, m): what each cell is to be drawn in proportion to, >= 0; all 0 gives a uniform density.
    `uniform_share`: share of the points that are drawn uniformly, in (0, 1]: no cell gets less than that of an even
    share.
    """
    expect(0 < uniform_share <= 1, "uniform_share", "a number in (0, 1]", uniform_share)
    total = contribution.sum()
    guided = 0 if total == 0 else (1 - uniform_share) * contribution / total
    cells = guided + np.full(contribution.shape, (uniform_share if total else 1.0) / contribution.size)
    return Density(cells, _cumulated(cells.sum(axis=1)), _cumulated(cells))


def warp(density: Density, points: Array) -> tuple[Array, Array]:
    """Move uniform points so that they follow a density.

    `points` (n, 2): uniform points in [0, 1). Returns (n, 2), (n,): points in [0, 1), and how much of the unit square
    each stands for relative to a uniform one.
    """
    m = len(density.cells)
    row, first = _invert(density.rows[None], np.zeros(len(points), np.int64), points[:, 0])
    column, second = _invert(density.columns, row, points[:, 1])
    moved = np.stack([(row + first) / m, (column + second) / m], axis=1)
    return np.minimum(moved, ONE_ULP_BELOW_1), 1 / (m * m * density.cells[row, column])


def _cumulated(values: Array) -> Array:
    """Return running sums along the last axis, from exactly 0 to exactly 1."""
    sums = np.cumsum(values, axis=-1)
    return np.concatenate([np.zeros_like(sums[..., :1]), sums / sums[..., -1:]], axis=-1)


def _invert(tables: Array, which: Array, u: Array) -> tuple[Array, Array]:
    """Return cell and place in it, in [0, 1], where the table `which` of each point reaches u."""
    m = tables.shape[1] - 1
    # one search for all tables: table k is lifted to k .. k + 1
    lifted = (tables[:, :-1] + np.arange(len(tables))[:, None]).ravel()
    cell = np.searchsorted(lifted, which + u, side="right") - 1 - which * m
    cell = np.clip(cell, 0, m - 1)
    low, high = tables[which, cell], tables[which, cell + 1]
    return cell, np.clip((u - low) / (high - low), 0, 1)


class LightRays(NamedTuple):
    """Rays of a light: one for each cell of its grid, or several sets of them."""

    origins: Array  # (s, 3) float64, m
    directions: Array  # (s, 3) float64, unit vectors
    measure: float  # solid angle of a cell of even size, sr; for a directional light its perpendicular area, m^2
    weight: Array  # (s,) what a ray stands for, in units of `measure`: 1 over the density at its place


def stratified_sets(n: int, side: int, random: np.random.Generator) -> Array:
    """Place side^2 sets of n x n points in the unit square: each set jittered, all of them together jittered finer.

    `n`: cells along one side of the grid of a set. `side`: parts along one side of a cell: the side^2 sets share out
    its parts at random, one each. `random`: shares out the parts and places the points in them. Returns (side^2, n * n,
    2): each set along a Hilbert curve over the grid. Every point is uniform in its cell.
    """
    count = side * side
    part = random.permuted(np.broadcast_to(np.arange(count), (n * n, count)), axis=1).T
    within = np.stack([part % side, part // side], axis=-1) + random.random((count, n * n, 2))
    return np.asarray(np.minimum((_cells(n) + within / side) / n, ONE_ULP_BELOW_1))


def cell_centres(n: int) -> Array:
    """Return the centres of n x n cells of the unit square, along a Hilbert curve.

    `n`: cells along one side. Returns (n * n, 2): points.
    """
    return np.asarray((_cells(n) + 0.5) / n)


def light_rays(light: Light, geometry: Geometry, jitter: Array) -> LightRays:
    """Send one ray through each cell of a light's grid.

    `geometry`: what it shines on; only its bounds matter, and only to a directional light. `jitter` (n * n, 2): place
    of each ray in its cell, in [0, 1). Result: along a Hilbert curve over the grid.
    """
    n = math.isqrt(len(jitter))
    return rays_through(light, geometry, (_cells(n) + jitter) / n, n * n)


def rays_through(light: Light, geometry: Geometry, square: Array, cells: int,
                 density: Density | None = None) -> LightRays:
    """Send rays through points of the unit square that stands for a light's directions.

    `geometry`: what it shines on; only its bounds matter, and only to a directional light. `square` (s, 2): points of
    the unit square, uniform. `cells`: how many rays share the light's whole measure. `density`: where rays go more
    often than elsewhere; evenly where absent. Result: in the order of the points.
    """
    square, weight = (square, np.ones(len(square))) if density is None else warp(density, square)
    squares = light_squares((light,), geometry)
    origins, directions = np.empty((len(square), 3)), np.empty((len(square), 3))
    fill_rays(squares, 0, square, origins, directions)
    return LightRays(origins, directions, float(squares.measure[0]) / cells, weight)


def footprint(light: Light, geometry: Geometry, n: int) -> tuple[float, float]:
    """Return the measure of one ray and its largest footprint in the scene.

    `geometry`: what it shines on. `n`: cells along one side of the grid. Result: solid angle (sr) or area (m^2) of a
    ray, and the largest measure x distance^2 (m^2).
    """
    measure = float(light_squares((light,), geometry).measure[0]) / (n * n)
    if isinstance(light, DirectionalLight):
        return measure, measure
    reach = np.maximum(*(np.abs(np.subtract(corner, light.position)) for corner in geometry.bounds))
    return measure, measure * float(reach @ reach)


@cache
def _cells(n: int) -> Array:
    """Return the cells of an n x n grid along a Hilbert curve: (n * n, 2) integers as floats."""
    order = hilbert_order(n, n)
    return np.stack([order % n, order // n], axis=1).astype(np.float64)
