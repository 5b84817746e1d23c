"""The soft shadow of one area light on a tile of receivers, by filtered series (Sec. 4.1, 4.2).

Receivers are the SIMD lanes. Three passes over a tile surround two reads of the filtered map: where each receiver
looks for blockers; their mean depth, and the penumbra's filter; the filtered comparison.

Symbols: d distance of the receiver from the area light's centre (m); d' = t(d) - b on the series' scale; S_k, C_k,
SZ_k, CZ_k, Z means of sin(c_k z), cos(c_k z), of their products with z, and of z; w_k weights of the series.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.filters.basis import sine_cosine
from refgi.cluster.maps.shadow_maps import BACKWARD, ShadowMaps
from refgi.cluster.settings import ValSettings
from refgi.cluster.visibility.filtered import filtered
from refgi.cluster.visibility.kernel_size import (
    cone_tangent,
    disc,
    published_square,
    published_tangent,
    solid_angle_tangent,
)
from refgi.cluster.visibility.series import series
from refgi.jit import kernel

Array = npt.NDArray[Any]

FULL = 0.75  # share of the lanes from which on moving them together costs more than it saves
NOTHING = 0.02  # of the search disc blocked: less is the series' ripple, not a blocker
# rows of the room
X, Y, Z, D, EXTENT = 0, 1, 2, 3, 4  # receiver in the map's frame, its distance, the light's size towards it; m
S, T, RADIUS = 5, 6, 7  # where it looks, in [-1, 1] units
SINE, COSINE, STEP_SINE, STEP_COSINE = 8, 9, 10, 11  # of c_k d' for the current k, of 2 pi d'
SHADE, DEPTH = 12, 13  # sums over k; the latter becomes z_avg, m
ROOM_ROWS = 14
# places in the numbers of an area light
CENTER, FRAME, DELTA, NEAREST, SCALE, SEARCH_BIAS, BIAS, GAIN = 0, 3, 12, 13, 14, 15, 16, 17
NUMBERS = 18


class Choices(NamedTuple):
    """How filters are sized."""

    alpha: bool  # the printed angle of the penumbra
    alpha_over_pi: bool  # squares of side alpha / pi
    solid_angle: bool  # the search of blockers half-way
    foreshortened: bool  # the light's size as the receiver sees it


def choices(settings: ValSettings) -> Choices:
    """Return how settings size filters.

    Parameters
    ----------
    settings : ValSettings
        Its switches `as_published` and `foreshortened` count.

    Returns
    -------
    Choices
        One flag each.
    """
    published = settings.as_published
    return Choices("val_alpha" in published, "val_alpha_over_pi" in published,
                   "val_search_solid_angle" in published, settings.foreshortened)


def numbers_of(maps: ShadowMaps, k: int, delta: float, settings: ValSettings, behind: bool = False) -> Array:
    """Return what the kernels need to know of one area light and its map.

    Parameters
    ----------
    maps : ShadowMaps
        The maps.
    k : int
        Which one.
    delta : float
        Size of its area light, m.
    settings : ValSettings
        Series and bias.
    behind : bool
        Of the map of the hemisphere behind.

    Returns
    -------
    (NUMBERS,) ndarray
        In the dtype of the maps; see the places named above.
    """
    chain, numbers = series(settings), np.zeros(NUMBERS, maps.depth.dtype)
    near = maps.near if maps.near_behind is None or not behind else maps.near_behind
    numbers[CENTER : CENTER + 3] = maps.center[k]
    numbers[FRAME : FRAME + 9] = (BACKWARD @ maps.frame[k] if behind else maps.frame[k]).ravel()
    numbers[DELTA], numbers[NEAREST], numbers[SCALE] = delta, near[k], chain.range / maps.far[k]
    numbers[SEARCH_BIAS], numbers[BIAS], numbers[GAIN] = chain.search_bias, chain.bias, chain.gain
    return numbers


@kernel
def look(
    numbers: Array, choices: Choices, points: Array, size: int, wanted: Array, todo: Array, visible: Array, room: Array
) -> int:
    """Find where each receiver looks for blockers.

    Parameters
    ----------
    numbers : (NUMBERS,) ndarray
        The area light.
    choices : Choices
        How filters are sized.
    points : (>= 3, >= size) ndarray
        Receivers, world space, m.
    size : int
        How many.
    wanted : (>= size,) ndarray of bool
        Which of them.
    todo : (>= size,) ndarray of bool
        Filled: which may be shadowed at all.
    visible : (>= size,) ndarray
        Filled with 1.
    room : (ROOM_ROWS, >= size) ndarray
        Filled in rows X to RADIUS.

    Returns
    -------
    int
        How many may be shadowed.

    Notes
    -----
    Receivers behind the area light's plane see it whole (Sec. 5.1), those nearer than the nearest depth as well.
    """
    real = points.dtype.type
    zero, one, near, delta = real(0.0), real(1.0), numbers[NEAREST], numbers[DELTA]
    cx, cy, cz = numbers[CENTER], numbers[CENTER + 1], numbers[CENTER + 2]
    rx, ry, rz = numbers[FRAME], numbers[FRAME + 1], numbers[FRAME + 2]
    dx, dy, dz = numbers[FRAME + 3], numbers[FRAME + 4], numbers[FRAME + 5]
    fx, fy, fz = numbers[FRAME + 6], numbers[FRAME + 7], numbers[FRAME + 8]
    for i in range(size):
        px, py, pz = points[0, i] - cx, points[1, i] - cy, points[2, i] - cz
        d = math.sqrt(px * px + py * py + pz * pz)
        x, y, z = px * rx + py * ry + pz * rz, px * dx + py * dy + pz * dz, px * fx + py * fy + pz * fz
        ahead = wanted[i] & (z > zero) & (d > near)
        todo[i] = ahead
        visible[i] = one
        d = d if ahead else one
        z = z if ahead else one
        extent = delta * math.sqrt(z / d) if choices.foreshortened else delta
        room[X, i], room[Y, i], room[Z, i], room[D, i], room[EXTENT, i] = x, y, z, d, extent
        room[RADIUS, i] = solid_angle_tangent(extent, d) if choices.solid_angle else cone_tangent(extent, d, near)
    place_filters(choices.alpha_over_pi, size, room)
    return count_of(todo, size)


@kernel
def place_filters(squares: bool, size: int, room: Array) -> None:
    """Turn the tangents of cones into places and radii on the map.

    Parameters
    ----------
    squares : bool
        Squares of side alpha / pi instead of discs.
    size : int
        How many receivers.
    room : (ROOM_ROWS, >= size) ndarray
        Receivers, and tangents in row RADIUS; filled in rows S to RADIUS.
    """
    if squares:
        for i in range(size):
            where = published_square(room[X, i], room[Y, i], room[Z, i], room[D, i], room[RADIUS, i])
            room[S, i], room[T, i], room[RADIUS, i] = where
    else:
        for i in range(size):  # without a call of the library of C, these are SIMD lanes
            where = disc(room[X, i], room[Y, i], room[Z, i], room[D, i], room[RADIUS, i])
            room[S, i], room[T, i], room[RADIUS, i] = where


@kernel
def count_of(flags: Array, size: int) -> int:
    """Count what is true.

    Parameters
    ----------
    flags : (>= size,) ndarray of bool
        What to count.
    size : int
        Of the first this many.

    Returns
    -------
    int
        How many.
    """
    count = 0
    for i in range(size):
        count += 1 if flags[i] else 0
    return count


@kernel
def find_penumbra(
    numbers: Array, choices: Choices, weight: Array, means: Array, size: int, todo: Array, room: Array
) -> int:
    """Find the mean depth of blockers, and the filter whose size follows from it.

    Parameters
    ----------
    numbers : (NUMBERS,) ndarray
        The area light.
    choices : Choices
        How filters are sized.
    weight : (M,) ndarray
        w_k, in the dtype of `room`.
    means : (>= 4 M + 1, >= size) ndarray
        Means over the search disc: S, C, SZ, CZ for each k, then Z.
    size : int
        How many receivers.
    todo : (>= size,) ndarray of bool
        Which of them; those without a blocker are taken out.
    room : (ROOM_ROWS, >= size) ndarray
        Filled in rows S to RADIUS and DEPTH, the latter with z_avg, m: d where there is no blocker.

    Returns
    -------
    int
        How many have blockers.

    Notes
    -----
    z_avg = (Z/2 - sum_k w_k (cos(c_k d') SZ_k - sin(c_k d') CZ_k)) / (1 - V), where V is that of the search disc.
    """
    real = room.dtype.type
    half, near, scale = real(0.5), numbers[NEAREST], numbers[SCALE]
    terms = len(weight)
    start(numbers[SEARCH_BIAS], scale, size, room)
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
        depth = (half * means[4 * terms, i] - room[DEPTH, i]) / (blocked * scale) if found else d
        depth = min(max(depth, near), d) if found else d
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
        Distances; sums are kept there.
    """
    real = room.dtype.type
    zero, one, half, gain, terms = real(0.0), real(1.0), real(0.5), numbers[GAIN], len(weight)
    start(numbers[BIAS], numbers[SCALE], size, room)
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
def start(bias: Any, scale: Any, size: int, room: Array) -> None:
    """Set out on a series: sin(pi d'), cos(pi d'), their step of 2 pi d' and empty sums.

    Parameters
    ----------
    bias : float
        b, on the series' scale.
    scale : float
        Of depths, 1/m.
    size : int
        How many receivers.
    room : (ROOM_ROWS, >= size) ndarray
        Distances in row D; filled in rows SINE to DEPTH.
    """
    zero, one, two = room.dtype.type(0.0), room.dtype.type(1.0), room.dtype.type(2.0)
    for i in range(size):
        t = room[D, i] * scale
        sine, cosine = sine_cosine((t if t < one else one) - bias)
        room[SINE, i], room[COSINE, i] = sine, cosine
        room[STEP_SINE, i], room[STEP_COSINE, i] = two * sine * cosine, one - two * sine * sine
        room[SHADE, i], room[DEPTH, i] = zero, zero


@kernel
def soft_tile(
    numbers: Array, choices: Choices, weight: Array, filters: Any, points: Array, size: int, wanted: Array,
    todo: Array, visible: Array, room: Array, means: Array,
) -> None:
    """Find how much of one area light each receiver of a tile sees.

    Parameters
    ----------
    numbers : (NUMBERS,) ndarray
        The area light, from `numbers_of`.
    choices : Choices
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
    count = find_penumbra(numbers, choices, weight, means, size, todo, room)
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
        room[D, count], room[RADIUS, count] = room[D, i], room[RADIUS, i]
        room[S, count], room[T, count] = room[S, i], room[T, i]
        first[count] = True
        count += todo[i]


@kernel
def _move_back(some: Array, size: int, todo: Array, visible: Array) -> None:
    count = 0
    for i in range(size):
        visible[i] = some[count] if todo[i] else visible[i]
        count += todo[i]
