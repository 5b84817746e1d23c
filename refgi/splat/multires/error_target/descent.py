"""Irradiance carried from level to finer level: known cells stay, the rest is blended from the coarser level.

Blend weights are those of `interpolate`. All arrays of irradiance are in W/m^2.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.splat.multires.error_target.interpolate import tent_of
from refgi.splat.multires.error_target.near import SIDE, near_irradiance_at

Array = npt.NDArray[Any]


@kernel
def fill_coarsest(representative: Array, exact: Array, near: Array, has_near: Array, irradiance: Array) -> None:
    """Fill the coarsest level's irradiance, (3, h_l, w_l), all of which is known."""
    irradiance[:] = 0
    for i in range(representative.shape[0]):
        for j in range(representative.shape[1]):
            if representative[i, j] >= 0:
                _write_exact(exact, near, has_near, representative[i, j], i, j, irradiance)


@kernel(parallel=True)
def fill_level(
    coarse: Array, weight: Array, across: Array, split: Array, representative: Array, exact: Array, near: Array,
    has_near: Array, fine: Array, known: Array, surplus: Array,
) -> None:
    """Fill a level other than the picture itself with irradiance, (3, h_l, w_l), without the near part; 0 where empty.

    coarse: (3, h_l+1, w_l+1), the coarser level; weight, across: of the level's `BlendWeights`; split: (h_l+1, w_l+1)
    bool, coarser cells whose children are known; representative: (h_l, w_l) flat indices, -1 where empty; exact: (3, h,
    w), irradiance of pixels where known; near, has_near: of `NearLight`. Fills known, (h_l, w_l) bool, and surplus,
    (h_l, w_l): the squared difference of known cells to their interpolation over all channels (the hierarchical
    surplus); 0 elsewhere.
    """
    for i in prange(split.shape[0]):
        _blend_row(coarse, weight, across, i, fine)
        last = min(2 * i + 2, representative.shape[0])
        known[2 * i : last], surplus[2 * i : last] = False, 0
        for j in range(split.shape[1]):
            if not split[i, j]:
                continue
            for y in range(2 * i, last):
                for x in range(2 * j, min(2 * j + 2, representative.shape[1])):
                    p = representative[y, x]
                    if p >= 0:
                        known[y, x] = True
                        surplus[y, x] = _write_exact(exact, near, has_near, p, y, x, fine)


@kernel
def _write_exact(exact: Array, near: Array, has_near: Array, p: int, y: int, x: int, fine: Array) -> Any:
    """Replace the interpolation of a cell by its known irradiance; return the square of their difference."""
    square = fine.dtype.type(0.0)
    row, column = p // exact.shape[2], p % exact.shape[2]
    for c in range(3):
        value = exact[c, row, column] - near_irradiance_at(near, has_near, c, row, column)
        square += (value - fine[c, y, x]) * (value - fine[c, y, x])
        fine[c, y, x] = value
    return square


@kernel(parallel=True)
def fill_picture(
    coarse: Array, weight: Array, across: Array, split: Array, covered: Array, exact: Array, near: Array,
    has_near: Array, picture: Array,
) -> None:
    """Fill the picture, (3, h, w): known pixels as they are, others with their interpolation and the near part.

    covered: (h, w) bool; the others are those of `fill_level`, for level 0.
    """
    height, width = picture.shape[1:]
    for i in prange(split.shape[0]):
        _blend_row(coarse, weight, across, i, picture)
        last = min(2 * i + 2, height)
        for k in range(has_near.shape[1]):
            if has_near[2 * i // SIDE, k]:
                for c in range(3):
                    for y in range(2 * i, last):
                        for x in range(k * SIDE, min(k * SIDE + SIDE, width)):
                            picture[c, y, x] += near[c, y, x]
        for j in range(split.shape[1]):
            if split[i, j]:
                for c in range(3):
                    for y in range(2 * i, last):
                        for x in range(2 * j, min(2 * j + 2, width)):
                            picture[c, y, x] = exact[c, y, x] if covered[y, x] else picture[c, y, x]


@kernel(parallel=True)
def residuals(
    pixel: Array, coarse: Array, weight: Array, across: Array, split: Array, exact: Array, near: Array, has_near: Array,
    residual: Array,
) -> None:
    """Fill residual, (3, n), with exact less `fill_picture` at the pixels (n flat indices) where exact is known."""
    width, zero = exact.shape[2], residual.dtype.type(0.0)
    for k in prange(len(pixel)):
        y, x = pixel[k] // width, pixel[k] % width
        i, j, child = y >> 1, x >> 1, 2 * (y & 1) + (x & 1)
        for c in range(3):
            blended = zero
            for corner in range(4):
                if tent_of(across, child, corner) > zero:
                    row, column = i + (corner >> 1) * (2 * (y & 1) - 1), j + (corner & 1) * (2 * (x & 1) - 1)
                    if 0 <= row < coarse.shape[1] and 0 <= column < coarse.shape[2]:
                        blended += weight[4 * child + corner, i, j] * coarse[c, row, column]
            picture = blended + near_irradiance_at(near, has_near, c, y, x)
            residual[c, k] = zero if split[i, j] else exact[c, y, x] - picture


@kernel
def _blend_row(coarse: Array, weight: Array, across: Array, i: int, fine: Array) -> None:
    """Blend the two finer rows within row i of coarser cells."""
    height, width = coarse.shape[1:]
    blended = np.empty((2, width), coarse.dtype)
    for v in range(min(2, fine.shape[1] - 2 * i)):
        for c in range(3):
            blended[:] = 0
            for u in range(2):
                for corner in range(4):
                    row, right = i + (corner >> 1) * (2 * v - 1), (corner & 1) * (2 * u - 1)
                    if tent_of(across, 2 * v + u, corner) > 0 and 0 <= row < height:
                        first, last = max(0, -right), width - max(0, right)
                        _add(weight[8 * v + 4 * u + corner, i, first:last], coarse[c, row, first + right :],
                             blended[u, first:last])
            _interleave(blended[0], blended[1], fine[c, 2 * i + v])


@kernel
def _add(weight: Array, irradiance: Array, blended: Array) -> None:
    for j in range(len(blended)):
        blended[j] += weight[j] * irradiance[j]


@kernel
def _interleave(even: Array, odd: Array, row: Array) -> None:
    for j in range(len(row) // 2):
        row[2 * j] = even[j]
        row[2 * j + 1] = odd[j]
    if len(row) % 2:
        row[len(row) - 1] = even[len(row) // 2]
