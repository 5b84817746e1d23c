"""Sum over the samples around every texel of a level (Sec. 3.1, Eq. 1; Sec. 3.2, indirect lighting shader).

Threads take strips of a level so narrow that what their samples read stays in the cache of a core. Receivers at either
end of a strip whose samples have no radiance are skipped, which changes no bit of a sum; a sample that is dark for a
whole strip is not listed, which changes the rounding.
"""

import math
from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.rsm.pool import plane
from refgi.skips import left_out
from refgi.sssil.form_factor import (
    BLOCK,
    DISC,
    PLANES,
    ROWS,
    TEXEL,
    WIDE,
    Emitters,
    SampleForm,
    add_two,
    close_group,
    dark_ends,
    disc_texels,
    form_of,
    pack,
)
from refgi.sssil.pattern import (
    PixelSamples,
    chosen_radius,
    pixel_key,
    pixel_samples,
    row_key,
    shared_offsets,
    shift_of,
    shifted,
)
from refgi.sssil.settings import HssilSettings
from refgi.sssil.view import Level
from refgi.stages import stage, tally
from refgi.types import Array

BAND = 4  # rows that a thread takes at once
GROUP = 256  # samples that are summed before they are added to the total


@stage("sssil.gather", steps="refgi.sssil.crown_steps.gather_steps")
def gather(level: Level, index: int, settings: HssilSettings, senders: Level | None = None) -> Array:
    """Sum the light of the samples around each texel of a level (Eq. 1).

    level: Receivers, and senders unless those are given.
    index: 0 for the first level, whose inner disc is sampled as well.
    senders: The same level with other surface points, as senders.
    -> (3, h, w): Irradiance, W/m^2, in the dtype of the level. Excludes albedo/pi and visibility.
    """
    rows, columns = level.shape
    sampling, senders = settings.sampling, level if senders is None else senders
    radius = chosen_radius((rows << index, columns << index), sampling)
    factor, form = math.pi * level_factor(index, settings), form_of(settings.senders)
    if sampling.pattern == "pixel":
        own = pixel_samples(sampling, index, level.number, radius)
        tally("pairs", lambda: rows * columns * own.weight.size)
        emitters = pack(senders, 1, math.ceil(2 * radius), WIDE)
        result = plane(level.radiance.shape, level.radiance.dtype)
        _gather_per_pixel(emitters, level.position, level.normal, own, form, level.position.dtype.type(factor), result)
        return result
    offsets, weight = _reaching(*shared_offsets(sampling, index, level.number, rows, radius, columns), rows, columns)
    tally("pairs", lambda: rows * columns * offsets.shape[2])
    return sum_of_samples(level, senders, offsets, weight, math.ceil(2 * radius), form, factor,
                          paired=sampling.pattern in ("fixed", "all"))


def sum_of_samples(
    level: Level, senders: Level, offsets: Array, weight: Array, farthest: int, form: SampleForm, factor: float, *,
    paired: bool = False,
) -> Array:
    """Return `factor` / pi times the irradiance of texels by samples as of `shared_offsets`, `farthest` at most.

    `paired`: mirror images follow each other.
    """
    result = plane(level.radiance.shape, level.radiance.dtype)
    emitters = pack(senders, offsets.shape[1], farthest, WIDE)
    trims = left_out("sssil.senders", lambda: dark_ends(emitters))
    _gather_shared(emitters, level.position, level.normal, offsets, weight, paired, trims, form,
                   level.position.dtype.type(factor), result)
    return result


def _reaching(offsets: Array, weight: Array, rows: int, columns: int) -> tuple[Array, Array]:
    """Return the samples without those that reach no texel from anywhere, where all receivers share one set."""
    if offsets.shape[:2] != (1, 1):
        return offsets, weight
    within = (np.abs(offsets[0, 0]) < (columns, rows)).all(axis=1)
    return offsets[:, :, within], weight[:, :, within]


def level_factor(index: int, settings: HssilSettings) -> float:
    """Return the factor of a level's sum: 1 / pi where Eq. 4 lacks its pi, 4^k where areas are scaled twice."""
    factor = 1.0
    if "hss_disc_pi" in settings.as_published and settings.senders.form_factor != "point":
        factor /= math.pi
    if "hss_level_factor" in settings.as_published:
        factor *= 4.0**index
    return factor


@kernel(parallel=True)
def _gather_shared(
    emitters: Emitters, position: Array, normal: Array, offsets: Array, weight: Array, paired: bool, trims: bool,
    form: SampleForm, factor: Any, result: Array,
) -> None:
    rows, packed = normal.shape[1], emitters.packed
    scale = packed.dtype.type(emitters.scale)
    phases, strip, line, pad = emitters.phases, emitters.strip, emitters.line, emitters.pad
    strips, bands = (line - 2 * pad) // strip, (rows + BAND - 1) // BAND
    for task in prange(strips * bands):
        left, top = np.int64(task) // bands * strip, np.int64(task) % bands * BAND
        tile = np.empty(ROWS * WIDE, packed.dtype)
        starts, weights = np.empty((3, weight.shape[2] + 1), np.int64), np.empty((2, weight.shape[2] + 1), packed.dtype)
        for row in range(top, min(rows, top + BAND)):
            shared = row % offsets.shape[0]
            for phase in range(phases):
                _load(tile, strip, position, normal, scale, row, phase + phases * left, phases)
                stands_for = weight[shared % weight.shape[0], phase % weight.shape[1]]
                count = _list_emitting(emitters, offsets[shared, phase], stands_for, paired, trims, form, row, phase,
                                       left, starts, weights)
                for j in range(0, count, 2):
                    low = min(starts[1, j], starts[1, j + 1]) // BLOCK * BLOCK
                    lanes = (max(starts[2, j], starts[2, j + 1]) - low + BLOCK - 1) // BLOCK * BLOCK
                    add_two(tile, low, lanes, packed, phases * line, starts[0, j], weights[0, j], weights[1, j],
                            starts[0, j + 1], weights[0, j + 1], weights[1, j + 1])
                    if (j + 2) % GROUP == 0:
                        close_group(tile, strip)
                close_group(tile, strip)
                _store(tile, strip, factor, row, phase + phases * left, phases, result)


@kernel
def _load(
    tile: Array, lanes: int, position: Array, normal: Array, scale: Any, row: int, column: int, phases: int
) -> None:
    """Copy the receivers of a strip into a tile, lengths times `scale`, and clear its sums."""
    zero = tile.dtype.type(0.0)
    y, x, by = np.uint64(row), np.uint64(column), np.uint64(phases)
    inside = np.uint64(max(0, min(lanes, (normal.shape[2] - column + phases - 1) // phases)))
    for c in range(3):
        to = np.uint64(c * WIDE)
        for i in range(np.uint64(lanes)):
            tile[to + i] = zero
        for i in range(inside):
            tile[to + i] = position[c, y, x + by * i] * scale
        to = np.uint64((c + 3) * WIDE)
        for i in range(np.uint64(lanes)):
            tile[to + i] = zero
        for i in range(inside):
            tile[to + i] = normal[c, y, x + by * i]
    for c in range(6, ROWS):
        to = np.uint64(c * WIDE)
        for i in range(np.uint64(lanes)):
            tile[to + i] = zero


@kernel
def _list_emitting(
    emitters: Emitters, offsets: Array, weight: Array, paired: bool, trims: bool, form: SampleForm, row: int,
    phase: int, left: int, starts: Array, weights: Array,
) -> int:
    """List the places of a strip's samples that emit, and the lanes for which they do; all lanes unless it `trims`.

    In pairs where samples are paired; one without radiance stands in for a missing partner. `weights` gets the texels
    that samples stand for, and those of their discs.
    """
    emit_from, emit_to, lanes, line = emitters.emit_from, emitters.emit_to, emitters.strip, emitters.line
    rows, phases, first = emit_to.shape[0] - 1, emit_to.shape[1], emitters.pad + left
    black = rows * PLANES * phases * line
    start, low, high = starts[0], starts[1], starts[2]
    power = 0
    while 1 << power < phases:
        power += 1
    count, emitting_in_pair = 0, 0
    for j in range(weight.size):
        a, column = row + np.int64(offsets[j, 1]), phase + np.int64(offsets[j, 0])
        of, lane = column & (phases - 1), first + (column >> power)
        start[count], low[count], high[count] = black, lanes, 0
        weights[0, count], weights[1, count] = weight[j], disc_texels(weight[j], form)
        inside = 0 <= a < rows and lane >= 0 and lane + lanes <= line
        if inside and not (offsets[j, 0] == 0 and offsets[j, 1] == 0):
            start[count] = (a * PLANES * phases + of) * line + lane
            block, last = np.uint64(lane) // np.uint64(BLOCK), np.uint64(lane + lanes - 1) // np.uint64(BLOCK)
            low[count] = max(0, emit_from[a, of, block] - lane)
            high[count] = min(lanes, emit_to[a, of, last + np.uint64(1)] - lane)
        emits = low[count] < high[count]
        if emits and not trims:
            low[count], high[count] = 0, lanes
        count += 1 if emits or paired else 0
        emitting_in_pair += 1 if emits else 0
        if paired and j % 2 == 1 and emitting_in_pair == 0:
            count -= 2
        emitting_in_pair = emitting_in_pair if j % 2 == 0 else 0
    start[count], low[count], high[count], weights[0, count], weights[1, count] = black, lanes, 0, 0.0, 0.0
    return count


@kernel
def _store(tile: Array, lanes: int, factor: Any, row: int, column: int, phases: int, result: Array) -> None:
    y, x, by = np.uint64(row), np.uint64(column), np.uint64(phases)
    inside = np.uint64(max(0, min(lanes, (result.shape[2] - column + phases - 1) // phases)))
    for c in range(3):
        total = np.uint64((c + 9) * WIDE)
        for i in range(inside):
            result[c, y, x + by * i] = factor * tile[total + i]


@kernel(parallel=True)
def _gather_per_pixel(
    emitters: Emitters, position: Array, normal: Array, own: PixelSamples, form: SampleForm, factor: Any,
    result: Array,
) -> None:
    rows, weight = normal.shape[1], own.weight
    packed, line, pad, strip = emitters.packed, emitters.line, emitters.pad, emitters.strip
    scale = packed.dtype.type(emitters.scale)
    strips, bands = (line - 2 * pad) // strip, (rows + BAND - 1) // BAND
    for task in prange(strips * bands):
        left, top = np.int64(task) // bands * strip, np.int64(task) % bands * BAND
        tile, shifts = np.empty(ROWS * WIDE, packed.dtype), np.empty((3, WIDE))
        lines, real = np.empty(2 * PLANES * WIDE, packed.dtype), packed.dtype.type
        for row in range(top, min(rows, top + BAND)):
            first = row * PLANES * line + pad + left
            _load(tile, strip, position, normal, scale, row, left, 1)
            for i in range(strip):
                shifts[0, i], shifts[1, i], shifts[2, i] = shift_of(pixel_key(row_key(own.key, row), left + i), 0)
            for j in range(0, weight.size, 2):
                k = min(j + 1, weight.size - 1)
                one = _expand(emitters, first, row, own, j, form, shifts, lines, 0)
                two = _expand(emitters, first, row, own, k, form, shifts, lines, PLANES * WIDE)
                second = real(weight[k] if k > j else 0.0)
                add_two(tile, 0, strip, lines, WIDE, 0, real(weight[j]), one, PLANES * WIDE, second, two)
                if (j + 2) % GROUP == 0:
                    close_group(tile, strip)
            close_group(tile, strip)
            _store(tile, strip, factor, row, left, 1, result)


@kernel
def _expand(
    emitters: Emitters, first: int, row: int, own: PixelSamples, j: int, form: SampleForm, shifts: Array, lines: Array,
    to: int,
) -> Any:
    """Copy the texels of one sample of each receiver of a strip into a line, with their relative weight.

    Areas are those of the disc over the texels returned; what the sample stands for besides is radiance.
    """
    packed, line, rows, weight = emitters.packed, emitters.line, emitters.emit_to.shape[0] - 1, own.weight[j]
    real, within = packed.dtype.type, 0.0 if j < own.inner else 1.0
    for i in range(np.uint64(emitters.strip)):
        ox, oy, relative = shifted(own.points, j, within, own.radius, own.uniform, shifts[0, i], shifts[1, i],
                                   shifts[2, i])
        stands_for = weight * relative
        # for the disc of all this is 1, to the bit
        covered = disc_texels(stands_for, form) / stands_for if form.kind == DISC and stands_for > 0.0 else 1.0
        area, radiance = relative * covered, 1.0 / covered
        if form.kind == TEXEL:
            area, radiance = 1.0, relative
        lane = first % line + np.int64(i) + ox
        inside = 0 <= row + oy < rows and 0 <= lane < line and not (ox == 0 and oy == 0)
        texel = np.uint64((row + oy) * PLANES * line + lane if inside else rows * PLANES * line)
        for c in range(PLANES):
            by = 1.0 if c < 3 else (area if c < 6 else radiance)
            lines[np.uint64(to + c * WIDE) + i] = packed[texel + np.uint64(c * line)] * real(by)
    return real(weight if form.kind == DISC else (1.0 if form.kind == TEXEL else 0.0))
