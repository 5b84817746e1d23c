"""From level to level by what surfaces have in common: an interpolation that edges do not need to stop.

The tent of P7 mixes what lies next to each other on the screen. Here each of its four neighbours k of the coarser level
is weighed by how much its surface is that of the finer cell's pixel as well (and pixels by where the pixels that stand
for cells of level 1 are: half a pixel off these cells' centres)::

    a = <n . n_k>^128 (1 - |n . (x_k - x)| / |x_k - x|)^4,

as at half resolution, but sharper: facets a few degrees apart must not mix at an error of 1 %. A cell that no neighbour
agrees with takes the plain tent.

How well the normal itself is interpolated says, before any light is known, where light cannot be: without visibility, E
is a smooth function of position and normal. The squares of what it misses are added up over all pixels of each cell.

Coarser cells are the SIMD lanes. The four finer cells of each, its *children*, are seen to one after the other: child
2 v + u lies below (v = 1) and to the right (u = 1), so that its neighbours lie to that side.

Symbols: x, n position and normal of the finer cell's pixel, x_k, n_k those of a coarser neighbour.

The surfaces that stand for the cells of each level, side by side as in a picture of that level's size.
"""

import itertools
import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange, threads
from refgi.rsm.memory import plane
from refgi.splat.multires.refinement.grid import level_shape, representative
from refgi.stages import stage

Array = npt.NDArray[Any]

FEW_CELLS = 1 << 16  # of a level, that one thread has seen to before others are awake
LEAST_AGREEMENT = 1e-12  # of 1; leaves the plain tent where nothing agrees
LANES = 128  # coarser cells a thread works on at once
ROWS = 22
OWN, OTHER, WEIGHT, TOTAL, MADE = 0, 7, 14, 18, 19  # first rows of a tile: x, n and whether there is a surface, ...


class Level(NamedTuple):
    """One surface for each cell."""

    position: Array  # (3, h_l, w_l), world space, m
    normal: Array  # (3, h_l, w_l), unit vectors; both 0 where a cell is empty
    covered: Array  # (h_l, w_l) bool
    place: Array  # (h_l, w_l) int32, the pixel that stands for it, -1 where empty; (0, 0) at level 0: each its own

    @property
    def crew(self) -> int | None:
        """Threads that are worth waking for the level; None: all."""
        return 1 if self.covered.size <= FEW_CELLS else None


def levels_of(position: Array, normal: Array, covered: Array, top: int) -> tuple[Level, ...]:
    """Return the surfaces of levels 0, the picture itself, to `top`.

    Parameters
    ----------
    position, normal : (3, h, w) ndarray
        World space, m, and unit vectors.
    covered : (h, w) ndarray of bool
        Whether there is a surface.
    top : int
        Coarsest level.

    Returns
    -------
    tuple of Level
        Each cell is where the pixel is that stands for it, of `representative`.
    """
    position, normal, covered = (np.ascontiguousarray(part) for part in (position, normal, covered))
    levels = [Level(position, normal, covered, np.empty((0, 0), np.int32))]
    for level in range(1, top + 1):
        shape = level_shape(covered.shape[0], covered.shape[1], level)
        one = Level(plane((3, *shape), position.dtype), plane((3, *shape), position.dtype), plane(shape, np.bool_),
                    plane(shape, np.int32))
        with threads(one.crew):
            _gather(position, normal, covered, level, *one)
        levels.append(one)
    return tuple(levels)


@kernel(parallel=True)
def _gather(
    position: Array, normal: Array, covered: Array, level: int, at: Array, facing: Array, there: Array, place: Array
) -> None:
    width, zero = covered.shape[1], position.dtype.type(0.0)
    for i in prange(place.shape[0]):
        for j in range(place.shape[1]):
            p = representative(covered, level, i, j)
            place[i, j], there[i, j] = p, p >= 0
            y, x = max(p, 0) // width, max(p, 0) % width
            for c in range(3):
                at[c, i, j] = position[c, y, x] if p >= 0 else zero
                facing[c, i, j] = normal[c, y, x] if p >= 0 else zero


class Blend(NamedTuple):
    """How the cells of a level are made of the coarser level."""

    weight: Array  # (16, h_l+1, w_l+1): 4 child + corner; corners: the parent, its neighbours in column, row and both
    across: Array  # (2,) the tent's share of a neighbour for even and odd cells; weights of those with 0 are not filled
    rest: Array  # (h_l+1, w_l+1), squares of the error of the interpolated normal, over all pixels of each coarser cell


@stage("splat.blends")
def blends(levels: tuple[Level, ...]) -> tuple[Blend, ...]:
    """Weigh the coarser neighbours of every cell.

    Parameters
    ----------
    levels : tuple of Level
        Surfaces, from level 0.

    Returns
    -------
    tuple of Blend
        For every level but the coarsest. Weights of a cell sum to 1, or 0 where it is empty.
    """
    made: list[Blend] = []
    for fine, coarse in itertools.pairwise(levels):
        real = fine.position.dtype
        across = np.array([0.25, 0.25] if made else [0.5, 0.0], real)
        blend = Blend(plane((16, *coarse.covered.shape), real), across, plane(coarse.covered.shape, real))
        below = made[-1].rest if made else np.zeros((0, 0), real)
        with threads(fine.crew):
            _weigh(fine[:3], coarse[:3], across, below, 4.0 ** len(made), blend.weight, blend.rest)
        made.append(blend)
    return tuple(made)


@kernel(parallel=True)
def _weigh(
    fine: Any, coarse: Any, across: Array, below: Array, pixels: float, weight: Array, rest: Array
) -> None:
    for i in prange(rest.shape[0]):
        rest[i] = 0
        for first in range(0, rest.shape[1], LANES):
            for child in range(4):
                if 2 * i + (child >> 1) < fine[2].shape[0]:
                    _weigh_child(fine, coarse, across, below, pixels, child, i, first, weight, rest)


@kernel
def tent_of(across: Array, child: int, corner: int) -> Any:
    """Return the plain tent's weight of a corner for a child.

    Parameters
    ----------
    across : (2,) ndarray
        Of a `Blend`.
    child, corner : int
        0 to 3 each.

    Returns
    -------
    float
        0 where the weights of a `Blend` are not filled.
    """
    one = across.dtype.type(1.0)
    down, right = across[child >> 1], across[child & 1]
    return (down if corner >> 1 else one - down) * (right if corner & 1 else one - right)


@kernel
def _weigh_child(
    fine: Any, coarse: Any, across: Array, below: Array, pixels: float, child: int, i: int, first: int, weight: Array,
    rest: Array,
) -> None:
    """Weigh the neighbours of one child of each of LANES cells."""
    v, u = child >> 1, child & 1
    tile = np.zeros((ROWS, LANES), rest.dtype)
    _load(fine, 2 * i + v, 2 * first + u, 2, tile[OWN : OWN + 7])
    for corner in range(4):
        tent = tent_of(across, child, corner)
        if tent > 0:
            _load(coarse, i + (corner >> 1) * (2 * v - 1), first + (corner & 1) * (2 * u - 1), 1,
                  tile[OTHER : OTHER + 7])
            _share(tile, tent, corner)
    for corner in range(4):
        if tent_of(across, child, corner) > 0:
            _normalise(tile[WEIGHT + corner], tile[TOTAL], weight[4 * child + corner, i, first : first + LANES])
    _add_rest(tile, below, rest.dtype.type(pixels), child, i, first, rest)


@kernel
def _load(surface: Any, row: int, column: int, step: int, rows: Array) -> None:
    """Copy every `step`-th cell of a row, from a column on; nothing is there outside."""
    position, normal, covered = surface
    height, width = covered.shape
    inside = 0 <= row < height
    begin = 1 if column < 0 else 0
    end = max(begin, min(LANES, (width - column + step - 1) // step)) if inside else begin
    rows[6] = 0
    if begin < end:
        first = column + step * begin
        _copy(covered[row, first:], step, rows[6, begin:end])
        for c in range(3):
            _copy(position[c, row, first:], step, rows[c, begin:end])
            _copy(normal[c, row, first:], step, rows[3 + c, begin:end])


@kernel
def _copy(cells: Array, step: int, row: Array) -> None:
    if step == 1:
        for k in range(len(row)):
            row[k] = cells[k]
    else:
        for k in range(len(row)):
            row[k] = cells[2 * k]


@kernel
def _share(tile: Array, tent: Any, corner: int) -> None:
    """Weigh one neighbour of each cell, without branches."""
    real = type(tent)
    zero, one = real(0.0), real(1.0)
    for k in range(LANES):
        nx, ny, nz = tile[OWN + 3, k], tile[OWN + 4, k], tile[OWN + 5, k]
        mx, my, mz = tile[OTHER + 3, k], tile[OTHER + 4, k], tile[OTHER + 5, k]
        dx, dy, dz = tile[OTHER, k] - tile[OWN, k], tile[OTHER + 1, k] - tile[OWN + 1, k], (
            tile[OTHER + 2, k] - tile[OWN + 2, k])
        square = dx * dx + dy * dy + dz * dz
        away = dx * nx + dy * ny + dz * nz
        sine = math.sqrt(away * away / (square if square > zero else one))
        flat = one - (sine if sine < one else one)
        power = nx * mx + ny * my + nz * mz
        power = power if power > zero else zero
        power = power if power < one else one
        power = power * power  # unrolled: a loop in here would keep the lanes apart
        power = power * power
        power = power * power
        power = power * power
        power = power * power
        power = power * power
        power = power * power
        flat = flat * flat
        share = tent * (power * (flat * flat) + real(LEAST_AGREEMENT)) * (tile[OWN + 6, k] * tile[OTHER + 6, k])
        tile[WEIGHT + corner, k] = share
        tile[TOTAL, k] += share
        tile[MADE, k] += share * mx
        tile[MADE + 1, k] += share * my
        tile[MADE + 2, k] += share * mz


@kernel
def _normalise(share: Array, total: Array, weight: Array) -> None:
    zero = share.dtype.type(0.0)
    for k in range(len(weight)):
        weight[k] = share[k] / total[k] if total[k] > zero else zero


@kernel
def _add_rest(tile: Array, below: Array, pixels: Any, child: int, i: int, first: int, rest: Array) -> None:
    """Add what stopping at the coarser cells does to the normals of the pixels of one child of each."""
    zero, one = type(pixels)(0.0), type(pixels)(1.0)
    for k in range(LANES):
        there = tile[TOTAL, k] > zero
        scale = one / (tile[TOTAL, k] if there else one)
        x = tile[MADE, k] * scale - tile[OWN + 3, k]
        y = tile[MADE + 1, k] * scale - tile[OWN + 4, k]
        z = tile[MADE + 2, k] * scale - tile[OWN + 5, k]
        tile[MADE, k] = pixels * (x * x + y * y + z * z) if there else zero
    for k in range(min(LANES, rest.shape[1] - first)):
        rest[i, first + k] += tile[MADE, k]
    if below.size:
        column = 2 * first + (child & 1)
        for k in range(min(LANES, (below.shape[1] - column + 1) // 2)):
            rest[i, first + k] += below[2 * i + (child >> 1), column + 2 * k]
