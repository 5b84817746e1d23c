"""Rows of texels around a block of pixels, each value written once for every pixel of a row that the texel has.

Three sets of lines hold what lies left of every pixel's texel, the texel itself, and what lies right of it, so that all
that a row of pixels reads lies in line, whatever a pixel's place in its texel. Depth is kept as its inverse, the
nearness: it is linear in the picture along every plane, and 0 at infinity.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel

Array = npt.NDArray[Any]

WIDE, PAD = 320, 32  # pixels of a block along a row, and the most that a texel beside it may have
SPAN = WIDE + 16  # places of a line: an odd number of cache lines
LIGHT, NORMAL, NEARNESS, SET = 0, 3 * SPAN, 6 * SPAN, 7 * SPAN  # of a set: three lines, three, one
LEFT, OWN, RIGHT, LINES = 0, SET, 2 * SET, 3 * SET
ROOM = WIDE + 2 * PAD  # of one line before it is shifted
NOWHERE = 1e18  # 1/m; nearness of a texel that sees no surface: no pixel has the like


@kernel
def load_texels(
    light: Array, depth: Array, normal: Array, row: int, left: int, factor: int, room: Array, texels: Array
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
    room : (7, ROOM) ndarray
        Overwritten.
    texels : (LINES,) ndarray
        Filled.
    """
    count, start = WIDE // factor + 2, left // factor - 1
    inside = (row >= 0) & (row < depth.shape[0])
    low = max(-start, 0) if inside else count
    high = max(min(count, depth.shape[1] - start), low)
    for c in range(3):
        _expand(light[c], row, start, low, high, factor, room[c])
        _expand(normal[c], row, start, low, high, factor, room[3 + c])
        _fill_beyond(room[c], 0, low, count, high, factor)
        _fill_beyond(room[3 + c], 0, low, count, high, factor)
    _expand(depth, row, start, low, high, factor, room[6])
    _invert(room[6], low * factor, high * factor)
    _fill_beyond(room[6], NOWHERE, low, count, high, factor)
    for line in range(7):
        _shift(room[line], factor, texels, line * SPAN)


@kernel
def _fill_beyond(room: Array, value: Any, low: int, count: int, high: int, factor: int) -> None:
    for i in range(low * factor):
        room[i] = value
    for i in range(high * factor, count * factor):
        room[i] = value


@kernel
def _expand(values: Array, row: int, start: int, low: int, high: int, factor: int, room: Array) -> None:
    """Write each texel's value `factor` times."""
    shift, two = np.uint64(start), np.uint64(2)  # may stand for a number below 0: places wrap round to the right ones
    if factor == 2:  # written out, which lets it run in lanes
        for i in range(np.uint64(low), np.uint64(high)):
            value = values[row, shift + i]
            room[two * i] = value
            room[two * i + np.uint64(1)] = value
        return
    size = np.uint64(factor)
    for i in range(np.uint64(low), np.uint64(high)):
        for k in range(size):
            room[size * i + k] = values[row, shift + i]


@kernel
def _invert(room: Array, low: int, high: int) -> None:
    one, none, infinite = room.dtype.type(1.0), room.dtype.type(NOWHERE), room.dtype.type(np.inf)
    for i in range(np.uint64(low), np.uint64(high)):
        room[i] = one / room[i] if room[i] < infinite else none


@kernel
def _shift(room: Array, factor: int, texels: Array, line: int) -> None:
    """Copy a line that begins with the texel left of the block to where left, own and right texels are read."""
    left, own, right = np.uint64(LEFT + line), np.uint64(OWN + line), np.uint64(RIGHT + line)
    size = np.uint64(factor)
    for i in range(np.uint64(WIDE)):
        texels[left + i] = room[i]
    for i in range(np.uint64(WIDE)):
        texels[own + i] = room[size + i]
    for i in range(np.uint64(WIDE)):
        texels[right + i] = room[size + size + i]
