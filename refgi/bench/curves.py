"""Curves of error over time: what lies on the front, and the path tracer's error in equal time."""

import math
from collections.abc import Sequence

import numpy as np

Point = tuple[float, float]  # s, error


def front(points: Sequence[Point]) -> list[bool]:
    """Return for each point whether no other is as fast and nearer, or as near and faster (Pareto).

    Parameters
    ----------
    points : sequence of (float, float)
        Time and error; such as are not finite are never on the front.

    Returns
    -------
    list of bool
        In the order of the points.
    """
    def beaten(seconds: float, error: float) -> bool:
        return any(s <= seconds and e <= error and (s, e) != (seconds, error) for s, e in points)

    return [math.isfinite(s) and math.isfinite(e) and not beaten(s, e) for s, e in points]


def error_in(line: Sequence[Point], seconds: float) -> float:
    """Return the error of an estimate that runs for some time, by its measured points.

    Parameters
    ----------
    line : sequence of (float, float)
        Time and error of the estimate when it is stopped early.
    seconds : float
        The time.

    Returns
    -------
    float
        Between points along the straight line of both logarithms; after the last one falling with the root of time;
        infinite before the first, which no shorter run precedes.
    """
    known = sorted((s, e) for s, e in line if s > 0 and e > 0)
    if not known or seconds < known[0][0]:
        return math.inf
    if seconds >= known[-1][0]:
        return known[-1][1] * math.sqrt(known[-1][0] / seconds)
    x, y = np.log([s for s, _ in known]), np.log([e for _, e in known])
    return float(np.exp(np.interp(math.log(seconds), x, y)))
