"""Packing of a level's texels as senders, for the sum over samples.

The columns of a level are split into phases, column x into phase x modulo P, and those of one phase are adjacent:
receivers that share samples are the SIMD lanes, and what they read is contiguous. Padding of zero radiance surrounds
the columns, and one row of it follows the last, so that samples outside the picture need no test.

Lengths are scaled by a power of two, so that fourth powers of distances stay within float32.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.rsm.pool import plane
from refgi.sssil.pyramid.view import Level

Array = npt.NDArray[Any]

BLOCK = 8  # lanes that are known to be dark together, and that padding and sums come in
PLANES = 9  # position, m = -normal area / pi, radiance


class Emitters(NamedTuple):
    """Texels of a level, packed for sums over samples."""

    packed: Array  # (PLANES (h + 1) phases line,) by row, plane, phase and lane; the last row is dark
    emit_from: Array  # (h + 1, phases, line / BLOCK + 1) int32: lane of the first emitting block from this one on
    emit_to: Array  # likewise: lane behind the last emitting block before this one
    phases: int  # P
    line: int  # lanes of a phase, with those around
    pad: int  # lanes before the first column
    strip: int  # lanes that are summed at once
    scale: float  # power of two that lengths were multiplied by


def pack(level: Level, phases: int, farthest: int, most_lanes: int) -> Emitters:
    """Pack the texels of a level, in its dtype, for sums over samples.

    Columns are split into `phases` P, a power of two; `farthest` is the largest distance of a sample, columns;
    `most_lanes` how many may be summed at once, a multiple of BLOCK.
    """
    rows, columns = level.shape
    lanes = -(-columns // phases)
    strips = -(-lanes // most_lanes)
    strip = -(-lanes // (strips * BLOCK)) * BLOCK
    pad = -(-(min(farthest, columns) // phases + 1) // BLOCK) * BLOCK
    line = 2 * pad + strips * strip
    packed = plane((PLANES * (rows + 1) * phases * line,), level.position.dtype)
    emit_from, emit_to = np.empty((2, rows + 1, phases, line // BLOCK + 1), np.int32)
    scale = length_scale(level.depth)
    real = level.position.dtype.type
    _pack(level.position, level.normal, level.radiance, level.area, phases, line, pad, real(scale),
          real(scale * scale / math.pi), packed, emit_from, emit_to)
    return Emitters(packed, emit_from, emit_to, phases, line, pad, strip, scale)


def dark_ends(emitters: Emitters) -> tuple[int, int]:
    """Return how many lanes of all rows lie before the first emitting block of a row or after its last."""
    first = np.maximum(emitters.emit_from[:-1, :, 0], emitters.pad)
    last = np.minimum(emitters.emit_to[:-1, :, -1], emitters.line - emitters.pad)
    total = first.size * (emitters.line - 2 * emitters.pad)
    return total - int(np.maximum(last - first, 0).sum()), total


def length_scale(depth: Array) -> float:
    """Return the power of two that scales the geometric middle of the depths' range to about 1.

    Depths (h, w) are in m, inf where there is no surface; 1 where none is visible.
    """
    some = depth[(depth > 0) & (depth < np.inf)]
    if not some.size:
        return 1.0
    return 2.0 ** -round((math.log2(float(some.min())) + math.log2(float(some.max()))) / 2)


@kernel(parallel=True)
def _pack(
    position: Array, normal: Array, radiance: Array, area: Array, phases: int, line: int, pad: int, scale: Any,
    share: Any, packed: Array, emit_from: Array, emit_to: Array,
) -> None:
    for row in prange(area.shape[0] + 1):
        _pack_row(position, normal, radiance, area, np.int64(row), phases, line, pad, scale, share, packed, emit_from,
                  emit_to)


@kernel
def _pack_row(
    position: Array, normal: Array, radiance: Array, area: Array, row: Any, phases: int, line: int, pad: int,
    scale: Any, share: Any, packed: Array, emit_from: Array, emit_to: Array,
) -> None:
    start, step = row * PLANES * phases * line, phases * line
    for phase in range(phases):
        lanes = 0
        if row < area.shape[0]:
            lanes = (area.shape[1] - phase + phases - 1) // phases
            _pack_line(position, normal, radiance, area, row, phase, phases, start + phase * line + pad, step, scale,
                       share, packed)
        for k in range(PLANES):
            line_start = start + (k * phases + phase) * line
            _clear_lanes(packed, line_start, line_start + pad)
            _clear_lanes(packed, line_start + pad + lanes, line_start + line)
        _find_emitting(packed, start + phase * line, step, row, phase, emit_from, emit_to)


@kernel
def _clear_lanes(packed: Array, first: Any, last: Any) -> None:
    zero = packed.dtype.type(0.0)
    for i in range(np.uint64(first), np.uint64(last)):
        packed[i] = zero


@kernel
def _pack_line(
    position: Array, normal: Array, radiance: Array, area: Array, row: Any, phase: int, phases: int, first: Any,
    step: int, scale: Any, share: Any, packed: Array,
) -> None:
    lanes = np.uint64(max(0, (area.shape[1] - phase + phases - 1) // phases))
    y, x, to, by = np.uint64(row), np.uint64(phase), np.uint64(first), np.uint64(step)
    every = np.uint64(phases)
    for c in range(3):
        p, m, r = to + np.uint64(c) * by, to + np.uint64(c + 3) * by, to + np.uint64(c + 6) * by
        if phases > 1:
            for i in range(lanes):
                packed[p + i] = position[c, y, x + every * i] * scale
            for i in range(lanes):
                packed[m + i] = -normal[c, y, x + every * i] * (area[y, x + every * i] * share)
            for i in range(lanes):
                packed[r + i] = radiance[c, y, x + every * i]
        else:
            for i in range(lanes):
                packed[p + i] = position[c, y, i] * scale
            for i in range(lanes):
                packed[m + i] = -normal[c, y, i] * (area[y, i] * share)
            for i in range(lanes):
                packed[r + i] = radiance[c, y, i]


@kernel
def _find_emitting(
    packed: Array, first: Any, step: int, row: Any, phase: int, emit_from: Array, emit_to: Array
) -> None:
    """Find the blocks of a line that hold any radiance: the next from each on, and the last before it."""
    blocks = emit_to.shape[2] - 1
    emit_to[row, phase, 0], emit_from[row, phase, blocks] = 0, blocks * BLOCK
    for block in range(blocks):
        emits = _emits(packed, first + 6 * step + block * BLOCK, step)
        emit_to[row, phase, block + 1] = (block + 1) * BLOCK if emits else emit_to[row, phase, block]
    for block in range(blocks - 1, -1, -1):
        emits = emit_to[row, phase, block + 1] == (block + 1) * BLOCK
        emit_from[row, phase, block] = block * BLOCK if emits else emit_from[row, phase, block + 1]


@kernel
def _emits(packed: Array, first: Any, step: int) -> bool:
    zero = packed.dtype.type(0.0)
    for c in range(3):
        line_start = np.uint64(first + c * step)
        for i in range(np.uint64(BLOCK)):
            if packed[line_start + i] > zero:
                return True
    return False
