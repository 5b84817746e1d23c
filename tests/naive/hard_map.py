"""Slow literal twin of hard paraboloid visibility: one receiver, one texel, one ray against every triangle."""

import math

import numpy as np

from tests.naive.raster import nearest


def texel(center, frame, size, point):
    """Row and column that a point is seen through, or None behind the plane."""
    x, y, z = (frame @ (np.asarray(point, float) - center)).tolist()
    if z <= 0:
        return None
    scale = math.sqrt(x * x + y * y + z * z) + z
    return tuple(min(math.floor((c / scale + 1) / 2 * size), size - 1) for c in (y, x))


def direction(frame, size, row, column):
    """Unit vector through a texel's centre, or None outside the disc."""
    s, t = 2 * (column + 0.5) / size - 1, 2 * (row + 0.5) / size - 1
    square = s * s + t * t
    if square > 1:
        return None
    return np.array([2 * s, 2 * t, 1 - square]) / (1 + square) @ frame


def visible(center, frame, size, point, normal, vertices, faces, slack):
    """V of one receiver, and how near the call was (share of a distance, or a barycentric coordinate)."""
    place = texel(center, frame, size, point)
    toward = None if place is None else direction(frame, size, *place)
    if toward is None:
        return 1, math.inf
    hit, distance, _, margin = nearest(center, toward, vertices, faces)
    limit = math.dist(point, center)
    along = float(normal @ toward)
    if along:
        plane = float(normal @ (np.asarray(point) - center)) / along
        if plane > 0:
            limit = min(limit, plane)
    limit *= 1 - slack
    if hit < 0:
        return 1, margin
    return int(distance >= limit), min(margin, abs(distance / limit - 1))
