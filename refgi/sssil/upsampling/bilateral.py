"""Joint bilateral upsampling of a picture's irradiance (Sec. 3.2; Kopf, Cohen, Lischinski and Uyttendaele 2007).

Threads take blocks of WIDE pixels by BAND rows of texels.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.sssil.upsampling import lines, receivers, weights
from refgi.sssil.upsampling.lines import PAD, SPAN, WIDE

Array = npt.NDArray[Any]

BAND = 16  # rows of texels of a block
LEAST = 1e-20  # sum of weights that is too small to divide by


@kernel(parallel=True)
def fill_bilateral(
    light: Array, below_depth: Array, below_normal: Array, depth: Array, normal: Array, factor: int, sharpness: Any,
    lean: Any, power: Any, added: Array | None, result: Array,
) -> None:
    """Carry irradiance of texels over to pixels of the same surface.

    Parameters
    ----------
    light : (3, hc, wc) ndarray
        Irradiance of texels, W/m^2.
    below_depth, below_normal : (hc, wc), (3, hc, wc) ndarray
        What texels see: m, inf for nothing; unit vectors.
    depth, normal : (h, w), (3, h, w) ndarray
        What pixels see.
    factor : int
        Pixels along a texel's side.
    sharpness, lean, power : float
        Of `load_receivers` and `alike`; power may be None.
    added : (3, h, w) ndarray or None
        Irradiance that is added where a surface is seen, W/m^2.
    result : (3, h, w) ndarray
        Filled.
    """
    height, width = depth.shape
    rows = below_depth.shape[0]
    across, side = (width + WIDE - 1) // WIDE, np.int64(factor)
    for task in prange(across * ((rows + BAND - 1) // BAND)):
        left, first = np.int64(task) % across * WIDE, np.int64(task) // across * BAND
        texels, near = np.zeros((3, lines.LINES), depth.dtype), np.zeros((3, SPAN), depth.dtype)
        here, tent = np.zeros(receivers.HERE, depth.dtype), np.zeros(receivers.TENT, depth.dtype)
        sums = np.zeros(weights.SUMS, depth.dtype)
        receivers.write_tent(side, tent)
        for row in range(first - 1, first + 1):
            lines.load_texels(light, below_depth, below_normal, row, left, side, texels[(row + 3) % 3])
        for y in range(first * side - 1, first * side + 1):
            receivers.load_nearness(depth, y, left, near[(y + 3) % 3])
        for row in range(first, min(first + BAND, rows)):
            lines.load_texels(light, below_depth, below_normal, row + 1, left, side, texels[(row + 1) % 3])
            for y in range(row * side, min((row + 1) * side, height)):
                receivers.load_nearness(depth, y + 1, left, near[(y + 1) % 3])
                receivers.load_receivers(normal, y, left, side, sharpness, lean, near[(y + 2) % 3], near[y % 3],
                                         near[(y + 1) % 3], here)
                _sum_up(texels, row, y % side, here, tent, side, power, sums)
                _store(texels, row, y, left, here, sums, side, added, result)


@kernel
def _sum_up(
    texels: Array, row: int, place: int, here: Array, tent: Array, factor: int, power: Any, sums: Array
) -> None:
    far, own, near, side = receivers.tent_weights(place, factor, here)
    above, middle, below = texels[(row + 2) % 3], texels[row % 3], texels[(row + 1) % 3]
    weights.start_sums(middle, here, power, sums)
    weights.add_texels(middle, here, tent, factor, 0, own, power, sums)
    weights.add_texels(above, here, tent, factor, -1, near if side < 0 else far, power, sums)
    weights.add_texels(below, here, tent, factor, 1, far if side < 0 else near, power, sums)


@kernel
def _store(
    texels: Array, row: int, y: int, left: int, here: Array, sums: Array, factor: int, added: Array | None,
    result: Array,
) -> None:
    real = sums.dtype.type
    zero, one, least = real(0.0), real(1.0), real(LEAST)
    start, size = np.uint64(left), np.uint64(min(WIDE, result.shape[2] - left))
    scarce = 0
    for i in range(size):
        vanished = sums[np.uint64(weights.TOTAL) + i] < least
        scarce += 1 if vanished & (here[np.uint64(receivers.SCALE) + i] > zero) else 0
    if scarce > 0:
        _take_nearest(texels, row, y % factor, here, sums, factor, np.int64(size))
    for c in range(3):
        line = np.uint64(c * SPAN)
        for i in range(size):
            total = sums[np.uint64(weights.TOTAL) + i]
            value = sums[np.uint64(weights.SUM) + line + i] / (total if total >= least else one)
            value = value + sums[np.uint64(weights.REFERENCE) + line + i]
            if added is not None:
                value = value + added[c, y, start + i]
            result[c, y, start + i] = value if here[np.uint64(receivers.SCALE) + i] > zero else zero


@kernel
def _take_nearest(texels: Array, row: int, place: int, here: Array, sums: Array, factor: int, size: int) -> None:
    """Put the light of the texel that is nearest in depth where no texel has any weight."""
    real = sums.dtype.type
    up = -1 if 2 * place + 1 < factor else 1
    for i in range(size):
        if sums[weights.TOTAL + i] >= real(LEAST) or here[receivers.SCALE + i] <= real(0.0):
            continue
        nearer = -1 if 2 * (i % factor) + 1 < factor else 1
        best, slot, at = real(lines.NOWHERE / 2), -1, 0
        for dy in (0, up, -up):
            for dx in (0, nearer, -nearer):
                x = PAD + i + dx * factor
                plane = (here[receivers.PLANE + i] + real(dy) * here[receivers.DOWN + i]
                         + real(dx) * here[receivers.ACROSS + i])
                off = abs(texels[(row + dy + 3) % 3, lines.NEARNESS + x] - plane)
                if off < best:
                    best, slot, at = off, (row + dy + 3) % 3, x
        for c in range(3):
            sums[weights.SUM + c * SPAN + i] = real(0.0)
            light = texels[slot, lines.LIGHT + c * SPAN + at] if slot >= 0 else real(0.0)
            sums[weights.REFERENCE + c * SPAN + i] = light
