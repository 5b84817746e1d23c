"""Visibility of samples by a bitmask of angles on the depth map (after Therrien et al. 2023).

From a receiver the picture is marched in slices, nearest samples first. The surface at a sample extends from its point
away from the eye by a thickness, and occludes the sectors of elevation whose middle it covers (`slices`).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.sssil.crown import level_factor
from refgi.sssil.form_factor import SampleForm, disc_texels, form_factor, form_of, length_scale
from refgi.sssil.pattern import chosen_radius, level_key, pixel_key, row_key
from refgi.sssil.settings import Bitmask, HssilSettings
from refgi.sssil.slices import (
    AREA,
    INVERSE,
    PLANES,
    L,
    N,
    SliceCounts,
    direction,
    fill_slices,
    heights,
    pack,
    sector_mask,
    slice_counts,
    slice_offsets,
    turn_of,
    visibility,
)
from refgi.sssil.view import Level
from refgi.stages import stage, tally
from refgi.types import Array


class Marched(NamedTuple):
    """A level to be marched, its lengths scaled; see `_packed`."""

    receiving: Array
    sending: Array  # senders and occluders
    thickness: Any  # of surfaces, in the dtype of the level
    form: SampleForm


PART, TOTAL, HIGHEST, SCRATCH = 0, 6, 9, 10  # lines of scratch: two slices' sums, all sums, largest q so far


@stage("sssil.bitmask")
def bitmask_gather(
    level: Level, index: int, settings: HssilSettings, diagonal: float, senders: Level | None = None
) -> Array:
    """Sum the light of the samples around each texel of a level, times their visibility by a bitmask of the depth map.

    level: Receivers, and senders unless those are given.
    index: 0 for the first level, whose inner disc is sampled as well.
    diagonal: Diagonal of the scene, m.
    senders: The same level with other surface points, as senders and occluders.
    -> (3, h, w): Irradiance, W/m^2, in the dtype of the level. Excludes albedo/pi.

    Raises
    ------
    InputError
        If `visibility` is no bitmask.
    """
    sampling, bitmask = settings.sampling, settings.visibility
    expect(isinstance(bitmask, Bitmask), "visibility", "bitmask", bitmask)
    assert isinstance(bitmask, Bitmask)
    rows, columns = level.shape
    steps = slice_counts(sampling, bitmask, index, chosen_radius((rows << index, columns << index), sampling))
    real = level.position.dtype.type
    scale = length_scale(level.depth)
    phases = sampling.tile if sampling.pattern == "interleaved" else 1
    packed = _packed(level, scale, phases)
    sending = packed if senders is None or senders is level else _packed(senders, scale, phases)
    marched = Marched(packed, sending, real(bitmask.thickness * diagonal * scale), form_of(settings.senders))
    factor = real(level_factor(index, settings))
    result = np.empty_like(level.radiance)
    tally("pairs", lambda: rows * columns * steps.slices * (steps.disc + steps.crown))
    if sampling.pattern == "pixel":
        key = level_key(sampling.seed, level.number)
        _march_pixels(marched, steps, key, factor, result)
    else:
        offsets, weight = slice_offsets(sampling, steps, level.number, rows)
        _march_rows(marched, offsets, weight, factor, result)
    return result


def _packed(level: Level, scale: float, phases: int) -> Array:
    """Return a level's texels with scaled lengths, (rows, PLANES, columns): columns of one phase, then of the next."""
    packed = np.zeros((level.shape[0], PLANES, phases * -(-level.shape[1] // phases)), level.position.dtype)
    pack(level.position, level.normal, level.radiance, level.area, level.position.dtype.type(scale), phases, packed)
    return packed


@kernel(parallel=True)
def _march_rows(marched: Marched, offsets: Array, weight: Array, factor: Any, result: Array) -> None:
    packed = marched.receiving
    for prow in prange(packed.shape[0]):
        row = np.int64(prow)
        lines, mask = np.zeros((SCRATCH, packed.shape[2]), packed.dtype), np.zeros(packed.shape[2], np.uint32)
        shared = row % offsets.shape[0]
        for k in range(offsets.shape[2]):
            mask[:] = np.uint32(0)
            lines[HIGHEST, :] = packed.dtype.type(0.0)
            for phase in range(offsets.shape[1]):
                _march_phase(marched, row, phase, offsets.shape[1], result.shape[2], offsets[shared, phase, k],
                             weight[shared, phase, k], lines, mask, k % 2)
            if k % 2 == 1 or k + 1 == offsets.shape[2]:
                _join(lines)
        _store(packed, row, offsets.shape[1], lines, factor, result)


@kernel
def _march_phase(marched: Marched, row: Any, phase: int, phases: int, columns: int, offsets: Array, weight: Array,
                 lines: Array, mask: Array, half: int) -> None:
    """March one slice for the receivers of a row and phase, which are the SIMD lanes."""
    packed, sending, thickness, form = marched
    rows, lanes = packed.shape[0], packed.shape[2] // phases
    receiver, part, real = packed[row], np.uint64(PART + 3 * half), packed.dtype.type
    receivers = (columns - phase + phases - 1) // phases
    for j in range(offsets.shape[0]):
        ox, oy = np.int64(offsets[j, 0]), np.int64(offsets[j, 1])
        of = (phase + ox) % phases
        by = (phase + ox - of) // phases  # lanes to the right
        low: Any = max(0, -by)
        size = min(receivers, (columns - of + phases - 1) // phases - by) - low
        if row + oy < 0 or row + oy >= rows or size <= 0 or (ox == 0 and oy == 0):
            continue
        sender, first, second = sending[row + oy], np.uint64(phase * lanes + low), np.uint64(of * lanes + low + by)
        if weight[j] > 0.0:
            _add_sample(receiver, first, sender, second, np.uint64(size), real(weight[j]),
                        real(disc_texels(weight[j], form)), thickness, lines, mask, part)
        else:
            _add_occluder(receiver, first, sender, second, np.uint64(size), thickness, lines, mask)


@kernel
def _add_sample(receiver: Array, first: Any, sender: Array, second: Any, size: Any, weight: Any, disc: Any,
           thickness: Any, lines: Array, mask: Array, part: Any) -> None:
    """Add the light of one sample to each receiver of a row, and its occlusion to the masks."""
    for i in range(size):
        p, q = first + i, second + i
        dx, dy, dz, c = direction(receiver, p, sender, q)
        square = dx * dx + dy * dy + dz * dz
        front, back = heights(receiver, p, sender, q, dx, dy, dz, c, thickness)
        g = visibility(front, lines[HIGHEST, p], mask[p]) * _transfer(sender, q, dx, dy, dz, c, square, weight, disc)
        lines[part, p] = lines[part, p] + g * sender[L, q]
        lines[part + np.uint64(1), p] = lines[part + np.uint64(1), p] + g * sender[L + 1, q]
        lines[part + np.uint64(2), p] = lines[part + np.uint64(2), p] + g * sender[L + 2, q]
        lines[HIGHEST, p] = front if front > lines[HIGHEST, p] else lines[HIGHEST, p]
        mask[p] = mask[p] | sector_mask(back, front)


@kernel
def _add_occluder(receiver: Array, first: Any, sender: Array, second: Any, size: Any, thickness: Any, lines: Array,
           mask: Array) -> None:
    """Add the occlusion of one sample to the masks of a row of receivers."""
    for i in range(size):
        p, q = first + i, second + i
        dx, dy, dz, c = direction(receiver, p, sender, q)
        front, back = heights(receiver, p, sender, q, dx, dy, dz, c, thickness)
        lines[HIGHEST, p] = front if front > lines[HIGHEST, p] else lines[HIGHEST, p]
        mask[p] = mask[p] | sector_mask(back, front)


@kernel
def _transfer(sender: Array, q: Any, dx: Any, dy: Any, dz: Any, c: Any, square: Any, weight: Any,
              disc: Any) -> Any:
    """Return pi times the form factor of a sample that stands for `weight` texels, its disc for `disc`."""
    real = type(dx)
    zero = real(0.0)
    s = -(sender[N, q] * dx + sender[N + 1, q] * dy + sender[N + 2, q] * dz)
    s = s if s > zero else zero
    return form_factor(real(math.pi) * (c if c > zero else zero), s * (sender[AREA, q] * weight),
                       s * (sender[AREA, q] * disc), square)


@kernel
def _join(lines: Array) -> None:
    """Add the sums of two slices to each other and to the total: mirror images give mirror images to the bit."""
    for c in range(3):
        for i in range(np.uint64(lines.shape[1])):
            lines[TOTAL + c, i] = lines[TOTAL + c, i] + (lines[PART + c, i] + lines[PART + 3 + c, i])
    lines[PART : PART + 6] = lines.dtype.type(0.0)


@kernel
def _store(packed: Array, row: Any, phases: int, lines: Array, factor: Any, result: Array) -> None:
    zero, lanes = packed.dtype.type(0.0), packed.shape[2] // phases
    for c in range(3):
        for phase in range(phases):
            for lane in range(np.uint64((result.shape[2] - phase + phases - 1) // phases)):
                i, column = np.uint64(phase * lanes) + lane, np.uint64(phase) + np.uint64(phases) * lane
                result[c, row, column] = factor * lines[TOTAL + c, i] if packed[row, INVERSE, i] > zero else zero


@kernel(parallel=True)
def _march_pixels(marched: Marched, steps: SliceCounts, key: Any, factor: Any, result: Array) -> None:
    packed = marched.receiving
    for prow in prange(packed.shape[0]):
        row = np.int64(prow)
        count = steps.disc + steps.crown + steps.occluders
        offsets, length = np.empty((steps.slices, count, 2), np.int32), np.empty(count)
        weight = np.empty((steps.slices, count))
        lines, mask = np.zeros((SCRATCH, packed.shape[2]), packed.dtype), np.zeros(packed.shape[2], np.uint32)
        for column in range(packed.shape[2]):
            turn, shift = turn_of(pixel_key(row_key(key, row), column))
            fill_slices(steps, turn, shift, False, length, offsets, weight)
            for k in range(steps.slices):
                _march_pixel(marched, row, column, offsets[k], weight[k], lines, mask)
        _join(lines)
        _store(packed, row, 1, lines, factor, result)


@kernel
def _march_pixel(marched: Marched, row: Any, column: Any, offsets: Array, weight: Array, lines: Array,
                 mask: Array) -> None:
    packed, sending, thickness, form = marched
    rows, columns = packed.shape[0], packed.shape[2]
    receiver, part, one, p = packed[row], np.uint64(PART), np.uint64(1), np.uint64(column)
    real = packed.dtype.type
    mask[p], lines[HIGHEST, p] = np.uint32(0), packed.dtype.type(0.0)
    for j in range(offsets.shape[0]):
        a, b = row + np.int64(offsets[j, 1]), column + np.int64(offsets[j, 0])
        if a < 0 or a >= rows or b < 0 or b >= columns or (a == row and b == column):
            continue
        if weight[j] > 0.0:
            disc = real(disc_texels(weight[j], form))
            _add_sample(receiver, p, sending[a], np.uint64(b), one, real(weight[j]), disc, thickness, lines, mask, part)
        else:
            _add_occluder(receiver, p, sending[a], np.uint64(b), one, thickness, lines, mask)
