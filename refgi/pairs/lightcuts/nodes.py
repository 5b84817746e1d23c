"""Lists of nodes with their bounds, their refinement, and the irradiance of listed nodes at the receivers of a tile."""

from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel
from refgi.pairs.lightcuts.groups import LANES, fill_errors
from refgi.pairs.lightcuts.tree import BOUND_ROWS, FAN, RADIUS, SOFT, LightTree, block_of
from refgi.pairs.pair_sum import GROUP, NX, SUM, TOTAL, X, close_lanes, pair_term
from refgi.types import Array

BATCH = 128  # nodes whose bounds are computed at a time
# unsigned, which needs no check for places counted from the end
NONE, ONE, TWO, THREE, FOUR = np.uint64(0), np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(FAN)


class Nodes(NamedTuple):
    """A list of nodes and what is known of them; the part in use is counted apart."""

    node: Array  # (n,) int32
    level: Array  # (n,) int8
    error: Array  # (n,) bound, W/m^2; 0 for a light
    radius: Array  # (n,) m; 0 for a light
    bound: Array  # (BOUND_ROWS, BATCH) scratch
    found: Array  # (BATCH,) scratch
    opened: Array  # (BATCH / FAN,) int64 scratch
    bounds: Array  # (1,) int64, how many were computed


@kernel
def empty_list(tree: LightTree) -> Nodes:
    """Return memory for every node of a tree twice, which a refinement may need before it closes up."""
    count, dtype = 2 * tree.starts[-1] + FAN, tree.nodes.dtype
    return Nodes(np.empty(count, np.int32), np.empty(count, np.int8), np.empty(count, dtype), np.empty(count, dtype),
                 np.zeros((BOUND_ROWS, BATCH), dtype), np.zeros(BATCH, dtype), np.empty(BATCH // FAN, np.int64),
                 np.zeros(1, np.int64))


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
    nodes.bounds[0] += count
    for first in range(0, count, BATCH):
        last = min(first + BATCH, count)
        for i in range(first, last):
            level = np.int64(nodes.level[i])
            if level > 0:
                place = np.uint64(np.int64(nodes.node[i]) - tree.starts[level])
                block, child = np.uint64(block_of(tree.starts, level, np.int64(place // FOUR))), place % FOUR
                lane = np.uint64(i - first)
                for row in range(np.uint64(BOUND_ROWS)):
                    nodes.bound[row, lane] = tree.bounds[block, row, child]
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
        nodes.bounds[0] += taken * FAN
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
        block = np.uint64(block_of(tree.starts, level - 1, np.int64(nodes.node[i]) - tree.starts[level]))
        first = np.uint64(FAN * t)
        for row in range(np.uint64(BOUND_ROWS)):  # all read before any is written: four lanes at once
            p, q = tree.bounds[block, row, NONE], tree.bounds[block, row, ONE]
            r, s = tree.bounds[block, row, TWO], tree.bounds[block, row, THREE]
            nodes.bound[row, first], nodes.bound[row, first + ONE] = p, q
            nodes.bound[row, first + TWO], nodes.bound[row, first + THREE] = r, s


@kernel
def _append_children(tree: LightTree, nodes: Nodes, t: int, size: int) -> int:
    """Append the children of the node opened as number t, whose place is marked by -1; return how many are listed."""
    zero = tree.nodes.dtype.type(0.0)
    i = nodes.opened[t]
    level = np.int64(nodes.level[i])
    first = tree.starts[level - 1] + FAN * (np.int64(nodes.node[i]) - tree.starts[level])
    nodes.node[i] = -1
    at, child = np.uint64(size), np.uint64(FAN * t)
    for k in range(np.uint64(FAN)):  # beyond the last one too, where the next node's children go
        nodes.node[at + k], nodes.level[at + k] = first + np.int64(k), level - 1
        nodes.error[at + k] = nodes.found[child + k] if level > 1 else zero
        nodes.radius[at + k] = nodes.bound[RADIUS, child + k] if level > 1 else zero
    return int(size + min(FAN, tree.starts[level] - first))


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
    for group in range(0, count, GROUP):
        last = min(group + GROUP, count)
        for four in range(group, last, 4):
            a, b = _nth(tree, chosen, four, last), _nth(tree, chosen, four + 1, last)
            c, d = _nth(tree, chosen, four + 2, last), _nth(tree, chosen, four + 3, last)
            nodes = _load(tree.nodes, a), _load(tree.nodes, b), _load(tree.nodes, c), _load(tree.nodes, d)
            if tree.clamped:
                _add_four(tile, start, stop, nodes, (_limits(tree, a), _limits(tree, b), _limits(tree, c),
                                                     _limits(tree, d)))
            else:
                _add_four(tile, start, stop, nodes, (None, None, None, None))
        close_lanes(tile, start, stop)


@kernel
def _nth(tree: LightTree, chosen: Array, i: int, last: int) -> Any:
    return np.int64(chosen[i]) if i < last else len(tree.nodes) - 1


@kernel
def _limits(tree: LightTree, k: int) -> Any:
    return tree.least, tree.nodes[k, SOFT], tree.most


@kernel
def _load(nodes: Array, k: Any) -> Any:
    return (nodes[k, 0], nodes[k, 1], nodes[k, 2], nodes[k, 3], nodes[k, 4], nodes[k, 5], nodes[k, 6], nodes[k, 7],
            nodes[k, 8])


@kernel
def _add_four(tile: Array, start: Any, stop: Any, nodes: Any, limits: Any) -> None:
    one, two, three, four = nodes
    for i in range(start, stop):
        receiver = tile[X, i], tile[X + 1, i], tile[X + 2, i], tile[NX, i], tile[NX + 1, i], tile[NX + 2, i]
        g1, g2 = pair_term(one, receiver, limits[0]), pair_term(two, receiver, limits[1])
        g3, g4 = pair_term(three, receiver, limits[2]), pair_term(four, receiver, limits[3])
        # Eq. (2)
        tile[SUM, i] = tile[SUM, i] + g1 * one[6] + g2 * two[6] + g3 * three[6] + g4 * four[6]
        tile[SUM + 1, i] = tile[SUM + 1, i] + g1 * one[7] + g2 * two[7] + g3 * three[7] + g4 * four[7]
        tile[SUM + 2, i] = tile[SUM + 2, i] + g1 * one[8] + g2 * two[8] + g3 * three[8] + g4 * four[8]


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
