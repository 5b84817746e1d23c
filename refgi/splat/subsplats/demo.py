"""One pass of the upsampling as the authors' demo does it (GPU Pro, 2010), which is not quite what the paper says.

A texel looks at the 3 x 3 texels of the coarser level around the one it lies in, with weights (1 - f, 1, f)/2 along
each axis, f the place of its centre in that texel: a wider filter than the tent. Only where the coarser level holds
nothing is the neighbour at the texel's own level taken. Across a corner as in `tent`, which took its rule from here.
"""

from typing import Any

import numpy.typing as npt

from refgi.jit import kernel, prange

Array = npt.NDArray[Any]


@kernel(parallel=True)
def demo_pass(
    lit: Array, leaf: Array, coarse: Array, coarse_mask: Array, filled: Array, filter_all: bool, result: Array,
    mask: Array,
) -> None:
    """Fill a level.

    Parameters
    ----------
    lit, leaf : (3, h_l, w_l) and (h_l, w_l) ndarray
        What was lit at this level and where.
    coarse, coarse_mask : (3, h', w') and (h', w') ndarray
        The level above and where it has texels.
    filled : (h_l, w_l) ndarray of bool
        Whether a cell shows a surface.
    filter_all : bool
        Filter the texels lit at this level too.
    result, mask : (3, h_l, w_l) and (h_l, w_l) ndarray
        Filled: irradiance, 0 where there is none, and whether there is any.
    """
    height, width = filled.shape
    for i in prange(height):
        for j in range(width):
            mask[i, j] = leaf[i, j] or (filled[i, j] and coarse_mask[i >> 1, j >> 1])
            if mask[i, j] and (filter_all or not leaf[i, j]):
                red, green, blue = _filtered(lit, leaf, coarse, coarse_mask, i, j)
            else:
                red, green, blue = lit[0, i, j], lit[1, i, j], lit[2, i, j]
            result[0, i, j], result[1, i, j], result[2, i, j] = red, green, blue


@kernel
def _filtered(lit: Array, leaf: Array, coarse: Array, coarse_mask: Array, i: int, j: int) -> Any:
    """Return the weighted mean of the taps around a texel, by differences to the tap in the middle."""
    real = lit.dtype.type
    down, across = _weights(real, i), _weights(real, j)
    vertical = _holds(leaf, coarse_mask, i, j, -1, 0), True, _holds(leaf, coarse_mask, i, j, 1, 0)
    horizontal = _holds(leaf, coarse_mask, i, j, 0, -1), True, _holds(leaf, coarse_mask, i, j, 0, 1)
    x, y, z = _tap(lit, coarse, coarse_mask, i, j, 0, 0)
    total, red, green, blue = real(0.0), real(0.0), real(0.0), real(0.0)
    for k in range(9):
        di, dj = k // 3 - 1, k % 3 - 1
        beside = vertical[di + 1] or horizontal[dj + 1]  # of the taps that touch a corner
        if beside and _holds(leaf, coarse_mask, i, j, di, dj):
            r, g, b = _tap(lit, coarse, coarse_mask, i, j, di, dj)
            weight = down[di + 1] * across[dj + 1]
            total += weight
            red, green, blue = red + weight * (r - x), green + weight * (g - y), blue + weight * (b - z)
    return x + red / total, y + green / total, z + blue / total


@kernel
def _weights(real: Any, i: int) -> Any:
    """Return 1 - f, 1 and f of texel i."""
    f = real(0.75) if i % 2 else real(0.25)
    return real(1.0) - f, real(1.0), f


@kernel
def _holds(leaf: Array, coarse_mask: Array, i: int, j: int, di: int, dj: int) -> Any:
    """Return whether there is light one texel further, of the coarser level or of this one."""
    row, column = _inside(coarse_mask, (i >> 1) + di, (j >> 1) + dj)
    if coarse_mask[row, column]:
        return True
    row, column = _inside(leaf, i + di, j + dj)
    return leaf[row, column]


@kernel
def _tap(lit: Array, coarse: Array, coarse_mask: Array, i: int, j: int, di: int, dj: int) -> Any:
    """Return the light one texel further, of the coarser level where that has any."""
    row, column = _inside(coarse_mask, (i >> 1) + di, (j >> 1) + dj)
    if coarse_mask[row, column]:
        return coarse[0, row, column], coarse[1, row, column], coarse[2, row, column]
    row, column = _inside(lit[0], i + di, j + dj)
    return lit[0, row, column], lit[1, row, column], lit[2, row, column]


@kernel
def _inside(plane: Array, i: int, j: int) -> Any:
    """Return the nearest texel of the picture."""
    return min(max(i, 0), plane.shape[0] - 1), min(max(j, 0), plane.shape[1] - 1)
