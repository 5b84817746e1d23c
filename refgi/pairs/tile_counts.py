"""How many lights kernels pass over, tile by tile: the tests of `sum_pairs`, `add_lobes` and `glossy_sum`, counted."""

from typing import TYPE_CHECKING

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.glossy_sum import FARTHEST, TILE_ROWS, M, ReceiverLobes, load_lobes
from refgi.pairs.lobe_culling import (
    CORNERS,
    MEASURES,
    PARTS,
    bound_lobes,
    bound_part,
    bound_receivers,
    lights_in_lobes,
    lobes_in_reach,
)
from refgi.pairs.pair_sum import GROUP, ROWS, TILE, load_tile
from refgi.pairs.ranged_sum import LANES
from refgi.pairs.tiles import bound_tile, lights_in_reach, list_all
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.pairs.pixel_lights import Packed, PackedLobes


def tiles_behind(position: Array, normal: Array, lights: Array, lanes: int = TILE) -> tuple[int, int]:
    """Return how many pairs of tile and packed diffuse light `sum_pairs` passes over, and of how many.

    `position`, `normal` (3, n): receivers, m. `lights` (9, N + 1). `lanes`: receivers of a tile.
    """
    reached = np.zeros(-(-position.shape[1] // lanes), np.int64)
    _count_diffuse(position, normal, lights, lanes, reached)
    pairs = len(reached) * (lights.shape[1] - 1)
    return pairs - int(reached.sum()), pairs


def lobe_tiles(position: Array, normal: Array, lobes: "PackedLobes", lanes: int = TILE) -> tuple[int, int]:
    """Return how many pairs of tile and lobe `add_lobes` passes over for the whole tile, and of how many.

    `position`, `normal` (3, n): receivers, m. `lanes`: receivers of a tile. Widened exponents may reach anywhere near
    the light.
    """
    reached = np.zeros(-(-position.shape[1] // lanes), np.int64)
    whole_from = -1.0 if lobes.widening is None else np.inf
    _count_lobes(position, normal, lobes.lights, whole_from, lanes, reached)
    pairs = len(reached) * lobes.lights.shape[1]
    return pairs - int(reached.sum()), pairs


def lights_off_lobes(position: Array, normal: Array, of: ReceiverLobes, packed: "Packed") -> tuple[int, int]:
    """Return how many pairs of tile of LANES and light lie in no lobe of a receiver, and of how many.

    `position`, `normal` (3, n): receivers, m. `packed`: the lights, whose diffuse parts and lobes count each.
    """
    passed = pairs = 0
    for lights in [packed.diffuse[:, :-1]] + ([] if packed.lobes is None else [packed.lobes.lights]):
        reached = np.zeros(-(-position.shape[1] // LANES), np.int64)
        _count_in_lobes(position, normal, of, np.ascontiguousarray(lights[:3]), reached)
        pairs += len(reached) * lights.shape[1]
        passed += len(reached) * lights.shape[1] - int(reached.sum())
    return passed, pairs


@kernel(parallel=True)
def _count_diffuse(position: Array, normal: Array, lights: Array, lanes: int, reached: Array) -> None:
    for block in prange(len(reached)):
        size = min(lanes, position.shape[1] - block * lanes)
        tile = np.zeros((ROWS, lanes), position.dtype)
        load_tile(tile, position, normal, block * lanes, size)
        low, high = np.empty(6, position.dtype), np.empty(6, position.dtype)
        bound_tile(tile, size, low, high)
        reach, chosen = np.empty(GROUP, np.bool_), np.empty(GROUP + 1, np.int64)
        black = lights.shape[1] - 1
        for group in range(0, black, GROUP):
            reached[block] += lights_in_reach(lights, group, min(group + GROUP, black), low, high, reach, chosen)


@kernel(parallel=True)
def _count_lobes(
    position: Array, normal: Array, lights: Array, whole_from: float, lanes: int, reached: Array
) -> None:
    bounds = bound_lobes(lights[9], whole_from)
    for block in prange(len(reached)):
        size = min(lanes, position.shape[1] - block * lanes)
        tile = np.zeros((ROWS, lanes), position.dtype)
        load_tile(tile, position, normal, block * lanes, size)
        spheres = np.empty((4, PARTS + 1), position.dtype)
        bound_part(tile, 0, size, spheres, PARTS)
        scratch, chosen = np.empty((MEASURES, GROUP), position.dtype), np.empty(GROUP, np.int64)
        for group in range(0, lights.shape[1], GROUP):
            found = list_all(group, min(group + GROUP, lights.shape[1]), chosen)
            reached[block] += lobes_in_reach(lights, bounds, spheres, found, scratch, chosen)


@kernel(parallel=True)
def _count_in_lobes(position: Array, normal: Array, of: ReceiverLobes, lights: Array, reached: Array) -> None:
    for block in prange(len(reached)):
        size = min(LANES, position.shape[1] - block * LANES)
        tile = np.zeros((TILE_ROWS, LANES), position.dtype)
        load_tile(tile, position, normal, block * LANES, size)
        load_lobes(tile, of, block * LANES, size)
        low, high = np.empty(CORNERS, position.dtype), np.empty(CORNERS, position.dtype)
        cosine = bound_receivers(tile, M, FARTHEST, size, low, high)
        chosen = np.empty(GROUP, np.int64)
        for group in range(0, lights.shape[1], GROUP):
            found = list_all(group, min(group + GROUP, lights.shape[1]), chosen)
            reached[block] += lights_in_lobes(lights, low, high, cosine, found, chosen)
