"""Curves of error over time: the front, a curve's knee, and the path tracer's error in equal time."""

import math
from collections.abc import Sequence

import numpy as np

Point = tuple[float, float]  # s, error


def front(points: Sequence[Point]) -> list[bool]:
    """Return for each point (time, error) whether no other is as fast and nearer, or as near and faster (Pareto).

    Points that are not finite are never on the front.
    """
    def beaten(seconds: float, error: float) -> bool:
        return any(s <= seconds and e <= error and (s, e) != (seconds, error) for s, e in points)

    return [math.isfinite(s) and math.isfinite(e) and not beaten(s, e) for s, e in points]


def error_in(line: Sequence[Point], seconds: float) -> float:
    """Return the error of an estimate that runs for some time, s, by its measured points (time, error).

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


def knee(points: Sequence[Point]) -> int | None:
    """Return which point (time, error) of a method's curve is its knee: the first of the least error^4 x time.

    Where an error is bias and noise, e^2 = b^2 + c / t, this is where the noise has come down to the bias, c / t = b^2:
    from there on more time buys less and less. None where no point is positive and finite.

    >>> knee([(t, (0.1**2 + 0.04 / t) ** 0.5) for t in (1.0, 2.0, 4.0, 8.0)])
    2
    """
    costs = [e**4 * s if 0 < s < math.inf and 0 < e < math.inf else math.inf for s, e in points]
    least = min(costs, default=math.inf)
    return costs.index(least) if math.isfinite(least) else None
