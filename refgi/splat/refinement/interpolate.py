"""From level to level by what surfaces have in common: an interpolation that edges do not need to stop.

The tent of P7 mixes what lies next to each other on the screen. Here each of its four neighbours k of the coarser level
is weighed by how much its surface is that of the finer cell's pixel as well (and pixels by where the pixels that stand
for cells of level 1 are: half a pixel off these cells' centres)::

    a = <n . n_k>^128 (1 - |n . (x_k - x)| / |x_k - x|)^4,

as at half resolution, but sharper: facets a few degrees apart must not mix at an error of 1 %. A cell that no neighbour
agrees with takes the plain tent.

How well the normal itself is interpolated says, before any light is known, where light cannot be: without visibility, E
is a smooth function of position and normal. `residuals` adds that up over all pixels of each cell.

Symbols: x, n position and normal of the finer cell's pixel, x_k, n_k those of a coarser neighbour.
"""

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.stages import stage

Array = npt.NDArray[Any]

LEAST_AGREEMENT = 1e-12  # of 1; leaves the plain tent where nothing agrees


class Blend(NamedTuple):
    """How each cell of a level is made of the coarser level."""

    weight: Array  # (4, h_l, w_l), of the parent, its neighbours in column, row and both; sums to 1, or 0 where empty
    residual: Array  # (h_l, w_l), square of the error of the interpolated normal


@stage("splat.blends")
def blends(position: Array, normal: Array, places: tuple[Array, ...]) -> tuple[Blend, ...]:
    """Weigh the coarser neighbours of every cell.

    Parameters
    ----------
    position, normal : (3, h, w) ndarray
        World space, m, and unit vectors.
    places : tuple of (h_l, w_l) ndarray
        The pixel that stands for each cell, of `representatives`.

    Returns
    -------
    tuple of Blend
        For every level but the coarsest.
    """
    flat_position, flat_normal = (np.ascontiguousarray(plane).reshape(3, -1) for plane in (position, normal))
    made: list[Blend] = []
    for here, above in itertools.pairwise(places):
        blend = Blend(np.zeros((4, *here.shape), position.dtype), np.zeros(here.shape, position.dtype))
        across = np.array([0.25, 0.25] if made else [0.5, 0.0], position.dtype)
        _weigh(flat_position, flat_normal, here, above, across, blend.weight, blend.residual)
        made.append(blend)
    return tuple(made)


def residuals(made: tuple[Blend, ...], coarsest: tuple[int, int]) -> tuple[Array, ...]:
    """Add up, for every cell, what stopping there does to the normals of its pixels.

    Parameters
    ----------
    made : tuple of Blend
        Of all levels but the coarsest.
    coarsest : tuple of 2 ints
        Cells of the coarsest level.

    Returns
    -------
    tuple of (h_l, w_l) ndarray
        Sums of squares over a cell's pixels, for levels 0 (all 0) to the coarsest.
    """
    sums = [np.zeros(made[0].residual.shape if made else coarsest, made[0].residual.dtype if made else np.float32)]
    for level, blend in enumerate(made):
        shape = made[level + 1].residual.shape if level + 1 < len(made) else coarsest
        above = np.zeros(shape, blend.residual.dtype)
        _collect(blend.residual, sums[level], 4.0**level, above)
        sums.append(above)
    return tuple(sums)


@kernel(parallel=True)
def _weigh(
    position: Array, normal: Array, here: Array, above: Array, across: Array, weight: Array, residual: Array
) -> None:
    for i in prange(here.shape[0]):
        for j in range(here.shape[1]):
            if here[i, j] >= 0:
                _weigh_cell(position, normal, here, above, across, weight, residual, i, j)


@kernel
def _weigh_cell(
    position: Array, normal: Array, here: Array, above: Array, across: Array, weight: Array, residual: Array, i: int,
    j: int,
) -> None:
    real = position.dtype.type
    p, total = here[i, j], real(0.0)
    nx, ny, nz = real(0.0), real(0.0), real(0.0)
    for corner in range(4):
        row, column = (i >> 1) + (corner >> 1) * (2 * (i & 1) - 1), (j >> 1) + (corner & 1) * (2 * (j & 1) - 1)
        vertical = across[i & 1] if corner >> 1 else real(1.0) - across[i & 1]
        tent = vertical * (across[j & 1] if corner & 1 else real(1.0) - across[j & 1])
        if tent == real(0.0) or not (0 <= row < above.shape[0] and 0 <= column < above.shape[1]):
            continue
        q = above[row, column]
        if q < 0:
            continue
        share = tent * (_agreement(position, normal, p, q) + real(LEAST_AGREEMENT))
        weight[corner, i, j] = share
        total += share
        nx, ny, nz = nx + share * normal[0, q], ny + share * normal[1, q], nz + share * normal[2, q]
    for corner in range(4):
        weight[corner, i, j] /= total
    nx, ny, nz = nx / total - normal[0, p], ny / total - normal[1, p], nz / total - normal[2, p]
    residual[i, j] = nx * nx + ny * ny + nz * nz


@kernel
def _agreement(position: Array, normal: Array, p: int, q: int) -> Any:
    """Return a of pixel q for pixel p."""
    real = position.dtype.type
    zero, one = real(0.0), real(1.0)
    dx, dy, dz = position[0, q] - position[0, p], position[1, q] - position[1, p], position[2, q] - position[2, p]
    nx, ny, nz = normal[0, p], normal[1, p], normal[2, p]
    cosine = nx * normal[0, q] + ny * normal[1, q] + nz * normal[2, q]
    if cosine <= zero:
        return zero
    square = dx * dx + dy * dy + dz * dz
    sine = abs(dx * nx + dy * ny + dz * nz) / math.sqrt(square) if square > zero else zero
    flat = one - (sine if sine < one else one)
    power = (cosine if cosine < one else one)
    for _ in range(7):
        power *= power
    flat *= flat
    return power * (flat * flat)


@kernel(parallel=True)
def _collect(residual: Array, below: Array, pixels: float, above: Array) -> None:
    height, width = residual.shape
    scale = residual.dtype.type(pixels)
    for i in prange(above.shape[0]):
        for j in range(above.shape[1]):
            for y in range(2 * i, min(2 * i + 2, height)):
                for x in range(2 * j, min(2 * j + 2, width)):
                    above[i, j] += scale * residual[y, x] + below[y, x]


@kernel(parallel=True)
def descend(
    coarse: Array, weight: Array, known: Array, place: Array, values: Array, fine: Array, surplus: Array
) -> None:
    """Fill a level: with light where it is known, elsewhere with what the coarser level makes of it.

    Parameters
    ----------
    coarse : (3, h_l+1, w_l+1) ndarray
        The coarser level.
    weight : (4, h_l, w_l) ndarray
        Of the level's `Blend`.
    known : (h_l, w_l) ndarray of bool
        Cells whose light is known.
    place : (h_l, w_l) ndarray
        The pixel that stands for each.
    values : (3, n) ndarray
        Light of pixels, where known.
    fine : (3, h_l, w_l) ndarray
        Filled; zeros before.
    surplus : (h_l, w_l) ndarray
        Filled with the square of what known cells differ by from their interpolation, all channels; 0 elsewhere.
    """
    real = fine.dtype.type
    height, width = coarse.shape[1:]
    for i in prange(fine.shape[1]):
        up, down = i >> 1, min(max((i >> 1) + 2 * (i & 1) - 1, 0), height - 1)
        for j in range(fine.shape[2]):
            left, right = j >> 1, min(max((j >> 1) + 2 * (j & 1) - 1, 0), width - 1)
            surplus[i, j] = real(0.0)
            if place[i, j] < 0:
                continue
            a, b, c, d = weight[0, i, j], weight[1, i, j], weight[2, i, j], weight[3, i, j]
            for channel in range(3):
                made = ((a * coarse[channel, up, left] + b * coarse[channel, up, right])
                        + (c * coarse[channel, down, left] + d * coarse[channel, down, right]))
                if known[i, j]:
                    value = values[channel, place[i, j]]
                    surplus[i, j] += (value - made) * (value - made)
                    made = value
                fine[channel, i, j] = made
