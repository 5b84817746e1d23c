"""Blend weights between levels by the similarity of their surfaces: an interpolation that edges do not need to stop.

Each of the tent's four neighbours k of the coarser level is weighted by a = <n . n_k>^128 (1 - |n . (x_k - x)| /
|x_k - x|)^4 as well, x, n and x_k, n_k surfaces of the finer cell and of the neighbour; a cell that is similar to none
has the plain tent. How well the normal itself is interpolated predicts where irradiance cannot be: its squared errors
are summed over all pixels of each cell. Coarser cells are the SIMD lanes. Of the four finer cells of each, its
*children*, 2 v + u lies below (v = 1) and to the right (u = 1), so that its neighbours lie to that side.
"""

import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from refgi.error_target.grid import level_shape, representative
from refgi.jit import kernel, prange, threads
from refgi.rsm.pool import plane
from refgi.stages import stage
from refgi.types import Array

FEW_CELLS = 1 << 16  # of a level, that one thread has processed before others are awake
LEAST_AGREEMENT = 1e-12  # of 1; leaves the plain tent where nothing agrees
LANES = 128  # coarser cells a thread works on at once
ROWS = 22
OWN, OTHER, WEIGHT, TOTAL, BLENDED = 0, 7, 14, 18, 19  # first rows of a tile: x, n and whether there is a surface, ...


class SurfaceLevel(NamedTuple):
    """The surface at the representative pixel of each cell of a level."""

    position: Array  # (3, h_l, w_l), world space, m
    normal: Array  # (3, h_l, w_l), unit vectors; both 0 where a cell is empty
    covered: Array  # (h_l, w_l) bool
    representative_pixel: Array  # (h_l, w_l) int32, flat index, -1 where empty; (0, 0) at level 0: each its own

    @property
    def thread_count(self) -> int | None:
        """Threads that are worth waking for the level; None: all."""
        return 1 if self.covered.size <= FEW_CELLS else None


def surface_levels(position: Array, normal: Array, covered: Array, top: int) -> tuple[SurfaceLevel, ...]:
    """Return the surfaces of levels 0, the picture itself, to `top`, at the representative pixels.

    position, normal: (3, h, w), world space, m, and unit vectors; covered: (h, w) bool.
    """
    position, normal, covered = (np.ascontiguousarray(part) for part in (position, normal, covered))
    levels = [SurfaceLevel(position, normal, covered, np.empty((0, 0), np.int32))]
    for level in range(1, top + 1):
        shape = level_shape(covered.shape[0], covered.shape[1], level)
        one = SurfaceLevel(plane((3, *shape), position.dtype), plane((3, *shape), position.dtype),
                           plane(shape, np.bool_), plane(shape, np.int32))
        with threads(one.thread_count):
            _fill_surfaces(position, normal, covered, level, *one)
        levels.append(one)
    return tuple(levels)


@kernel(parallel=True)
def _fill_surfaces(
    position: Array, normal: Array, covered: Array, level: int, surface_position: Array, surface_normal: Array,
    valid: Array, representative_pixel: Array,
) -> None:
    width, zero = covered.shape[1], position.dtype.type(0.0)
    for i in prange(representative_pixel.shape[0]):
        for j in range(representative_pixel.shape[1]):
            p = representative(covered, level, i, j)
            representative_pixel[i, j], valid[i, j] = p, p >= 0
            y, x = max(p, 0) // width, max(p, 0) % width
            for c in range(3):
                surface_position[c, i, j] = position[c, y, x] if p >= 0 else zero
                surface_normal[c, i, j] = normal[c, y, x] if p >= 0 else zero


class BlendWeights(NamedTuple):
    """Weights that make the cells of a level out of the coarser level."""

    weight: Array  # (16, h_l+1, w_l+1): 4 child + corner; corners: the parent, its neighbours in column, row and both
    across: Array  # (2,) the tent's share of a neighbour for even and odd cells; weights of those with 0 are not filled
    normal_error: Array  # (h_l+1, w_l+1), sum of squares over each coarser cell's pixels: interpolated normal - normal


@stage("error_target.blends")
def blend_weights(levels: tuple[SurfaceLevel, ...]) -> tuple[BlendWeights, ...]:
    """Return the weights of the coarser neighbours of every cell.

    levels: Surfaces, from level 0.
    -> tuple of BlendWeights: For every level but the coarsest. Weights of a cell sum to 1, or 0 where it is empty.
    """
    made: list[BlendWeights] = []
    for fine, coarse in itertools.pairwise(levels):
        real = fine.position.dtype
        across = np.array([0.25, 0.25] if made else [0.5, 0.0], real)
        blend = BlendWeights(plane((16, *coarse.covered.shape), real), across, plane(coarse.covered.shape, real))
        below = made[-1].normal_error if made else np.zeros((0, 0), real)
        with threads(fine.thread_count):
            _weigh(fine[:3], coarse[:3], across, below, 4.0 ** len(made), blend.weight, blend.normal_error)
        made.append(blend)
    return tuple(made)


@kernel(parallel=True)
def _weigh(
    fine: Any, coarse: Any, across: Array, below: Array, pixels: float, weight: Array, normal_error: Array
) -> None:
    for i in prange(normal_error.shape[0]):
        normal_error[i] = 0
        for first in range(0, normal_error.shape[1], LANES):
            for child in range(4):
                if 2 * i + (child >> 1) < fine[2].shape[0]:
                    _weigh_child(fine, coarse, across, below, pixels, child, i, first, weight, normal_error)


@kernel
def tent_of(across: Array, child: int, corner: int) -> Any:
    """Return the plain tent's weight of a corner for a child (0 to 3 each); 0 where `BlendWeights` are not filled."""
    one = across.dtype.type(1.0)
    down, right = across[child >> 1], across[child & 1]
    return (down if corner >> 1 else one - down) * (right if corner & 1 else one - right)


@kernel
def _weigh_child(
    fine: Any, coarse: Any, across: Array, below: Array, pixels: float, child: int, i: int, first: int, weight: Array,
    normal_error: Array,
) -> None:
    """Compute the weights of one child of each of LANES cells."""
    v, u = child >> 1, child & 1
    tile = np.zeros((ROWS, LANES), normal_error.dtype)
    _load(fine, 2 * i + v, 2 * first + u, 2, tile[OWN : OWN + 7])
    for corner in range(4):
        tent = tent_of(across, child, corner)
        if tent > 0:
            _load(coarse, i + (corner >> 1) * (2 * v - 1), first + (corner & 1) * (2 * u - 1), 1,
                  tile[OTHER : OTHER + 7])
            _weigh_neighbour(tile, tent, corner)
    for corner in range(4):
        if tent_of(across, child, corner) > 0:
            _normalise(tile[WEIGHT + corner], tile[TOTAL], weight[4 * child + corner, i, first : first + LANES])
    _add_normal_error(tile, below, normal_error.dtype.type(pixels), child, i, first, normal_error)


@kernel
def _load(surface: Any, row: int, column: int, step: int, rows: Array) -> None:
    """Copy every `step`-th cell of a row, from a column on; zeros outside."""
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
def _weigh_neighbour(tile: Array, tent: Any, corner: int) -> None:
    """Add one neighbour's bilateral weight a, times the tent, for each cell, without branches."""
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
        # a = <n . n_k>^128 (1 - |n . (x_k - x)| / |x_k - x|)^4
        share = tent * (power * (flat * flat) + real(LEAST_AGREEMENT)) * (tile[OWN + 6, k] * tile[OTHER + 6, k])
        tile[WEIGHT + corner, k] = share
        tile[TOTAL, k] += share
        tile[BLENDED, k] += share * mx
        tile[BLENDED + 1, k] += share * my
        tile[BLENDED + 2, k] += share * mz


@kernel
def _normalise(share: Array, total: Array, weight: Array) -> None:
    zero = share.dtype.type(0.0)
    for k in range(len(weight)):
        weight[k] = share[k] / total[k] if total[k] > zero else zero


@kernel
def _add_normal_error(
    tile: Array, below: Array, pixels: Any, child: int, i: int, first: int, normal_error: Array
) -> None:
    """Add the squared error of the interpolated normal over the pixels of one child of each cell."""
    zero, one = type(pixels)(0.0), type(pixels)(1.0)
    for k in range(LANES):
        valid = tile[TOTAL, k] > zero
        scale = one / (tile[TOTAL, k] if valid else one)
        x = tile[BLENDED, k] * scale - tile[OWN + 3, k]
        y = tile[BLENDED + 1, k] * scale - tile[OWN + 4, k]
        z = tile[BLENDED + 2, k] * scale - tile[OWN + 5, k]
        tile[BLENDED, k] = pixels * (x * x + y * y + z * z) if valid else zero
    for k in range(min(LANES, normal_error.shape[1] - first)):
        normal_error[i, first + k] += tile[BLENDED, k]
    if below.size:
        column = 2 * first + (child & 1)
        for k in range(min(LANES, (below.shape[1] - column + 1) // 2)):
            normal_error[i, first + k] += below[2 * i + (child >> 1), column + 2 * k]
