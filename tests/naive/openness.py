"""Slow literal twin of openness: the share of cosine-weighted directions that no triangle blocks within a radius.

Directions are a Sobol pair with Owen's scrambling, in whole numbers of any size (docs/conventions, "Random numbers"):
point i turns the set about its normal and shifts it in sin^2 of the polar angle.
"""

import math
from functools import cache

import numpy as np

from tests.naive.crossings import corners_of, nearest
from tests.naive.draws import mix32

WORD = 2**32
LIFT = 1e-8  # m: a ray starts this far off its surface


def openness(geometry, position, normal, index, radius, rays, seed):
    """Return the share of free rays of points (n, 3), each with the index that its draws have."""
    directions = [directions_of(up, int(i), rays, seed) for up, i in zip(normal, index, strict=True)]
    starts = np.repeat(position + LIFT * normal, rays, axis=0)
    _, far = nearest(corners_of(geometry), starts, np.reshape(directions, (-1, 3)))
    return (far > radius).reshape(-1, rays).mean(axis=1)


def directions_of(normal, index, rays, seed):
    """Return the directions (rays, 3) of point `index`."""
    word = mix32(index ^ mix32((seed + 0x9E3779B9) % WORD))
    turn = mix32((word + 1) % WORD) / WORD
    points = [(sobol_owen(k, 0, seed), sobol_owen(k, 1, seed)) for k in range(rays)]
    return [cosine_direction(normal, (u + word / WORD) % 1, v + turn) for u, v in points]


def cosine_direction(normal, sin2, turn):
    """Return the direction of a squared sine of the polar angle and a share of the turn about a normal."""
    tangent, bitangent = basis(normal)
    across = math.cos(2 * math.pi * turn) * tangent + math.sin(2 * math.pi * turn) * bitangent
    return math.sqrt(sin2) * across + math.sqrt(1 - sin2) * normal


def basis(n):
    """Tangents of a unit normal: those of z turned to n about the axis between, mirrored below (Duff et al. 2017)."""
    sign = math.copysign(1.0, n[2])
    scale = -1 / (sign + n[2])
    return (np.array([1 + sign * n[0] * n[0] * scale, sign * n[0] * n[1] * scale, -sign * n[0]]),
            np.array([n[0] * n[1] * scale, sign + n[1] * n[1] * scale, -n[1]]))


@cache
def sobol_owen(index, dimension, seed):
    """Coordinate 0 or 1 of point `index`: shuffled by a scramble of its index, then scrambled itself (Burley 2020)."""
    key = mix32(seed ^ mix32(0x9E3779B9))
    shuffled = scramble(index, key)
    bits = pascal(shuffled) if dimension else mirrored(shuffled)
    return scramble(bits, (key + 1 + dimension) % WORD) / WORD


def pascal(index):
    """The second Sobol axis: bit k of the index adds column k of Pascal's triangle modulo 2, first row foremost."""
    bits = 0
    for k in range(32):
        if index >> k & 1:
            bits ^= sum((math.comb(k, row) & 1) << (31 - row) for row in range(k + 1))
    return bits


def scramble(value, seed):
    """Owen's scramble by the permutation of Laine and Karras on mirrored bits."""
    x = (mirrored(value) + mix32(seed)) % WORD
    for factor in (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6):
        x ^= x * factor % WORD
    return mirrored(x)


def mirrored(value):
    """32 bits in reverse order."""
    return int(f"{value:032b}"[::-1], 2)
