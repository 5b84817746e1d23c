"""Sums over cuts through the light tree: clusters fine enough for each group of receivers, and for its halves.

A cut begins at the highest level. Nodes whose bound is above a threshold are replaced by their children, until the
bounds add up to S <= error (E - S), E the least sum of the group's receivers. A node that is large beside the group is
opened by it; one that is small but near is left to the group's halves, of which each sees it from one side, and they to
theirs. What is accepted on the way adds to the sums and to S of all receivers of the group. The last halves lower
their threshold until S suffices; where what was accepted before them is too much already, they begin anew from the top.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.pairs.lightcuts.bounds import bound_group, fill_errors
from refgi.pairs.lightcuts.groups import LANES, half_of
from refgi.pairs.lightcuts.tree import BOUND_ROWS, FAN, RADIUS, SOFT, LightTree, block_of
from refgi.pairs.pair_sum import COMPENSATION, GROUP, NX, ROWS, SUM, TILE, TOTAL, X, pair_term

Array = npt.NDArray[Any]

DEPTHS = 8  # of halving
BATCH = 128  # nodes whose bounds are computed at a time


class Nodes(NamedTuple):
    """A list of nodes and what is known of them."""

    node: Array  # (n,) int32
    level: Array  # (n,) int8
    error: Array  # (n,) bound, W/m^2
    radius: Array  # (n,) m
    bound: Array  # (BOUND_ROWS, BATCH) scratch
    found: Array  # (BATCH,) scratch


@kernel(parallel=True)
def sum_cuts(
    position: Array, normal: Array, order: Array, starts: Array, tree: LightTree, irradiance: Array, pairs: Array,
    P: Array,
) -> None:
    """Fill irradiance (3, n), W/m^2, with sums over cuts, each to the tree's error; and pairs (groups,), how many.

    `order`, `starts` are those of `group_receivers`.
    """
    for g in prange(len(starts) - 1):
        first, size = starts[g], starts[g + 1] - starts[g]
        tile = np.zeros((ROWS, TILE), position.dtype)
        for i in range(size):
            for axis in range(3):
                tile[X + axis, i] = position[axis, order[first + i]]
                tile[NX + axis, i] = normal[axis, order[first + i]]
        _sum_group(tile, size, tree, pairs, g, P)
        for i in range(size):
            for c in range(3):
                irradiance[c, order[first + i]] = tile[TOTAL + c, i]


@kernel
def _sum_group(tile: Array, size: int, tree: LightTree, pairs: Array, g: int, P: Array) -> None:
    most = tree.starts[-1] + FAN + tree.starts[1]
    LOOKN = int(P[0]); FEWN = P[2]; NEARN = P[3]; SHAREN = P[1]; CONTR = P[4]
    left, left_level = np.empty((DEPTHS, tree.starts[1] + FAN), np.int32), np.empty((DEPTHS, tree.starts[1] + FAN), np.int8)
    count, spent, budget = np.zeros(DEPTHS, np.int64), np.zeros(DEPTHS), np.zeros(DEPTHS)
    nodes = Nodes(np.empty(most, np.int32), np.empty(most, np.int8), np.empty(most, tile.dtype), np.empty(most, tile.dtype), np.zeros((BOUND_ROWS, BATCH), tile.dtype), np.zeros(BATCH, tile.dtype))
    begins, ends, depths = np.zeros(DEPTHS + 1, np.int64), np.zeros(DEPTHS + 1, np.int64), np.zeros(DEPTHS + 1, np.int64)
    kept = np.empty((6, TILE), tile.dtype)
    group = np.zeros(9, tile.dtype)
    ends[0], waiting = size, 1
    while waiting > 0:
        waiting -= 1
        begin, end, depth = begins[waiting], ends[waiting], depths[waiting]
        bound_group(tile, begin, end, group)
        # the list to begin with
        found, base, allowed = 0, 0.0, 0.0
        if depth == 0:
            found = _begin(tree, nodes, group)
        else:
            found, base, allowed = count[depth - 1], spent[depth - 1], budget[depth - 1]
            for i in range(found):
                nodes.node[i], nodes.level[i] = left[depth - 1, i], left_level[depth - 1, i]
            _evaluate(tree, nodes, found, group)
        splits = end - begin > P[5] and depth < DEPTHS - 1
        if allowed == 0.0:
            threshold, before = np.inf, 0
            while found < LOOKN:
                largest = 0.0
                for i in range(found):
                    largest = max(largest, np.float64(nodes.error[i]))
                if largest == 0.0:
                    break
                found = _refine(tree, nodes, found, min(0.25 * largest, 1e30), group, 0.0, pairs, g)
            _keep(tile, begin, end, kept)
            _add_nodes(tile, begin, end, tree, nodes.node, found)
            pairs[g, 0] += found * (end - begin)
            least, largest = _extremes(tile, begin, end)
            _restore(tile, begin, end, kept)
            allowed = tree.error * least / (1.0 + tree.error)
            if splits and (least <= 0.0 or largest > CONTR * least) and found >= LOOKN:
                # too uneven: halves look for themselves
                left[depth, :found] = nodes.node[:found]
                left_level[depth, :found] = nodes.level[:found]
                count[depth], spent[depth], budget[depth] = found, base, 0.0
                waiting = _push(begins, ends, depths, waiting, begin, end, depth)
                continue
        if splits:
            threshold = allowed / SHAREN
            found = _refine(tree, nodes, found, threshold, group, NEARN * group[RADIUS], pairs, g)
            rest = 0
            total = 0.0
            for i in range(found):
                rest += nodes.error[i] > threshold
                total += nodes.error[i]
            if base + total > allowed and rest > FEWN:
                rest, accepted, total = 0, 0, base
                for i in range(found):
                    if nodes.error[i] > threshold:
                        left[depth, rest], left_level[depth, rest] = nodes.node[i], nodes.level[i]
                        rest += 1
                    else:
                        nodes.node[accepted] = nodes.node[i]
                        accepted += 1
                        total += nodes.error[i]
                _add_nodes(tile, begin, end, tree, nodes.node, accepted)
                pairs[g, 0] += accepted * (end - begin)
                pairs[g, 1] += accepted * (end - begin)
                count[depth], spent[depth], budget[depth] = rest, total, allowed
                waiting = _push(begins, ends, depths, waiting, begin, end, depth)
                continue
        _keep(tile, begin, end, kept)
        factor = 3.0
        while True:
            total = base
            for i in range(found):
                total += nodes.error[i]
            if total <= allowed:
                _add_nodes(tile, begin, end, tree, nodes.node, found)
                pairs[g, 0] += found * (end - begin)
                least, largest = _extremes(tile, begin, end)
                allowed = tree.error * least / (1.0 + tree.error)
                if total <= allowed:
                    pairs[g, 1] += found * (end - begin)
                    P[8] += (end - begin) * total / max(allowed, 1e-30); P[9] += (end - begin); P[10] += (end - begin) * base / max(allowed, 1e-30)
                    P[11] += (end - begin) * found
                    break
                _restore(tile, begin, end, kept)
            if base > 0.9 * allowed:  # what was accepted before is too much
                pairs[g, 3] += 1
                for row in range(6):
                    for i in range(begin, end):
                        tile[TOTAL + row, i] = 0
                        kept[row, i] = 0
                base = 0.0
                found = _begin(tree, nodes, group)
                continue
            largest = 0.0
            for i in range(found):
                largest = max(largest, np.float64(nodes.error[i]))
            threshold = factor * (allowed - base) / found
            while not largest > threshold:
                factor *= 0.7
                threshold = factor * (allowed - base) / found
            found = _refine(tree, nodes, found, threshold, group, 0.0, pairs, g)


@kernel
def _push(begins: Array, ends: Array, depths: Array, waiting: int, begin: int, end: int, depth: int) -> int:
    middle = half_of(begin, end)
    begins[waiting], ends[waiting], depths[waiting] = middle, end, depth + 1
    begins[waiting + 1], ends[waiting + 1], depths[waiting + 1] = begin, middle, depth + 1
    return waiting + 2


@kernel
def _begin(tree: LightTree, nodes: Nodes, group: Array) -> int:
    """List the nodes of the highest level."""
    found, level = 0, len(tree.starts) - 2
    for k in range(tree.starts[level], tree.starts[level + 1]):
        nodes.node[found], nodes.level[found] = k, level
        found += 1
    _evaluate(tree, nodes, found, group)
    return found


@kernel
def _evaluate(tree: LightTree, nodes: Nodes, count: int, group: Array) -> None:
    """Compute the bounds of listed nodes."""
    for first in range(0, count, BATCH):
        last = min(first + BATCH, count)
        for i in range(first, last):
            level = np.int64(nodes.level[i])
            place = np.int64(nodes.node[i]) - tree.starts[level]
            if level > 0:
                block, lane = block_of(tree.starts, level, place // FAN), place % FAN
                for row in range(BOUND_ROWS):
                    nodes.bound[row, i - first] = tree.bounds[block, row, lane]
        fill_errors(nodes.bound, last - first, group, tree.least, tree.most, nodes.found)
        for i in range(first, last):
            lit = nodes.level[i] > 0
            nodes.error[i] = nodes.found[i - first] if lit else nodes.error.dtype.type(0)
            nodes.radius[i] = nodes.bound[RADIUS, i - first] if lit else nodes.error.dtype.type(0)


@kernel
def _refine(tree: LightTree, nodes: Nodes, count: int, threshold: float, group: Array, radius: float, pairs: Array, g: int) -> int:
    """Replace nodes whose bound is above a threshold and whose radius is above another by their children, and so on."""
    node, level, error, width = nodes.node, nodes.level, nodes.error, nodes.radius
    zero, limit, least = error.dtype.type(0.0), error.dtype.type(threshold), error.dtype.type(radius)
    starts = tree.starts
    at, size = 0, count
    opened = np.empty(BATCH // FAN, np.int64)
    while at < size:
        taken = 0
        while at < size and taken < BATCH // FAN:
            if error[at] > limit and width[at] > least:
                opened[taken] = at
                taken += 1
            at += 1
        for t in range(taken):
            i = opened[t]
            below = np.int64(level[i]) - 1
            if below > 0:
                block = block_of(starts, below, node[i] - starts[below + 1])
                for row in range(BOUND_ROWS):
                    for k in range(FAN):
                        nodes.bound[row, FAN * t + k] = tree.bounds[block, row, k]
        fill_errors(nodes.bound, taken * FAN, group, tree.least, tree.most, nodes.found)
        pairs[g, 2] += taken * FAN
        for t in range(taken):
            i = opened[t]
            below = np.int64(level[i]) - 1
            first = starts[below] + FAN * (node[i] - starts[below + 1])
            last = min(first + FAN, starts[below + 1])
            node[i] = -1
            for k in range(first, last):
                node[size], level[size] = k, below
                error[size] = nodes.found[FAN * t + k - first] if below > 0 else zero
                width[size] = nodes.bound[RADIUS, FAN * t + k - first] if below > 0 else zero
                size += 1
    kept = 0
    for i in range(size):
        if node[i] >= 0:
            node[kept], level[kept], error[kept], width[kept] = node[i], level[i], error[i], width[i]
            kept += 1
    return kept


@kernel
def _extremes(tile: Array, begin: int, end: int) -> Any:
    least, largest = np.inf, 0.0
    for i in range(begin, end):
        value = np.float64(tile[TOTAL, i]) + tile[TOTAL + 1, i] + tile[TOTAL + 2, i]
        least, largest = min(least, value), max(largest, value)
    return least, largest


@kernel
def _keep(tile: Array, begin: int, end: int, kept: Array) -> None:
    for row in range(6):
        for i in range(begin, end):
            kept[row, i] = tile[TOTAL + row, i]


@kernel
def _restore(tile: Array, begin: int, end: int, kept: Array) -> None:
    for row in range(6):
        for i in range(begin, end):
            tile[TOTAL + row, i] = kept[row, i]


@kernel
def _add_nodes(tile: Array, begin: int, end: int, tree: LightTree, chosen: Array, count: int) -> None:
    """Add the first `count` of the nodes `chosen` to the totals of receivers begin to end - 1, GROUP by GROUP."""
    zero = tile.dtype.type(0.0)
    start, stop = np.uint64(begin), np.uint64((end + LANES - 1) // LANES * LANES)
    black, nodes = len(tree.nodes) - 1, tree.nodes
    for group in range(0, count, GROUP):
        last = min(group + GROUP, count)
        for pair in range(group, last, 2):
            a, b = np.int64(chosen[pair]), np.int64(chosen[pair + 1]) if pair + 1 < last else black
            one, two = _load(nodes, a), _load(nodes, b)
            if tree.clamped:
                limits_a, limits_b = (tree.least, nodes[a, SOFT], tree.most), (tree.least, nodes[b, SOFT], tree.most)
                for i in range(start, stop):
                    receiver = tile[X, i], tile[X + 1, i], tile[X + 2, i], tile[NX, i], tile[NX + 1, i], tile[NX + 2, i]
                    g1, g2 = pair_term(one, receiver, limits_a), pair_term(two, receiver, limits_b)
                    # Eq. (2)
                    tile[SUM, i] = tile[SUM, i] + g1 * one[6] + g2 * two[6]
                    tile[SUM + 1, i] = tile[SUM + 1, i] + g1 * one[7] + g2 * two[7]
                    tile[SUM + 2, i] = tile[SUM + 2, i] + g1 * one[8] + g2 * two[8]
            else:
                for i in range(start, stop):
                    receiver = tile[X, i], tile[X + 1, i], tile[X + 2, i], tile[NX, i], tile[NX + 1, i], tile[NX + 2, i]
                    g1, g2 = pair_term(one, receiver, None), pair_term(two, receiver, None)
                    # Eq. (2)
                    tile[SUM, i] = tile[SUM, i] + g1 * one[6] + g2 * two[6]
                    tile[SUM + 1, i] = tile[SUM + 1, i] + g1 * one[7] + g2 * two[7]
                    tile[SUM + 2, i] = tile[SUM + 2, i] + g1 * one[8] + g2 * two[8]
        for c in range(3):
            for i in range(start, stop):
                added, old, lost = tile[SUM + c, i], tile[TOTAL + c, i], tile[COMPENSATION + c, i]
                part = added - lost
                total = old + part
                tile[COMPENSATION + c, i] = lost if added == zero else (total - old) - part
                tile[TOTAL + c, i] = old if added == zero else total
                tile[SUM + c, i] = zero


@kernel
def _load(nodes: Array, k: int) -> Any:
    return (nodes[k, 0], nodes[k, 1], nodes[k, 2], nodes[k, 3], nodes[k, 4], nodes[k, 5], nodes[k, 6], nodes[k, 7],
            nodes[k, 8])
