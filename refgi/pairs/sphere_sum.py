"""The sum over all pairs of virtual spherical light and receiver, the clamp "sphere" of Eq. 2.

Tiles, groups and order of the lights are those of `pair_sum`. A first pass runs over the receivers as lanes and takes
the closed form; it leaves a mark where a horizon cuts the cone, and a second pass sees to those receivers one by one.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.pairs.pair_sum import (
    GROUP,
    LEAST_SQUARE,
    NX,
    ROWS,
    SUM,
    TILE,
    TOTAL,
    X,
    close_group,
    load_tile,
    pair_cosines,
)
from refgi.pairs.pixel_lights import Range
from refgi.pairs.ranged_sum import range_factor
from refgi.pairs.sphere_pair import LEAST_RATIO, cone_term, cut_cone_term

Array = npt.NDArray[Any]

TERM, RATIO = range(ROWS, ROWS + 2)  # further rows of a tile: of one light, 1/m^2; sin^2 a of cones that are cut, or 0


@kernel(parallel=True)
def sum_spheres(
    position: Array, normal: Array, lights: Array, square_radius: Array, reach: Range | None, irradiance: Array
) -> None:
    """Fill irradiance (3, n), W/m^2, with the sum of every spherical light at every receiver (Hasan et al. 2009).

    Arguments as for `pair_sum.sum_pairs`, with `square_radius` (N,) the squares of the lights' radii, m^2, and `reach`
    by the point light in the middle of the sphere. No light is culled: one behind a horizon still reaches over it by
    its radius.
    """
    count = position.shape[1]
    for block in prange((count + TILE - 1) // TILE):
        first = block * TILE
        size = min(TILE, count - first)
        tile = np.zeros((ROWS + 2, TILE), position.dtype)
        load_tile(tile, position, normal, first, size)
        for group in range(0, lights.shape[1] - 1, GROUP):
            for k in range(group, min(group + GROUP, lights.shape[1] - 1)):
                light = lights[0, k], lights[1, k], lights[2, k], lights[3, k], lights[4, k], lights[5, k]
                whole_cones(tile, light, square_radius[k])
                cut_cones(tile, light, square_radius[k], size)
                if reach is not None:
                    _weight(tile, light, reach.square[k], reach.scale[k], reach.outside)
                for i in range(TILE):
                    tile[SUM, i] += tile[TERM, i] * lights[6, k]
                    tile[SUM + 1, i] += tile[TERM, i] * lights[7, k]
                    tile[SUM + 2, i] += tile[TERM, i] * lights[8, k]
            close_group(tile)
        for c in range(3):
            for i in range(size):
                irradiance[c, first + i] = tile[TOTAL + c, i]


@kernel
def whole_cones(tile: Array, light: Any, square_radius: Any) -> None:
    """Fill row TERM (1/m^2) where no horizon cuts the cone, and mark the other receivers in row RATIO.

    `light` is position and reversed normal, `square_radius` that of its sphere, m^2.
    """
    real = tile.dtype.type
    one, zero = real(1.0), real(0.0)
    px, py, pz, lx, ly, lz = light
    for i in range(tile.shape[1]):
        dx, dy, dz = px - tile[X, i], py - tile[X + 1, i], pz - tile[X + 2, i]
        nx, ny, nz = tile[NX, i], tile[NX + 1, i], tile[NX + 2, i]
        exact, cl, cx = pair_cosines(dx, dy, dz, lx, ly, lz, nx, ny, nz)
        square = exact if exact > real(LEAST_SQUARE) else real(LEAST_SQUARE)
        clamped = square if square > square_radius else square_radius
        ratio = square_radius / clamped
        inverse = one / math.sqrt(square)
        cl, cx = cl * inverse, cx * inverse
        low = cl if cl < cx else cx
        sin_a = math.sqrt(ratio) if ratio >= real(LEAST_RATIO) else zero
        term = cone_term(cl, cx, lx * nx + ly * ny + lz * nz, ratio) / clamped
        tile[TERM, i] = term if (low >= sin_a) & (low > zero) else zero
        tile[RATIO, i] = ratio if (low < sin_a) & (low > -sin_a) & (exact > real(LEAST_SQUARE)) else zero


@kernel
def cut_cones(tile: Array, light: Any, square_radius: Any, size: int) -> None:
    """Fill row TERM (1/m^2) of the receivers that `whole_cones` marked, out of the first `size`."""
    real = tile.dtype.type
    px, py, pz, lx, ly, lz = light
    for i in range(size):
        ratio = tile[RATIO, i]
        if ratio > real(0.0):
            dx, dy, dz = px - tile[X, i], py - tile[X + 1, i], pz - tile[X + 2, i]
            square = dx * dx + dy * dy + dz * dz
            inverse = real(1.0) / math.sqrt(square)
            axis = dx * inverse, dy * inverse, dz * inverse
            normal = tile[NX, i], tile[NX + 1, i], tile[NX + 2, i]
            tile[TERM, i] = cut_cone_term(axis, (lx, ly, lz), normal, ratio) / max(square, square_radius)


@kernel
def _weight(tile: Array, light: Any, square_range: Any, scale: Any, outside: bool) -> None:
    """Multiply row TERM by what the range makes of each pair."""
    px, py, pz, lx, ly, lz = light
    for i in range(TILE):
        dx, dy, dz = px - tile[X, i], py - tile[X + 1, i], pz - tile[X + 2, i]
        tile[TERM, i] *= range_factor(dx, dy, dz, lx, ly, lz, square_range, scale, outside)
