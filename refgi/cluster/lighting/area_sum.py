"""The light of one area light's pixel lights on all receivers, under their common visibility (Sec. 4).

A tile of receivers runs past the members of its subset, as in `pair_sum`; those that are lit move together, and V is
found for them alone. What lies in no member's reach is not even loaded.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.filters.depth_scale import DepthScale
from refgi.cluster.lighting.interleave import FIRST, SIZE, SUBSET
from refgi.cluster.maps.hard import hard_tile
from refgi.cluster.visibility.look import ROOM_ROWS, Choices
from refgi.cluster.visibility.soft import FULL, soft_tile
from refgi.jit import kernel, prange
from refgi.pairs.pair_sum import GROUP, ROWS, TILE, TOTAL, Clamp, X, add_listed, load_tile
from refgi.pairs.tiles import bound_tile, lights_in_reach

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
        tile, visible = np.zeros((ROWS, TILE), real), np.ones(TILE, real)
        reach, chosen = np.empty(GROUP, np.bool_), np.empty(GROUP + 1, np.int64)
        for t in range(np.int64(task), receivers.tiles.shape[1], TASKS):
            if _light_tile(receivers, t, lights, clamp, start, tile, reach, chosen):
                _add(tile, receivers.tiles, t, visible, irradiance)


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
        tile, visible, facing = np.zeros((ROWS, TILE), real), np.empty(TILE, real), np.empty((3, TILE), real)
        reach, chosen = np.empty(GROUP, np.bool_), np.empty(GROUP + 1, np.int64)
        for t in range(np.int64(task), receivers.tiles.shape[1], TASKS):
            if _light_tile(receivers, t, lights, clamp, start, tile, reach, chosen):
                first, size = receivers.tiles[FIRST, t], receivers.tiles[SIZE, t]
                for i in range(size):
                    visible[i] = 1
                    for c in range(3):
                        facing[c, i] = receivers.facing[c, first + i]
                hard_tile(depth, center, frame, tile, facing, 0, size, visible)
                _add(tile, receivers.tiles, t, visible, irradiance)


@kernel(parallel=True)
def add_soft(
    receivers: Tiles, lights: Array, clamp: Clamp | None, start: Array, numbers: Array, sizes: Choices,
    scale: DepthScale, weight: Array, filters: Any, irradiance: Array,
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
    sizes : Choices
        How filters are sized.
    scale : DepthScale
        That of the filtered map.
    weight : (M,) ndarray
        Of the series' terms.
    filters : Mip, Sat or Brute
        The filtered map.
    irradiance : (3, n) ndarray
        Added to, W/m^2.
    """
    for task in prange(TASKS):
        real = receivers.position.dtype
        tile, visible, room = np.zeros((ROWS, TILE), real), np.empty(TILE, real), np.empty((ROOM_ROWS, TILE), real)
        reach, chosen = np.empty(GROUP, np.bool_), np.empty(GROUP + 1, np.int64)
        lit, all_lit, todo = np.empty(TILE, np.bool_), np.ones(TILE, np.bool_), np.empty(TILE, np.bool_)
        places, points, some = np.empty(TILE, np.int64), np.empty((3, TILE), real), np.empty(TILE, real)
        means = np.empty((4 * len(weight) + 1, TILE), real)
        for t in range(np.int64(task), receivers.tiles.shape[1], TASKS):
            if not _light_tile(receivers, t, lights, clamp, start, tile, reach, chosen):
                continue
            size = receivers.tiles[SIZE, t]
            count = _lit(tile, size, lit, places)
            if count >= FULL * size:
                soft_tile(numbers, sizes, scale, weight, filters, tile, size, lit, todo, visible, room, means)
            else:
                _gather(tile, places, count, points)
                soft_tile(numbers, sizes, scale, weight, filters, points, count, all_lit, todo, some, room, means)
                _scatter(some, places, count, visible)
            _add(tile, receivers.tiles, t, visible, irradiance)


@kernel
def _light_tile(
    receivers: Tiles, t: int, lights: Array, clamp: Clamp | None, start: Array, tile: Array, reach: Array,
    chosen: Array,
) -> bool:
    """Sum the light on a tile into its rows TOTAL; return False, and do nothing, where no light can reach it."""
    low, high, subset = receivers.low[t], receivers.high[t], receivers.tiles[SUBSET, t]
    last, loaded = start[subset + 1], False
    for group in range(start[subset], last, GROUP):
        listed = lights_in_reach(lights, group, min(group + GROUP, last), low, high, reach, chosen)
        if listed > 0:
            if not loaded:
                load_tile(tile, receivers.position, receivers.normal, receivers.tiles[FIRST, t],
                          receivers.tiles[SIZE, t])
                for row in range(TOTAL, ROWS):
                    for i in range(TILE):
                        tile[row, i] = 0
                loaded = True
            add_listed(tile, lights, clamp, chosen, listed)
    return loaded


@kernel
def _lit(tile: Array, size: int, lit: Array, places: Array) -> int:
    """List the receivers that have any light, and count them."""
    zero = tile.dtype.type(0.0)
    for i in range(TILE):
        lit[i] = (tile[TOTAL, i] > zero) | (tile[TOTAL + 1, i] > zero) | (tile[TOTAL + 2, i] > zero)
    count = 0
    for i in range(size):
        places[count] = i
        count += lit[i]
    return count


@kernel
def _gather(tile: Array, places: Array, count: int, points: Array) -> None:
    for c in range(3):
        for j in range(count):
            points[c, j] = tile[X + c, places[j]]


@kernel
def _scatter(some: Array, places: Array, count: int, visible: Array) -> None:
    for i in range(TILE):
        visible[i] = 0
    for j in range(count):
        visible[places[j]] = some[j]


@kernel
def _add(tile: Array, tiles: Array, t: int, visible: Array, irradiance: Array) -> None:
    """E += V_m E_m."""
    first, size = np.uint64(tiles[FIRST, t]), np.uint64(tiles[SIZE, t])
    for i in range(size):
        v = visible[i]
        irradiance[0, first + i] += v * tile[TOTAL, i]
        irradiance[1, first + i] += v * tile[TOTAL + 1, i]
        irradiance[2, first + i] += v * tile[TOTAL + 2, i]
