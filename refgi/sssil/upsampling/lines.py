"""Rows of texels around a block of pixels, each value repeated for every pixel of a row that the texel covers.

Whatever a pixel's place in its texel, its texel's neighbours are as many places away as a texel has pixels, so that a
row of pixels reads contiguous values. Depth is stored as its inverse, the nearness: it is linear in the picture along
every plane, and 0 at infinity.
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
    light: Array, depth: Array, normal: Array, row: int, left: int, wide: int, factor: int, scratch: Array,
    texels: Array,
) -> None:
    """Write a row of texels around a block of pixels into `texels` (LINES,).

    `light` (3, hc, wc), W/m^2; `depth` (hc, wc), m, inf for no surface; `normal` (3, hc, wc). Beyond the picture there
    are no surfaces, light and normals are those of its edge. The block begins at pixel `left`, the first of a texel,
    and has `wide` pixels, whole texels of `factor`. `scratch` is (2, SPAN).
    """
    nowhere = scratch.dtype.type(NOWHERE)
    texel = scratch[0]
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
def load_bounds(light: Array, row: int, left: int, wide: int, factor: int, scratch: Array, bounds: Array) -> None:
    """Write the minimum and the maximum light of the 3 x 3 texels around each one of a row into `bounds` (BOUNDS,).

    Arguments as those of `load_texels`; lines begin a texel left of the block.
    """
    low, high, end = _inside(left, wide, factor, light.shape[2])
    above, below, shift = max(row - 1, 0), min(row + 1, light.shape[1] - 1), np.uint64(left // factor - 1)
    least, most = scratch[0], scratch[1]
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
