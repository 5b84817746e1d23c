"""Which lobes can reach which tile of receivers: what adds exactly 0 need not be summed.

A tile is bounded by a ball around its positions. A lobe is passed over when the ball lies behind the light's surface,
or so far off the lobe's axis that (1 - h)^P is below the smallest normal number, which `exp2` makes 0. Both by more
than rounding, so that the kernel itself would add 0 and the sum is the same to the bit.

Symbols: d vector from the ball's centre to the light, rho its radius, h = 1 - cos of the angle to the lobe's axis.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.splat.pair_sum import X

Array = npt.NDArray[Any]

ROUNDING = 32.0  # units of rounding that h and cosines may be off; about 8 are possible
MARGIN = 1.03  # on the logarithm of the smallest normal number


@kernel
def vanishing_limits(lights: Array, widened: bool) -> Array:
    """Return the h of each light from which on its lobe is 0.

    Parameters
    ----------
    lights : (13, N) ndarray
        Packed lights; row 9 holds the exponents.
    widened : bool
        Whether exponents fall near the light; then only what lies behind the lobe is sure to be 0.

    Returns
    -------
    (N,) ndarray
        At most 1.
    """
    real = lights.dtype.type
    smallest = -87.33654 if np.finfo(lights.dtype).eps > 1e-10 else -708.3964  # ln of the smallest normal number
    limits = np.ones(lights.shape[1], lights.dtype)
    for k in range(lights.shape[1]):
        if lights[9, k] > 0 and not widened:
            limits[k] = real(-math.expm1(MARGIN * smallest / np.float64(lights[9, k])))
    return limits


@kernel
def bound_by_ball(tile: Array, size: int) -> Any:
    """Return a ball around the receivers of a tile.

    Parameters
    ----------
    tile : (>= 3, >= size) ndarray
        Receivers: position first.
    size : int
        How many of them count.

    Returns
    -------
    tuple of 4 floats
        Centre and radius, m.
    """
    real = tile.dtype.type
    center = np.empty(3, tile.dtype)
    for axis in range(3):
        low = high = tile[X + axis, 0]
        for i in range(1, size):
            low, high = min(low, tile[X + axis, i]), max(high, tile[X + axis, i])
        center[axis] = low + real(0.5) * (high - low)
    x, y, z = center[0], center[1], center[2]
    largest = real(0.0)
    for i in range(size):
        dx, dy, dz = tile[X, i] - x, tile[X + 1, i] - y, tile[X + 2, i] - z
        largest = max(largest, dx * dx + dy * dy + dz * dz)
    return x, y, z, math.sqrt(largest) * real(1.0001)


@kernel
def lobes_in_reach(
    lights: Array, limits: Array, first: int, last: int, ball: Any, listed: Array | None, passed: Array, chosen: Array
) -> int:
    """List the lights of a group whose lobe may reach a tile.

    Parameters
    ----------
    lights : (13, N) ndarray
        Packed lights: position, reversed normal, reversed axis first.
    limits : (N,) ndarray
        Those of `vanishing_limits`.
    first, last : int
        The group: lights first to last - 1.
    ball : tuple of 4 floats
        Around the tile's receivers.
    listed : (N,) ndarray of bool or None
        Lights that come into question; None: all.
    passed : (>= last - first,) ndarray of bool
        Room to work in.
    chosen : (>= last - first,) ndarray of int64
        Filled with indices of lights, rising.

    Returns
    -------
    int
        How many were listed.
    """
    if listed is None:
        _reaches(lights, limits, first, last, ball, passed)
    else:
        for k in range(first, last):
            passed[k - first] = listed[k]
    count = 0
    for k in range(first, last):
        chosen[count] = k
        count += passed[k - first]
    return count


@kernel
def _reaches(lights: Array, limits: Array, first: int, last: int, ball: Any, passed: Array) -> None:
    real = lights.dtype.type
    zero, one = real(0.0), real(1.0)
    slack = real(ROUNDING) * real(np.finfo(lights.dtype).eps)
    x, y, z, rho = ball
    for k in range(first, last):
        dx, dy, dz = lights[0, k] - x, lights[1, k] - y, lights[2, k] - z
        r = math.sqrt(dx * dx + dy * dy + dz * dz)
        above = dx * lights[3, k] + dy * lights[4, k] + dz * lights[5, k]
        outside = r > rho
        inverse = one / (r if outside else one)
        cosine = (dx * lights[6, k] + dy * lights[7, k] + dz * lights[8, k]) * inverse
        sine = math.sqrt(max(one - cosine * cosine, zero))
        sine_ball = rho * inverse
        cosine_ball = math.sqrt(max(one - sine_ball * sine_ball, zero))
        # the least angle to the axis is that to the centre less the ball's
        nearest = one if cosine >= cosine_ball else cosine * cosine_ball + sine * sine_ball
        in_lobe = (one - nearest < limits[k] + slack) | (not outside)
        passed[k - first] = (above + rho + slack * (r + rho) > zero) & in_lobe
