"""The light of one area light's pixel lights on all receivers, under their common visibility (Sec. 4).

A tile of receivers runs past the members of its subset; those that receive light move together, and V is found for them
alone. What lies in no member's reach is not even loaded.
"""

from typing import Any, NamedTuple

import numpy as np

from refgi.cluster.interleave import FIRST, SIZE, SUBSET
from refgi.cluster.visibility.search_region import SCRATCH_ROWS, Scratch
from refgi.cluster.visibility.shadow import shadow_tile
from refgi.jit import kernel, prange
from refgi.pairs.pair_sum import GROUP, ROWS, TILE, TOTAL, Clamp, X, add_listed, load_tile
from refgi.pairs.tiles import bound_tile, lights_in_reach
from refgi.types import Array

TASKS = 64  # parts that tiles are split into, whatever the number of threads
DENSE = 0.75  # share of the lanes from which on moving them together costs more than it saves


class ReceiverTiles(NamedTuple):
    """All receivers, world space."""

    position: Array  # (3, n) m
    normal: Array  # (3, n) unit vectors
    facing: Array  # (3, n) normals of the triangles; (3, 0) where no shadow reads them
    tiles: Array  # (3, T) int64: rows FIRST, SIZE, SUBSET
    low: Array  # (T, 6) bounds of positions and normals
    high: Array  # (T, 6)


@kernel(parallel=True)
def bound_tiles(receivers: ReceiverTiles) -> None:
    """Fill `low` and `high` of every tile, as `bound_tile`."""
    position, normal, tiles, low, high = (receivers.position, receivers.normal, receivers.tiles, receivers.low,
                                          receivers.high)
    for task in prange(TASKS):
        tile = np.zeros((ROWS, TILE), position.dtype)
        for t in range(np.int64(task), tiles.shape[1], TASKS):
            load_tile(tile, position, normal, tiles[FIRST, t], tiles[SIZE, t])
            bound_tile(tile, tiles[SIZE, t], low[t], high[t])


def members_behind(receivers: ReceiverTiles, lights: Array, start: Array) -> tuple[int, int]:
    """Return how many pairs of tile and light of its subset are passed over for all area lights, and of how many."""
    reached = np.zeros(receivers.tiles.shape[1], np.int64)
    _count_reached(receivers, lights, start, reached)
    pairs = int(np.diff(start, axis=1).sum(axis=0)[receivers.tiles[SUBSET]].sum())
    return pairs - int(reached.sum()), pairs


@kernel(parallel=True)
def _count_reached(receivers: ReceiverTiles, lights: Array, start: Array, reached: Array) -> None:
    for t in prange(len(reached)):
        subset = receivers.tiles[SUBSET, t]
        reach, chosen = np.empty(GROUP, np.bool_), np.empty(GROUP + 1, np.int64)
        for m in range(len(start)):
            last = start[m, subset + 1]
            for group in range(start[m, subset], last, GROUP):
                reached[t] += lights_in_reach(lights, group, min(group + GROUP, last), receivers.low[t],
                                              receivers.high[t], reach, chosen)


@kernel(parallel=True)
def add_unshadowed(
    receivers: ReceiverTiles, lights: Array, clamp: Clamp | None, start: Array, irradiance: Array
) -> None:
    """Add the diffuse lights of one area light to `irradiance` (3, n) of every receiver, those of its subset.

    `lights` (9, N + 1) are packed and sorted, the last one black; `start` (subsets + 1,) is where each subset's begin.
    """
    tasks = min(TASKS, receivers.tiles.shape[1])
    for task in prange(tasks):
        real = receivers.position.dtype
        tile, visible = np.zeros((ROWS, TILE), real), np.ones(TILE, real)
        reach, chosen = np.empty(GROUP, np.bool_), np.empty(GROUP + 1, np.int64)
        for t in range(np.int64(task), receivers.tiles.shape[1], tasks):
            if _light_tile(receivers, t, lights, clamp, start, tile, reach, chosen):
                _add(tile, receivers.tiles, t, visible, irradiance)


@kernel(parallel=True)
def add_shadowed(
    receivers: ReceiverTiles, lights: Array, clamp: Clamp | None, start: Array, shadow: Any, channels: int,
    irradiance: Array,
) -> None:
    """Add the diffuse lights of one area light under its `shadow`, which reads `channels` of a filtered map."""
    tasks = min(TASKS, receivers.tiles.shape[1])
    for task in prange(tasks):
        real = receivers.position.dtype
        tile, visible, some = np.zeros((ROWS, TILE), real), np.empty(TILE, real), np.empty(TILE, real)
        reach, chosen = np.empty(GROUP, np.bool_), np.empty(GROUP + 1, np.int64)
        with_light, places = np.empty(TILE, np.bool_), np.empty(TILE, np.int64)
        points, facing = np.empty((3, TILE), real), np.empty((3, TILE), real)
        scratch = Scratch(np.empty(TILE, np.bool_), np.empty((SCRATCH_ROWS, TILE), real),
                          np.empty((channels, TILE), real))
        for t in range(np.int64(task), receivers.tiles.shape[1], tasks):
            if not _light_tile(receivers, t, lights, clamp, start, tile, reach, chosen):
                continue
            first, size = receivers.tiles[FIRST, t], receivers.tiles[SIZE, t]
            count = _list_with_light(tile, size, with_light, places)
            if count >= DENSE * size:
                _copy_facing(receivers.facing, first, size, facing)
                shadow_tile(shadow, tile, facing, size, with_light, visible, scratch)
            else:
                _gather(tile, receivers.facing, first, places, count, with_light, points, facing)
                shadow_tile(shadow, points, facing, count, with_light, some, scratch)
                _scatter(some, places, count, visible)
            _add(tile, receivers.tiles, t, visible, irradiance)


@kernel
def _light_tile(
    receivers: ReceiverTiles, t: int, lights: Array, clamp: Clamp | None, start: Array, tile: Array, reach: Array,
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
def _list_with_light(tile: Array, size: int, with_light: Array, places: Array) -> int:
    """List the receivers that have any light, and count them."""
    zero = tile.dtype.type(0.0)
    for i in range(TILE):
        with_light[i] = (tile[TOTAL, i] > zero) | (tile[TOTAL + 1, i] > zero) | (tile[TOTAL + 2, i] > zero)
    count = 0
    for i in range(size):
        places[count] = i
        count += with_light[i]
    return count


@kernel
def _copy_facing(source: Array, first: int, size: int, facing: Array) -> None:
    if source.shape[1] > 0:
        for c in range(3):
            for i in range(size):
                facing[c, i] = source[c, first + i]


@kernel
def _gather(
    tile: Array, source: Array, first: int, places: Array, count: int, active: Array, points: Array, facing: Array
) -> None:
    """Move receivers to the first lanes, with the normals of their triangles where there are any; flag these lanes."""
    for c in range(3):
        for j in range(count):
            points[c, j] = tile[X + c, places[j]]
        if source.shape[1] > 0:
            for j in range(count):
                facing[c, j] = source[c, first + places[j]]
    for j in range(count):
        active[j] = True


@kernel
def _scatter(some: Array, places: Array, count: int, visible: Array) -> None:
    for i in range(TILE):
        visible[i] = 0
    for j in range(count):
        visible[places[j]] = some[j]


@kernel
def _add(tile: Array, tiles: Array, t: int, visible: Array, irradiance: Array) -> None:
    first, size = np.uint64(tiles[FIRST, t]), np.uint64(tiles[SIZE, t])
    for i in range(size):
        v = visible[i]
        # Sec. 4: E = sum_m V_m E_m
        irradiance[0, first + i] += v * tile[TOTAL, i]
        irradiance[1, first + i] += v * tile[TOTAL + 1, i]
        irradiance[2, first + i] += v * tile[TOTAL + 2, i]
