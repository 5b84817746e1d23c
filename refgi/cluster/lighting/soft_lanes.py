"""The soft shadow of one area light on a tile, with final filters over those receivers alone that have blockers.

The lanes of `visibility.soft.soft_tile` keep their places; here those that are left move together before the second
read of the map, which is half of the cost and is needed by less than half of them. The bits are the same.
"""

from typing import Any

import numpy.typing as npt

from refgi.cluster.visibility.filtered import filtered
from refgi.cluster.visibility.soft import RADIUS, Choices, D, S, T, compare, find_penumbra, look
from refgi.jit import kernel

Array = npt.NDArray[Any]

FULL = 0.75  # share of the lanes from which on moving costs more than it saves


@kernel
def soft_lanes(
    numbers: Array, sizes: Choices, weight: Array, filters: Any, points: Array, size: int, wanted: Array, todo: Array,
    visible: Array, room: Array, means: Array, places: Array,
) -> None:
    """Find how much of one area light each receiver of a tile sees.

    Parameters
    ----------
    numbers : (NUMBERS,) ndarray
        The area light, from `numbers_of`.
    sizes : Choices
        How filters are sized.
    weight : (M,) ndarray
        w_k, in the dtype of `points`.
    filters : Mip, Sat or Brute
        The filtered map.
    points : (>= 3, >= size) ndarray
        Receivers, world space, m, in the first three rows.
    size : int
        How many.
    wanted : (>= size,) ndarray of bool
        Which of them.
    todo : (>= size,) ndarray of bool
        Overwritten.
    visible : (>= size,) ndarray
        Filled as by `soft_tile`.
    room : (2, ROOM_ROWS, >= size) ndarray
        Overwritten.
    means : (4 M + 2, >= size) ndarray
        Overwritten.
    places : (>= size,) ndarray of int64
        Overwritten.
    """
    all_lanes, few, some = room[0], room[1], means[4 * len(weight) + 1]
    if look(numbers, sizes, points, size, wanted, todo, visible, all_lanes) == 0:
        return
    filtered(filters, all_lanes[S], all_lanes[T], all_lanes[RADIUS], todo, size, True, means)
    count = find_penumbra(numbers, sizes, weight, means, size, todo, all_lanes)
    if count >= FULL * size:
        filtered(filters, all_lanes[S], all_lanes[T], all_lanes[RADIUS], todo, size, False, means)
        compare(numbers, weight, means, size, todo, visible, all_lanes)
    elif count > 0:
        listed(todo, size, places)
        for i in range(count):
            todo[i] = True
        for j in range(count):
            few[D, j], few[RADIUS, j] = all_lanes[D, places[j]], all_lanes[RADIUS, places[j]]
            few[S, j], few[T, j] = all_lanes[S, places[j]], all_lanes[T, places[j]]
        filtered(filters, few[S], few[T], few[RADIUS], todo, count, False, means)
        compare(numbers, weight, means, count, todo, some, few)
        for j in range(count):
            visible[places[j]] = some[j]


@kernel
def listed(chosen: Array, size: int, places: Array) -> int:
    """List the lanes that are chosen, and count them.

    Parameters
    ----------
    chosen : (>= size,) ndarray of bool
        Whether.
    size : int
        Lanes.
    places : (>= size,) ndarray of int64
        Filled.

    Returns
    -------
    int
        How many.
    """
    count = 0
    for i in range(size):
        places[count] = i
        count += chosen[i]
    return count
