"""Form factor of a receiver and a sample (Sec. 3.1, Eq. 3 and 4), and texels laid out as senders for sums of it.

d from receiver to sample, |d| = r; m = -n_j ds_j / pi; c = max(0, n . d) = r cos(theta); s = max(0, m . d) = r R^2.
Columns of a level are split into phases, x modulo P, so that receivers that share samples are SIMD lanes and read
contiguous places; padding of zero radiance surrounds them. Lengths are scaled by a power of two: r^4 fits float32.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.rsm.pool import plane
from refgi.sssil.settings import SenderSettings
from refgi.sssil.view import Level
from refgi.types import Array

POINT, TEXEL, DISC = 0, 1, 2  # form factors
LEAST = 1e-37  # stands in for a denominator of 0, where the numerator is 0 as well


class SampleForm(NamedTuple):
    """What of a sample its disc covers."""

    kind: int  # POINT, TEXEL or DISC
    share: float  # of what the sample stands for, of a DISC


@kernel
def form_factor(c: Any, s: Any, disc: Any, square: Any) -> Any:
    """Return c s / (r^4 + d r): Eq. 4 where the disc d is all that the sample stands for, Eq. 3 where it is 0; no pi.

    `s` is r R^2 of all texels that the sample stands for, `disc` d of those of its disc, `square` r^2.
    """
    least = type(c)(LEAST)
    # Eq. (4): cos(theta) R^2 / (r^2 + R^2); Eq. (3): cos(theta) cos(theta') ds / r^2
    below = square * square + disc * math.sqrt(square)
    return c * s / (below if below > least else least)


@kernel
def disc_texels(weight: float, form: SampleForm) -> float:
    """Return how many texels the disc of a sample covers that stands for `weight`: a share, no less than one or all."""
    if form.kind == DISC:
        return max(form.share * weight, min(1.0, weight))
    return 1.0 if form.kind == TEXEL else 0.0


def form_of(senders: SenderSettings) -> SampleForm:
    """Return the form factor of samples as kernels know it."""
    return SampleForm({"point": POINT, "texel": TEXEL, "disc": DISC}[senders.form_factor], senders.disc_share)


class Facing(NamedTuple):
    """A point and a vector there."""

    x: Any
    y: Any
    z: Any
    nx: Any
    ny: Any
    nz: Any


@kernel
def term(receiver: Facing, sample: Facing, weight: Any, disc: Any) -> Any:
    """Return the form factor of a receiver, its normal, and a sample, its reversed normal times area / pi."""
    px, py, pz, nx, ny, nz = receiver
    qx, qy, qz, mx, my, mz = sample
    zero = type(px)(0.0)
    dx, dy, dz = qx - px, qy - py, qz - pz
    square = dx * dx + dy * dy + dz * dz
    c = nx * dx + ny * dy + nz * dz
    s = mx * dx + my * dy + mz * dz
    c = c if c > zero else zero
    texel = s if s > zero else zero
    return form_factor(c, texel * weight, texel * disc, square)


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
    """Pack a level's texels in `phases`, a power of two; samples reach `farthest` columns, sums take `most_lanes`."""
    rows, columns = level.shape
    lanes = -(-columns // phases)
    strips = -(-lanes // most_lanes)
    strip = -(-lanes // (strips * BLOCK)) * BLOCK
    pad = -(-(min(farthest, columns) // phases + 1) // BLOCK) * BLOCK
    line = 2 * pad + strips * strip
    packed = plane((PLANES * (rows + 1) * phases * line,), level.position.dtype)
    emit_from, emit_to = np.empty((2, rows + 1, phases, line // BLOCK + 1), np.int32)
    emitters = Emitters(packed, emit_from, emit_to, phases, line, pad, strip, length_scale(level.depth))
    _pack(level.position, level.normal, level.radiance, level.area, emitters)
    return emitters


def dark_ends(emitters: Emitters) -> tuple[int, int]:
    """Return how many lanes of all rows lie before the first emitting block of a row or after its last."""
    first = np.maximum(emitters.emit_from[:-1, :, 0], emitters.pad)
    last = np.minimum(emitters.emit_to[:-1, :, -1], emitters.line - emitters.pad)
    total = first.size * (emitters.line - 2 * emitters.pad)
    return total - int(np.maximum(last - first, 0).sum()), total


def length_scale(depth: Array) -> float:
    """Return the power of two that scales the geometric middle of the depths, m, to about 1; 1 without surface."""
    some = depth[(depth > 0) & (depth < np.inf)]
    if not some.size:
        return 1.0
    return 2.0 ** -round((math.log2(float(some.min())) + math.log2(float(some.max()))) / 2)


@kernel(parallel=True)
def _pack(position: Array, normal: Array, radiance: Array, area: Array, emitters: Emitters) -> None:
    for row in prange(area.shape[0] + 1):
        _pack_row(position, normal, radiance, area, np.int64(row), emitters)


@kernel
def _pack_row(
    position: Array, normal: Array, radiance: Array, area: Array, row: Any, emitters: Emitters
) -> None:
    packed, phases, line, pad = emitters.packed, emitters.phases, emitters.line, emitters.pad
    start, step = row * PLANES * phases * line, phases * line
    for phase in range(phases):
        lanes = 0
        if row < area.shape[0]:
            lanes = (area.shape[1] - phase + phases - 1) // phases
            _pack_line(position, normal, radiance, area, row, phase, emitters)
        for k in range(PLANES):
            line_start = start + (k * phases + phase) * line
            _clear_lanes(packed, line_start, line_start + pad)
            _clear_lanes(packed, line_start + pad + lanes, line_start + line)
        _find_emitting(packed, start + phase * line, step, row, phase, emitters.emit_from, emitters.emit_to)


@kernel
def _clear_lanes(packed: Array, first: Any, last: Any) -> None:
    zero = packed.dtype.type(0.0)
    for i in range(np.uint64(first), np.uint64(last)):
        packed[i] = zero


@kernel
def _pack_line(
    position: Array, normal: Array, radiance: Array, area: Array, row: Any, phase: int, emitters: Emitters
) -> None:
    packed, phases, line, real = emitters.packed, emitters.phases, emitters.line, emitters.packed.dtype.type
    scale, share = real(emitters.scale), real(emitters.scale * emitters.scale / math.pi)
    first, step = (row * PLANES * phases + phase) * line + emitters.pad, phases * line
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


WIDE = 320  # lanes of a tile
ROWS = 12  # position, normal, sum of a group of samples, sum of all

X, Y, Z, NX, NY, NZ, R, G, B = (np.uint64(k * WIDE) for k in range(9))


@kernel
def add_two(
    tile: Array, low: int, lanes: int, packed: Array, step: int, first: int, first_weight: Any, first_disc: Any,
    second: int, second_weight: Any, second_disc: Any,
) -> None:
    """Add the light of two samples to `lanes` receivers of a tile from `low` on; the two are added to each other first.

    `tile` (ROWS * WIDE,) holds receivers and their sums; `first` and `second` are the places of the first receiver's
    samples in `packed`, whose planes are `step` elements apart.
    """
    # unsigned: no checks for places counted from the end
    by, a, b = np.uint64(step), np.uint64(first), np.uint64(second)
    a1, a2, a3, a4 = a + by, a + by * np.uint64(2), a + by * np.uint64(3), a + by * np.uint64(4)
    a5, a6, a7, a8 = a4 + by, a4 + by * np.uint64(2), a4 + by * np.uint64(3), a4 + by * np.uint64(4)
    b1, b2, b3, b4 = b + by, b + by * np.uint64(2), b + by * np.uint64(3), b + by * np.uint64(4)
    b5, b6, b7, b8 = b4 + by, b4 + by * np.uint64(2), b4 + by * np.uint64(3), b4 + by * np.uint64(4)
    for i in range(np.uint64(low), np.uint64(low + lanes)):
        to = Facing(tile[X + i], tile[Y + i], tile[Z + i], tile[NX + i], tile[NY + i], tile[NZ + i])
        one = Facing(packed[a + i], packed[a1 + i], packed[a2 + i], packed[a3 + i], packed[a4 + i], packed[a5 + i])
        two = Facing(packed[b + i], packed[b1 + i], packed[b2 + i], packed[b3 + i], packed[b4 + i], packed[b5 + i])
        g, h = term(to, one, first_weight, first_disc), term(to, two, second_weight, second_disc)
        # Eq. (1)
        tile[R + i] = tile[R + i] + (g * packed[a6 + i] + h * packed[b6 + i])
        tile[G + i] = tile[G + i] + (g * packed[a7 + i] + h * packed[b7 + i])
        tile[B + i] = tile[B + i] + (g * packed[a8 + i] + h * packed[b8 + i])


@kernel
def close_group(tile: Array, lanes: int) -> None:
    """Add the sums of a group of samples to the totals of a tile: many samples round like few."""
    zero = tile.dtype.type(0.0)
    for c in range(6, 9):
        here, there = np.uint64(c * WIDE), np.uint64((c + 3) * WIDE)
        for i in range(np.uint64(lanes)):
            tile[there + i] = tile[there + i] + tile[here + i]
            tile[here + i] = zero
