"""One pixel light after another at a tile of glossy receivers: the terms of `glossy_sum`, group by group.

A light's terms are found in a few passes over the tile; one that lies in no lobe is passed over after the first, one
that lights none of the receivers before the power is taken. Symbols as in `glossy_sum`.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.elementary import exp2, log2p1
from refgi.jit import kernel
from refgi.lobes import lobe_gap
from refgi.pairs.lobe_culling import LIMIT
from refgi.pairs.lobe_shape import Widening
from refgi.pairs.lobe_sum import TERM, lobe_terms
from refgi.pairs.pair_sum import GROUP, NX, ROWS, SUM, Clamp, X, close_group, limits_of, pair_term
from refgi.pairs.pixel_lights import Range
from refgi.pairs.ranged_sum import LANES, range_factor
from refgi.pairs.sphere_sum import TERM as SPHERE_TERM
from refgi.pairs.sphere_sum import cut_cones, whole_cones

Array = npt.NDArray[Any]

M = ROWS + 5  # first further rows of a tile: those of `lobe_sum` come before
GAP, EXPONENT, FARTHEST, TILE_ROWS = M + 3, M + 4, M + 5, M + 6


@kernel
def add_diffuse_listed(
    tile: Array, size: int, lights: Array, clamp: Clamp | None, spheres: Array | None, reach: Range | None,
    chosen: Array, found: int,
) -> None:
    """Add the first `found` diffuse lights of `chosen`, which rise, to the totals of a tile, group by group."""
    group = -1
    for j in range(found):
        k = chosen[j]
        if _in_lobes(tile, lights, k) and _diffuse_terms(tile, size, lights, k, limits_of(clamp, k), spheres):
            if k // GROUP != group and group >= 0:
                close_group(tile)
            group = k // GROUP
            if reach is not None:
                _weight_by_range(tile, lights, k, reach.square[k], reach.scale[k], reach.outside)
            _add_weighted(tile, lights[6, k], lights[7, k], lights[8, k])
    if group >= 0:
        close_group(tile)


@kernel
def add_lobes_listed(
    tile: Array, lights: Array, bounds: Array, clamp: Clamp, widening: Widening | None, reach: Range | None,
    chosen: Array, found: int,
) -> None:
    """Add the first `found` lobes of `chosen`, which rise, to the totals of a tile, group by group."""
    lanes = np.uint64(0), np.uint64(LANES)
    group = -1
    for j in range(found):
        k = chosen[j]
        if _in_lobes(tile, lights, k):
            lit = lobe_terms(tile, lanes, lights, k, bounds[LIMIT, k], clamp, widening, reach)
            if lit and _clear_off_lobes(tile):
                if k // GROUP != group and group >= 0:
                    close_group(tile)
                group = k // GROUP
                _add_weighted(tile, lights[10, k], lights[11, k], lights[12, k])
    if group >= 0:
        close_group(tile)


@kernel
def _in_lobes(tile: Array, lights: Array, k: int) -> bool:
    """Fill row GAP with h of light k; return whether it lies in any lobe of the tile."""
    x, y, z = lights[0, k], lights[1, k], lights[2, k]
    for i in range(LANES):
        dx, dy, dz = x - tile[X, i], y - tile[X + 1, i], z - tile[X + 2, i]
        tile[GAP, i] = lobe_gap(tile[M, i], tile[M + 1, i], tile[M + 2, i], dx, dy, dz)
    found = np.int32(0)
    for i in range(LANES):  # apart, as in `lobe_sum`
        found |= np.int32(tile[GAP, i] < tile[FARTHEST, i])
    return bool(found)


@kernel
def _diffuse_terms(tile: Array, size: int, lights: Array, k: int, limits: Any, spheres: Array | None) -> bool:
    """Fill row TERM with g (1/m^2), 0 off a receiver's lobe, and clear row GAP there; return whether any is not 0."""
    x, y, z, lx, ly, lz = lights[0, k], lights[1, k], lights[2, k], lights[3, k], lights[4, k], lights[5, k]
    if spheres is not None:
        whole_cones(tile, (x, y, z, lx, ly, lz), spheres[k])
        cut_cones(tile, (x, y, z, lx, ly, lz), spheres[k], size)
        zero = tile.dtype.type(0.0)
        for i in range(LANES):
            dx, dy, dz = x - tile[X, i], y - tile[X + 1, i], z - tile[X + 2, i]
            above = dx * tile[NX, i] + dy * tile[NX + 1, i] + dz * tile[NX + 2, i] > zero
            tile[TERM, i] = tile[SPHERE_TERM, i] if above else zero
    else:
        for i in range(LANES):
            receiver = tile[X, i], tile[X + 1, i], tile[X + 2, i], tile[NX, i], tile[NX + 1, i], tile[NX + 2, i]
            tile[TERM, i] = pair_term((x, y, z, lx, ly, lz), receiver, limits)
    return _clear_off_lobes(tile)


@kernel
def _clear_off_lobes(tile: Array) -> bool:
    """Clear rows TERM and GAP off the lobes; return whether any TERM is left.

    Short loops with few rows each: from about eight pairs of rows on the compiler no longer finds out that they do not
    overlap.
    """
    zero = tile.dtype.type(0.0)
    for i in range(LANES):
        counts = tile[GAP, i] < tile[FARTHEST, i]
        tile[GAP, i] = tile[GAP, i] if counts else zero
        tile[TERM, i] = tile[TERM, i] if counts else zero
    found = np.int32(0)
    for i in range(LANES):
        found |= np.int32(tile[TERM, i] > zero)
    return bool(found)


@kernel
def _weight_by_range(tile: Array, lights: Array, k: int, square_range: Any, scale: Any, outside: bool) -> None:
    """Multiply row TERM by what the range of a diffuse light makes of each pair."""
    x, y, z, lx, ly, lz = lights[0, k], lights[1, k], lights[2, k], lights[3, k], lights[4, k], lights[5, k]
    for i in range(LANES):
        dx, dy, dz = x - tile[X, i], y - tile[X + 1, i], z - tile[X + 2, i]
        tile[TERM, i] *= range_factor(dx, dy, dz, lx, ly, lz, square_range, scale, outside)


@kernel
def _add_weighted(tile: Array, red: Any, green: Any, blue: Any) -> None:
    """Add TERM <m . w>^P times a colour to rows SUM."""
    for i in range(LANES):
        tile[GAP, i] = log2p1(-tile[GAP, i])
    for i in range(LANES):
        # f_s over its norm and reflectance
        tile[TERM, i] *= exp2(tile[EXPONENT, i] * tile[GAP, i])
    for i in range(LANES):
        # AMS Eq. (2)
        tile[SUM, i] += tile[TERM, i] * red
        tile[SUM + 1, i] += tile[TERM, i] * green
        tile[SUM + 2, i] += tile[TERM, i] * blue
