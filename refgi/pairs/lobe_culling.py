"""Which lobes can light which part of a tile of receivers: what adds exactly 0 need not be summed.

A tile and each of its PARTS, 64 receivers, are bounded by balls around the positions. A lobe is passed over when the
ball lies behind the light's surface; or so far off the lobe's axis that (1 - h)^P is below the smallest normal number,
which `exp2` makes 0, or that B < xi I_low everywhere in the ball (procedure P3). Each by more than rounding, so that
the kernel itself would add 0 and the sum is the same to the bit.

Symbols: d vector from the ball's centre to the light, r its length, rho the ball's radius, h = 1 - cos of the angle to
the lobe's axis.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.elementary import exp2, log2p1
from refgi.jit import kernel
from refgi.pairs.pair_sum import TILE, X

Array = npt.NDArray[Any]

PARTS = 4  # of a tile; 8 x 8 pixels each where tiles are blocks of them
ROUNDING = 32.0  # units of rounding that h and cosines may be off; about 8 are possible
MARGIN = 1e-3  # on the root of B: the kernel's own test is off by less
VANISHED = 1.03  # times the logarithm of the smallest normal number
NEAR = 1e-3  # share of the range within which a threshold narrows no lobe: near - 1 must keep the digits of MARGIN
LIMIT, ROOT, SHARE, WHOLE, BOUNDS = range(5)  # rows of the lobes' bounds
ABOVE, NEAREST, GAP, RANGED, PASSED, MEASURES = range(BOUNDS, BOUNDS + 6)  # rows of a room, after those
CENTER, RADIUS = 0, 3  # rows of balls


@kernel
def bound_lobes(exponent: Array, distance: float) -> Array:
    """Say from which h on each lobe is 0.

    Parameters
    ----------
    exponent : (N,) ndarray
        P.
    distance : float
        Nearer than this (m) exponents are smaller; infinite where they may be anywhere.

    Returns
    -------
    (BOUNDS, N) ndarray
        LIMIT: from this h on, at most 1, the lobe is 0 where its exponent is whole; ROOT: 2 / P; SHARE: 0, for B of any
        size (`bound_range`); WHOLE: `distance`.
    """
    real = exponent.dtype.type
    smallest = -87.33654 if np.finfo(exponent.dtype).eps > 1e-10 else -708.3964  # ln of the smallest normal number
    bounds = np.zeros((BOUNDS, len(exponent)), exponent.dtype)
    for k in range(len(exponent)):
        p = max(np.float64(exponent[k]), 1e-30)
        bounds[LIMIT, k] = real(-math.expm1(VANISHED * smallest / p))
        bounds[ROOT, k] = real(2.0 / p)
        bounds[WHOLE, k] = real(distance)
    return bounds


@kernel
def bound_range(bounds: Array, square: Array, scale: Array) -> None:
    """Add which pairs a threshold leaves out.

    Parameters
    ----------
    bounds : (BOUNDS, N) ndarray
        Row SHARE is filled: at the distance r nothing below (SHARE r)^2 of the lobe's peak counts, 1/m.
    square, scale : (N,) ndarray
        Those of `Range`.
    """
    real = bounds.dtype.type
    for k in range(len(square)):
        bounds[SHARE, k] = math.sqrt(scale[k] / square[k]) * real(1.0 - MARGIN)


@kernel
def bound_by_balls(tile: Array, size: int, balls: Array) -> bool:
    """Bound the parts of a tile, and in the last column all of it.

    Parameters
    ----------
    tile : (>= 3, TILE) ndarray
        Receivers: position first.
    size : int
        How many of them count.
    balls : (4, PARTS + 1) ndarray
        Filled with centres and radii, m. Parts without receivers lie in the first one.

    Returns
    -------
    bool
        Whether the parts are much smaller than the whole.
    """
    lanes = TILE // PARTS
    total = 0.0
    for part in range(PARTS):
        first = part * lanes if part * lanes < size else 0
        _bound(tile, first, min(first + lanes, size), balls, part)
        total += balls[RADIUS, part]
    _bound(tile, 0, size, balls, PARTS)
    return bool(total < 0.7 * PARTS * balls[RADIUS, PARTS])


@kernel
def _bound(tile: Array, first: int, last: int, balls: Array, column: int) -> None:
    real = tile.dtype.type
    for axis in range(3):
        low = high = tile[X + axis, first]
        for i in range(first + 1, last):
            low, high = min(low, tile[X + axis, i]), max(high, tile[X + axis, i])
        balls[CENTER + axis, column] = low + real(0.5) * (high - low)
    x, y, z = balls[CENTER, column], balls[CENTER + 1, column], balls[CENTER + 2, column]
    largest = real(0.0)
    for i in range(first, last):
        dx, dy, dz = tile[X, i] - x, tile[X + 1, i] - y, tile[X + 2, i] - z
        largest = max(largest, dx * dx + dy * dy + dz * dz)
    balls[RADIUS, column] = math.sqrt(largest) * real(1.0001)


@kernel
def lobes_in_reach(
    lights: Array, bounds: Array, first: int, last: int, balls: Array, listed: Array | None, room: Array, chosen: Array
) -> int:
    """List the lights of a group whose lobe may light a tile.

    Parameters
    ----------
    lights : (13, N) ndarray
        Packed lights: position, reversed normal, reversed axis first.
    bounds : (BOUNDS, N) ndarray
        Those of `bound_lobes`.
    first, last : int
        The group: lights first to last - 1.
    balls : (4, PARTS + 1) ndarray
        Around the tile's receivers.
    listed : (N,) ndarray of bool or None
        Lights that come into question; None: all, and the whole tile's ball decides.
    room : (MEASURES, >= last - first) ndarray
        To work in.
    chosen : (>= last - first,) ndarray of int64
        Filled with indices of lights, rising.

    Returns
    -------
    int
        How many were listed.
    """
    count = 0
    if listed is None:
        ball = balls[0, PARTS], balls[1, PARTS], balls[2, PARTS], balls[3, PARTS]
        for k in range(first, last):
            i = k - first
            room[ABOVE, i], room[NEAREST, i], room[GAP, i] = _measure(_cone(lights, k), ball)
            for row in range(BOUNDS):
                room[row, i] = bounds[row, k]
        _judge(room, last - first)
        for k in range(first, last):
            chosen[count] = k
            count += room[PASSED, k - first] > 0
    else:
        for k in range(first, last):
            chosen[count] = k
            count += listed[k]
    return count


@kernel
def parts_in_reach(lights: Array, bounds: Array, k: int, balls: Array, room: Array) -> Any:
    """Find the parts of a tile that a lobe may light.

    Parameters
    ----------
    lights, bounds : ndarray
        As for `lobes_in_reach`.
    k : int
        The light.
    balls : (4, PARTS + 1) ndarray
        Around the parts.
    room : (MEASURES, >= PARTS) ndarray
        To work in.

    Returns
    -------
    tuple of 2 int
        The first of them and the one after the last; equal where there is none.
    """
    cone = _cone(lights, k)
    for i in range(PARTS):
        ball = balls[0, i], balls[1, i], balls[2, i], balls[3, i]
        room[ABOVE, i], room[NEAREST, i], room[GAP, i] = _measure(cone, ball)
        for row in range(BOUNDS):
            room[row, i] = bounds[row, k]
    _judge(room, PARTS)
    first, last = 0, PARTS
    while first < last and not room[PASSED, first] > 0:
        first += 1
    while last > first and not room[PASSED, last - 1] > 0:
        last -= 1
    return first, last


@kernel
def _cone(lights: Array, k: int) -> Any:
    return (lights[0, k], lights[1, k], lights[2, k], lights[3, k], lights[4, k], lights[5, k], lights[6, k],
            lights[7, k], lights[8, k])


@kernel
def _measure(cone: Any, ball: Any) -> Any:
    """Return how far at most receivers lie before the light's plane, the cosine of their least angle, r - rho."""
    px, py, pz, lx, ly, lz, ax, ay, az = cone
    x, y, z, rho = ball
    real = type(px)
    zero, one = real(0.0), real(1.0)
    slack = real(ROUNDING) * real(np.finfo(real).eps)
    dx, dy, dz = px - x, py - y, pz - z
    r = math.sqrt(dx * dx + dy * dy + dz * dz)
    above = dx * lx + dy * ly + dz * lz + rho + slack * (r + rho)
    inverse = one / (r if r > rho else one)
    cosine, sine_ball = (dx * ax + dy * ay + dz * az) * inverse, rho * inverse
    sine = math.sqrt(max(one - cosine * cosine, zero))
    cosine_ball = math.sqrt(max(one - sine_ball * sine_ball, zero))
    # the least angle to the axis is that to the centre less the ball's
    nearest = one if cosine >= cosine_ball else cosine * cosine_ball + sine * sine_ball
    return above, nearest if r > rho else one, r - rho


@kernel
def _judge(room: Array, count: int) -> None:
    """Fill row PASSED with 1 where a lobe may light a ball, else with 0; apart from the measures it runs in lanes."""
    real = room.dtype.type
    zero, one = real(0.0), real(1.0)
    slack = real(ROUNDING) * real(np.finfo(room.dtype).eps)
    for i in range(count):
        near = room[SHARE, i] * room[GAP, i]  # its square is s of the weakest pair that counts, where that is nearest
        # log2p1 makes -127 (float64: -1023) of -1, which leaves LIMIT to decide
        room[RANGED, i] = one - exp2(room[ROOT, i] * log2p1((near if near > real(NEAR) else zero) - one))
    for i in range(count):
        whole = room[GAP, i] > room[WHOLE, i]
        limit = min(room[LIMIT, i], room[RANGED, i])
        limit = limit if whole else one
        inside = (one - room[NEAREST, i] < limit + slack) & (room[SHARE, i] * room[GAP, i] < one)
        room[PASSED, i] = one if inside & (room[ABOVE, i] > zero) else zero
