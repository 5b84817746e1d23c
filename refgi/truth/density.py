"""Densities over the unit square, constant in cells: uniform points are moved to where the density is high.

q_ij is the probability of cell (i, j) of an m x m grid. The first coordinate follows the marginal sum_j q_ij, the
second q_ij / sum_j q_ij within row i; both are linear inside a cell, so a point stands for 1 / (m^2 q_ij) of a uniform
one.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.sampling import ONE_ULP_BELOW_1

Array = npt.NDArray[Any]


class Density(NamedTuple):
    """A density over the unit square."""

    cells: Array  # (m, m) float64 probabilities, all > 0, first coordinate first; their sum is 1
    rows: Array  # (m + 1,) cumulated sums over the first coordinate, from 0 to 1
    columns: Array  # (m, m + 1) cumulated shares along the second coordinate of each row, from 0 to 1


def density_of(contribution: Array, uniform_share: float) -> Density:
    """Make a density of contributions, mixed with a uniform one.

    Parameters
    ----------
    contribution : (m, m) ndarray
        What each cell is to be drawn in proportion to, >= 0; all 0 gives a uniform density.
    uniform_share : float
        Share of the points that are drawn uniformly, in (0, 1]: no cell gets less than that of an even share.

    Returns
    -------
    Density
        Its tables.
    """
    expect(0 < uniform_share <= 1, "uniform_share", "a number in (0, 1]", uniform_share)
    total = contribution.sum()
    guided = 0 if total == 0 else (1 - uniform_share) * contribution / total
    cells = guided + np.full(contribution.shape, (uniform_share if total else 1.0) / contribution.size)
    return Density(cells, _cumulated(cells.sum(axis=1)), _cumulated(cells))


def warp(density: Density, points: Array) -> tuple[Array, Array]:
    """Move uniform points so that they follow a density.

    Parameters
    ----------
    density : Density
        The density.
    points : (n, 2) ndarray
        Uniform points in [0, 1).

    Returns
    -------
    (n, 2) ndarray, (n,) ndarray
        Points in [0, 1), and how much of the unit square each stands for relative to a uniform one.
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
