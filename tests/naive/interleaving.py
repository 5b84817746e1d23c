"""Slow literal twins of interleaved sampling and the geometry-aware blur (Dong et al. 2009, Sec. 6)."""

import functools
import math

import numpy as np


def bayer(x, y):
    """Return the rank of a place in Bayer's ordered dither, from its bits, the lowest of x and y counting most."""
    if x == y == 0:
        return 0.0
    return {(0, 0): 0, (1, 1): 1, (1, 0): 2, (0, 1): 3}[x % 2, y % 2] / 4 + bayer(x // 2, y // 2) / 4


def lights_of(x, y, side, count, area_of=None):
    """Return the lights that pixel (x, y) sums: one of n^2, in their order.

    By index; or, given the area light of each, up to three runs of lights sorted by these: run j goes to the place
    of rank j mod n^2, runs of one length as near as can be.
    """
    if area_of is None:
        return [i for i in range(count) if i % (side * side) == (y % side) * side + x % side]
    places = sorted(((i, j) for i in range(side) for j in range(side)), key=lambda place: bayer(*place))
    mine = places.index((x % side, y % side))
    each = min(3, max(1, count // side**2))
    by_area = sorted(range(count), key=lambda i: (area_of[i], i))
    chosen = []
    for turn in range(each):
        run, runs = turn * side**2 + mine, each * side**2
        chosen += by_area[-(-run * count // runs) : -(-(run + 1) * count // runs)]
    return sorted(chosen)


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
