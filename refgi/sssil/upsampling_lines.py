"""Rows of texels around a block of pixels, and rows of pixels that irradiance is upsampled to.

A texel's neighbours are as many places away as it has pixels, so that a row of pixels reads contiguous values. Depth is
stored as its inverse, the nearness, linear in the picture along every plane: differences between neighbouring pixels
give its value at the texels around, the smaller one along each axis, none where signs disagree, as at silhouettes.
"""

from typing import Any

import numpy as np

from refgi.jit import kernel
from refgi.types import Array

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
    """Write a row of texels around a block of pixels into `texels` (LINES,); beyond the picture they see no surface.

    The block begins at pixel `left`, the first of a texel, and has `wide` pixels, whole texels of `factor`.
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
    """Write least and most light of the 3 x 3 texels around each of a row into `bounds`, a texel left on."""
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


RECEIVER_NORMAL, SCALE, PLANE = 0, 3 * SPAN, 4 * SPAN
ACROSS, DOWN, HERE = 5 * SPAN, 6 * SPAN, 7 * SPAN


@kernel
def load_nearness(depth: Array, row: int, left: int, wide: int, line: Array) -> None:
    """Write 1/z of a row of pixels from `left` - 1 on into `line`; 0: no surface. Beyond the edge its slope goes on."""
    zero, one = line.dtype.type(0.0), line.dtype.type(1.0)
    height, width = depth.shape
    if row < 0 or row >= height:
        inner, next_inner = (0, 1) if row < 0 else (height - 1, height - 2)
        for i in range(wide + 2):
            x = left - 1 + i
            known = height > 1 and x >= 0 and x < width
            line[i] = _beyond(depth[inner, x], depth[next_inner, x]) if known else zero
        return
    size = min(wide + 1, width - left)
    for i in range(np.uint64(size)):
        line[np.uint64(1) + i] = one / depth[row, np.uint64(left) + i]
    for i in range(size + 1, wide + 2):
        line[i] = zero
    line[0] = zero
    if left > 0:
        line[0] = one / depth[row, left - 1]
    elif width > 1:
        line[0] = _beyond(depth[row, 0], depth[row, 1])
    if size < wide + 1 and width > 1:
        line[size + 1] = _beyond(depth[row, width - 1], depth[row, width - 2])


@kernel
def _beyond(depth: Any, inner: Any) -> Any:
    """Return the nearness as far on the other side of a pixel as another is on this; 0 if not known."""
    zero, one, two = type(depth)(0.0), type(depth)(1.0), type(depth)(2.0)
    pixels, there = one / depth, one / inner
    value = two * pixels - there
    return value if (pixels > zero) & (there > zero) & (value > zero) else zero


@kernel
def load_receivers(
    normal: Array, row: int, left: int, wide: int, factor: int, sharpness: Any, corner: Any, above: Array,
    nearness: Array, below: Array, tents: Array, pixels: Array,
) -> None:
    """Write normals of a row of pixels, and the nearness of their planes at texels, into `pixels` (HERE,).

    `sharpness` = 1 / (4 sqrt(2) sigma), sigma the standard deviation of depths as a share; `corner`: offset of the
    point that a texel stands for from its centre, toward the nearer side along either axis, texels.
    """
    real = pixels.dtype.type
    zero, side = real(0.0), real(factor)
    offset_y = tents[row % factor]
    size = np.uint64(min(wide, normal.shape[2] - left))
    for c in range(3):
        line = np.uint64(RECEIVER_NORMAL + c * SPAN)
        for i in range(size):
            pixels[line + i] = normal[c, row, np.uint64(left) + i]
    for i in range(np.uint64(wide)):
        value = nearness[i + np.uint64(1)]
        gx = side * _slope(nearness[i], value, nearness[i + np.uint64(2)])
        gy = side * _slope(above[i + np.uint64(1)], value, below[i + np.uint64(1)])
        pixels[np.uint64(ACROSS) + i] = gx
        pixels[np.uint64(DOWN) + i] = gy
        pixels[np.uint64(SCALE) + i] = sharpness / value if value > zero else zero
        # the point that a texel stands for is at its nearest corner, not in its centre
        pixels[np.uint64(PLANE) + i] = (value - (tents[i] * gx - corner * abs(gx))) - (offset_y * gy - corner * abs(gy))


@kernel
def _slope(before: Any, value: Any, after: Any) -> Any:
    """Return the smaller of two differences, 0 where they disagree or a neighbour is not known."""
    zero = type(value)(0.0)
    first, second = value - before, after - value
    smaller = first if abs(first) < abs(second) else second
    smaller = smaller if first * second > zero else zero
    return smaller if (before > zero) & (after > zero) & (value > zero) else zero
