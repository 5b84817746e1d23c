"""Groups of receivers that lie near each other and face the same way, and what a cluster of lights is off by at one.

Stretches of receivers are halved at the middle of their normals' widest range while that is wide, else at the median of
the widest side of their box, until a part fits a tile: a group; inside it halving goes on. The error of a cluster that
its representative stands for, summed over channels, is at most the lesser of (docs/methods/lightcuts)::

    e <= w a b / (r^2 + A / pi),
    e <= N b / r^2 + 2 (D + w s v) / r^3 + (K(a, b) w s^2 / 2 + w |A - mean A| / pi) / r^4,
    K(a, b) = min(3 + 1.5 sqrt 6, 1 + 4 a b + sqrt(1 + 8 min(1, a + b)^2)),

a and b at most the cosines of light and receiver, r at least the distance, over the cluster and the group; the second,
Taylor's series about the mean, holds where both cosines are positive throughout. Symbols as in `tree`. A group has a
middle x, a direction g, a turn, a height and a radius as a cluster has. With d_0 = p - x, c = m . g, s = |m - c g|:
m . d is m . d_0 within height + |c| height_g + s radius_g, n_i . d that within turn times |d|; g . d likewise.
"""

import math
from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.lightcuts.tree import (
    FACING,
    HEIGHT,
    INFLATION,
    MIDDLE,
    RADIUS,
    SHIFT,
    SOFTEST,
    SPREAD,
    TILT,
    TURN,
    UNEVEN,
    WEIGHT,
    select,
    swap,
)
from refgi.pairs.pair_sum import LEAST_SQUARE, NX, TILE, X
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
                select(keys, order, first, begin, end, middle, row)
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
def _partition(keys: Array, order: Array, first: int, begin: int, end: int, row: int) -> int:
    """Put the receivers below the middle of a row's range first; return where the others begin."""
    least = most = keys[row, begin]
    for i in range(begin, end):
        least, most = min(least, keys[row, i]), max(most, keys[row, i])
    middle, found = least + (most - least) * keys.dtype.type(0.5), begin
    for i in range(begin, end):
        if keys[row, i] < middle:
            swap(keys, order, first, i, found)
            found += 1
    return max(begin + 1, min(found, end - 1))


CURVATURE = 3.0 + 1.5 * math.sqrt(6.0)  # largest second derivative of the pair term along a line, times r^4
SLOPE = 2.0  # largest first derivative, times r^3
ROUNDING = 8.0  # units of rounding of coordinates within which a receiver lies in a light's plane, or it in its


@kernel
def bound_group(tile: Array, begin: int, end: int, group: Array) -> None:
    """Fill a group (9,) with middle, direction, turn, height and radius of a tile's receivers begin to end - 1."""
    real = tile.dtype.type
    for row in range(6):
        least = most = tile[row, begin]
        total = 0.0
        for i in range(begin, end):
            value = tile[row, i]
            least, most = value if value < least else least, value if value > most else most
            total += value
        group[row] = total if row >= NX else least + real(0.5) * (most - least)
    length = math.sqrt(np.float64(group[3]) ** 2 + np.float64(group[4]) ** 2 + np.float64(group[5]) ** 2)
    for axis in range(3):
        group[3 + axis] = group[3 + axis] / length if length > 0.0 else tile[NX + axis, begin]
    turn, height, radius = 0.0, 0.0, 0.0
    for i in range(begin, end):
        away, bent, over = 0.0, 0.0, 0.0
        for axis in range(3):
            step = np.float64(tile[X + axis, i]) - group[axis]
            away, over = away + step * step, over + step * group[3 + axis]
            bent += (np.float64(tile[NX + axis, i]) - group[3 + axis]) ** 2
        turn, height, radius = max(turn, bent), max(height, abs(over)), max(radius, away)
    group[TURN], group[HEIGHT], group[RADIUS] = math.sqrt(turn), height, math.sqrt(radius) * INFLATION


@kernel
def fill_errors(bound: Array, count: int, group: Array, least: Any, most: Any, errors: Array) -> None:
    """Fill errors (n,) with the bounds e, W/m^2, of the first `count` clusters of bound, (BOUND_ROWS, n).

    `group` is of `bound_group`, `least` (m^2) and `most` (1/m^2) those of `Clamp`.
    """
    real = bound.dtype.type
    zero, half, one, two, tiny = real(0.0), real(0.5), real(1.0), real(2.0), real(LEAST_SQUARE)
    rounding, inflation = real(ROUNDING) * real(np.finfo(bound.dtype).eps), real(INFLATION)
    curvature, slope, four, eight = real(CURVATURE), real(SLOPE), real(4.0), real(8.0)
    x, y, z, gx, gy, gz = group[0], group[1], group[2], group[3], group[4], group[5]
    turned, thick, wide = group[TURN], group[HEIGHT], group[RADIUS]
    far = abs(x) + abs(y) + abs(z)
    for k in range(np.uint64(count)):
        px, py, pz = bound[MIDDLE, k], bound[MIDDLE + 1, k], bound[MIDDLE + 2, k]
        mx, my, mz = bound[FACING, k], bound[FACING + 1, k], bound[FACING + 2, k]
        height, radius = bound[HEIGHT, k], bound[RADIUS, k]
        dx, dy, dz = px - x, py - y, pz - z
        c = mx * gx + my * gy + mz * gz
        ox, oy, oz = mx - c * gx, my - c * gy, mz - c * gz
        s, c = math.sqrt(ox * ox + oy * oy + oz * oz), abs(c)
        along, over = dx * mx + dy * my + dz * mz, dx * gx + dy * gy + dz * gz
        sx, sy, sz = dx - along * mx, dy - along * my, dz - along * mz
        across = math.sqrt(sx * sx + sy * sy + sz * sz)
        reach = math.sqrt(dx * dx + dy * dy + dz * dz) + radius + wide
        slack = height + c * thick + s * wide
        margin = rounding * (abs(px) + abs(py) + abs(pz) + far)
        swing, tilt = slack + bound[TURN, k] * reach, thick + c * height + s * radius + turned * reach
        # the least distance, and the largest cosines
        up, out = abs(along) - slack - margin, across - radius - wide - margin
        up, out = (up if up > zero else zero), (out if out > zero else zero)
        square = up * up + out * out
        square = square if square > tiny else tiny
        inverse = one / square
        root = math.sqrt(inverse)
        cl, cx = along + swing, over + tilt
        a, b = (cl + margin) * root, (cx + margin) * root
        a, b = (a if a < one else one), (b if b < one else one)
        out_of_sight = (cl <= margin) | (cx <= margin)
        term = a * b / ((square if square > least else least) + bound[SOFTEST, k])
        whole = bound[WEIGHT, k] * (term if term < most else most)
        # the smooth part
        both = a + b if a + b < one else one
        bend = one + four * a * b + math.sqrt(one + eight * both * both)
        bend = half * (bend if bend < curvature else curvature)
        smooth = (bound[TILT, k] * b + (slope * bound[SHIFT, k] + (bend * bound[SPREAD, k] + bound[UNEVEN, k]) * root)
                  * root) * inverse
        # what a plane through the cluster leaves of one cosine, where it may pass through it
        bent, sunk = height + bound[TURN, k] * reach + margin, c * height + (s + turned) * radius + margin
        kink_a, kink_b = bent * two * root, sunk * two * root
        kink_a = (kink_a if kink_a < a else a) * b if along - swing < bent else zero
        kink_b = (kink_b if kink_b < b else b) * a if over - tilt < sunk else zero
        kink = bound[WEIGHT, k] * inverse * (kink_a if kink_a > kink_b else kink_b)
        smooth = smooth if smooth > kink else kink
        error = inflation * (smooth if (square >= least) & (term <= most) & (smooth < whole) else whole)
        error = error if error >= zero else real(np.inf)  # not a number: beyond the range of these
        errors[k] = zero if out_of_sight else error
