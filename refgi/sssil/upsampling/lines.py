"""Rows of texels around a block of pixels, each value written once for every pixel of a row that the texel has.

So a pixel's own texel and those to its left and right lie a fixed number of places apart whatever the pixel's place in
its texel, and all that a row of pixels reads lies in line. Depth is kept as its inverse, the nearness: it is linear in
the picture along every plane, and 0 at infinity.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel

Array = npt.NDArray[Any]

WIDE, PAD = 128, 32  # pixels of a block along a row, and the most that a texel beside it may have
SPAN = WIDE + 2 * PAD + 16  # places of a line: an odd number of cache lines
LIGHT, NORMAL, NEARNESS, LINES = 0, 3 * SPAN, 6 * SPAN, 7 * SPAN  # three lines, three, one
NOWHERE = 1e18  # 1/m; nearness of a texel that sees no surface: no pixel has the like


@kernel
def load_texels(
    light: Array, depth: Array, normal: Array, row: int, left: int, factor: int, line: Array
) -> None:
    """Write a row of texels around a block of pixels.

    Parameters
    ----------
    light : (3, hc, wc) ndarray
        Irradiance, W/m^2.
    depth : (hc, wc) ndarray
        Depth, m; inf where no surface is seen.
    normal : (3, hc, wc) ndarray
        Unit normals.
    row : int
        Row of texels; outside the picture there are no surfaces.
    left : int
        First pixel of the block, which is the first of a texel.
    factor : int
        Pixels along a texel's side.
    line : (LINES,) ndarray
        Filled.
    """
    count, start = WIDE // factor + 2, left // factor - 1
    inside = (row >= 0) & (row < depth.shape[0])
    low = max(-start, 0) if inside else count
    high = max(min(count, depth.shape[1] - start), low)
    _write_none(line, 0, low, factor)
    _write_none(line, high, count, factor)
    shift = np.uint64(start)  # may stand for a number below 0: places wrap round to the right ones
    for c in range(3):
        _write(line, np.uint64(NORMAL + c * SPAN), normal, c, row, shift, np.uint64(low), np.uint64(high), factor)
        _write(line, np.uint64(LIGHT + c * SPAN), light, c, row, shift, np.uint64(low), np.uint64(high), factor)
    _write_nearness(line, depth, row, shift, np.uint64(low), np.uint64(high), factor)


@kernel
def _write_none(line: Array, low: int, high: int, factor: int) -> None:
    for place in range(PAD - factor + low * factor, PAD - factor + high * factor):
        for plane in range(NEARNESS // SPAN):
            line[plane * SPAN + place] = 0
        line[NEARNESS + place] = NOWHERE


@kernel
def _write(
    line: Array, plane: Any, values: Array, c: int, row: int, shift: Any, low: Any, high: Any, factor: int
) -> None:
    size = np.uint64(factor)
    begin = plane + np.uint64(PAD) - size
    if factor == 2:  # written out, which lets it run in lanes
        for i in range(low, high):
            value = values[c, row, shift + i]
            line[begin + np.uint64(2) * i] = value
            line[begin + np.uint64(2) * i + np.uint64(1)] = value
        return
    for i in range(low, high):
        value = values[c, row, shift + i]
        for k in range(size):
            line[begin + size * i + k] = value


@kernel
def _write_nearness(line: Array, depth: Array, row: int, shift: Any, low: Any, high: Any, factor: int) -> None:
    one, none, infinite = line.dtype.type(1.0), line.dtype.type(NOWHERE), line.dtype.type(np.inf)
    size = np.uint64(factor)
    begin = np.uint64(NEARNESS + PAD) - size
    if factor == 2:
        for i in range(low, high):
            z = depth[row, shift + i]
            value = one / z if z < infinite else none
            line[begin + np.uint64(2) * i] = value
            line[begin + np.uint64(2) * i + np.uint64(1)] = value
        return
    for i in range(low, high):
        z = depth[row, shift + i]
        value = one / z if z < infinite else none
        for k in range(size):
            line[begin + size * i + k] = value
