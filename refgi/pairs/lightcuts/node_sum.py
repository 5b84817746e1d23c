"""Irradiance of listed nodes at the receivers of a tile: the sum of `pair_sum` over representatives."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.pairs.lightcuts.groups import LANES
from refgi.pairs.lightcuts.tree import SOFT, LightTree
from refgi.pairs.pair_sum import COMPENSATION, GROUP, NX, SUM, TOTAL, X, pair_term

Array = npt.NDArray[Any]


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
