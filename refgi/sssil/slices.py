"""Slices of the picture marched from a receiver, and elevations of samples in 32 sectors (Therrien et al. 2023).

A slice holds samples of crown and disc, and occluders of weight 0, nearest first. Texels of an interleaved tile turn
and shift them by points of one sequence; else all receivers of a row share both. Elevations of front and back, in the
plane of eye, receiver and sample, count from the horizon on the sample's side over the normal in steps of ::

    q(a, b) = a / (a + |b|), 2 - that where b < 0, 0 where a < 0

for a along the normal and b along the horizon: 0.64 to 1.27 of equal angles, without an arctangent. Visibility is that
of the two sectors next to a sample, interpolated; 1 where it is as high as all before: no receding surface hides
itself.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.sampling import FIRST_STEP, SECOND_STEP, hash_bits
from refgi.sssil.form_factor import LEAST
from refgi.sssil.pattern import distance, level_key, relative_weight, row_key
from refgi.sssil.settings import Bitmask, SamplingSettings
from refgi.types import Array

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
    """Return how densely the slices of a level are sampled, with half as many occluders as the crown has samples."""
    slices = bitmask.count(sampling.samples)
    inner, outer = sampling.counts(index)
    crown = max(1, round(outer / slices))
    disc = max(1, round(inner / slices)) if inner else 0
    return SliceCounts(slices, disc, crown, (crown + 1) // 2, radius, sampling.density == "uniform")


def slice_offsets(sampling: SamplingSettings, steps: SliceCounts, number: int, rows: int) -> tuple[Array, Array]:
    """Return the samples that receivers share, slice by slice, nearest first: offsets (m, P, slices, n, 2) and weights.

    (m, P) is the tile with "interleaved", (1, 1) with "fixed", where a slice with an even index is followed by its
    mirror image and an odd last one is vertical, else (rows, 1). A weight is texels of the level, 0 for a blocker.
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
    """Write the samples around one receiver, (slices, n, 2) and weights; `mirrored`: in pairs; `length`: scratch."""
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


SECTORS = 32
# planes of a packed level; 1 / l, l, and the cosine of the direction to the eye against the normal
X, N, L, AREA, INVERSE, LENGTH, FACING, PLANES = 0, 3, 6, 9, 10, 11, 12, 13


@kernel(parallel=True)
def pack(
    position: Array, normal: Array, radiance: Array, area: Array, scale: Any, phases: int, packed: Array
) -> None:
    """Write the planes of a level row by row, columns by their phase; `INVERSE` is 0 where there is no surface."""
    zero, one, over_pi = scale - scale, scale / scale, scale * scale / type(scale)(math.pi)
    lanes = packed.shape[2] // phases
    for row in prange(area.shape[0]):
        for column in range(area.shape[1]):
            square, along, at = zero, zero, column % phases * lanes + column // phases
            for c in range(3):
                packed[row, X + c, at] = position[c, row, column] * scale
                packed[row, N + c, at] = normal[c, row, column]
                packed[row, L + c, at] = radiance[c, row, column]
                square += packed[row, X + c, at] * packed[row, X + c, at]
                along -= packed[row, X + c, at] * normal[c, row, column]
            packed[row, AREA, at] = area[row, column] * over_pi
            length = math.sqrt(square)
            packed[row, LENGTH, at] = length
            packed[row, INVERSE, at] = one / length if square > zero else zero
            packed[row, FACING, at] = along * packed[row, INVERSE, at]


@kernel
def direction(receiver: Array, p: Any, sender: Array, q: Any) -> Any:
    """Return d and n . d of a receiver and a sample."""
    dx = sender[X, q] - receiver[X, p]
    dy = sender[X + 1, q] - receiver[X + 1, p]
    dz = sender[X + 2, q] - receiver[X + 2, p]
    return dx, dy, dz, receiver[N, p] * dx + receiver[N + 1, p] * dy + receiver[N + 2, p] * dz


@kernel
def heights(receiver: Array, p: Any, sender: Array, q: Any, dx: Any, dy: Any, dz: Any, c: Any,
             thickness: Any) -> Any:
    """Return q of a sample's front and back, 0 to 2; both 0 where there is no surface."""
    zero = type(dx)(0.0)
    toward = receiver[X, p] * dx + receiver[X + 1, p] * dy + receiver[X + 2, p] * dz
    x = -toward * receiver[INVERSE, p]  # along the receiver's direction to the eye
    # |p x d| and not the root of d^2 - x^2, of which nothing is left where one of both is near the eye
    ax = receiver[X + 1, p] * dz - receiver[X + 2, p] * dy
    ay = receiver[X + 2, p] * dx - receiver[X, p] * dz
    az = receiver[X, p] * dy - receiver[X + 1, p] * dx
    y = math.sqrt(ax * ax + ay * ay + az * az) * receiver[INVERSE, p]
    # the back lies on the sample's ray from the eye: further by a share of all that grows along it
    share, length, facing = thickness * sender[INVERSE, q], receiver[LENGTH, p], receiver[FACING, p]
    front = _height(x, y, c, facing)
    back = _height(x + share * (x - length), y + share * y, c + share * (c - facing * length), facing)
    covered = sender[INVERSE, q] > zero
    return front if covered else zero, back if covered else zero


@kernel
def _height(x: Any, y: Any, c: Any, facing: Any) -> Any:
    """Return q of a direction with x to the eye, y across and c along the normal."""
    real = type(x)
    zero, least = real(0.0), real(LEAST)
    a = (c if c > zero else zero) * y
    b = facing * (x * x + y * y) - c * x  # both times y and the length of the normal within the slice
    below = a + abs(b)
    part = a / (below if below > least else least)
    beyond = (b < zero) & (a > zero)
    return real(2.0) - part if beyond else part


@kernel
def visibility(height: Any, highest: Any, mask: Any) -> Any:
    """Return the visibility of a sample, 0 to 1."""
    real, last = type(height), np.int32(SECTORS - 1)
    one = real(1.0)
    place = height * real(SECTORS // 2) + real(0.5)
    upper = np.int32(place)  # its middle is above the sample, that of the sector before it below
    share = place - real(upper)
    high, low = np.uint32(min(upper, last)), np.uint32(min(max(np.int32(upper - 1), np.int32(0)), last))
    bit_high, bit_low = np.uint32(mask >> high) & np.uint32(1), np.uint32(mask >> low) & np.uint32(1)
    free = one - (share * real(bit_high) + (one - share) * real(bit_low))
    return one if height >= highest else free


@kernel
def sector_mask(back: Any, front: Any) -> Any:
    """Return the sectors whose middles lie between the heights of back and front."""
    real = type(front)
    half, sectors = real(0.5), real(SECTORS // 2)
    return np.uint32(_bits_below(np.int32(front * sectors + half)) & ~_bits_below(np.int32(back * sectors + half)))


@kernel
def _bits_below(sector: Any) -> Any:
    """Return the bits of all sectors before one, 0 to 32 or more."""
    last = min(sector, np.int32(SECTORS))
    half = np.uint32(last >> 1) & np.uint32(31)  # no shift reaches 32 bits, which processors disagree about
    rest = np.uint32(np.uint32(last) - half) & np.uint32(31)
    return np.uint32(np.uint32(np.uint32(np.uint32(1) << half) << rest) - np.uint32(1))
