"""Slow literal twin of where `hssil` samples: docs/conventions, "Random numbers", in whole numbers and floats."""

import math

from tests.naive.draws import mix32

G = 1.324717957244746  # g^3 = g + 1
GOLDEN = 0.6180339887498949


def level_key(seed, number):
    """Return the key of a level; 0 is the full picture."""
    return mix32(seed ^ mix32((number + 0x9E3779B9) % 2**32))


def row_key(level, row):
    """Return the key of a row of a level."""
    return mix32(level ^ mix32((row + 0x85EBCA6B) % 2**32))


def pixel_key(row, column):
    """Return the key of a pixel of a row."""
    return mix32(row ^ mix32((column + 0xC2B2AE35) % 2**32))


def shifts(key):
    """Return (s, t) of a key."""
    return mix32(key) / 2**32, mix32(key ^ 0x27D4EB2F) / 2**32


def counts(sampling, index):
    """Return how many samples lie in the disc and in the crown of a level."""
    if index > 0:
        return 0, sampling.samples
    if sampling.inner_samples is not None:
        return sampling.inner_samples, sampling.samples
    if sampling.density == "uniform":
        return max(1, round(sampling.samples / 3)), sampling.samples
    return math.ceil(sampling.samples / 2), max(1, math.floor(sampling.samples / 2))


def place(sampling, number, row, column, stretch):
    """Return what is added to (u_j, v_j) at a receiver of a level: stretches of so many points follow each other."""
    level = level_key(sampling.seed, number)
    if sampling.pattern == "pixel":
        return shifts(pixel_key(row_key(level, row), column))
    s, t = shifts(level)
    n = 2 * row + column % 2
    if sampling.pattern == "interleaved":
        n = sampling.tile * (row % sampling.tile) + column % sampling.tile
    return s + n * stretch / G, t + n * stretch / G**2


def distance(radius, low, square, u, density):
    """Return how far from the receiver a point lies; low is 0 in the disc and 1 in the crown, square 1 and 3."""
    return radius * math.sqrt(low + square * u) if density == "uniform" else radius * (low + u)


def stands_for(radius, far, square, count, density):
    """Return the texels of a point: the area of the ring of its share, d(pi far^2) / du, over the number of points."""
    if density == "uniform":
        return square * math.pi * radius**2 / max(count, 1)
    return 2 * math.pi * far * radius / max(count, 1)


def nearest(x, y):
    """Return the texel whose centre is nearest; halves round up."""
    return math.floor(x + 0.5), math.floor(y + 0.5)


def samples(sampling, radius, index, number, row, column):
    """Return (ox, oy, texels it stands for) of the samples around a receiver: the disc's, then the crown's."""
    inner, crown = counts(sampling, index)
    found = []
    for count, low, square in ((inner, 0.0, 1.0), (crown, 1.0, 3.0)):
        found += [(*offset, stands_for(radius, far, square, count, sampling.density))
                  for *offset, far in ring(sampling, radius, low, square, count, number, row, column, crown)]
    return found


def ring(sampling, radius, low, square, count, number, row, column, stretch):
    """Return the texels of `count` points and how far these lie from the receiver."""
    if sampling.pattern == "fixed":
        return mirrored(radius, low, square, count, shifts(level_key(sampling.seed, number)), sampling.density)
    s, t = place(sampling, number, row, column, stretch)
    found = []
    for j in range(count):
        far = distance(radius, low, square, (0.5 + j / G + s) % 1, sampling.density)
        found.append((*nearest(*polar(far, 2 * math.pi * ((0.5 + j / G**2 + t) % 1))), far))
    return found


def mirrored(radius, low, square, count, shift, density):
    """Return half of the points on the right, and their mirror images; an odd last one above or below."""
    found = []
    for j in range((count + 1) // 2):
        u, v = (0.5 + j / G + shift[0]) % 1, (0.5 + j / G**2 + shift[1]) % 1
        far = distance(radius, low, square, u, density)
        x, y = polar(far, math.pi * (v - 0.5))
        if 2 * j + 1 < count:
            ox, oy = nearest(x, y)
            found += [(ox, oy, far), (-ox, oy, far)]
        else:
            found.append((*nearest(0.0, math.copysign(far, y)), far))
    return found


def polar(far, angle):
    """Return columns and rows."""
    return far * math.cos(angle), far * math.sin(angle)


def every_texel(radius, index, shape):
    """Return each texel once: the disc below 2 r at the first level, the crown from r on at others."""
    rows, columns = shape
    return [(ox, oy, 1.0) for oy in range(1 - rows, rows) for ox in range(1 - columns, columns)
            if (ox, oy) != (0, 0) and math.hypot(ox, oy) < 2 * radius and (index == 0 or math.hypot(ox, oy) >= radius)]


def slices(sampling, bitmask, radius, index, number, row, column):
    """Return slices of (ox, oy, texels it stands for), nearest first; occluders stand for none.

    Samples and disc are shared out among the slices; half as many occluders as crown samples lie in the inner disc.
    """
    count = max(1, round(math.sqrt(sampling.samples))) if bitmask.slices is None else bitmask.slices
    inner, outer = counts(sampling, index)
    crown = max(1, round(outer / count))
    disc = max(1, round(inner / count)) if inner else 0
    level, fixed = level_key(sampling.seed, number), sampling.pattern == "fixed"
    key = level if fixed else row_key(level, row)
    turn, shift = shifts(pixel_key(key, column) if sampling.pattern == "pixel" else key)
    if sampling.pattern == "interleaved":
        n = sampling.tile * (row % sampling.tile) + column % sampling.tile
        turn, shift = ((a + n * by) % 1 for a, by in zip(shifts(level), (1 / G**2, 1 / G), strict=True))
    found = []
    for k in range(count):
        part = (shift + (k // 2 if fixed else k) * GOLDEN) % 1
        angle = symmetric(k, count) if fixed else 2 * math.pi * (k + turn) / count
        side = -1 if fixed and k % 2 else 1
        right, down = math.sin(angle), math.cos(angle)
        texels = [(far, *nearest(far * right, far * down), weight) for far, weight in
                  along(radius, count, disc, crown, (crown + 1) // 2, part, sampling.density)]
        found.append([(side * ox, oy, weight) for _, ox, oy, weight in texels])
    return found


def symmetric(k, count):
    """Return the angle of slice k off the vertical: pairs of mirror images, an odd last one upright."""
    if k == count - count % 2:
        return 0.0
    return 2 * math.pi * (k // 2 + (1.0 if count % 2 else 0.5)) / count


def along(radius, count, disc, crown, occluders, part, density):
    """Return (distance, texels it stands for) along a slice, nearest first."""
    placed = [(radius * (j + part) / occluders, 0.0) for j in range(occluders)]
    for points, low, square in ((disc, 0.0, 1.0), (crown, 1.0, 3.0)):
        for j in range(points):
            far = distance(radius, low, square, (j + part) / points, density)
            placed.append((far, stands_for(radius, far, square, points, density) / count))
    return sorted(placed, key=lambda sample: sample[0])
