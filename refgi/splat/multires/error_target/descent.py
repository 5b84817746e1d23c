"""Light on its way down the levels: what is known stays, the rest is made of the coarser level (`interpolate`)."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.splat.multires.error_target.interpolate import tent_of
from refgi.splat.multires.error_target.near import SIDE, near_at

Array = npt.NDArray[Any]


@kernel
def begin(place: Array, exact: Array, near: Array, touched: Array, light: Array) -> None:
    """Fill the coarsest level, of which all is known.

    Parameters
    ----------
    place, exact, near, touched : ndarray
        As in `descend`.
    light : (3, h_l, w_l) ndarray
        Filled.
    """
    light[:] = 0
    for i in range(place.shape[0]):
        for j in range(place.shape[1]):
            if place[i, j] >= 0:
                _keep(exact, near, touched, place[i, j], i, j, light)


@kernel(parallel=True)
def descend(
    coarse: Array, weight: Array, across: Array, split: Array, place: Array, exact: Array, near: Array, touched: Array,
    fine: Array, known: Array, surplus: Array,
) -> None:
    """Fill a level that is not the picture itself.

    Parameters
    ----------
    coarse : (3, h_l+1, w_l+1) ndarray
        Light of the coarser level, W/m^2.
    weight, across : ndarray
        Of the level's `Blend`.
    split : (h_l+1, w_l+1) ndarray of bool
        Coarser cells whose children's light is known.
    place : (h_l, w_l) ndarray
        The pixel that stands for each cell, -1 where empty.
    exact : (3, h, w) ndarray
        Light of pixels, where known.
    near, touched : ndarray
        Of `NearLight`: what of it no interpolation holds.
    fine : (3, h_l, w_l) ndarray
        Filled with light without what is near; 0 where empty.
    known : (h_l, w_l) ndarray of bool
        Filled: cells whose light is known.
    surplus : (h_l, w_l) ndarray
        Filled with the square of what known cells differ by from their interpolation, all channels; 0 elsewhere.
    """
    for i in prange(split.shape[0]):
        _blend_row(coarse, weight, across, i, fine)
        last = min(2 * i + 2, place.shape[0])
        known[2 * i : last], surplus[2 * i : last] = False, 0
        for j in range(split.shape[1]):
            if not split[i, j]:
                continue
            for y in range(2 * i, last):
                for x in range(2 * j, min(2 * j + 2, place.shape[1])):
                    p = place[y, x]
                    if p >= 0:
                        known[y, x] = True
                        surplus[y, x] = _keep(exact, near, touched, p, y, x, fine)


@kernel
def _keep(exact: Array, near: Array, touched: Array, p: int, y: int, x: int, fine: Array) -> Any:
    """Put what is known of a cell in place of its interpolation; return the square of their difference."""
    square = fine.dtype.type(0.0)
    row, column = p // exact.shape[2], p % exact.shape[2]
    for c in range(3):
        value = exact[c, row, column] - near_at(near, touched, c, row, column)
        square += (value - fine[c, y, x]) * (value - fine[c, y, x])
        fine[c, y, x] = value
    return square


@kernel(parallel=True)
def assemble(
    coarse: Array, weight: Array, across: Array, split: Array, covered: Array, exact: Array, near: Array,
    touched: Array, picture: Array,
) -> None:
    """Fill the picture: known pixels as they are, others with their interpolation and what is near.

    Parameters
    ----------
    coarse, weight, across, split : ndarray
        As in `descend`, for level 0.
    covered : (h, w) ndarray of bool
        Whether there is a surface.
    exact, near, touched : ndarray
        As in `descend`.
    picture : (3, h, w) ndarray
        Filled, W/m^2.
    """
    height, width = picture.shape[1:]
    for i in prange(split.shape[0]):
        _blend_row(coarse, weight, across, i, picture)
        last = min(2 * i + 2, height)
        for k in range(touched.shape[1]):
            if touched[2 * i // SIDE, k]:
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
def misses(
    pixel: Array, coarse: Array, weight: Array, across: Array, split: Array, exact: Array, near: Array, touched: Array,
    missed: Array,
) -> None:
    """Tell what the picture that `assemble` makes differs by from the full sum, at pixels where that is known.

    Parameters
    ----------
    pixel : (n,) ndarray of int64
        Flat indices.
    coarse, weight, across, split, exact, near, touched : ndarray
        As in `assemble`.
    missed : (3, n) ndarray
        Filled: the full sum less the picture, W/m^2.
    """
    width, zero = exact.shape[2], missed.dtype.type(0.0)
    for k in prange(len(pixel)):
        y, x = pixel[k] // width, pixel[k] % width
        i, j, child = y >> 1, x >> 1, 2 * (y & 1) + (x & 1)
        for c in range(3):
            made = zero
            for corner in range(4):
                if tent_of(across, child, corner) > zero:
                    row, column = i + (corner >> 1) * (2 * (y & 1) - 1), j + (corner & 1) * (2 * (x & 1) - 1)
                    if 0 <= row < coarse.shape[1] and 0 <= column < coarse.shape[2]:
                        made += weight[4 * child + corner, i, j] * coarse[c, row, column]
            missed[c, k] = zero if split[i, j] else exact[c, y, x] - (made + near_at(near, touched, c, y, x))


@kernel
def _blend_row(coarse: Array, weight: Array, across: Array, i: int, fine: Array) -> None:
    """Interpolate the two finer rows within a row of coarser cells."""
    height, width = coarse.shape[1:]
    made = np.empty((2, width), coarse.dtype)
    for v in range(min(2, fine.shape[1] - 2 * i)):
        for c in range(3):
            made[:] = 0
            for u in range(2):
                for corner in range(4):
                    row, right = i + (corner >> 1) * (2 * v - 1), (corner & 1) * (2 * u - 1)
                    if tent_of(across, 2 * v + u, corner) > 0 and 0 <= row < height:
                        first, last = max(0, -right), width - max(0, right)
                        _add(weight[8 * v + 4 * u + corner, i, first:last], coarse[c, row, first + right :],
                             made[u, first:last])
            _weave(made[0], made[1], fine[c, 2 * i + v])


@kernel
def _add(weight: Array, light: Array, made: Array) -> None:
    for j in range(len(made)):
        made[j] += weight[j] * light[j]


@kernel
def _weave(even: Array, odd: Array, row: Array) -> None:
    for j in range(len(row) // 2):
        row[2 * j] = even[j]
        row[2 * j + 1] = odd[j]
    if len(row) % 2:
        row[len(row) - 1] = even[len(row) // 2]
