"""The order of lights in which aligned runs of 4, 16, 64 ... are compact: a k-d tree's.

A set of lights is halved at the median of its widest side, of positions or of normals, whose unit counts as NORMALS
times the width of the scene; the first half has as many lights as fill a subtree. Halves that follow each other are
one level of the light tree, so its clusters are squarish patches that face one way. Halving is by selection and
depends on nothing but the lights: the same bits for every number of threads.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange

Array = npt.NDArray[Any]

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
                _select(keys, order, begin, end, begin + half, _widest(keys, begin, end))
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
def _select(keys: Array, order: Array, begin: int, end: int, middle: int, row: int) -> None:
    """Put the least values of a column before `middle` and the others behind it (Hoare's selection)."""
    low, high = begin, end - 1
    while low < high:
        pivot, i, j = keys[(low + high) // 2, row], low, high
        while i <= j:
            while keys[i, row] < pivot:
                i += 1
            while keys[j, row] > pivot:
                j -= 1
            if i <= j:
                for column in range(6):
                    keys[i, column], keys[j, column] = keys[j, column], keys[i, column]
                order[i], order[j] = order[j], order[i]
                i, j = i + 1, j - 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            return
