"""What a cluster of lights may be off by at a group of receivers, when its representative stands in for it.

The bound is the lesser of two. With a and b at most the cosines of light and receiver and r at least the distance, for
every light of the cluster and every receiver of the group::

    e <= w a b / (r^2 + A / pi),
    e <= N b / r^2 + 2 (D + w s v) / r^3 + (K(a, b) w s^2 / 2 + w |A - mean A| / pi) / r^4,
    K(a, b) = min(3 + 1.5 sqrt 6, 1 + 4 a b + sqrt(1 + 8 min(1, a + b)^2)),

e being the sum over channels of the error's size. The second holds where both cosines are positive throughout, so that
the pair term is smooth: Taylor's series about the mean, whose first derivatives cancel. Its constants bound the
derivatives of <n . d> <m . d> / r^4, times powers of r; a softness A / pi makes no derivative larger. Symbols as in
`tree`. A group has a middle x, a direction g, a turn, a height and a radius as a cluster has.

With d_0 = p - x, c = m . g and s = |m - c g|: m . d is m . d_0 within height + |c| height_g + s radius_g, in which the
plane's direction is tight, and n_i . d that within turn times |d|; g . d likewise; and r is at least what the heights
leave of d_0 along m and the radii across it.
"""

import math
from typing import Any

import numpy as np

from refgi.jit import kernel
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
)
from refgi.pairs.pair_sum import LEAST_SQUARE, NX, X
from refgi.types import Array

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
