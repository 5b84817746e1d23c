"""Low-discrepancy points of a crown (Sec. 3.2), shifted for each receiver by a hash (Cranley and Patterson 1976).

A point (u, v) of the unit square lies at the angle 2 pi v. With uniform density it lies r sqrt(1 + 3 u) from the
receiver in the crown, r sqrt(u) in the disc within: equal areas get equally many points. With a density of the inverse
distance it lies r (1 + u) and r u away: rings of equal width get equally many. It takes the texel it falls into, and
stands for as many texels as there are to a point where it lies.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel
from refgi.sampling import FIRST_STEP, SECOND_STEP, hash_bits
from refgi.sssil.settings import SamplingSettings

Array = npt.NDArray[Any]

TO_UNIT = 2.0**-32


def sample_points(inner: int, crown: int) -> Array:
    """Return the points of the unit square that all patterns shift: those of the inner disc, then those of the crown.

    (inner + crown, 3) float64: u in [0, 1), cos 2 pi v and sin 2 pi v.
    """
    count = np.concatenate([np.arange(inner), np.arange(crown)])
    u, v = (0.5 + count * FIRST_STEP) % 1.0, (0.5 + count * SECOND_STEP) % 1.0
    return np.stack([u, np.cos(2.0 * math.pi * v), np.sin(2.0 * math.pi * v)], axis=1)


def sample_weight(radius: float, inner: int, crown: int) -> Array:
    """Return how many texels each sample stands for where density is uniform, (inner + crown,) float64.

    pi r^2 / inner in the disc, 3 pi r^2 / crown in the crown of inner radius r (texels): the areas shared out.
    """
    disc = math.pi * radius**2
    return np.repeat([disc / max(inner, 1), 3.0 * disc / crown], [inner, crown])


def known_radius(sampling: SamplingSettings, radius: float | None) -> float:
    """Return the inner radius of the crowns, texels: `radius`, else the settings'; `InputError` if neither is set."""
    found = sampling.radius if radius is None else radius
    expect(found is not None, "radius", "texels, or the size of the first level to choose it by", found)
    return float(found)  # type: ignore[arg-type]


@kernel
def level_key(seed: Any, number: Any) -> Any:
    """Return the hash of seed and level number, uint32."""
    return hash_bits(np.uint32(seed) ^ hash_bits(np.uint32(number) + np.uint32(0x9E3779B9)))


@kernel
def row_key(key: Any, row: Any) -> Any:
    """Return the hash of a level's key and a row, uint32."""
    return hash_bits(key ^ hash_bits(np.uint32(row) + np.uint32(0x85EBCA6B)))


@kernel
def pixel_key(key: Any, column: Any) -> Any:
    """Return the hash of a row's key and a column, uint32."""
    return hash_bits(key ^ hash_bits(np.uint32(column) + np.uint32(0xC2B2AE35)))


@kernel
def shift_of(key: Any, block: Any) -> Any:
    """Return the shift of the common points by a key: an addend of u modulo 1, and cosine and sine of a turn.

    `block` points of the sequence are skipped.
    """
    u = (hash_bits(key) * TO_UNIT + block * FIRST_STEP) % 1.0
    v = (hash_bits(key ^ np.uint32(0x27D4EB2F)) * TO_UNIT + block * SECOND_STEP) % 1.0
    return u, math.cos(2.0 * math.pi * v), math.sin(2.0 * math.pi * v)


def key_shift(key: Any) -> Array:
    """Return the random shift (u, v) of a key, (2,) float64 in [0, 1)."""
    return np.array([hash_bits(key), hash_bits(key ^ np.uint32(0x27D4EB2F))]) * TO_UNIT


def tile_shifts(start: Array, tile: tuple[int, int], stretch: int) -> Array:
    """Return the shifts of the texels of a tile, row by row, each `stretch` points of the sequence after the last.

    `start` (2,): shift of the first. Returns (rows, columns, 2): addends of u and v modulo 1.
    """
    points = np.arange(tile[0] * tile[1]).reshape(*tile, 1) * stretch
    shifts: Array = (start + points * np.array([FIRST_STEP, SECOND_STEP])) % 1.0
    return shifts


@kernel
def distance(share: Any, near: float, radius: float, uniform: bool) -> Any:
    """Return how far the point u = `share` is from the receiver, texels; `near` is 0 in the disc, 1 in the crown."""
    if uniform:
        return radius * math.sqrt(near + (1.0 + 2.0 * near) * share)
    return radius * (near + share)


@kernel
def relative_weight(length: Any, near: float, radius: float, uniform: bool) -> Any:
    """Return how many texels a point at a distance stands for, over the mean of disc (`near` 0) or crown (1).

    The area 2 pi r dr over the number of points N du there: with r the radius and l the distance, 2 pi l r / N against
    pi r^2 / N in the disc and 3 pi r^2 / N in the crown.
    """
    return 1.0 if uniform else 2.0 * length / (radius * (1.0 + 2.0 * near))


@kernel
def shifted(
    points: Array, j: Any, near: float, radius: float, uniform: bool, u: float, cosine: float, sine: float
) -> Any:
    """Return the offset (ox, oy) of shifted point j, texels from the receiver, and its relative weight.

    `points` are of `sample_points`; `near` is 0 in the disc and 1 in the crown; `u, cosine, sine` of `shift_of`.
    """
    share = points[j, 0] + u
    share = share - 1.0 if share >= 1.0 else share
    length = distance(share, near, radius, uniform)
    x = length * (points[j, 1] * cosine - points[j, 2] * sine)
    y = length * (points[j, 1] * sine + points[j, 2] * cosine)
    return (np.int64(math.floor(x + 0.5)), np.int64(math.floor(y + 0.5)),
            relative_weight(length, near, radius, uniform))


@kernel
def pixel_offset(points: Array, inner: int, radius: float, uniform: bool, key: Any, j: int) -> Any:
    """Return offset (ox, oy) and relative weight of sample j of a receiver's own; the first `inner` lie in the disc."""
    u, cosine, sine = shift_of(key, 0)
    return shifted(points, j, 0.0 if j < inner else 1.0, radius, uniform, u, cosine, sine)
