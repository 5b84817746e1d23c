"""Rows of texels around a block of pixels, each value written once for every pixel of a row that the texel has.

All that a row of pixels reads lies in line then, whatever a pixel's place in its texel: what is left and right of its
texel is as many places away as a texel has pixels. Depth is kept as its inverse, the nearness: it is linear in the
picture along every plane, and 0 at infinity.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel

Array = npt.NDArray[Any]

WIDE, PAD = 1280, 32  # most pixels of a block along a row: long ones stream; and most along a texel's side
SPAN = WIDE + 2 * PAD + 16  # places of a line, which begins a texel left of the block: an odd number of cache lines
LIGHT, NORMAL, NEARNESS, LINES = 0, 3 * SPAN, 6 * SPAN, 7 * SPAN
LEAST, MOST, BOUNDS = 0, 3 * SPAN, 6 * SPAN
NOWHERE = 1e18  # 1/m; nearness of a texel that sees no surface: no pixel has the like


@kernel
def load_texels(
    light: Array, depth: Array, normal: Array, row: int, left: int, wide: int, factor: int, room: Array, texels: Array
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
    wide : int
        Pixels of the block, whole texels; some may lie beyond the picture.
    factor : int
        Pixels along a texel's side.
    room : (2, SPAN) ndarray
        Overwritten.
    texels : (LINES,) ndarray
        Filled.

    Notes
    -----
    Beyond the picture light and normals are those of its edge.
    """
    nowhere = room.dtype.type(NOWHERE)
    texel = room[0]
    low, high, end = _inside(left, wide, factor, depth.shape[1])
    for c in range(3):
        _copy(light[c], row, left // factor - 1, low, high, end, texel)
        _repeat(texel, end, factor, texels, LIGHT + c * SPAN)
        _copy(normal[c], row, left // factor - 1, low, high, end, texel)
        _repeat(texel, end, factor, texels, NORMAL + c * SPAN)
    _copy(depth, row, left // factor - 1, low, high, end, texel)
    _invert(texel, end)
    if row < 0 or row >= depth.shape[0]:
        low, high = end, end
    for i in range(low):
        texel[i] = nowhere
    for i in range(high, end):
        texel[i] = nowhere
    _repeat(texel, end, factor, texels, NEARNESS)


@kernel
def load_bounds(light: Array, row: int, left: int, wide: int, factor: int, room: Array, bounds: Array) -> None:
    """Write the least and the most light of the three by three texels around each one of a row.

    Parameters
    ----------
    light : (3, hc, wc) ndarray
        Irradiance, W/m^2.
    row : int
        Row of texels, in the picture.
    left : int
        First pixel of the block.
    wide : int
        Pixels of the block.
    factor : int
        Pixels along a texel's side.
    room : (2, SPAN) ndarray
        Overwritten.
    bounds : (BOUNDS,) ndarray
        Filled; as other lines, they begin a texel left of the block.
    """
    low, high, end = _inside(left, wide, factor, light.shape[2])
    above, below, shift = max(row - 1, 0), min(row + 1, light.shape[1] - 1), np.uint64(left // factor - 1)
    least, most = room[0], room[1]
    one, two = np.uint64(1), np.uint64(2)
    for c in range(3):
        for i in range(np.uint64(low), np.uint64(high)):
            up, own, down = light[c, above, shift + i], light[c, row, shift + i], light[c, below, shift + i]
            least[i], most[i] = min(up, own, down), max(up, own, down)
        _extend(least, low, high, end)
        _extend(most, low, high, end)
        for i in range(np.uint64(end - 2)):  # in place: a texel's is written where the one before it was
            least[i] = min(least[i], least[i + one], least[i + two])
            most[i] = max(most[i], most[i + one], most[i + two])
        _repeat(least, end - 2, factor, bounds, LEAST + c * SPAN)
        _repeat(most, end - 2, factor, bounds, MOST + c * SPAN)


@kernel
def _inside(left: int, wide: int, factor: int, width: int) -> Any:
    """Return which places of a line of texels, first and end, are in the picture, and how many there are."""
    start, end = left // factor - 1, wide // factor + 2
    return max(-start, 0), min(end, width - start), end


@kernel
def _copy(values: Array, row: int, start: int, low: int, high: int, end: int, line: Array) -> None:
    inner = min(max(row, 0), values.shape[0] - 1)
    shift = np.uint64(start)  # may stand for a number below 0: places wrap round to the right ones
    for i in range(np.uint64(low), np.uint64(high)):
        line[i] = values[inner, shift + i]
    _extend(line, low, high, end)


@kernel
def _extend(line: Array, low: int, high: int, end: int) -> None:
    for i in range(low):
        line[i] = line[low]
    for i in range(high, end):
        line[i] = line[high - 1]


@kernel
def _invert(line: Array, end: int) -> None:
    one, none, infinite = line.dtype.type(1.0), line.dtype.type(NOWHERE), line.dtype.type(np.inf)
    for i in range(np.uint64(end)):
        line[i] = one / line[i] if line[i] < infinite else none


@kernel
def _repeat(texel: Array, count: int, factor: int, lines: Array, line: int) -> None:
    """Write each texel's value `factor` times."""
    first, two, size = np.uint64(line), np.uint64(2), np.uint64(factor)
    if factor == 2:  # written out, which lets it run in lanes
        for i in range(np.uint64(count)):
            lines[first + two * i] = texel[i]
            lines[first + two * i + np.uint64(1)] = texel[i]
        return
    for i in range(np.uint64(count)):
        for k in range(size):
            lines[first + size * i + k] = texel[i]
