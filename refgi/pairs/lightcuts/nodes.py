"""Lists of nodes with their bounds, their refinement, and the irradiance of listed nodes at the receivers of a tile."""

from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel
from refgi.pairs.lightcuts.bounds import fill_errors
from refgi.pairs.lightcuts.groups import LANES
from refgi.pairs.lightcuts.tree import BOUND_ROWS, FAN, RADIUS, SOFT, LightTree, block_of
from refgi.pairs.pair_sum import COMPENSATION, GROUP, NX, SUM, TOTAL, X, pair_term
from refgi.types import Array

BATCH = 128  # nodes whose bounds are computed at a time


class Nodes(NamedTuple):
    """A list of nodes and what is known of them; the part in use is counted apart."""

    node: Array  # (n,) int32
    level: Array  # (n,) int8
    error: Array  # (n,) bound, W/m^2; 0 for a light
    radius: Array  # (n,) m; 0 for a light
    bound: Array  # (BOUND_ROWS, BATCH) scratch
    found: Array  # (BATCH,) scratch
    opened: Array  # (BATCH / FAN,) int64 scratch


@kernel
def empty_list(tree: LightTree) -> Nodes:
    """Return memory for every node of a tree twice, which a refinement may need before it closes up."""
    count, dtype = 2 * tree.starts[-1] + FAN, tree.nodes.dtype
    return Nodes(np.empty(count, np.int32), np.empty(count, np.int8), np.empty(count, dtype), np.empty(count, dtype),
                 np.zeros((BOUND_ROWS, BATCH), dtype), np.zeros(BATCH, dtype), np.empty(BATCH // FAN, np.int64))


@kernel
def list_top(tree: LightTree, nodes: Nodes, group: Array) -> int:
    """List the nodes of the highest level, with their bounds for a group of receivers; return how many."""
    count, level = 0, len(tree.starts) - 2
    for k in range(tree.starts[level], tree.starts[level + 1]):
        nodes.node[count], nodes.level[count] = k, level
        count += 1
    evaluate(tree, nodes, count, group)
    return count


@kernel
def evaluate(tree: LightTree, nodes: Nodes, count: int, group: Array) -> None:
    """Compute the bounds of the first `count` nodes for a group of receivers, of `bound_group`."""
    zero = tree.nodes.dtype.type(0.0)
    for first in range(0, count, BATCH):
        last = min(first + BATCH, count)
        for i in range(first, last):
            level = np.int64(nodes.level[i])
            if level > 0:
                place = np.int64(nodes.node[i]) - tree.starts[level]
                block = block_of(tree.starts, level, place // FAN)
                for row in range(BOUND_ROWS):
                    nodes.bound[row, i - first] = tree.bounds[block, row, place % FAN]
        fill_errors(nodes.bound, last - first, group, tree.least, tree.most, nodes.found)
        for i in range(first, last):
            nodes.error[i] = nodes.found[i - first] if nodes.level[i] > 0 else zero
            nodes.radius[i] = nodes.bound[RADIUS, i - first] if nodes.level[i] > 0 else zero


@kernel
def refine(tree: LightTree, nodes: Nodes, count: int, threshold: float, group: Array, radius: float) -> int:
    """Replace nodes of a bound above and a radius of at least these by their children, and so on; return how many."""
    real = tree.nodes.dtype.type
    limit, width = real(threshold), real(radius)
    at, size = 0, count
    while at < size:
        taken = 0
        while at < size and taken < len(nodes.opened):
            if nodes.error[at] > limit and nodes.radius[at] >= width:
                nodes.opened[taken] = at
                taken += 1
            at += 1
        for t in range(taken):
            _load_children(tree, nodes, t)
        fill_errors(nodes.bound, taken * FAN, group, tree.least, tree.most, nodes.found)
        for t in range(taken):
            size = _append_children(tree, nodes, t, size)
    return _close_up(nodes, size)


@kernel
def _close_up(nodes: Nodes, size: int) -> int:
    """Drop the places marked by -1; return how many nodes are left."""
    first = 0
    while first < size and nodes.node[first] >= 0:
        first += 1
    kept = first
    for i in range(first, size):
        if nodes.node[i] >= 0:
            nodes.node[kept], nodes.level[kept] = nodes.node[i], nodes.level[i]
            nodes.error[kept], nodes.radius[kept] = nodes.error[i], nodes.radius[i]
            kept += 1
    return kept


@kernel
def _load_children(tree: LightTree, nodes: Nodes, t: int) -> None:
    i = nodes.opened[t]
    level = np.int64(nodes.level[i])
    if level > 1:
        block = tree.bounds[block_of(tree.starts, level - 1, np.int64(nodes.node[i]) - tree.starts[level])]
        first = np.uint64(FAN * t)  # unsigned, which needs no check for places counted from the end
        for row in range(np.uint64(BOUND_ROWS)):
            for k in range(np.uint64(FAN)):
                nodes.bound[row, first + k] = block[row, k]


@kernel
def _append_children(tree: LightTree, nodes: Nodes, t: int, size: int) -> int:
    """Append the children of the node opened as number t, whose place is marked by -1; return how many are listed."""
    zero = tree.nodes.dtype.type(0.0)
    i = nodes.opened[t]
    level = np.int64(nodes.level[i])
    first = tree.starts[level - 1] + FAN * (np.int64(nodes.node[i]) - tree.starts[level])
    last = min(first + FAN, tree.starts[level])
    nodes.node[i] = -1
    for k in range(first, last):
        child = FAN * t + k - first
        nodes.node[size], nodes.level[size] = k, level - 1
        nodes.error[size] = nodes.found[child] if level > 1 else zero
        nodes.radius[size] = nodes.bound[RADIUS, child] if level > 1 else zero
        size += 1
    return size


@kernel
def sum_of_errors(nodes: Nodes, count: int) -> float:
    """Return the sum of the first `count` bounds, W/m^2."""
    a, b, c, d = 0.0, 0.0, 0.0, 0.0  # four at a time, so that one addition need not wait for another
    rest = count // 4 * 4
    for i in range(0, rest, 4):
        a, b = a + nodes.error[i], b + nodes.error[i + 1]
        c, d = c + nodes.error[i + 2], d + nodes.error[i + 3]
    for i in range(rest, count):
        a += nodes.error[i]
    return (a + b) + (c + d)


@kernel
def largest_error(nodes: Nodes, count: int) -> float:
    """Return the largest of the first `count` bounds, W/m^2."""
    a = b = c = d = nodes.error.dtype.type(0.0)
    rest = count // 4 * 4
    for i in range(0, rest, 4):
        p, q, r, s = nodes.error[i], nodes.error[i + 1], nodes.error[i + 2], nodes.error[i + 3]
        a, b, c, d = p if p > a else a, q if q > b else b, r if r > c else c, s if s > d else d
    for i in range(rest, count):
        a = nodes.error[i] if nodes.error[i] > a else a
    return np.float64(max(max(a, b), max(c, d)))


@kernel
def add_nodes(tile: Array, begin: int, end: int, tree: LightTree, chosen: Array, count: int) -> None:
    """Add the first `count` of the nodes `chosen` to the totals of receivers begin to end - 1 of a tile.

    `begin` is a multiple of LANES; rows SUM hold zeros before.
    """
    start, stop = np.uint64(begin), np.uint64((end + LANES - 1) // LANES * LANES)
    black = len(tree.nodes) - 1
    for group in range(0, count, GROUP):
        last = min(group + GROUP, count)
        for pair in range(group, last, 2):
            a, b = np.int64(chosen[pair]), np.int64(chosen[pair + 1]) if pair + 1 < last else black
            if tree.clamped:
                limits_a = tree.least, tree.nodes[a, SOFT], tree.most
                limits_b = tree.least, tree.nodes[b, SOFT], tree.most
                _add_two(tile, start, stop, _load(tree.nodes, a), _load(tree.nodes, b), limits_a, limits_b)
            else:
                _add_two(tile, start, stop, _load(tree.nodes, a), _load(tree.nodes, b), None, None)
        _close(tile, start, stop)


@kernel
def _load(nodes: Array, k: Any) -> Any:
    return (nodes[k, 0], nodes[k, 1], nodes[k, 2], nodes[k, 3], nodes[k, 4], nodes[k, 5], nodes[k, 6], nodes[k, 7],
            nodes[k, 8])


@kernel
def _add_two(tile: Array, start: Any, stop: Any, one: Any, two: Any, limits_a: Any, limits_b: Any) -> None:
    for i in range(start, stop):
        receiver = tile[X, i], tile[X + 1, i], tile[X + 2, i], tile[NX, i], tile[NX + 1, i], tile[NX + 2, i]
        g1, g2 = pair_term(one, receiver, limits_a), pair_term(two, receiver, limits_b)
        # Eq. (2)
        tile[SUM, i] = tile[SUM, i] + g1 * one[6] + g2 * two[6]
        tile[SUM + 1, i] = tile[SUM + 1, i] + g1 * one[7] + g2 * two[7]
        tile[SUM + 2, i] = tile[SUM + 2, i] + g1 * one[8] + g2 * two[8]


@kernel
def _close(tile: Array, start: Any, stop: Any) -> None:
    """Add rows SUM to rows TOTAL as `pair_sum.close_group`, for some receivers."""
    zero = tile.dtype.type(0.0)
    for c in range(3):
        for i in range(start, stop):
            added, old, lost = tile[SUM + c, i], tile[TOTAL + c, i], tile[COMPENSATION + c, i]
            part = added - lost
            total = old + part
            tile[COMPENSATION + c, i] = lost if added == zero else (total - old) - part
            tile[TOTAL + c, i] = old if added == zero else total
            tile[SUM + c, i] = zero


@kernel
def extremes(tile: Array, begin: int, end: int) -> Any:
    """Return the least and the largest sum over channels of the totals of some receivers, W/m^2."""
    least, largest = np.inf, 0.0
    for i in range(begin, end):
        value = np.float64(tile[TOTAL, i]) + tile[TOTAL + 1, i] + tile[TOTAL + 2, i]
        least, largest = min(least, value), max(largest, value)
    return least, largest


@kernel
def copy_totals(tile: Array, begin: int, end: int, kept: Array) -> None:
    """Copy the totals of some receivers and their compensation to kept (6, TILE)."""
    for row in range(6):
        for i in range(begin, end):
            kept[row, i] = tile[TOTAL + row, i]


@kernel
def restore_totals(tile: Array, begin: int, end: int, kept: Array) -> None:
    """Copy totals back."""
    for row in range(6):
        for i in range(begin, end):
            tile[TOTAL + row, i] = kept[row, i]
