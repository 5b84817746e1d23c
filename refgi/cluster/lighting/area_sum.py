"""The light of one area light's pixel lights on all receivers, and its share under their common visibility."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.pairs.culling import bound_tile
from refgi.pairs.pair_sum import GROUP, ROWS, TILE, TOTAL, Clamp, load_tile, sum_tile

Array = npt.NDArray[Any]


@kernel(parallel=True)
def bound_tiles(position: Array, normal: Array, tiles: Array, low: Array, high: Array) -> None:
    """Bound the receivers of every tile.

    Parameters
    ----------
    position, normal : (3, n) ndarray
        Receivers.
    tiles : (3, T) ndarray of int64
        First receiver of each tile, how many it has and its subset.
    low, high : (T, 6) ndarray
        Filled; as `bound_tile`.
    """
    for t in prange(tiles.shape[1]):
        tile = np.zeros((ROWS, TILE), position.dtype)
        load_tile(tile, position, normal, tiles[0, t], tiles[1, t])
        bound_tile(tile, tiles[1, t], low[t], high[t])


@kernel(parallel=True)
def sum_members(
    position: Array, normal: Array, tiles: Array, low: Array, high: Array, lights: Array, clamp: Clamp | None,
    start: Array, irradiance: Array,
) -> None:
    """Add up the diffuse lights of one area light at every receiver, those of its subset.

    Parameters
    ----------
    position, normal : (3, n) ndarray
        Receivers, world space; m and unit vectors.
    tiles : (3, T) ndarray of int64
        As in `bound_tiles`.
    low, high : (T, 6) ndarray
        Of `bound_tiles`.
    lights : (9, N + 1) ndarray
        Packed lights, sorted; the last one is black.
    clamp : Clamp or None
        How near pairs are kept finite.
    start : (subsets + 1,) ndarray of int64
        First light of each subset, and one past its last.
    irradiance : (3, n) ndarray
        Filled with W/m^2.
    """
    for t in prange(tiles.shape[1]):
        first, size, subset = tiles[0, t], tiles[1, t], tiles[2, t]
        tile = np.zeros((ROWS, TILE), position.dtype)
        if start[subset] < start[subset + 1]:
            reach, chosen = np.empty(GROUP, np.bool_), np.empty(GROUP + 1, np.int64)
            load_tile(tile, position, normal, first, size)
            sum_tile(tile, low[t], high[t], lights, clamp, start[subset], start[subset + 1], reach, chosen)
        for c in range(3):
            for i in range(size):
                irradiance[c, first + i] = tile[TOTAL + c, i]


@kernel
def add_share(part: Array, lit: Array, visible: Array, total: Array, lost: Array) -> None:
    """Add V_m E_m to the sums of some receivers, with what the addition before rounded off (Kahan 1965).

    Parameters
    ----------
    part : (3, n) ndarray
        E_m, W/m^2.
    lit : (k,) ndarray of int64
        Which receivers.
    visible : (k,) ndarray
        V_m of these.
    total, lost : (3, n) ndarray
        Sums, and what rounding added to them.
    """
    for c in range(3):
        for j in range(len(lit)):
            i = lit[j]
            share = visible[j] * part[c, i] - lost[c, i]
            old = total[c, i]
            total[c, i] = old + share
            lost[c, i] = (total[c, i] - old) - share
