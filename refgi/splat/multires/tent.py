"""One level of the masked upsampling, from the next coarser level and the subsplats of the level itself (Sec. 3.5).

`tent_pass`: out = C_0 + sum m w (C - C_0) / sum m w over the 3 x 3 texels C around, w = (1, 2, 1) x (1, 2, 1), m = 1
where a texel was evaluated, at this or any coarser level (of which each is repeated 2 x 2): constants stay as they are,
to the bit. A diagonal texel counts only if one of the two beside it has m = 1. `demo_pass`, the authors' (GPU Pro,
2010): the 3 x 3 texels of the coarser level with (1 - f, 1, f) / 2 along each axis, f the place of the texel's centre
in the one it lies in; where the coarser level holds nothing, the neighbour at the texel's own level.
"""

from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.types import Array

BAND = 32  # rows of a task: two more are read than written
MASK, SHARE = 3, 4  # planes of a row after the three channels: m, and m where the texel is to be filtered


@kernel(parallel=True)
def tent_pass(
    values: Array, order: Array, starts: Array, column: Array, coarse: Array, coarse_mask: Array, filled: Array,
    filter_all: bool, corner: float, result: Array, mask: Array,
) -> None:
    """Fill a level by the masked tent filter.

    Of values (3, n), order and starts of `sorted_by_row` and column (n,) of all subsplats; coarse, coarse_mask: the
    level above; filled (h_l, w_l): cells that show a surface; corner: 0, or 1 to count diagonal texels always.
    """
    height, width = filled.shape
    for band in prange((height + BAND - 1) // BAND):
        rows = np.zeros((3, 5, width + 3), values.dtype)
        first, last = band * BAND, min(band * BAND + BAND, height)
        for step in range(last - first + 2):
            i = min(max(first + step - 1, 0), height - 1)
            row = rows[step % 3]
            _double_coarse_row(coarse, coarse_mask, filled, i, row)
            _insert_leaves(values, order[starts[i] : starts[i + 1]], column, filter_all, row)
            if step >= 2:
                here = rows[(step - 1) % 3]
                _filter(rows[(step - 2) % 3], here, row, values.dtype.type(corner), first + step - 2, result)
                _store_mask(here[MASK, 1:], mask[first + step - 2])


@kernel
def _double_coarse_row(coarse: Array, coarse_mask: Array, filled: Array, i: int, row: Array) -> None:
    """Repeat the coarse texels along row i twice each, where cells show a surface."""
    for c in range(3):
        _double(coarse[c, i >> 1], row[c, 1:])
    row_mask, share, surface = row[MASK, 1:], row[SHARE, 1:], filled[i]
    _double(coarse_mask[i >> 1], row_mask)
    for j in range(len(surface)):
        row_mask[j] *= surface[j]
    for j in range(len(surface)):
        share[j] = row_mask[j]
    for c in range(3):
        channel = row[c, 1:]
        for j in range(len(surface)):
            channel[j] *= row_mask[j]


@kernel
def _double(coarse: Array, fine: Array) -> None:
    for j in range(len(coarse)):
        fine[2 * j] = coarse[j]
        fine[2 * j + 1] = coarse[j]


@kernel
def _insert_leaves(values: Array, members: Array, column: Array, filter_all: bool, row: Array) -> None:
    """Insert the texels of a row that were evaluated at this level, and clamp the border to the edge."""
    for k in members:
        j = column[k] + 1
        for c in range(3):
            row[c, j] = values[c, k]
        row[MASK, j] = 1
        row[SHARE, j] = filter_all
    width = row.shape[1] - 3
    for c in range(MASK + 1):
        row[c, 0] = row[c, 1]
        row[c, width + 1] = row[c, width]


@kernel
def _filter(above: Array, here: Array, below: Array, corner: Any, i: int, result: Array) -> None:
    """Fill row i by the rows around it: all channels in one loop, the weights of a texel found once."""
    real = type(corner)
    two, four = real(2.0), real(4.0)
    mnw, mn, mne = above[MASK], above[MASK, 1:], above[MASK, 2:]
    mw, me, share = here[MASK], here[MASK, 2:], here[SHARE, 1:]
    msw, ms, mse = below[MASK], below[MASK, 1:], below[MASK, 2:]
    a0, a1, a2, h0, h1, h2 = above[0], above[1], above[2], here[0], here[1], here[2]
    b0, b1, b2 = below[0], below[1], below[2]
    red, green, blue = result[0, i], result[1, i], result[2, i]
    for j in range(len(red)):
        n, w, e, s = two * mn[j], two * mw[j], two * me[j], two * ms[j]
        nw, ne = mnw[j] * max(mn[j], mw[j], corner), mne[j] * max(mn[j], me[j], corner)
        sw, se = msw[j] * max(ms[j], mw[j], corner), mse[j] * max(ms[j], me[j], corner)
        weights = nw, n, ne, w, e, sw, s, se
        # Sec. 3.5: sum m w C / sum m w
        scale = share[j] / (four + ((n + s) + (w + e)) + ((nw + ne) + (sw + se)))
        red[j] = h0[j + 1] + scale * _weighted_differences(a0, h0, b0, j, weights)
        green[j] = h1[j + 1] + scale * _weighted_differences(a1, h1, b1, j, weights)
        blue[j] = h2[j + 1] + scale * _weighted_differences(a2, h2, b2, j, weights)


@kernel
def _weighted_differences(above: Array, here: Array, below: Array, j: int, weights: Any) -> Any:
    """Return the weighted sum of the differences of a texel's neighbours to it."""
    nw, n, ne, w, e, sw, s, se = weights
    x = here[j + 1]
    edges = (n * (above[j + 1] - x) + s * (below[j + 1] - x)) + (w * (here[j] - x) + e * (here[j + 2] - x))
    corners = (nw * (above[j] - x) + ne * (above[j + 2] - x)) + (sw * (below[j] - x) + se * (below[j + 2] - x))
    return edges + corners


@kernel
def _store_mask(row_mask: Array, mask: Array) -> None:
    for j in range(len(mask)):
        mask[j] = row_mask[j] != 0


@kernel(parallel=True)
def demo_pass(
    layer: Array, leaf: Array, coarse: Array, coarse_mask: Array, filled: Array, filter_all: bool, result: Array,
    mask: Array,
) -> None:
    """Fill a level by the filter of the authors' demo.

    layer, leaf: (3, h_l, w_l) W/m^2 and (h_l, w_l), what was evaluated at this level and where; the others are those of
    `tent_pass`.
    """
    height, width = filled.shape
    for i in prange(height):
        for j in range(width):
            mask[i, j] = leaf[i, j] or (filled[i, j] and coarse_mask[i >> 1, j >> 1])
            if mask[i, j] and (filter_all or not leaf[i, j]):
                red, green, blue = _filtered(layer, leaf, coarse, coarse_mask, i, j)
            else:
                red, green, blue = layer[0, i, j], layer[1, i, j], layer[2, i, j]
            result[0, i, j], result[1, i, j], result[2, i, j] = red, green, blue


@kernel
def _filtered(layer: Array, leaf: Array, coarse: Array, coarse_mask: Array, i: int, j: int) -> Any:
    """Return the weighted mean of the taps around a texel, by differences to the tap in the middle."""
    real = layer.dtype.type
    down, across = _weights(real, i), _weights(real, j)
    vertical = _has_irradiance(leaf, coarse_mask, i, j, -1, 0), True, _has_irradiance(leaf, coarse_mask, i, j, 1, 0)
    horizontal = _has_irradiance(leaf, coarse_mask, i, j, 0, -1), True, _has_irradiance(leaf, coarse_mask, i, j, 0, 1)
    x, y, z = _tap(layer, coarse, coarse_mask, i, j, 0, 0)
    total, red, green, blue = real(0.0), real(0.0), real(0.0), real(0.0)
    for k in range(9):
        di, dj = k // 3 - 1, k % 3 - 1
        beside = vertical[di + 1] or horizontal[dj + 1]  # of the taps that touch a corner
        if beside and _has_irradiance(leaf, coarse_mask, i, j, di, dj):
            r, g, b = _tap(layer, coarse, coarse_mask, i, j, di, dj)
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
def _has_irradiance(leaf: Array, coarse_mask: Array, i: int, j: int, di: int, dj: int) -> Any:
    """Return whether the texel at an offset holds irradiance, of the coarser level or of this one."""
    row, column = _inside(coarse_mask, (i >> 1) + di, (j >> 1) + dj)
    if coarse_mask[row, column]:
        return True
    row, column = _inside(leaf, i + di, j + dj)
    return leaf[row, column]


@kernel
def _tap(layer: Array, coarse: Array, coarse_mask: Array, i: int, j: int, di: int, dj: int) -> Any:
    """Return the irradiance of the texel at an offset, of the coarser level where that holds any."""
    row, column = _inside(coarse_mask, (i >> 1) + di, (j >> 1) + dj)
    if coarse_mask[row, column]:
        return coarse[0, row, column], coarse[1, row, column], coarse[2, row, column]
    row, column = _inside(layer[0], i + di, j + dj)
    return layer[0, row, column], layer[1, row, column], layer[2, row, column]


@kernel
def _inside(plane: Array, i: int, j: int) -> Any:
    """Return the nearest texel of the picture."""
    return min(max(i, 0), plane.shape[0] - 1), min(max(j, 0), plane.shape[1] - 1)
