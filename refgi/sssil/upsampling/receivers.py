"""Rows of pixels that irradiance is upsampled to: normals, and the planes through them.

On a plane the nearness 1/z is linear in the picture, so differences between neighbouring pixels give its value at the
texels around, without rays or normals: of the two differences along each axis the smaller one counts, and none where
they disagree in sign, which avoids silhouettes.

Symbols: g_x, g_y slope of the nearness (1/m a texel).
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.sssil.upsampling.lines import SPAN

Array = npt.NDArray[Any]

NORMAL, SCALE, PLANE = 0, 3 * SPAN, 4 * SPAN
ACROSS, DOWN, HERE = 5 * SPAN, 6 * SPAN, 7 * SPAN


@kernel
def load_nearness(depth: Array, row: int, left: int, wide: int, line: Array) -> None:
    """Write 1/z of a row of pixels, and of one more at either end, into `line` (SPAN,); 0 for no surface.

    Place 0 is pixel `left` - 1. One pixel beyond the picture's edge (row -1 or h), the slope is that at the edge.
    """
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

    `sharpness` = 1 / (4 sqrt(2) sigma), sigma the standard deviation of depths as a share of the depth; `corner`:
    offset of the point that a texel stands for from its centre, toward the nearer side along either axis, texels;
    `above`, `nearness`, `below`: of `load_nearness`; `tents`: of `write_tents`. Filled: normal; sharpness z, 0 for no
    surface; nearness at the own texel's point; its change from texel to texel.
    """
    real = pixels.dtype.type
    zero, side = real(0.0), real(factor)
    offset_y = tents[row % factor]
    size = np.uint64(min(wide, normal.shape[2] - left))
    for c in range(3):
        line = np.uint64(NORMAL + c * SPAN)
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
