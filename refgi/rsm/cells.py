"""Footprints of pixel lights: a partition of a map's texels into one cell per chosen texel, and sums over cells."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.rsm.projection import Projection

Array = npt.NDArray[Any]

EQUALLY_NEAR = 8  # chosen texels looked at for ties


def cells_of_grid(maps: Projection, count: int) -> Array:
    """Return the grid cell that holds each texel's centre.

    Parameters
    ----------
    maps : Projection
        k stacked maps.
    count : int
        k n^2 cells: n x n on each map, row by row, map by map.

    Returns
    -------
    (H * W,) ndarray of int
        Cell of each texel.

    Raises
    ------
    InputError
        If there are more cells than texels along a side.
    """
    n = math.isqrt(count // maps.maps)
    shorter = min(maps.height, maps.width)
    expect(n <= shorter, "count", f"at most {maps.maps * shorter**2} with filtering", count)
    row = (2 * np.arange(maps.height) + 1) * n // (2 * maps.height)
    column = (2 * np.arange(maps.width) + 1) * n // (2 * maps.width)
    one = row[:, None] * n + column
    return np.ravel(np.add.outer(np.arange(maps.maps) * (n * n), one))


def cells_of_nearest(maps: Projection, texel: Array) -> Array:
    """Return the nearest chosen texel of each texel, on its own map as long as that has one.

    Parameters
    ----------
    maps : Projection
        The stacked maps.
    texel : (N,) ndarray of int
        Chosen texels, indices into the flattened maps; of equal or equally near ones the first gets the texel.

    Returns
    -------
    (H * W,) ndarray of int
        Index into `texel` of each texel.
    """
    from scipy.spatial import cKDTree

    apart = 4 * (maps.height + maps.width)  # keeps stacked maps from being neighbours

    def place(index: Array) -> Array:
        row, column = index // maps.width, index % maps.width
        return np.stack([row + row // maps.height * apart, column], axis=1).astype(np.float64)

    unique, first = np.unique(texel, return_index=True)
    candidates = np.arange(1, min(EQUALLY_NEAR, len(unique)) + 1)
    distance, nearest = cKDTree(place(unique)).query(place(np.arange(math.prod(maps.shape))), k=candidates)
    tied = np.rint(distance**2) == np.rint(distance[:, :1] ** 2)  # squares of integer steps
    return np.asarray(np.where(tied, first[nearest], len(texel)).min(axis=1))


def cell_sums(flux: Array, cell: Array, count: int) -> Array:
    """Return the flux of each cell.

    Parameters
    ----------
    flux : (3, H, W) ndarray
        Flux of each texel, W.
    cell : (H * W,) ndarray of int
        Cell of each texel.
    count : int
        Number of cells.

    Returns
    -------
    (3, count) ndarray
        W, summed in float64.
    """
    sums = [np.bincount(cell, channel.reshape(-1), minlength=count) for channel in flux]
    return np.stack(sums).astype(flux.dtype)


def lit_texels(texel: Array, cell: Array, lit: Array) -> Array:
    """Return the texel that stands for each cell: the chosen one, or where that is dark the nearest lit one.

    Parameters
    ----------
    texel : (N,) ndarray of int
        Chosen texels.
    cell : (H * W,) ndarray of int
        Cell of each texel.
    lit : (H, W) ndarray of bool
        Which texels have flux.

    Returns
    -------
    (N,) ndarray of int
        As `texel` where the whole cell is dark; of equally near texels the first.
    """
    width = lit.shape[1]
    shines = lit.reshape(-1)
    candidates = np.flatnonzero(shines & ~shines[texel][cell])
    own = texel[cell[candidates]]
    square = (candidates // width - own // width) ** 2 + (candidates % width - own % width) ** 2
    order = np.lexsort((candidates, square, cell[candidates]))
    cells, first = np.unique(cell[candidates][order], return_index=True)
    moved = texel.copy()
    moved[cells] = candidates[order][first]
    return moved
