"""Sums over cuts through the light tree: clusters fine enough for each group of receivers, and for its halves.

A cut begins at the highest level. Nodes whose bound is above a threshold are replaced by their children, until the
bounds add up to S <= error (E - S), E the least sum over channels of the group's receivers. A node that is large beside
the group is opened by it; one that is small but near is left to the group's halves, of which each sees it from one
side, and they to theirs. What is accepted on the way adds to the sums and to S of all receivers of the group. The last
halves lower their threshold until S suffices; where what was accepted before them is too much already, they begin anew
from the top.
"""

from typing import NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.lightcuts.bounds import bound_group
from refgi.pairs.lightcuts.groups import group_receivers, half_of
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
from refgi.pairs.lightcuts.tree import LightTree
from refgi.pairs.pair_sum import NX, ROWS, TILE, TOTAL, X
from refgi.stages import stage, tally
from refgi.types import Array

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
            halves.node[depth, :left], halves.level[depth, :left] = nodes.node[count - left : count], nodes.level[
                count - left : count]
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
