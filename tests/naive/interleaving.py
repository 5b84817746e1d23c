"""Slow literal twin of the geometry-aware blur (Dong et al. 2009, Sec. 6)."""

import functools
import math

import numpy as np


def window(place, count, side):
    """Return the places of a window of n: place - n // 2 on; one outside the picture becomes its like n further in."""
    places = []
    for offset in range(side):
        other = place - side // 2 + offset
        if other < 0:
            other += side
        elif other >= count:
            other -= side
        if 0 <= other < count:
            places.append(other)
    return places


@functools.cache
def elsewhere(dy, dx, side, reach=1):
    """Return where else the place of a window finds its subset: pixels n apart, from near to far."""
    steps = [step * side for step in range(-reach, reach + 1)]
    places = [(dy + v, dx + u) for v in steps for u in steps if (v, u) != (0, 0)]
    return sorted(places, key=lambda place: (place[0] ** 2 + place[1] ** 2, place))


def completed(y, x, side, shape, counts):
    """Return the pixels that count for (x, y): for each place of the window itself, or the nearest of its subset."""
    chosen = []
    for dy in range(-(side // 2), side - side // 2):
        for dx in range(-(side // 2), side - side // 2):
            for v, u in [(dy, dx), *elsewhere(dy, dx, side)]:
                if 0 <= y + v < shape[0] and 0 <= x + u < shape[1] and counts(y + v, x + u):
                    chosen.append((y + v, x + u))
                    break
    return chosen


def blurred(values, position, normal, covered, side, extent, cosine, every_subset=False):
    """Return the mean of (3, h, w) values over pixels of each window that are near and face alike.

    Or over the nearest pixels of every subset that are, the window's own first.
    """
    _, height, width = values.shape
    result = np.zeros(values.shape)
    for y in range(height):
        for x in range(width):
            if not covered[y, x]:
                continue

            def counts(j, i, y=y, x=x):
                distance = math.dist(position[:, j, i].tolist(), position[:, y, x].tolist())
                dot = sum(float(a) * float(b) for a, b in zip(normal[:, j, i], normal[:, y, x], strict=True))
                return covered[j, i] and distance <= extent and dot >= cosine

            if every_subset:
                chosen = completed(y, x, side, (height, width), counts)
            else:
                chosen = [(j, i) for j in window(y, height, side) for i in window(x, width, side) if counts(j, i)]
            accepted = [values[:, j, i].astype(float) for j, i in chosen]
            result[:, y, x] = sum(accepted) / len(accepted)
    return result
