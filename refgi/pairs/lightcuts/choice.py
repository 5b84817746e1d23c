"""Whether a sum by clusters takes less than that of all lights one by one: an estimate of counts, never of clocks.

The tree over a few of the lights is cut for a few groups of receivers, and pairs and bounds of that are counted; with
the number of lights they grow by a power that two such trees tell. The full sum takes the pairs of lights and tiles of
receivers that can reach each other. It is the same on every machine and any number of threads.
"""

import math
from typing import TYPE_CHECKING

import numpy as np

from refgi.diagnostics import LightcutsChoice, tell_lightcuts
from refgi.pairs.lightcuts.cuts import sum_groups
from refgi.pairs.lightcuts.groups import group_receivers
from refgi.pairs.lightcuts.tree import light_tree
from refgi.pairs.pair_sum import TILE, Clamp
from refgi.pairs.settings import LEAST_LIGHTS, AutoLightcuts, Lightcuts
from refgi.pairs.tile_counts import tiles_behind
from refgi.pairs.tiles import block_by_block, taken
from refgi.stages import counted_pixels, skip
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.pairs.packing import Packed
    from refgi.pairs.pixel_lights import PixelLights

LEAST_PAIRS = 1 << 30  # of light and receiver; fewer are summed in full
LIGHTS = 4096  # in the tree that is tried, at most a quarter of all
TILES, PART = 16, 64  # tiles of the full sum that are looked at, and receivers of each that a cut is tried for
GROWTH = 0.3, 0.8  # powers of the number of lights that a cut's work grows with
PAIR, TEST, CUT_PAIR, BOUND, NODE, RECEIVER = 0.42, 0.2, 0.45, 34.0, 600.0, 160.0  # ns of one thread
SURE = 0.7  # of the full sum's time, what clusters may be estimated to take: estimates are 0.8 to 2.3 times what is met


def for_lights(lightcuts: AutoLightcuts | Lightcuts | None, lights: "PixelLights") -> AutoLightcuts | Lightcuts | None:
    """Return lightcuts, none for "auto" where lights are few."""
    count = lights.flux.shape[1]
    if isinstance(lightcuts, AutoLightcuts) and count < LEAST_LIGHTS:
        skip("pairs.lightcuts", f"{count:,} lights: fewer than {LEAST_LIGHTS:,} are summed in full")
        return None
    return lightcuts


def chosen(lightcuts: AutoLightcuts, packed: "Packed", planes: tuple[Array, Array], covered: Array) -> Lightcuts | None:
    """Return bounded lightcuts where they take less time than the full sum of diffuse lights, else none.

    `planes`: positions and normals (3, h, w) of the receivers.
    """
    count, covered = packed.diffuse.shape[1] - 1, np.asarray(covered, np.bool_)
    number = int(np.count_nonzero(covered))
    if packed.spheres is not None or not bool((packed.diffuse[6:] >= 0).all()):
        skip("pairs.lightcuts", "spheres and lights of negative flux have no bound")
        return None
    if count < LEAST_LIGHTS or count * counted_pixels(number) < LEAST_PAIRS:
        skip("pairs.lightcuts", f"{count:,} diffuse lights at {number:,} points are summed in full")
        return None
    if count * number < LEAST_PAIRS:  # a small picture that stands for a large one
        return Lightcuts(lightcuts.error)
    first = np.linspace(0, number - TILE, TILES).astype(np.int64) // TILE * TILE
    places = block_by_block(covered, (first[:, None] + np.arange(TILE)).reshape(-1))
    position, normal = (taken(np.asarray(part, packed.diffuse.dtype), places) for part in planes)
    share = estimated_share(position, normal, packed.diffuse, packed.clamp, lightcuts.error, number)
    if share > SURE:
        skip("pairs.lightcuts", f"estimated to take {share:.2g} times the time of the full sum of {count:,} lights")
        return None
    choice = LightcutsChoice(count, lightcuts.error, share)
    skip("pairs.full_sum", choice.statement)
    tell_lightcuts(choice)
    return Lightcuts(lightcuts.error)


def estimated_share(
    position: Array, normal: Array, lights: Array, clamp: Clamp | None, error: float, number: int
) -> float:
    """Return the estimated time of clusters over that of the full sum of packed lights at `number` receivers.

    position, normal (3, TILES TILE): Some of the receivers, tile by tile.
    """
    count = lights.shape[1] - 1
    behind, tiles = tiles_behind(position, normal, lights)
    full = count * (PAIR * (1 - behind / tiles) + TEST / TILE)
    most = min(count // 4, LIGHTS)
    few, many = (_work(position, normal, lights, clamp, error, some) for some in (most // 4, most))
    growth = min(max(math.log(many / few, 4), GROWTH[0]), GROWTH[1])
    cuts = many * (count / most) ** growth + RECEIVER + NODE * count / number
    return float(cuts / full)


def _work(position: Array, normal: Array, lights: Array, clamp: Clamp | None, error: float, number: int) -> float:
    """Return the time that cuts through a tree over `number` of the lights take for a receiver, ns."""
    count = lights.shape[1] - 1
    some = np.append((np.arange(number) + 0.5) * count // number, count).astype(np.int64)
    soft = clamp if clamp is None else clamp._replace(softness=np.ascontiguousarray(clamp.softness[some]))
    tree = light_tree(np.ascontiguousarray(lights[:, some]), soft, error)
    orders, starts = list[Array](), list[Array]()
    for tile in range(position.shape[1] // TILE):
        place = tile * TILE + tile % (TILE // PART) * PART + np.arange(PART)
        part, start = group_receivers(position[:, place], normal[:, place])
        orders.append(place[part])
        starts.append(tile * PART + start[:-1])
    order = np.concatenate(orders)
    pairs, bounds = sum_groups(position, normal, order, np.append(np.concatenate(starts), len(order)), tree,
                               np.zeros_like(position))
    return (CUT_PAIR * pairs + BOUND * bounds) / len(order)
