"""How many lights the kernels pass over, tile by tile: the tests of `sum_pairs` and `add_lobes`, counted."""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.pairs.lobe_culling import MEASURES, PARTS, bound_lobes, bound_parts, lobes_in_reach
from refgi.pairs.pair_sum import GROUP, ROWS, TILE, load_tile
from refgi.pairs.tiles import bound_tile, lights_in_reach

if TYPE_CHECKING:
    from refgi.pairs.packing import PackedLobes

Array = npt.NDArray[Any]


def tiles_behind(position: Array, normal: Array, lights: Array) -> tuple[int, int]:
    """Return how many pairs of tile and packed diffuse light `sum_pairs` passes over, and of how many.

    `position`, `normal` (3, n): receivers, m. `lights` (9, N + 1).
    """
    reached = np.zeros(-(-position.shape[1] // TILE), np.int64)
    _count_diffuse(position, normal, lights, reached)
    pairs = len(reached) * (lights.shape[1] - 1)
    return pairs - int(reached.sum()), pairs


def lobe_tiles(position: Array, normal: Array, lobes: "PackedLobes") -> tuple[int, int]:
    """Return how many pairs of tile and lobe `add_lobes` passes over for the whole tile, and of how many.

    `position`, `normal` (3, n): receivers, m. Widened exponents may reach anywhere near the light.
    """
    reached = np.zeros(-(-position.shape[1] // TILE), np.int64)
    whole_from = -1.0 if lobes.widening is None else np.inf
    _count_lobes(position, normal, lobes.lights, whole_from, reached)
    pairs = len(reached) * lobes.lights.shape[1]
    return pairs - int(reached.sum()), pairs


@kernel(parallel=True)
def _count_diffuse(position: Array, normal: Array, lights: Array, reached: Array) -> None:
    for block in prange(len(reached)):
        size = min(TILE, position.shape[1] - block * TILE)
        tile = np.zeros((ROWS, TILE), position.dtype)
        load_tile(tile, position, normal, block * TILE, size)
        low, high = np.empty(6, position.dtype), np.empty(6, position.dtype)
        bound_tile(tile, size, low, high)
        reach, chosen = np.empty(GROUP, np.bool_), np.empty(GROUP + 1, np.int64)
        black = lights.shape[1] - 1
        for group in range(0, black, GROUP):
            reached[block] += lights_in_reach(lights, group, min(group + GROUP, black), low, high, reach, chosen)


@kernel(parallel=True)
def _count_lobes(position: Array, normal: Array, lights: Array, whole_from: float, reached: Array) -> None:
    bounds = bound_lobes(lights[9], whole_from)
    for block in prange(len(reached)):
        size = min(TILE, position.shape[1] - block * TILE)
        tile = np.zeros((ROWS, TILE), position.dtype)
        load_tile(tile, position, normal, block * TILE, size)
        spheres = np.empty((4, PARTS + 1), position.dtype)
        bound_parts(tile, size, spheres)
        scratch, chosen = np.empty((MEASURES, GROUP), position.dtype), np.empty(GROUP, np.int64)
        for group in range(0, lights.shape[1], GROUP):
            end = min(group + GROUP, lights.shape[1])
            reached[block] += lobes_in_reach(lights, bounds, group, end, spheres, None, scratch, chosen)
