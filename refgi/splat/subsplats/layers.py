"""The layers of the illumination buffer: what was lit at each level, and which cells can hold light at all."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.splat.refinement.grid import Subsplats, level_shape

Array = npt.NDArray[Any]


def layer(values: Array, subsplats: Subsplats, level: int) -> Array:
    """Return what was lit at one level.

    Parameters
    ----------
    values : (3, n) ndarray
        Irradiance at the subsplats.
    subsplats : Subsplats
        Where they are.
    level : int
        Which level.

    Returns
    -------
    (3, h_l, w_l) ndarray
        Irradiance; 0 where there is no subsplat of this level.
    """
    plane = np.zeros((3, *subsplats.leaf[level].shape), values.dtype)
    of_level = np.flatnonzero(subsplats.level == level)
    plane[:, subsplats.row[of_level], subsplats.column[of_level]] = values[:, of_level]
    return plane


def filled_cells(covered: Array, top: int) -> list[Array]:
    """Return which cells show any surface.

    Parameters
    ----------
    covered : (h, w) ndarray of bool
        Whether there is a surface.
    top : int
        Coarsest level.

    Returns
    -------
    list of (h_l, w_l) ndarray of bool
        Levels 0 to `top`.
    """
    levels = [covered]
    for level in range(1, top + 1):
        levels.append(np.empty(level_shape(covered.shape[0], covered.shape[1], level), np.bool_))
        _any_of_four(levels[-2], levels[-1])
    return levels


def sorted_by_row(subsplats: Subsplats) -> tuple[list[Array], Array]:
    """Return the subsplats level by level and row by row.

    Parameters
    ----------
    subsplats : Subsplats
        In any order.

    Returns
    -------
    starts : list of (h_l + 1,) ndarray of int64
        For each level where its rows start in `order`, and where the last one ends.
    order : (n,) ndarray of int64
        Which subsplat is next.
    """
    heights = [len(leaf) for leaf in subsplats.leaf]
    bases = np.cumsum([0, *heights])
    starts = np.zeros(bases[-1] + 1, np.int64)
    order = np.empty(len(subsplats.level), np.int64)
    _sort(subsplats.level, subsplats.row, bases, starts, order)
    return [starts[base : base + height + 1] for base, height in zip(bases, heights, strict=False)], order


@kernel
def _any_of_four(fine: Array, coarse: Array) -> None:
    height, width = fine.shape
    for i in range(coarse.shape[0]):
        upper, lower, cells = fine[2 * i], fine[min(2 * i + 1, height - 1)], coarse[i]
        for j in range(width // 2):
            cells[j] = upper[2 * j] | upper[2 * j + 1] | lower[2 * j] | lower[2 * j + 1]
        if width % 2:
            cells[width // 2] = upper[width - 1] | lower[width - 1]


@kernel
def _sort(level: Array, row: Array, bases: Array, starts: Array, order: Array) -> None:
    """Sort by counting: subsplats of the same row stay in the order of the list."""
    for k in range(len(level)):
        starts[bases[level[k]] + row[k] + 1] += 1
    for key in range(len(starts) - 1):
        starts[key + 1] += starts[key]
    places = starts.copy()
    for k in range(len(level)):
        key = bases[level[k]] + row[k]
        order[places[key]] = k
        places[key] += 1
