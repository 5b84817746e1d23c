"""Point sets on the unit square, directions from them, and seeded random numbers that any language reproduces.

Host functions return whole sets (Halton, grid, an order along a Hilbert curve). Kernels give single points by index,
for use inside loops: a Sobol pair with hash-based Owen scrambling, where dimension and seed pick an independent
randomisation. Nothing here keeps state: the same index, dimension and seed give the same point everywhere.

Seeded random numbers in GLSL, with ``uint`` of 32 bits::

    uint mix32(uint x) {
        x = (x ^ (x >> 16)) * 0x21F0AAADu;
        x = (x ^ (x >> 15)) * 0xD35A2D97u;
        return x ^ (x >> 15);
    }
    float draw(uint seed, uint stream, uint index) {
        uint key = mix32(mix32(seed + 0x9E3779B9u) ^ stream);
        return float(mix32(mix32(index + key) ^ key) >> 8) * (1.0 / 16777216.0);
    }

A stream is one use of random numbers; a use that needs several of them, such as one for each map, numbers its parts:
the stream is then `use + 256 part`.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from refgi.errors import expect
from refgi.jit import kernel
from refgi.types import Array

ONE_ULP_BELOW_1 = 1.0 - 2.0**-53
# steps of a sequence of low discrepancy on the square (Roberts 2018): 1 / g and 1 / g^2 where g^3 = g + 1
FIRST_STEP, SECOND_STEP = 0.7548776662466927, 0.5698402909980532


def halton(count: int, bases: Sequence[int] = (2, 3), shift: Sequence[float] | None = None, start: int = 0) -> Array:
    """Return consecutive points of the Halton sequence in [0, 1), optionally shifted modulo 1 (Cranley-Patterson).

    (count, d) float64, one pairwise coprime base a dimension, from index `start` on; index 0 is the origin.

    >>> halton(3, start=1).round(3).tolist()
    [[0.5, 0.333], [0.25, 0.667], [0.75, 0.111]]
    """
    expect(count >= 0, "count", "0 or more points", count)
    points = np.stack([_radical_inverses(start + count, base)[start:] for base in bases], axis=1)
    if shift is not None:
        points = np.minimum((points + np.asarray(shift)) % 1.0, ONE_ULP_BELOW_1)
    return points


def _radical_inverses(count: int, base: int) -> Array:
    """Return the radical inverses of 0 to `count` - 1, (count,): each further digit adds its own to those before."""
    values, weight = np.zeros(1), 1.0
    while len(values) < count:
        weight /= base
        digits = np.arange(min(base, -(-count // len(values))))
        values = np.add.outer(digits * weight, values).reshape(-1)
    return values[:count]


def grid(n: int) -> Array:
    """Return the centres (u, v) of an n by n grid, (n n, 2) float64; u runs fastest.

    >>> grid(2).tolist()
    [[0.25, 0.25], [0.75, 0.25], [0.25, 0.75], [0.75, 0.75]]
    """
    centre = (np.arange(n) + 0.5) / n
    v, u = np.meshgrid(centre, centre, indexing="ij")
    return np.stack([u.ravel(), v.ravel()], axis=1)


def hilbert_order(height: int, width: int) -> Array:
    """Return a picture's flat pixel indices (h w,), int64, in the order of a Hilbert curve: neighbours stay close."""
    order = max(1, max(height, width) - 1).bit_length()
    row, column = (axis.ravel().astype(np.int64) for axis in np.mgrid[:height, :width])
    rank = np.zeros(len(row), np.int64)
    x, y = column.copy(), row.copy()
    for bit in range(order - 1, -1, -1):
        right, below = (x >> bit) & 1, (y >> bit) & 1
        rank = rank * 4 + ((3 * right) ^ below)
        mirror = (below == 0) & (right == 1)
        x, y = np.where(mirror, ~x, x), np.where(mirror, ~y, y)
        x, y = np.where(below == 0, y, x), np.where(below == 0, x, y)
    return np.argsort(rank, kind="stable")


@kernel
def hash_bits(value: Any) -> Any:
    """Return 32 well-mixed bits of an integer, taken modulo 2^32."""
    x = np.uint32(value)
    x = np.uint32((x ^ (x >> np.uint32(16))) * np.uint32(0x21F0AAAD))
    x = np.uint32((x ^ (x >> np.uint32(15))) * np.uint32(0xD35A2D97))
    return np.uint32(x ^ (x >> np.uint32(15)))


@kernel
def uniform(word: Any) -> Any:
    """Return a hash of 32 bits as a number in (0, 1), float64."""
    return (hash_bits(word) + 0.5) * 2.0**-32


@kernel
def reverse_bits(value: Any) -> Any:
    """Return a 32-bit integer (taken modulo 2^32) with its bits in reverse order."""
    x = np.uint32(value)
    x = np.uint32((x >> np.uint32(16)) | (x << np.uint32(16)))
    x = np.uint32(((x & np.uint32(0xFF00FF00)) >> np.uint32(8)) | ((x & np.uint32(0x00FF00FF)) << np.uint32(8)))
    x = np.uint32(((x & np.uint32(0xF0F0F0F0)) >> np.uint32(4)) | ((x & np.uint32(0x0F0F0F0F)) << np.uint32(4)))
    x = np.uint32(((x & np.uint32(0xCCCCCCCC)) >> np.uint32(2)) | ((x & np.uint32(0x33333333)) << np.uint32(2)))
    return np.uint32(((x & np.uint32(0xAAAAAAAA)) >> np.uint32(1)) | ((x & np.uint32(0x55555555)) << np.uint32(1)))


@kernel
def scramble(value: Any, seed: Any) -> Any:
    """Return 32 bits after a nested uniform (Owen) scramble: each bit flips by a hash of the bits above it.

    `value` 2^-32 is a point in [0, 1); every elementary interval keeps its number of points. The multiply-and-add
    permutation idea of Laine and Karras 2011, applied to the reversed bits.
    """
    s = hash_bits(seed)
    x = np.uint32(reverse_bits(value) + s)
    x = np.uint32(x ^ np.uint32(x * np.uint32(0x6C50B47C)))
    x = np.uint32(x ^ np.uint32(x * np.uint32(0xB82F1E52)))
    x = np.uint32(x ^ np.uint32(x * np.uint32(0xC7AFE638)))
    x = np.uint32(x ^ np.uint32(x * np.uint32(0x8D22F6E6)))
    return reverse_bits(x)


@kernel
def sobol_owen(index: Any, dimension: Any, seed: Any) -> Any:
    """Return one coordinate in [0, 1), float64, of point `index` (0 to 2^32 - 1) of a scrambled low-discrepancy set.

    Coordinates 2 k and 2 k + 1 form a (0, 2)-sequence; pairs are shuffled against each other, after Burley 2020 (JCGT
    9, 4). `seed` randomises the whole set.
    """
    pair = hash_bits(np.uint32(seed) ^ hash_bits(np.uint32(dimension >> 1) + np.uint32(0x9E3779B9)))
    shuffled = scramble(index, pair)  # blocks of 2^k points stay blocks, so each stays well spread
    bits = reverse_bits(shuffled)
    if dimension & 1:
        bits = _second_sobol_axis(shuffled)
    return np.float64(scramble(bits, np.uint32(pair + np.uint32(1) + np.uint32(dimension & 1)))) * 2.0**-32


@kernel
def _second_sobol_axis(index: Any) -> Any:
    direction = np.uint32(0x80000000)
    bits = np.uint32(0)
    rest = np.uint32(index)
    while rest:
        if rest & np.uint32(1):
            bits = np.uint32(bits ^ direction)
        direction = np.uint32(direction ^ (direction >> np.uint32(1)))
        rest = np.uint32(rest >> np.uint32(1))
    return bits


@kernel
def cosine_hemisphere(u: Any, v: Any) -> Any:
    """Return a direction of density cos(theta) / pi, z up, by a point of the unit square.

    u = sin^2 theta, v the share of the turn.
    """
    real = type(u)
    radius = math.sqrt(u)
    phi = real(2.0 * math.pi) * v
    return radius * math.cos(phi), radius * math.sin(phi), math.sqrt(max(real(0.0), real(1.0) - u))


# uses; docs/conventions.md lists what each draws
(PIXEL_LIGHTS, LIGHT_PATHS, ROULETTE, RANGE, ERROR_SAMPLES, GATHERING), IMPERFECT_MAPS = range(6), 7
PARTS = 1 << 24  # of one use


@kernel
def draw_bits(seed: Any, stream: Any, index: Any) -> Any:
    """Return 32 random bits: a permutation of the index, another one for each seed and stream, all modulo 2^32."""
    key = hash_bits(hash_bits(np.uint32(np.uint32(seed) + np.uint32(0x9E3779B9))) ^ np.uint32(stream))
    return hash_bits(hash_bits(np.uint32(np.uint32(index) + key)) ^ key)


def draws(seed: int, use: int, count: int, part: int = 0) -> Array:
    """Return numbers 0 to `count` - 1 of a stream, (count,) float64 in [0, 1); one minus them lie in (0, 1].

    They are multiples of 2^-24, the same in float32. `seed` is 0 or more, taken modulo 2^32; `use` is one of this
    module's uses, `part` which stream of it.

    >>> draws(1, PIXEL_LIGHTS, 3).round(6).tolist()
    [0.64236, 0.831962, 0.388469]
    """
    expect(seed >= 0, "seed", "a whole number >= 0", seed)
    expect(0 <= part < PARTS, "part", f"0 to {PARTS - 1}", part)
    values = np.empty(count)
    _fill(np.uint32(seed % 2**32), np.uint32(use + 256 * part), values)
    return values


@kernel
def _fill(seed: Any, stream: Any, values: Array) -> None:
    for i in range(len(values)):
        values[i] = np.float64(draw_bits(seed, stream, np.uint32(i)) >> np.uint32(8)) * 2.0**-24
