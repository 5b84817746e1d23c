"""Along which axes the bounding rectangle of a cluster lies in its plane: fixed, of the lights, or of least area.

The paper names none. A square turned by 45 degrees fills twice its area of fixed axes.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.cluster.settings import Axes

Array = npt.NDArray[Any]

ROUND = 1e-9  # a spread this near to that of a disc has no direction


def turn_of(flat: Array, axes: Axes) -> float:
    """Return by how much the axes are turned within the plane.

    Parameters
    ----------
    flat : (2, n) ndarray
        Points of the plane, m.
    axes : {"fixed", "pca", "min_area"}
        Not at all; along the greatest variance; along the sides of the rectangle of least area.

    Returns
    -------
    float
        Angle from the first axis towards the second; 0 where no direction stands out.
    """
    if axes == "fixed" or flat.shape[1] < 2:
        return 0.0
    return _of_spread(flat) if axes == "pca" else _of_least_area(flat)


def _of_spread(flat: Array) -> float:
    s, t = flat - flat.mean(axis=1, keepdims=True)
    difference, product, sum_ = float(s @ s - t @ t), float(2 * (s @ t)), float(s @ s + t @ t)
    if math.hypot(difference, product) <= ROUND * sum_:
        return 0.0
    return 0.5 * math.atan2(product, difference)


def _of_least_area(flat: Array) -> float:
    """One side of the rectangle of least area lies along an edge of the hull (Freeman and Shapira 1975)."""
    corners = _hull(flat)
    edges = np.roll(corners, -1, axis=1) - corners
    length = np.hypot(*edges)
    if len(length) < 2 or not length.any():
        return 0.0
    (c, d), kept = (edges / np.where(length > 0, length, 1)), length > 0
    c, d = c[kept, None], d[kept, None]
    along, across = c * corners[0] + d * corners[1], c * corners[1] - d * corners[0]
    best = int(np.argmin(np.ptp(along, axis=1) * np.ptp(across, axis=1)))
    return math.atan2(float(d[best, 0]), float(c[best, 0]))


def _hull(flat: Array) -> Array:
    """Return the corners of the convex hull, (2, h), counter-clockwise (Andrew 1979)."""
    points = [(float(s), float(t)) for s, t in flat[:, np.lexsort(flat[::-1])].T]
    chains = [_chain(points), _chain(points[::-1])]
    return np.array([*chains[0][:-1], *chains[1][:-1]] or points[:1]).T


def _chain(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    chain: list[tuple[float, float]] = []
    for s, t in points:
        while len(chain) > 1:
            (a, b), (c, d) = chain[-2:]
            if (c - a) * (t - b) > (d - b) * (s - a):
                break
            chain.pop()
        chain.append((s, t))
    return chain
