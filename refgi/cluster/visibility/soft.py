"""The soft shadow of one area light on a tile of receivers, by filtered series (Sec. 4.1, 4.2).

Receivers are the SIMD lanes. Three passes over a tile surround two reads of the filtered map: where each receiver
looks for blockers; their mean depth, and the penumbra's filter; the filtered comparison.

Symbols: d distance of the receiver from the area light's centre (m); d' = t(d) - b on the series' scale; S_k, C_k,
SZ_k, CZ_k, Z means of sin(c_k z), cos(c_k z), of their products with z, and of z; w_k weights of the series.
"""

from typing import Any

import numpy.typing as npt

from refgi.cluster.filters.basis import sine_cosine
from refgi.cluster.filters.depth_scale import DepthScale, series_depths, series_distance
from refgi.cluster.visibility.filtered import filtered
from refgi.cluster.visibility.kernel_size import cone_tangent, published_tangent
from refgi.cluster.visibility.look import (
    BIAS,
    COSINE,
    DEPTH,
    EXTENT,
    GAIN,
    NEAREST,
    ON_SERIES,
    RADIUS,
    SEARCH_BIAS,
    SHADE,
    SINE,
    STEP_COSINE,
    STEP_SINE,
    Choices,
    D,
    S,
    T,
    X,
    count_of,
    look,
    place_filters,
)
from refgi.jit import kernel

Array = npt.NDArray[Any]

FULL = 0.75  # share of the lanes from which on moving them together costs more than it saves
NOTHING = 0.02  # of the search disc blocked: less is the series' ripple, not a blocker


@kernel
def find_penumbra(
    numbers: Array, choices: Choices, scale: DepthScale, weight: Array, means: Array, size: int, todo: Array,
    room: Array,
) -> int:
    """Find the mean depth of blockers, and the filter whose size follows from it.

    Parameters
    ----------
    numbers : (NUMBERS,) ndarray
        The area light.
    choices : Choices
        How filters are sized.
    scale : DepthScale
        From metres to the series' scale.
    weight : (M,) ndarray
        w_k, in the dtype of `room`.
    means : (>= 4 M + 1, >= size) ndarray
        Means over the search disc: S, C, SZ, CZ for each k, then Z.
    size : int
        How many receivers.
    todo : (>= size,) ndarray of bool
        Which of them; those without a blocker are taken out.
    room : (ROOM_ROWS, >= size) ndarray
        Filled in rows S to RADIUS and DEPTH, the latter with z_avg, m: d where there is no blocker; t(d) in ON_SERIES.

    Returns
    -------
    int
        How many have blockers.

    Notes
    -----
    z_avg is the distance at (Z/2 - sum_k w_k (cos(c_k d') SZ_k - sin(c_k d') CZ_k)) / (1 - V) of the series' scale,
    where V is that of the search disc: on a logarithmic scale, the blockers' geometric mean.
    """
    real = room.dtype.type
    half, near = real(0.5), numbers[NEAREST]
    terms = len(weight)
    series_depths(scale, room[D], room[ON_SERIES], size)
    start(numbers[SEARCH_BIAS], size, room)
    for k in range(terms):
        w = weight[k]
        for i in range(size):
            sine, cosine = room[SINE, i], room[COSINE, i]
            room[SHADE, i] += w * (cosine * means[k, i] - sine * means[terms + k, i])
            room[DEPTH, i] += w * (cosine * means[2 * terms + k, i] - sine * means[3 * terms + k, i])
            room[SINE, i] = sine * room[STEP_COSINE, i] + cosine * room[STEP_SINE, i]
            room[COSINE, i] = cosine * room[STEP_COSINE, i] - sine * room[STEP_SINE, i]
    for i in range(size):
        blocked = half - room[SHADE, i]
        found = todo[i] & (blocked >= real(NOTHING))
        todo[i] = found
        d = room[D, i]
        depth = (half * means[4 * terms, i] - room[DEPTH, i]) / blocked if found else room[ON_SERIES, i]
        depth = min(max(series_distance(scale, depth), near), d) if found else d
        room[DEPTH, i] = depth
        extent = room[EXTENT, i]
        # Sec. 4.2: alpha = arctan(p cos(beta) / d)
        room[RADIUS, i] = published_tangent(extent, d, depth) if choices.alpha else cone_tangent(extent, d, depth)
    place_filters(choices.alpha_over_pi, size, room)
    return count_of(todo, size)


@kernel
def compare(
    numbers: Array, weight: Array, means: Array, size: int, todo: Array, visible: Array, room: Array
) -> None:
    """Compare depths under the penumbra's filter (Sec. 4.1).

    Parameters
    ----------
    numbers : (NUMBERS,) ndarray
        The area light.
    weight : (M,) ndarray
        w_k, in the dtype of `room`.
    means : (>= 2 M, >= size) ndarray
        Means over the final filter: S, then C, for each k.
    size : int
        How many receivers.
    todo : (>= size,) ndarray of bool
        Which of them have blockers.
    visible : (>= size,) ndarray
        Filled where `todo`: V = 1/2 + sum_k w_k (cos(c_k d') S_k - sin(c_k d') C_k), in [0, 1].
    room : (ROOM_ROWS, >= size) ndarray
        Row ON_SERIES counts; sums are kept there.
    """
    real = room.dtype.type
    zero, one, half, gain, terms = real(0.0), real(1.0), real(0.5), numbers[GAIN], len(weight)
    start(numbers[BIAS], size, room)
    for k in range(terms):
        w = weight[k]
        for i in range(size):
            sine, cosine = room[SINE, i], room[COSINE, i]
            room[SHADE, i] += w * (cosine * means[k, i] - sine * means[terms + k, i])
            room[SINE, i] = sine * room[STEP_COSINE, i] + cosine * room[STEP_SINE, i]
            room[COSINE, i] = cosine * room[STEP_COSINE, i] - sine * room[STEP_SINE, i]
    for i in range(size):
        value = gain * (half + room[SHADE, i])
        value = min(max(value, zero), one)
        visible[i] = value if todo[i] else visible[i]


@kernel
def start(bias: Any, size: int, room: Array) -> None:
    """Set out on a series: sin(pi d'), cos(pi d'), their step of 2 pi d' and empty sums.

    Parameters
    ----------
    bias : float
        b, on the series' scale.
    size : int
        How many receivers.
    room : (ROOM_ROWS, >= size) ndarray
        t(d) in row ON_SERIES; filled in rows SINE to DEPTH.
    """
    zero, one, two = room.dtype.type(0.0), room.dtype.type(1.0), room.dtype.type(2.0)
    for i in range(size):
        sine, cosine = sine_cosine(room[ON_SERIES, i] - bias)
        room[SINE, i], room[COSINE, i] = sine, cosine
        room[STEP_SINE, i], room[STEP_COSINE, i] = two * sine * cosine, one - two * sine * sine
        room[SHADE, i], room[DEPTH, i] = zero, zero


@kernel
def soft_tile(
    numbers: Array, choices: Choices, scale: DepthScale, weight: Array, filters: Any, points: Array, size: int,
    wanted: Array, todo: Array, visible: Array, room: Array, means: Array,
) -> None:
    """Find how much of one area light each receiver of a tile sees.

    Parameters
    ----------
    numbers : (NUMBERS,) ndarray
        The area light, from `numbers_of`.
    choices : Choices
        How filters are sized.
    scale : DepthScale
        That of the filtered map.
    weight : (M,) ndarray
        w_k, in the dtype of `points`.
    filters : Mip, Sat or Brute
        The filtered map.
    points : (>= 3, >= size) ndarray
        Receivers, world space, m, in the first three rows.
    size : int
        How many.
    wanted : (>= size,) ndarray of bool
        Which of them; overwritten, with nothing but True.
    todo : (>= size,) ndarray of bool
        Filled: whose filtered comparison was needed.
    visible : (>= size,) ndarray
        Filled with V, 0 to 1; with 1 where not wanted, and behind the area light's plane.
    room : (ROOM_ROWS, >= size) ndarray
        Overwritten.
    means : (4 M + 1, >= size) ndarray
        Overwritten.

    Notes
    -----
    Each receiver's V depends on nothing but its own position, whatever tile it is in. The second read is half of the
    cost; where few have blockers, these move together for it.
    """
    if look(numbers, choices, points, size, wanted, todo, visible, room) == 0:
        return
    filtered(filters, room[S], room[T], room[RADIUS], todo, size, True, means)
    count = find_penumbra(numbers, choices, scale, weight, means, size, todo, room)
    if count >= FULL * size:
        filtered(filters, room[S], room[T], room[RADIUS], todo, size, False, means)
        compare(numbers, weight, means, size, todo, visible, room)
    elif count > 0:
        _move_together(size, todo, wanted, room)
        filtered(filters, room[S], room[T], room[RADIUS], wanted, count, False, means)
        compare(numbers, weight, means, count, wanted, room[X], room)
        _move_back(room[X], size, todo, visible)


@kernel
def _move_together(size: int, todo: Array, first: Array, room: Array) -> None:
    """Move the receivers left to do to the first lanes, in place, and flag these."""
    count = 0
    for i in range(size):
        room[ON_SERIES, count], room[RADIUS, count] = room[ON_SERIES, i], room[RADIUS, i]
        room[S, count], room[T, count] = room[S, i], room[T, i]
        first[count] = True
        count += todo[i]


@kernel
def _move_back(some: Array, size: int, todo: Array, visible: Array) -> None:
    count = 0
    for i in range(size):
        visible[i] = some[count] if todo[i] else visible[i]
        count += todo[i]
