"""Offsets of the samples of a visibility bitmask, in slices: directions of the picture marched from a receiver.

A slice holds the samples of its share of crown and disc, and occluders: samples of weight 0 that only occlude. Offsets
are whole texels (ox, oy) as in `crown.pattern`, nearest first.

With interleaved samples each texel of a tile turns its slices and shifts the samples along them by another point of one
sequence of low discrepancy; with other patterns all receivers of a row share both.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.sampling import FIRST_STEP, SECOND_STEP, hash_bits
from refgi.sssil.crown.points import distance, level_key, relative_weight, row_key
from refgi.sssil.settings import Bitmask, SamplingSettings

Array = npt.NDArray[Any]

GOLDEN = 0.6180339887498949  # turns the samples of one slice against those of the next
TO_UNIT = 2.0**-32


class SliceCounts(NamedTuple):
    """Numbers of samples of a slice."""

    slices: int
    disc: int  # samples of each slice in the inner disc
    crown: int  # and in the crown
    occluders: int  # and in the inner disc to block alone
    radius: float  # of the crown, texels
    uniform: bool  # density

    @property
    def per_slice(self) -> int:
        """Samples of a slice."""
        return self.disc + self.crown + self.occluders


def slice_counts(sampling: SamplingSettings, bitmask: Bitmask, index: int, radius: float) -> SliceCounts:
    """Return how densely the slices of a level are sampled, with half as many occluders as the crown has samples.

    Samples of crown and, at index 0, disc are distributed over slices, at least one a slice; `radius` is the crown's
    inner one, texels.
    """
    slices = bitmask.count(sampling.samples)
    inner, outer = sampling.counts(index)
    crown = max(1, round(outer / slices))
    disc = max(1, round(inner / slices)) if inner else 0
    return SliceCounts(slices, disc, crown, (crown + 1) // 2, radius, sampling.density == "uniform")


def slice_offsets(sampling: SamplingSettings, steps: SliceCounts, number: int, rows: int) -> tuple[Array, Array]:
    """Return the samples that receivers share, slice by slice; `steps` are of `slice_counts`.

    Offsets (m, P, slices, n, 2) int32 are texels (ox, oy) from the receiver at (x, y), at [y mod m, x mod P], nearest
    first: (tile, tile, ...) with "interleaved", (1, 1, ...) with "fixed", where each slice with an even index is
    followed by its mirror image, an odd last one is vertical, else (rows, 1, ...). Weights (m, P, slices, n) float64
    are the texels of the level that each sample stands for; 0 for a blocker.
    """
    fixed, tiled, key = sampling.pattern == "fixed", sampling.pattern == "interleaved", level_key(sampling.seed, number)
    tile = (sampling.tile, sampling.tile) if tiled else (1 if fixed else rows, 1)
    offsets = np.empty((*tile, steps.slices, steps.per_slice, 2), np.int32)
    weight = np.empty(offsets.shape[:-1])
    _fill_tile(steps, key, fixed, tiled, offsets, weight)
    return offsets, weight


@kernel(parallel=True)
def _fill_tile(steps: SliceCounts, key: Any, fixed: bool, tiled: bool, offsets: Array, weight: Array) -> None:
    for row in prange(offsets.shape[0]):
        length = np.empty(offsets.shape[3])
        for column in range(offsets.shape[1]):
            turn, shift = turn_of(key if fixed or tiled else row_key(key, np.int64(row)))
            if tiled:
                n = np.int64(row) * offsets.shape[1] + column
                turn, shift = (turn + n * SECOND_STEP) % 1.0, (shift + n * FIRST_STEP) % 1.0
            fill_slices(steps, turn, shift, fixed, length, offsets[row, column], weight[row, column])


@kernel
def turn_of(key: Any) -> Any:
    """Return the turn of slices, a share of the angle between two, and the shift of samples along them by a key."""
    return hash_bits(key) * TO_UNIT, hash_bits(key ^ np.uint32(0x27D4EB2F)) * TO_UNIT


@kernel
def fill_slices(
    steps: SliceCounts, turn: float, shift: float, mirrored: bool, length: Array, offsets: Array, weight: Array
) -> None:
    """Write the samples around one receiver: `offsets` (slices, n, 2) and `weight` (slices, n).

    `turn` and `shift` are of `turn_of`; `mirrored`: slices come in pairs of mirror images; `length` (n,) is scratch.
    """
    pairs = steps.slices // 2
    for k in range(steps.slices):
        part = (shift + (k // 2 if mirrored else k) * GOLDEN) % 1.0
        _fill_lengths(steps, part, length, weight[k])
        angle = 2.0 * math.pi * (k + turn) / steps.slices
        if mirrored:  # from the vertical; an odd slice lies on it
            angle = 2.0 * math.pi * (k // 2 + (1.0 if steps.slices % 2 else 0.5)) / steps.slices
            angle = 0.0 if k == 2 * pairs else angle
        right, down = math.sin(angle), math.cos(angle)
        side = -1 if mirrored and k % 2 == 1 else 1
        for j in range(length.size):
            offsets[k, j, 0] = side * np.int64(math.floor(length[j] * right + 0.5))
            offsets[k, j, 1] = np.int64(math.floor(length[j] * down + 0.5))


@kernel
def _fill_lengths(steps: SliceCounts, shift: float, length: Array, weight: Array) -> None:
    """Write the distances of a slice's samples from the receiver, rising, and the number of texels each stands for."""
    share = math.pi * steps.radius**2 / steps.slices
    filled = 0
    for j in range(steps.occluders):
        filled = _insert(steps.radius * (j + shift) / steps.occluders, 0.0, filled, length, weight)
    for j in range(steps.disc):
        far = distance((j + shift) / steps.disc, 0.0, steps.radius, steps.uniform)
        stands_for = share / steps.disc * relative_weight(far, 0.0, steps.radius, steps.uniform)
        filled = _insert(far, stands_for, filled, length, weight)
    for j in range(steps.crown):
        far = distance((j + shift) / steps.crown, 1.0, steps.radius, steps.uniform)
        stands_for = 3.0 * share / steps.crown * relative_weight(far, 1.0, steps.radius, steps.uniform)
        filled = _insert(far, stands_for, filled, length, weight)


@kernel
def _insert(far: float, stands_for: float, filled: int, length: Array, weight: Array) -> int:
    place = filled
    while place > 0 and length[place - 1] > far:
        length[place], weight[place] = length[place - 1], weight[place - 1]
        place -= 1
    length[place], weight[place] = far, stands_for
    return filled + 1
