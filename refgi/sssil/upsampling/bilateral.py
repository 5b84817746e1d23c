"""Joint bilateral upsampling of a picture's irradiance (Sec. 3.2; Kopf, Cohen, Lischinski and Uyttendaele 2007).

Threads take blocks of WIDE pixels by BAND rows of texels.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.sssil.upsampling import lines, receivers, weights
from refgi.sssil.upsampling.lines import SPAN, WIDE
from refgi.sssil.upsampling.tent import write_offsets

Array = npt.NDArray[Any]

BAND = 16  # rows of texels of a block


@kernel(parallel=True)
def fill_bilateral(
    light: Array, below_depth: Array, below_normal: Array, depth: Array, normal: Array, factor: int, sharpness: Any,
    lean: Any, power: Any, added: Array, adds: bool, result: Array,
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
    added : (3, h, w) ndarray
        Irradiance that is added where a surface is seen, W/m^2.
    adds : bool
        Whether it is.
    result : (3, h, w) ndarray
        Filled.
    """
    offsets = np.empty(WIDE, depth.dtype)
    write_offsets(factor, offsets)
    across = (depth.shape[1] + WIDE - 1) // WIDE
    bands = (below_depth.shape[0] + BAND - 1) // BAND
    for task in prange(across * bands):
        left, first = np.int64(task) % across * WIDE, np.int64(task) // across * BAND
        _fill_block(light, below_depth, below_normal, depth, normal, left, first, factor, offsets, sharpness, lean,
                    power, added, adds, result)


@kernel
def _fill_block(
    light: Array, below_depth: Array, below_normal: Array, depth: Array, normal: Array, left: int, first: int,
    side: int, offsets: Array, sharpness: Any, lean: Any, power: Any, added: Array, adds: bool, result: Array,
) -> None:
    texels, near = np.zeros((3, lines.LINES), depth.dtype), np.zeros((3, SPAN), depth.dtype)
    here, means = np.zeros(receivers.HERE, depth.dtype), np.zeros(weights.MEANS, depth.dtype)
    room = np.zeros((7, lines.ROOM), depth.dtype)
    # two rows of texels and two of pixels are loaded before the first that is filled
    for y in range((first - 2) * side, min((first + BAND) * side, depth.shape[0])):
        row = y // side
        if y % side == 0:
            lines.load_texels(light, below_depth, below_normal, row + 1, left, side, room, texels[(row + 4) % 3])
        if y >= first * side - 2:
            receivers.load_nearness(depth, y + 1, left, near[(y + 4) % 3])
        if y >= first * side:
            receivers.load_receivers(normal, y, left, side, sharpness, lean, near[(y + 2) % 3], near[y % 3],
                                     near[(y + 1) % 3], offsets, here)
            weights.average(texels[(row + 2) % 3], texels[row % 3], texels[(row + 1) % 3], here, power, means)
            _store(texels, row, y, left, here, means, side, added, adds, result)


@kernel
def _store(
    texels: Array, row: int, y: int, left: int, here: Array, means: Array, factor: int, added: Array,
    adds: bool, result: Array,
) -> None:
    real = means.dtype.type
    zero, least = real(0.0), real(weights.LEAST)
    start, size = np.uint64(left), np.uint64(min(WIDE, result.shape[2] - left))
    scarce = 0
    for i in range(np.uint64(WIDE)):
        unknown = (means[np.uint64(weights.TOTAL) + i] < least) & (here[np.uint64(receivers.SCALE) + i] > zero)
        scarce += 1 if unknown else 0
    if scarce > 0:
        _take_nearest(texels, row, y % factor, here, means, factor)
    for c in range(3):
        line = np.uint64(c * SPAN)
        for i in range(size):
            value = means[line + i]
            if adds:
                value = value + added[c, y, start + i]
            result[c, y, start + i] = value if here[np.uint64(receivers.SCALE) + i] > zero else zero


@kernel
def _take_nearest(texels: Array, row: int, place: int, here: Array, means: Array, factor: int) -> None:
    """Take the light of the texel that is nearest in depth where no texel has any weight."""
    real = means.dtype.type
    up = -1 if 2 * place + 1 < factor else 1
    for i in range(WIDE):
        if means[weights.TOTAL + i] >= real(weights.LEAST) or here[receivers.SCALE + i] <= real(0.0):
            continue
        nearer = -1 if 2 * (i % factor) + 1 < factor else 1
        best, slot, at = real(lines.NOWHERE / 2), -1, 0
        for dy in (0, up, -up):
            for dx in (0, nearer, -nearer):
                x = (dx + 1) * lines.SET + i
                plane = (here[receivers.PLANE + i] + real(dy) * here[receivers.DOWN + i]
                         + real(dx) * here[receivers.ACROSS + i])
                off = abs(texels[(row + dy + 3) % 3, lines.NEARNESS + x] - plane)
                if off < best:
                    best, slot, at = off, (row + dy + 3) % 3, x
        for c in range(3):
            means[c * SPAN + i] = texels[slot, lines.LIGHT + c * SPAN + at] if slot >= 0 else real(0.0)
