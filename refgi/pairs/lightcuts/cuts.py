"""Sums over cuts through the light tree: clusters fine enough for each group of receivers, and whether they pay.

Nodes whose bound is above a threshold are replaced by their children, until the bounds add up to S <= error (E - S), E
the least sum over channels of the group's receivers. A node large beside the group is opened; one that is small but
near is left to the group's halves, and they to theirs. The last halves lower their threshold until S suffices; where
what was accepted before is too much already, they begin anew from the top. `chosen` estimates from counts of pairs and
bounds, never from clocks, whether that takes less than the sum of all lights.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from refgi.diagnostics import LightcutsChoice, tell_lightcuts
from refgi.jit import kernel, prange
from refgi.pairs.lightcuts.groups import bound_group, group_receivers, half_of
from refgi.pairs.lightcuts.nodes import (
    Nodes,
    add_nodes,
    copy_totals,
    empty_list,
    evaluate,
    extremes,
    largest_error,
    list_top,
    refine,
    restore_totals,
    sum_of_errors,
)
from refgi.pairs.lightcuts.tree import LightTree, light_tree
from refgi.pairs.pair_sum import NX, ROWS, TILE, TOTAL, Clamp, X
from refgi.pairs.settings import LEAST_LIGHTS, AutoLightcuts, Lightcuts
from refgi.pairs.tile_counts import tiles_behind
from refgi.pairs.tiles import block_by_block, taken
from refgi.stages import counted_pixels, skip, stage, tally
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.pairs.pixel_lights import Packed, PixelLights

DEPTHS = 4  # of halving
UNDIVIDED = 96  # receivers of a group that is not halved
LOOK = 96  # nodes of a cut whose sum is the first estimate of a group's irradiance
SHARE = 512.0  # a group with halves accepts what may be off by 1 / SHARE of what is allowed to the sum
FEW = 24  # nodes for whose sake no group is halved
NEAR = 4.0  # a node this many times as wide as a group is opened, a smaller one is left to halves
CONTRAST = 4.0  # of a group's estimated irradiance, above which halves look for themselves
SPENT = 0.9  # of what is allowed: if so much was accepted before, a half begins anew
FIRST = 3.0  # of a first threshold, in what is allowed to each node
STEPS = 0.05, 0.8  # of a threshold, where the next may lie
LARGER = 2.0  # than the last threshold of a half, the first of the next
LOWER = 0.7  # of the largest bound, at which a threshold lies at most


class Halves(NamedTuple):
    """Groups that wait, last first, and what was left to the halves at each depth."""

    span: Array  # (DEPTHS + 2, 3) int64: first receiver, one past the last, and depth
    node: Array  # (DEPTHS, n) int32
    level: Array  # (DEPTHS, n) int8
    number: Array  # (DEPTHS,) int64
    spent: Array  # (DEPTHS,) bounds of what was accepted so far, W/m^2
    allowed: Array  # (DEPTHS,) estimated largest sum of bounds, W/m^2; 0: not known


@stage("pairs.lightcuts", kept=False)
def add_cuts(position: Array, normal: Array, tree: LightTree, irradiance: Array) -> None:
    """Sum the irradiance of a tree's lights at receivers, by clusters where their bounds allow it.

    position, normal (3, n): Receivers, world space; m and unit vectors. Neighbours should follow each other.
    irradiance (3, n): Filled with W/m^2. The sum over channels of its errors is at most `tree.error` times the sum of
        the full sum's channels, at every receiver, but for rounding.
    -> None: `irradiance` holds the sums.
    """
    pairs, _ = sum_groups(position, normal, *group_receivers(position, normal), tree, irradiance)
    tally("pairs", lambda: pairs)


def sum_groups(
    position: Array, normal: Array, order: Array, starts: Array, tree: LightTree, irradiance: Array
) -> tuple[int, int]:
    """Fill irradiance (3, n), W/m^2, of receivers in groups; return how many pairs and how many bounds that took."""
    work = np.zeros((len(starts) - 1, 2), np.int64)
    _sum_groups(position, normal, order, starts, tree, irradiance, work)
    return int(work[:, 0].sum()), int(work[:, 1].sum())


@kernel(parallel=True)
def _sum_groups(
    position: Array, normal: Array, order: Array, starts: Array, tree: LightTree, irradiance: Array, work: Array
) -> None:
    for g in prange(len(starts) - 1):
        first, size = starts[g], starts[g + 1] - starts[g]
        tile = np.zeros((ROWS, TILE), position.dtype)
        for i in range(size):
            for axis in range(3):
                tile[X + axis, i] = position[axis, order[first + i]]
                tile[NX + axis, i] = normal[axis, order[first + i]]
        work[g, 0], work[g, 1] = _sum_group(tile, size, tree)
        for i in range(size):
            for c in range(3):
                irradiance[c, order[first + i]] = tile[TOTAL + c, i]


@kernel
def _sum_group(tile: Array, size: int, tree: LightTree) -> tuple[int, int]:
    """Fill the totals of a tile's first `size` receivers; return how many pairs and how many bounds that took."""
    most = tree.starts[1] + 1
    halves = Halves(np.zeros((DEPTHS + 2, 3), np.int64), np.empty((DEPTHS, most), np.int32),
                    np.empty((DEPTHS, most), np.int8), np.zeros(DEPTHS, np.int64), np.zeros(DEPTHS), np.zeros(DEPTHS))
    nodes, group, kept = empty_list(tree), np.zeros(9, tile.dtype), np.empty((6, TILE), tile.dtype)
    halves.span[0, 1], waiting, pairs, guess = size, 1, 0, np.zeros(1)
    while waiting > 0:
        waiting -= 1
        begin, end, depth = halves.span[waiting, 0], halves.span[waiting, 1], halves.span[waiting, 2]
        bound_group(tile, begin, end, group)
        spent, allowed = 0.0, 0.0
        if depth == 0:
            count = list_top(tree, nodes, group)
        else:
            count, spent, allowed = halves.number[depth - 1], halves.spent[depth - 1], halves.allowed[depth - 1]
            for i in range(count):
                nodes.node[i], nodes.level[i] = halves.node[depth - 1, i], halves.level[depth - 1, i]
            evaluate(tree, nodes, count, group)
        divisible, is_even = end - begin > UNDIVIDED and depth < DEPTHS, True
        if allowed == 0.0:
            count = _first_cut(tree, nodes, count, group)
            copy_totals(tile, begin, end, kept)
            add_nodes(tile, begin, end, tree, nodes.node, count)
            least, largest = extremes(tile, begin, end)
            restore_totals(tile, begin, end, kept)
            pairs += count * (end - begin)
            allowed, is_even = tree.error * least / (1.0 + tree.error), largest <= CONTRAST * least
        left = count if divisible and not is_even else 0
        if divisible and is_even:
            count = refine(tree, nodes, count, allowed / SHARE, group, NEAR * group[8])
            left = _leave(nodes, count, allowed / SHARE, allowed - spent)
        if left > 0:
            spent += sum_of_errors(nodes, count - left)
            add_nodes(tile, begin, end, tree, nodes.node, count - left)
            pairs += (count - left) * (end - begin)
            for i in range(left):
                k = count - left + i
                halves.node[depth, i], halves.level[depth, i] = nodes.node[k], nodes.level[k]
            halves.number[depth], halves.spent[depth] = left, spent
            halves.allowed[depth] = allowed if is_even else 0.0
            waiting = _halve(halves, waiting)
        else:
            pairs += _finish(tile, begin, end, tree, nodes, count, group, spent, allowed, kept, guess)
    return pairs, nodes.bounds[0]


@kernel
def _first_cut(tree: LightTree, nodes: Nodes, count: int, group: Array) -> int:
    """Refine a list to about LOOK nodes, the largest bounds first."""
    largest = largest_error(nodes, count)
    while count < LOOK and largest > 0.0:
        count = refine(tree, nodes, count, min(0.25 * largest, 1e30), group, 0.0)
        largest = largest_error(nodes, count)
    return count


@kernel
def _leave(nodes: Nodes, count: int, threshold: float, allowed: float) -> int:
    """Put the nodes whose bound is above a threshold last; return how many, 0 where all may stay or they are few."""
    left = 0
    for i in range(count):
        left += nodes.error[i] > threshold
    if left <= FEW or sum_of_errors(nodes, count) <= allowed:
        return 0
    at = 0
    for i in range(count):
        if not nodes.error[i] > threshold:
            nodes.node[at], nodes.node[i] = nodes.node[i], nodes.node[at]
            nodes.level[at], nodes.level[i] = nodes.level[i], nodes.level[at]
            nodes.error[at], nodes.error[i] = nodes.error[i], nodes.error[at]
            at += 1
    return left


@kernel
def _halve(halves: Halves, waiting: int) -> int:
    """Replace the group that waited last by its halves; return how many wait."""
    begin, end, depth = halves.span[waiting, 0], halves.span[waiting, 1], halves.span[waiting, 2]
    middle = half_of(begin, end)
    halves.span[waiting, 0], halves.span[waiting, 1], halves.span[waiting, 2] = middle, end, depth + 1
    halves.span[waiting + 1, 0], halves.span[waiting + 1, 1], halves.span[waiting + 1, 2] = begin, middle, depth + 1
    return waiting + 2


@kernel
def _finish(
    tile: Array, begin: int, end: int, tree: LightTree, nodes: Nodes, count: int, group: Array, spent: float,
    allowed: float, kept: Array, guess: Array,
) -> int:
    """Refine a list until its bounds suffice for receivers begin to end - 1, and add it; return the pairs it took.

    `spent` are the bounds of what they have, `allowed` is an estimate of the largest sum of all, and `guess` (1,)
    the first threshold over it, which is set for the next half; 0: not known.
    """
    pairs, first = 0, FIRST * (allowed - spent) / max(count, LOOK)
    threshold = max(guess[0] * allowed, 0.0) if guess[0] > 0.0 else first
    copy_totals(tile, begin, end, kept)
    if threshold >= 0.0:  # else a darker half than its group, whose share is spent
        count = refine(tree, nodes, count, threshold, group, 0.0)
    while True:
        total = spent + sum_of_errors(nodes, count)
        if total <= allowed:
            add_nodes(tile, begin, end, tree, nodes.node, count)
            pairs += count * (end - begin)
            least, _ = extremes(tile, begin, end)
            allowed = tree.error * least / (1.0 + tree.error)
            if total <= allowed:
                guess[0] = LARGER * threshold / allowed if allowed > 0.0 else 0.0
                return pairs
            restore_totals(tile, begin, end, kept)
        if spent > SPENT * allowed:  # what was accepted before is too much
            kept[:], spent = 0, 0.0
            restore_totals(tile, begin, end, kept)
            count = list_top(tree, nodes, group)
            threshold = min(threshold, allowed) if threshold > 0.0 else FIRST * allowed / LOOK
        else:
            # the sum of bounds goes about with the root of the threshold
            share = (allowed - spent) / (total - spent)
            threshold *= min(max(share * share, STEPS[0]), STEPS[1])
            threshold = min(threshold, LOWER * largest_error(nodes, count))
        count = refine(tree, nodes, count, threshold, group, 0.0)


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
