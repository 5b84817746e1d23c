"""Slow literal twins of interleaved sampling and the geometry-aware blur (Dong et al. 2009, Sec. 6)."""

import math

import numpy as np


def lights_of(x, y, side, count):
    """Return the lights that pixel (x, y) sums: one of n^2, in their order."""
    return [i for i in range(count) if i % (side * side) == (y % side) * side + x % side]


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


def blurred(values, position, normal, covered, side, extent, cosine):
    """Return the mean of (3, h, w) values over pixels of each window that are near and face alike."""
    _, height, width = values.shape
    result = np.zeros(values.shape)
    for y in range(height):
        for x in range(width):
            if not covered[y, x]:
                continue
            accepted = []
            for j in window(y, height, side):
                for i in window(x, width, side):
                    distance = math.dist(position[:, j, i].tolist(), position[:, y, x].tolist())
                    dot = sum(float(a) * float(b) for a, b in zip(normal[:, j, i], normal[:, y, x], strict=True))
                    if covered[j, i] and distance <= extent and dot >= cosine:
                        accepted.append(values[:, j, i].astype(float))
            result[:, y, x] = sum(accepted) / len(accepted)
    return result
