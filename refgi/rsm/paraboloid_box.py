"""Where a triangle may be on a paraboloid map: the box of its corners, made wider for edges that are arcs."""

import math
from typing import Any

import numpy as np

from refgi.jit import kernel
from refgi.rsm.triangle import SMALLEST


@kernel
def bulge(square: float) -> Any:
    """Return how far an edge may leave its chord of squared length L^2: 1 - sqrt(1 - L^2/4).

    Parameters
    ----------
    square : float
        L^2.

    Returns
    -------
    float
        In the units of the unit disc, a little too much.

    Notes
    -----
    Each edge is an arc of at most half a circle, of radius R >= 1: R - sqrt(R^2 - L^2/4) is largest for R = 1.
    """
    if square < 0.04:
        return 0.13 * square + 1e-12
    return 1.0 - math.sqrt(max(1.0 - 0.25 * square, 0.0)) + 1e-12


@kernel
def box_across(x: Any, y: Any, z: Any) -> tuple[float, float, float, float]:
    """Return the range of s and of t that the part ahead of z = 0 may cover of a triangle that crosses it.

    Parameters
    ----------
    x, y, z : tuple of 4 floats
        Corners in the map's frame, the first again at the end.

    Returns
    -------
    tuple of 4 floats
        Least and greatest s, least and greatest t.
    """
    s_low, s_high, t_low, t_high, longest = np.inf, -np.inf, np.inf, -np.inf, 0.0
    s_first, t_first, s_last, t_last = np.nan, np.nan, np.nan, np.nan
    for half_step in range(6):  # each corner, then where its edge meets the plane
        a = half_step // 2
        if half_step % 2 == 0:
            if z[a] < 0.0:
                continue
            scale = 1.0 / max(math.sqrt(x[a] * x[a] + y[a] * y[a] + z[a] * z[a]) + z[a], SMALLEST)
            s, t = x[a] * scale, y[a] * scale
        else:
            if (z[a] < 0.0) == (z[a + 1] < 0.0):
                continue
            share = z[a] / (z[a] - z[a + 1])
            rim_x, rim_y = x[a] + share * (x[a + 1] - x[a]), y[a] + share * (y[a + 1] - y[a])
            length = math.sqrt(rim_x * rim_x + rim_y * rim_y)
            if length == 0.0:  # through the centre itself: no way to tell
                return -1.0, 1.0, -1.0, 1.0
            s, t = rim_x / length, rim_y / length
        s_low, s_high, t_low, t_high = min(s_low, s), max(s_high, s), min(t_low, t), max(t_high, t)
        if s_first == s_first:
            longest = max(longest, (s - s_last) * (s - s_last) + (t - t_last) * (t - t_last))
        else:
            s_first, t_first = s, t
        s_last, t_last = s, t
    longest = max(longest, (s_first - s_last) * (s_first - s_last) + (t_first - t_last) * (t_first - t_last))
    spare = bulge(longest)
    return s_low - spare, s_high + spare, t_low - spare, t_high + spare
