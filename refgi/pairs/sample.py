"""The pixels at which a picture's light and error are estimated: all over it, or more where pixel lights are near.

The square of what lights are off by has a heavy tail: a few pixels within the spacing of the lights hold half of it,
and pixels sampled evenly miss them. q(x) = sum over near lights of their irradiance squared, the variance that their
draw gives pixel x, says where they are; near lights lie in the 8 cells around x of a grid of twice the reach.
"""

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.pair_sum import Clamp, limits_of, load_light, pair_term
from refgi.pairs.tiles import block_by_block, taken
from refgi.stages import counted_pixels
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.pairs.irradiance import Receivers
    from refgi.pairs.pixel_lights import Packed

LOOKED = 1 << 14  # pixels that are chosen from
BUCKETS = 1 << 16  # of the cells of the grid
REACH = 2.0  # within which lights are near, in widths of what holds the lights over the root of their number
CHUNK = 64  # receivers that a thread takes at once


class Sample(NamedTuple):
    """Some pixels of a picture."""

    place: Array  # (n,) int64, flat indices
    position: Array  # (3, n) m
    normal: Array  # (3, n)
    weight: Array | None = None  # (n,) pixels that each stands for; None: all alike


def sample_pixels(receivers: "Receivers", count: int) -> Sample:
    """Sample pixels with a surface from all over a picture, the same ones in every run.

    One out of each of `count` equal stretches of the picture's blocks, at van der Corput's place in it; all where there
    are fewer.
    """
    covered = np.asarray(receivers.covered, np.bool_)
    shown = int(np.count_nonzero(covered))
    count = min(count, shown)
    ends = np.arange(count + 1) * shown // max(1, count)
    nth = ends[:-1] + (_van_der_corput(count) * np.diff(ends)).astype(np.int64)
    chosen = block_by_block(covered, nth)
    return Sample(chosen, *(taken(np.asarray(plane), chosen) for plane in (receivers.position, receivers.normal)))


def _van_der_corput(count: int) -> Array:
    index, value, digit = np.arange(count), np.zeros(count), 0.5
    while index.any():
        value, index, digit = value + digit * (index & 1), index >> 1, digit / 2
    return value


def sample_peaks(receivers: "Receivers", packed: "Packed", count: int) -> Sample:
    """Sample about `count` pixels with a surface, half of them by the variance that near lights give them.

    Those that hold much of it are taken for sure; the others stand for as many as they were unlikely.
    """
    looked = sample_pixels(receivers, LOOKED)
    if counted_pixels(len(looked.place)) <= count:
        return looked
    variance = near_variance(looked.position, looked.normal, packed.diffuse, packed.clamp)
    total = float(variance.sum())
    share = variance / total if 0 < total < math.inf else np.full(len(variance), 1 / len(variance))
    chance = np.minimum(count * (0.5 * share + 0.5 / len(share)), 1.0)
    sure = chance == 1.0
    ends = np.cumsum(np.where(sure, 0.0, chance))
    at = np.arange(math.ceil(ends[-1])) + _van_der_corput(math.ceil(ends[-1]))
    drawn = np.searchsorted(ends, at[at < ends[-1]], side="right")
    chosen = np.sort(np.concatenate([np.flatnonzero(sure), drawn]))
    return Sample(looked.place[chosen], np.take(looked.position, chosen, axis=1),
                  np.take(looked.normal, chosen, axis=1), 1 / chance[chosen])


class LightCells(NamedTuple):
    """Lights by the cells of a grid; cells share buckets."""

    order: Array  # (M,) lights, bucket by bucket
    starts: Array  # (BUCKETS + 1,) first of each bucket in the order
    low: Array  # (3,) float64, m
    side: float  # of a cell, m


def light_cells(lights: Array) -> LightCells:
    """Sort M packed lights (>= 3, M + 1) into cells."""
    place = lights[:3, :-1].astype(np.float64)
    low = place.min(axis=1)
    width = float((place.max(axis=1) - low).max())
    side = max(2 * REACH * width / math.sqrt(place.shape[1]), 1e-6 * width, 1e-30)
    bucket = bucket_of(*((place - low[:, None]) / side).astype(np.int64)).astype(np.uint16)
    starts = np.concatenate([[0], np.cumsum(np.bincount(bucket, minlength=BUCKETS))])
    order = np.argsort(bucket, kind="stable")
    return LightCells(order, starts, low, side)


def bucket_of(x: Any, y: Any, z: Any) -> Any:
    """Return the bucket of a cell, or of cells (M,): a spatial hash (Teschner et al. 2003)."""
    return (x * 73856093 ^ y * 19349663 ^ z * 83492791) & (BUCKETS - 1)


_bucket_at = kernel(bucket_of)


def near_variance(position: Array, normal: Array, lights: Array, clamp: Clamp | None) -> Array:
    """Return q (n,), (W/m^2)^2 summed over channels, at receivers (3, n) of packed diffuse lights (9, M + 1)."""
    found = np.zeros(position.shape[1])
    if lights.shape[1] > 1:
        _sum_squares(position, normal, lights, clamp, light_cells(lights), found)
    return found


@kernel(parallel=True)
def _sum_squares(
    position: Array, normal: Array, lights: Array, clamp: Clamp | None, cells: LightCells, found: Array
) -> None:
    for chunk in prange((len(found) + CHUNK - 1) // CHUNK):
        for i in range(chunk * CHUNK, min(chunk * CHUNK + CHUNK, len(found))):
            receiver = (position[0, i], position[1, i], position[2, i], normal[0, i], normal[1, i], normal[2, i])
            x = math.floor((receiver[0] - cells.low[0]) / cells.side - 0.5)
            y = math.floor((receiver[1] - cells.low[1]) / cells.side - 0.5)
            z = math.floor((receiver[2] - cells.low[2]) / cells.side - 0.5)
            for corner in range(8):
                bucket = _bucket_at(x + (corner & 1), y + (corner >> 1 & 1), z + (corner >> 2))
                for at in range(cells.starts[bucket], cells.starts[bucket + 1]):
                    k = cells.order[at]
                    light = load_light(lights, k)
                    g = np.float64(pair_term(light, receiver, limits_of(clamp, k)))
                    found[i] += (g * light[6]) ** 2 + (g * light[7]) ** 2 + (g * light[8]) ** 2
