"""Groups of receivers that lie near each other and face the same way, and the order in which halves of a group do too.

Stretches of receivers are halved at the middle of their normals' widest range while that is wide, else at the median of
the widest side of their box, until a part fits a tile of the kernels: a group. Inside it halving goes on, so that each
half, quarter and so on of a group is compact by itself.
"""

import math
from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.pair_sum import TILE
from refgi.types import Array

STRETCH = 16 * TILE  # receivers that follow each other in a call, among which groups are formed
LANES = 8  # the least part of a group; all but a group's last part are multiples of it
THICK = 0.2  # height over the widest side, likewise: surfaces behind each other
TURNED = 0.3  # range of a component of the normals from which on they are told apart first


def group_receivers(position: Array, normal: Array) -> tuple[Array, Array]:
    """Return the order of receivers (3, n) by groups, (n,) int64, and the first of each group, with n at the end."""
    count = position.shape[1]
    order, starts = np.arange(count), np.zeros(count, np.bool_)
    _form(position, normal, order, starts)
    return order, np.append(np.flatnonzero(starts), count)


@kernel(parallel=True)
def _form(position: Array, normal: Array, order: Array, starts: Array) -> None:
    for stretch in prange((len(order) + STRETCH - 1) // STRETCH):
        first = stretch * STRETCH
        last = min(first + STRETCH, len(order))
        keys = np.empty((6, last - first), position.dtype)
        for axis in range(3):
            for i in range(last - first):
                keys[axis, i], keys[3 + axis, i] = position[axis, first + i], normal[axis, first + i]
        begins, ends = np.empty(128, np.int64), np.empty(128, np.int64)
        grouped = np.empty(128, np.bool_)
        begins[0], ends[0], grouped[0], waiting = 0, last - first, False, 1
        while waiting > 0:
            waiting -= 1
            begin, end, inside = begins[waiting], ends[waiting], grouped[waiting]
            row, turned = _widest(keys, begin, end)
            turned = turned or (not inside and _thick(keys, begin, end, row))
            if not inside and end - begin <= TILE and not turned:
                inside = starts[first + begin] = True
            if end - begin <= LANES:
                starts[first + begin] |= not inside
                continue
            if turned and not inside:
                middle = _partition(keys, order, first, begin, end, row)
            else:
                middle = half_of(begin, end)
                _select(keys, order, first, begin, end, middle, row)
            begins[waiting], ends[waiting], grouped[waiting] = middle, end, inside
            begins[waiting + 1], ends[waiting + 1], grouped[waiting + 1] = begin, middle, inside
            waiting += 2


@kernel
def half_of(begin: int, end: int) -> int:
    """Return where the second half of receivers begin to end - 1 starts: whole LANES after the first."""
    return begin + (end - begin + 2 * LANES - 1) // (2 * LANES) * LANES


@kernel
def _widest(keys: Array, begin: int, end: int) -> Any:
    """Return the row of the widest range, of normals where that is over TURNED, and whether it is one of normals."""
    ranges = np.empty(6, keys.dtype)
    for row in range(6):
        least = most = keys[row, begin]
        for i in range(begin, end):
            value = keys[row, i]
            least, most = value if value < least else least, value if value > most else most
        ranges[row] = most - least
    widest = 3 + np.argmax(ranges[3:])
    turned = ranges[widest] > keys.dtype.type(TURNED)
    return (widest, turned) if turned else (np.argmax(ranges[:3]), turned)


@kernel
def _thick(keys: Array, begin: int, end: int, row: int) -> bool:
    """Return whether receivers are far off the plane through the first of them, beside their widest side."""
    real = keys.dtype.type
    nx, ny, nz = real(0.0), real(0.0), real(0.0)
    low = high = keys[row, begin]
    for i in range(begin, end):
        nx, ny, nz = nx + keys[3, i], ny + keys[4, i], nz + keys[5, i]
        low, high = min(low, keys[row, i]), max(high, keys[row, i])
    least = most = real(0.0)
    for i in range(begin, end):
        height = (nx * (keys[0, i] - keys[0, begin]) + ny * (keys[1, i] - keys[1, begin])
                  + nz * (keys[2, i] - keys[2, begin]))
        least, most = min(least, height), max(most, height)
    return bool(most - least > real(THICK) * (high - low) * math.sqrt(nx * nx + ny * ny + nz * nz))


@kernel
def _swap(keys: Array, order: Array, first: int, i: int, j: int) -> None:
    for row in range(6):
        keys[row, i], keys[row, j] = keys[row, j], keys[row, i]
    order[first + i], order[first + j] = order[first + j], order[first + i]


@kernel
def _partition(keys: Array, order: Array, first: int, begin: int, end: int, row: int) -> int:
    """Put the receivers below the middle of a row's range first; return where the others begin."""
    least = most = keys[row, begin]
    for i in range(begin, end):
        least, most = min(least, keys[row, i]), max(most, keys[row, i])
    middle, found = least + (most - least) * keys.dtype.type(0.5), begin
    for i in range(begin, end):
        if keys[row, i] < middle:
            _swap(keys, order, first, i, found)
            found += 1
    return max(begin + 1, min(found, end - 1))


@kernel
def _select(keys: Array, order: Array, first: int, begin: int, end: int, middle: int, row: int) -> None:
    """Put the least values of a row before `middle` and the others behind it (Hoare's selection)."""
    low, high = begin, end - 1
    while low < high:
        pivot, i, j = keys[row, (low + high) // 2], low, high
        while i <= j:
            while keys[row, i] < pivot:
                i += 1
            while keys[row, j] > pivot:
                j -= 1
            if i <= j:
                _swap(keys, order, first, i, j)
                i, j = i + 1, j - 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            return
