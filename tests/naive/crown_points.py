"""Where `hssil` samples: random shifts by docs/conventions, "Random numbers", and slices past a bitmask."""

import math

import numpy as np

from refgi.literal import hssil_crown
from refgi.literal.hssil_crown import FIRST_STEP, SECOND_STEP, distance, texels_of
from tests.naive.draws import mix32

GOLDEN = 0.6180339887498949


def level_key(seed, number):
    """Return the key of a level; 0 is the full picture."""
    return mix32(seed ^ mix32((number + 0x9E3779B9) % 2**32))


def row_key(level, row):
    return mix32(level ^ mix32((row + 0x85EBCA6B) % 2**32))


def pixel_key(row, column):
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


def samples(sampling, radius, index, number, shape):
    """Return offsets and weights of the samples of a level of so many rows and columns, by the place in their tile."""
    (inner, crown), density = counts(sampling, index), sampling.density
    level = level_key(sampling.seed, number)
    if sampling.pattern == "all":
        return hssil_crown.every_texel(0.0 if index == 0 else radius, 2 * radius)
    if sampling.pattern == "fixed":
        return hssil_crown.mirrored_samples(shifts(level), inner, crown, radius, density)
    if sampling.pattern == "pixel":
        points = hssil_crown.sample_points(inner, crown)
        added = np.array([[shifts(pixel_key(row_key(level, row), column)) for column in range(shape[1])]
                          for row in range(shape[0])])
    else:
        tile = (shape[0], 2) if sampling.pattern == "row" else (sampling.tile, sampling.tile)
        points, added = hssil_crown.points_and_shifts(shifts(level), inner, crown, *tile)
    return hssil_crown.crown_samples(points, added, inner, radius, density)


def nearest(x, y):
    """Return the texel whose centre is nearest; halves round up."""
    return math.floor(x + 0.5), math.floor(y + 0.5)


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
        turn, shift = ((a + n * by) % 1 for a, by in zip(shifts(level), (SECOND_STEP, FIRST_STEP), strict=True))
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
    for points, near in ((disc, 0.0), (crown, 1.0)):
        for j in range(points):
            far = distance((j + part) / points, near, radius, density)
            placed.append((far, texels_of(far, near, points, radius, density) / count))
    return sorted(placed, key=lambda sample: sample[0])
