"""The light of one area light's pixel lights on all receivers, under their common visibility (Sec. 4).

A tile of receivers runs past the members of its subset, as in `pair_sum`; those that are lit move together, and V is
found for them alone. What lies in no member's reach is not even loaded.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.lighting.interleave import FIRST, SIZE, SUBSET
from refgi.cluster.maps.hard import hard_tile
from refgi.cluster.visibility.soft import ROOM_ROWS, Choices, soft_tile
from refgi.jit import kernel, prange
from refgi.pairs.culling import bound_tile, lights_in_reach
from refgi.pairs.pair_sum import GROUP, ROWS, TILE, TOTAL, Clamp, X, load_tile, sum_tile

Array = npt.NDArray[Any]

TASKS = 64  # parts that tiles are dealt to, whatever the number of threads


class Tiles(NamedTuple):
    """All receivers, world space."""

    position: Array  # (3, n) m
    normal: Array  # (3, n) unit vectors
    facing: Array  # (3, n) normals of the triangles
    tiles: Array  # (3, T) int64: rows FIRST, SIZE, SUBSET
    low: Array  # (T, 6) bounds of positions and normals
    high: Array  # (T, 6)


@kernel(parallel=True)
def bound_tiles(receivers: Tiles) -> None:
    """Fill in the bounds of every tile.

    Parameters
    ----------
    receivers : Tiles
        Fields `low` and `high` are filled; as `bound_tile`.
    """
    position, normal, tiles, low, high = (receivers.position, receivers.normal, receivers.tiles, receivers.low,
                                          receivers.high)
    for task in prange(TASKS):
        tile = np.zeros((ROWS, TILE), position.dtype)
        for t in range(np.int64(task), tiles.shape[1], TASKS):
            load_tile(tile, position, normal, tiles[FIRST, t], tiles[SIZE, t])
            bound_tile(tile, tiles[SIZE, t], low[t], high[t])


@kernel(parallel=True)
def add_unshadowed(receivers: Tiles, lights: Array, clamp: Clamp | None, start: Array, irradiance: Array) -> None:
    """Add the diffuse lights of one area light to every receiver, those of its subset.

    Parameters
    ----------
    receivers : Tiles
        Receivers.
    lights : (9, N + 1) ndarray
        Packed lights, sorted; the last one is black.
    clamp : Clamp or None
        How near pairs are kept finite.
    start : (subsets + 1,) ndarray of int64
        First light of each subset, and one past its last.
    irradiance : (3, n) ndarray
        Added to, W/m^2.
    """
    for task in prange(TASKS):
        real = receivers.position.dtype
        tile, points, places = np.zeros((ROWS, TILE), real), np.empty((6, TILE), real), np.empty(TILE, np.int64)
        visible = np.ones(TILE, real)
        for t in range(np.int64(task), receivers.tiles.shape[1], TASKS):
            count = _light_tile(receivers, t, lights, clamp, start, tile, points, places)
            if count > 0:
                _add(tile, receivers.tiles[FIRST, t], places, count, visible, irradiance)


@kernel(parallel=True)
def add_hard(
    receivers: Tiles, lights: Array, clamp: Clamp | None, start: Array, depth: Array, center: Array, frame: Array,
    irradiance: Array,
) -> None:
    """Add the diffuse lights of one area light under one hard test (`maps.hard`).

    Parameters
    ----------
    receivers : Tiles
        Receivers.
    lights : (9, N + 1) ndarray
        As in `add_unshadowed`.
    clamp : Clamp or None
        The same.
    start : (subsets + 1,) ndarray of int64
        The same.
    depth : (n, n) ndarray
        The area light's map, m.
    center : (3,) ndarray
        Its centre, m.
    frame : (3, 3) ndarray
        Its frame.
    irradiance : (3, n) ndarray
        Added to, W/m^2.
    """
    for task in prange(TASKS):
        real = receivers.position.dtype
        tile, points, places = np.zeros((ROWS, TILE), real), np.empty((6, TILE), real), np.empty(TILE, np.int64)
        visible = np.empty(TILE, real)
        for t in range(np.int64(task), receivers.tiles.shape[1], TASKS):
            count = _light_tile(receivers, t, lights, clamp, start, tile, points, places)
            if count > 0:
                for i in range(count):
                    visible[i] = 1
                hard_tile(depth, center, frame, points[:3], points[3:], 0, count, visible)
                _add(tile, receivers.tiles[FIRST, t], places, count, visible, irradiance)


@kernel(parallel=True)
def add_soft(
    receivers: Tiles, lights: Array, clamp: Clamp | None, start: Array, numbers: Array, chosen: Choices,
    weight: Array, filters: Any, irradiance: Array,
) -> None:
    """Add the diffuse lights of one area light under its soft shadow (`visibility.soft`).

    Parameters
    ----------
    receivers : Tiles
        Receivers.
    lights : (9, N + 1) ndarray
        As in `add_unshadowed`.
    clamp : Clamp or None
        The same.
    start : (subsets + 1,) ndarray of int64
        The same.
    numbers : (NUMBERS,) ndarray
        The area light, of `numbers_of`.
    chosen : Choices
        How filters are sized.
    weight : (M,) ndarray
        Of the series' terms.
    filters : Mip, Sat or Brute
        The filtered map.
    irradiance : (3, n) ndarray
        Added to, W/m^2.
    """
    for task in prange(TASKS):
        real = receivers.position.dtype
        tile, points, places = np.zeros((ROWS, TILE), real), np.empty((6, TILE), real), np.empty(TILE, np.int64)
        wanted, todo, visible = np.ones(TILE, np.bool_), np.empty(TILE, np.bool_), np.empty(TILE, real)
        room, means = np.empty((ROOM_ROWS, TILE), real), np.empty((4 * len(weight) + 1, TILE), real)
        for t in range(np.int64(task), receivers.tiles.shape[1], TASKS):
            count = _light_tile(receivers, t, lights, clamp, start, tile, points, places)
            if count > 0:
                soft_tile(numbers, chosen, weight, filters, points, count, wanted, todo, visible, room, means)
                _add(tile, receivers.tiles[FIRST, t], places, count, visible, irradiance)


@kernel
def _light_tile(
    receivers: Tiles, t: int, lights: Array, clamp: Clamp | None, start: Array, tile: Array, points: Array,
    places: Array,
) -> int:
    """Sum the light on a tile into its rows TOTAL, and move the receivers that have any together.

    Return how many there are; `points` receives their positions and the normals of their triangles, `places` their
    lanes.
    """
    first, size, subset = receivers.tiles[FIRST, t], receivers.tiles[SIZE, t], receivers.tiles[SUBSET, t]
    low, high = receivers.low[t], receivers.high[t]
    reach, chosen = np.empty(GROUP, np.bool_), np.empty(GROUP + 1, np.int64)
    found = 0
    for group in range(start[subset], start[subset + 1], GROUP):
        found += lights_in_reach(lights, group, min(group + GROUP, start[subset + 1]), low, high, reach, chosen)
    if found == 0:
        return 0
    load_tile(tile, receivers.position, receivers.normal, first, size)
    for row in range(TOTAL, ROWS):
        for i in range(TILE):
            tile[row, i] = 0
    sum_tile(tile, low, high, lights, clamp, start[subset], start[subset + 1], reach, chosen)
    count = 0
    for i in range(size):
        places[count] = i
        count += (tile[TOTAL, i] != 0) | (tile[TOTAL + 1, i] != 0) | (tile[TOTAL + 2, i] != 0)
    for c in range(3):
        for j in range(count):
            points[c, j] = tile[X + c, places[j]]
            points[3 + c, j] = receivers.facing[c, first + places[j]]
    return count


@kernel
def _add(tile: Array, first: int, places: Array, count: int, visible: Array, irradiance: Array) -> None:
    """E += V_m E_m."""
    for c in range(3):
        for j in range(count):
            irradiance[c, first + places[j]] += visible[j] * tile[TOTAL + c, places[j]]
