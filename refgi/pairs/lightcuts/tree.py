"""The light tree: clusters of clusters of lights in the order of a k-d tree, each with what its bound needs.

Lights are halved by selection at the median of the widest side, of positions or of normals, whose unit counts as
NORMALS times the width of the scene: the same bits for every number of threads. A node of level l joins FAN neighbours
of level l - 1; its representative is a light at the mean position, with the mean normal, not of unit length, and the
flux of all (means weighted by the sum over channels). Symbols of a cluster: w_i = sum over channels of Phi_i / pi, p
and m its mean position and the direction of its mean reversed normal, s^2 and v^2 the mean squared distance of
positions to p and of normals to their mean, D = sum over channels of ``|sum_i (Phi_i / pi) (y_i - p)|`` and N the same
of normals, A areas. All its lights lie within a radius of p and a height of the plane through p across m, and their
normals within a turn of m.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.pair_sum import Clamp
from refgi.types import Array

NORMALS = 0.3  # of the width of the scene: what normals that differ by 1 count as
SHARED = 7  # levels of halving at which threads share the sets of one level; below, each has its own


def compact_order(lights: Array, count: int) -> Array:
    """Return the order of the first `count` packed lights (rows 0 to 5: position, reversed normal), (count,) int32."""
    keys, order = np.empty((count, 6), np.float32), np.arange(count, dtype=np.int32)
    if count == 0:
        return order
    places = lights[:3, :count]
    low = places.min(axis=1).astype(np.float64)
    width = max(float((places.max(axis=1).astype(np.float64) - low).max()), 1e-300)
    _fill_keys(lights, low, width, keys)
    capacity = 1 << max(0, count - 1).bit_length()
    for level in range(SHARED + 1):
        if capacity >> level < 2:
            break
        _halve_level(keys, order, capacity >> level, level == SHARED)
    return order


@kernel(parallel=True)
def _fill_keys(lights: Array, low: Array, width: float, keys: Array) -> None:
    for k in prange(len(keys)):
        for axis in range(3):
            keys[k, axis] = (np.float64(lights[axis, k]) - low[axis]) / width
            keys[k, 3 + axis] = np.float32(NORMALS) * lights[3 + axis, k]


@kernel(parallel=True)
def _halve_level(keys: Array, order: Array, capacity: int, deep: bool) -> None:
    for part in prange((len(order) + capacity - 1) // capacity):
        begins, ends = np.empty(64, np.int64), np.empty(64, np.int64)
        sizes, waiting = np.empty(64, np.int64), 1
        begins[0], ends[0], sizes[0] = part * capacity, min(part * capacity + capacity, len(order)), capacity
        while waiting > 0:
            waiting -= 1
            begin, end, half = begins[waiting], ends[waiting], sizes[waiting] // 2
            if end - begin > half:
                select(keys.T, order, 0, begin, end, begin + half, _widest(keys, begin, end))
            if deep and half > 1:
                middle = min(begin + half, end)
                begins[waiting], ends[waiting], sizes[waiting] = begin, middle, half
                waiting += 1
                if middle < end:
                    begins[waiting], ends[waiting], sizes[waiting] = middle, end, half
                    waiting += 1


@kernel
def _widest(keys: Array, begin: int, end: int) -> int:
    a, b, c, d, e, f = keys[begin, 0], keys[begin, 1], keys[begin, 2], keys[begin, 3], keys[begin, 4], keys[begin, 5]
    u, v, w, x, y, z = a, b, c, d, e, f
    for k in range(begin, end):
        a, b, c = min(a, keys[k, 0]), min(b, keys[k, 1]), min(c, keys[k, 2])
        d, e, f = min(d, keys[k, 3]), min(e, keys[k, 4]), min(f, keys[k, 5])
        u, v, w = max(u, keys[k, 0]), max(v, keys[k, 1]), max(w, keys[k, 2])
        x, y, z = max(x, keys[k, 3]), max(y, keys[k, 4]), max(z, keys[k, 5])
    widest, row = u - a, 0
    for other, width in enumerate((v - b, w - c, x - d, y - e, z - f)):
        if width > widest:
            widest, row = width, other + 1
    return row


@kernel
def swap(keys: Array, order: Array, first: int, i: int, j: int) -> None:
    """Exchange columns i and j of keys (6, n), and entries first + i and first + j of their order."""
    for row in range(6):
        keys[row, i], keys[row, j] = keys[row, j], keys[row, i]
    order[first + i], order[first + j] = order[first + j], order[first + i]


@kernel
def select(keys: Array, order: Array, first: int, begin: int, end: int, middle: int, row: int) -> None:
    """Put the least values of a row of begin to end - 1 before `middle`, the others behind it (Hoare's selection)."""
    low, high = begin, end - 1
    while low < high:
        pivot, i, j = keys[row, (low + high) // 2], low, high
        while i <= j:
            while keys[row, i] < pivot:
                i += 1
            while keys[row, j] > pivot:
                j -= 1
            if i <= j:
                swap(keys, order, first, i, j)
                i, j = i + 1, j - 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            return


FAN = 4  # children of a node
ROUNDING = 4.0  # units of rounding that the mean of a node may be off, twice
INFLATION = 1.0 + 1e-3  # of bounds, for the rounding of what they are computed from
SOFT, COLUMNS = 9, 10  # of a node: position, reversed normal, flux / pi, softness
# rows of a node's bound: p, m, turn, height and radius; w, N, D + w s v, w s^2, w |A - mean A| / pi, the least A / pi
MIDDLE, FACING = 0, 3
TURN, HEIGHT, RADIUS, WEIGHT, TILT, SHIFT, SPREAD, UNEVEN, SOFTEST, BOUND_ROWS = range(6, 16)
# rows of what only the build needs: w v^2 and D
FANNED, MOVED, BUILD_ROWS = range(3)


class LightTree(NamedTuple):
    """A tree over packed diffuse lights."""

    nodes: Array  # (T + 1, COLUMNS): representatives of level 0, 1, ...; the last is black
    bounds: Array  # (blocks, BOUND_ROWS, FAN): of the children of each node above level 1, and of the highest level
    starts: Array  # (levels + 1,) int64: first node of each level; the last entry is T
    clamped: bool  # whether pairs are clamped
    least: Any  # of the clamp: square of the minimum distance, m^2
    most: Any  # largest geometry term, 1/m^2
    error: float  # of a receiver's sum over channels, as a share of it


def light_tree(lights: Array, clamp: Clamp | None, error: float) -> LightTree:
    """Build the light tree of packed lights (9, M + 1): position, reversed normal, flux / pi >= 0; the last is black.

    It has as many levels as leave at most FAN nodes on the highest; `error` is the largest of a sum.
    """
    count = lights.shape[1] - 1
    starts = level_starts(count)
    total = int(starts[-1])
    nodes = np.zeros((total + 1, COLUMNS), lights.dtype)
    blocks = -(-(total - count) // FAN) + len(starts)
    bounds, build = np.zeros((blocks, BOUND_ROWS, FAN), lights.dtype), np.empty((total - count, BUILD_ROWS))
    _fill_leaves(lights, None if clamp is None else clamp.softness, compact_order(lights, count), nodes)
    for level in range(1, len(starts) - 1):
        _fill_level(nodes, starts, level, bounds, build)
    real = lights.dtype.type
    least, most = (real(0.0), real(np.inf)) if clamp is None else (clamp.least, clamp.bound)
    return LightTree(nodes, bounds, starts, clamp is not None, least, most, error)


def level_starts(count: int) -> Array:
    """Return the first node of each level of a tree over `count` lights, and how many nodes there are, int64."""
    starts, size = [0, count], count
    while size > FAN:
        size = -(-size // FAN)
        starts.append(starts[-1] + size)
    return np.array(starts, np.int64)


def tree_bytes(count: int, float_bytes: int, threads: int) -> int:
    """Return the memory of a tree over `count` lights, of its build and of the lists of each thread, at most, bytes."""
    nodes = 4 * count // 3 + 64
    of_lists = 2 * nodes * (5 + 2 * float_bytes) + 4 * count * 5
    return nodes * COLUMNS * float_bytes + (nodes - count) * (BOUND_ROWS * float_bytes + 16) + count * 28 + (
        threads * of_lists)


@kernel
def block_of(starts: Array, level: Any, parent: Any) -> Any:
    """Return the block of bounds of the children, of level `level` >= 1, of their level's parent number `parent`."""
    return (starts[level] - starts[1]) // FAN + level - 1 + parent


@kernel(parallel=True)
def _fill_leaves(lights: Array, softness: Array | None, order: Array, nodes: Array) -> None:
    for k in prange(len(order)):
        for row in range(9):
            nodes[k, row] = lights[row, order[k]]
        if softness is not None:
            nodes[k, SOFT] = softness[order[k]]


@kernel(parallel=True)
def _fill_level(nodes: Array, starts: Array, level: int, bounds: Array, build: Array) -> None:
    for k in prange(starts[level + 1] - starts[level]):
        _fill_node(nodes, starts, level, k, bounds, build)


@kernel
def _fill_node(nodes: Array, starts: Array, level: int, place: int, bounds: Array, build: Array) -> None:
    """Join the children of node number `place` of a level."""
    first = starts[level - 1] + FAN * place
    last, node = min(first + FAN, starts[level]), starts[level] + place
    of_children = bounds[block_of(starts, level - 1, place) if level > 1 else 0]
    bound = bounds[block_of(starts, level, place // FAN)]
    lane, total, mean = place % FAN, 0.0, np.zeros(COLUMNS)
    for k in range(first, last):
        total += np.float64(nodes[k, 6]) + nodes[k, 7] + nodes[k, 8]
    dark = total == 0.0  # fluxes that round to 0: all count alike
    for k in range(first, last):
        weight = 1.0 if dark else np.float64(nodes[k, 6]) + nodes[k, 7] + nodes[k, 8]
        for row in range(6):
            mean[row] += weight * nodes[k, row]
        mean[SOFT] += weight * nodes[k, SOFT]
        for c in range(6, 9):
            nodes[node, c] += nodes[k, c]
    if dark:
        total = np.float64(last - first)
    length = math.sqrt(mean[3] ** 2 + mean[4] ** 2 + mean[5] ** 2)
    for row in range(6):
        nodes[node, row] = mean[row] / total
    for axis in range(3):
        bound[MIDDLE + axis, lane] = nodes[node, axis]
        bound[FACING + axis, lane] = mean[3 + axis] / length if length > 0.0 else nodes[first, 3 + axis]
    nodes[node, SOFT] = mean[SOFT] / total
    _fill_extent(nodes, first, last, level, of_children, bound, lane)
    _fill_terms(nodes, starts, first, last, node, level, of_children, bound, lane, build)


@kernel
def _fill_extent(nodes: Array, first: int, last: int, level: int, of_children: Array, bound: Array, lane: int) -> None:
    """Fill turn, height and radius from the children's."""
    turn, height, radius = 0.0, 0.0, 0.0
    for k in range(first, last):
        child = k - first
        away, bent, over = 0.0, 0.0, 0.0
        for axis in range(3):
            facing = np.float64(of_children[FACING + axis, child] if level > 1 else nodes[k, 3 + axis])
            step = np.float64(nodes[k, axis]) - bound[MIDDLE + axis, lane]
            away += step * step
            bent += (facing - bound[FACING + axis, lane]) ** 2
            over += step * bound[FACING + axis, lane]
        away, bent, over = math.sqrt(away), math.sqrt(bent), abs(over)
        if level > 1:
            over += of_children[HEIGHT, child] + bent * of_children[RADIUS, child]
            away, bent = away + of_children[RADIUS, child], bent + of_children[TURN, child]
        turn, height, radius = max(turn, bent), max(height, over), max(radius, away)
    bound[TURN, lane], bound[HEIGHT, lane], bound[RADIUS, lane] = turn, height, radius * INFLATION


@kernel
def _fill_terms(
    nodes: Array, starts: Array, first: int, last: int, node: int, level: int, of_children: Array, bound: Array,
    lane: int, build: Array,
) -> None:
    eps = np.float64(np.finfo(nodes.dtype).eps)
    spread, fanned, moved, tilt, uneven, total = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    softest = np.inf
    moment, turned = np.zeros((3, 3)), np.zeros((3, 3))
    for k in range(first, last):
        distance, angle, weight, size = 0.0, 0.0, np.float64(nodes[k, 6]) + nodes[k, 7] + nodes[k, 8], 0.0
        for axis in range(3):
            away = np.float64(nodes[k, axis]) - nodes[node, axis]
            turn = np.float64(nodes[k, 3 + axis]) - nodes[node, 3 + axis]
            distance, angle, size = distance + away * away, angle + turn * turn, size + abs(nodes[k, axis])
            for c in range(3):
                moment[c, axis] += nodes[k, 6 + c] * away
                turned[c, axis] += nodes[k, 6 + c] * turn
        slack = ROUNDING * eps * size * math.sqrt(distance)  # a child's own mean is rounded
        spread, fanned = spread + weight * (distance + slack), fanned + weight * (angle + ROUNDING * eps)
        uneven += weight * abs(np.float64(nodes[k, SOFT]) - nodes[node, SOFT])
        total += weight
        if level > 1:
            below = k - starts[1]
            spread, tilt = spread + of_children[SPREAD, k - first], tilt + of_children[TILT, k - first]
            fanned, moved = fanned + build[below, FANNED], moved + build[below, MOVED]
            uneven += of_children[UNEVEN, k - first]
            softest = min(softest, np.float64(of_children[SOFTEST, k - first]))
        else:
            softest = min(softest, np.float64(nodes[k, SOFT]))
    for c in range(3):
        moved += math.sqrt(moment[c, 0] ** 2 + moment[c, 1] ** 2 + moment[c, 2] ** 2)
        tilt += math.sqrt(turned[c, 0] ** 2 + turned[c, 1] ** 2 + turned[c, 2] ** 2)
    build[node - starts[1], FANNED], build[node - starts[1], MOVED] = fanned, moved
    bound[WEIGHT, lane], bound[TILT, lane], bound[SPREAD, lane] = total, tilt, spread
    bound[SHIFT, lane], bound[UNEVEN, lane] = moved + math.sqrt(spread * fanned), uneven
    bound[SOFTEST, lane] = softest
