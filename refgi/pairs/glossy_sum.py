"""The sum over all pairs of pixel light and glossy receiver: radiance towards the eye (AMS Eq. 2 with its rho_s).

L_s = specular (P + 2) / (2 pi) sum over lights of <m . w>^P I(w) c_x / r^2, I c_x / r^2 the term of the diffuse sum,
clamped alike; m is the direction to the eye mirrored at the receiver, w the unit vector from it to the light. The power
is 2^(P log2(1 - h)), h = |m - w|^2 / 2, as for senders' lobes (`lobe_sum`). Tiles are of 64 receivers, each with the
lights that planes, ranges and its lobes leave (`lobe_culling`). Symbols as in `pair_sum`.
"""

from typing import Any, NamedTuple

import numpy as np

from refgi.elementary import exp2, log2p1
from refgi.jit import kernel, prange
from refgi.pairs.lobe_culling import (
    CORNERS,
    LIMIT,
    MEASURES,
    PARTS,
    bound_lobes,
    bound_part,
    bound_range,
    bound_receivers,
    lights_in_lobes,
    lobes_in_reach,
)
from refgi.pairs.lobe_sum import AT_ONCE, TERM, lobe_terms, whole_from
from refgi.pairs.pair_sum import (
    GROUP,
    NX,
    ROWS,
    SUM,
    TOTAL,
    Clamp,
    X,
    close_group,
    limits_of,
    load_light,
    load_tile,
    pair_term,
)
from refgi.pairs.pixel_lights import Range, Widening
from refgi.pairs.ranged_sum import LANES, list_chosen, weigh_by_range
from refgi.pairs.sphere_sum import TERM as SPHERE_TERM
from refgi.pairs.sphere_sum import cut_cones, whole_cones
from refgi.pairs.tiles import lights_in_reach, list_all
from refgi.radiometry import lobe_gap, receiver_norm
from refgi.types import Array

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
                weigh_by_range(tile, TERM, load_light(lights, k), reach.square[k], reach.scale[k], reach.outside)
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


class ReceiverLobes(NamedTuple):
    """The lobes of n receivers, beside their positions and normals."""

    mirrored: Array  # (3, n) unit vectors m
    exponent: Array  # (n,)
    farthest: Array  # (n,) h from which on each lobe is 0


def receiver_lobes_of(mirrored: Array, exponent: Array) -> ReceiverLobes:
    """Return lobes as kernels read them, of axes (3, n) and exponents (n,)."""
    exponent = np.ascontiguousarray(exponent, mirrored.dtype)
    return ReceiverLobes(np.ascontiguousarray(mirrored), exponent, bound_lobes(exponent, -1.0)[LIMIT].copy())


class Culls(NamedTuple):
    """What a sum passes over, to the same bits; whatever is not passed over adds its zeros."""

    behind: bool  # lights that a tile lies behind or, of diffuse ones, that lie behind it; lobes that miss it
    off_lobes: bool  # lights that lie in no receiver's lobe


@kernel(parallel=True)
def add_diffuse_lights(
    position: Array, normal: Array, of: ReceiverLobes, lights: Array, clamp: Clamp | None, spheres: Array | None,
    reach: Range | None, listed: Array | None, culls: Culls, radiance: Array,
) -> None:
    """Add norm sum (Phi / pi) g <m . w>^P over diffuse lights to every receiver: radiance over its reflectance.

    `lights` (9, N + 1) are packed, the last one black; `spheres` (N,): squared radii of virtual spherical lights, m^2,
    whose lobe is that of the centre, and planes cull none; `reach`, `listed` as for `lobe_sum.add_lobes`.
    In float32, with U = 2^-24, p = <m . w>^P and L = -P log2(1 - h), a term t = (Phi / pi) g p is off by at most U (t
    (20 + 5 L + 6.5 P (sqrt(2 h) + h) / (1 - h)) + 4 (Phi / pi) p (c_l + c_x) / r^2), with unit cosines: roundings of w
    reach h, those of the cosines are absolute. A sum is off by at most 70 U of L_s more. Less than 2^-126 of the peak
    is 0.
    """
    count, black = position.shape[1], lights.shape[1] - 1
    for block in prange((count + LANES - 1) // LANES):
        first = block * LANES
        size = min(LANES, count - first)
        tile = np.zeros((TILE_ROWS, LANES), position.dtype)
        load_tile(tile, position, normal, first, size)
        load_lobes(tile, of, first, size)
        low, high = np.empty(CORNERS, position.dtype), np.empty(CORNERS, position.dtype)
        cosine = bound_receivers(tile, M, FARTHEST, size, low, high)
        reached, chosen = np.empty(AT_ONCE, np.bool_), np.empty(AT_ONCE, np.int64)
        for start in range(0, black, AT_ONCE):
            end = min(start + AT_ONCE, black)
            if listed is not None:
                found = list_chosen(listed, block, start, end, chosen)
            elif culls.behind and spheres is None:
                found = lights_in_reach(lights, start, end, low, high, reached, chosen)
            else:
                found = list_all(start, end, chosen)
            if culls.off_lobes and found > 0:
                found = lights_in_lobes(lights, low, high, cosine, found, chosen)
            if found > 0:
                add_diffuse_listed(tile, size, lights, clamp, spheres, reach, chosen, found)
        _store(tile, of.exponent, first, size, radiance)


@kernel(parallel=True)
def add_glossy_lights(
    position: Array, normal: Array, of: ReceiverLobes, lights: Array, clamp: Clamp, widening: Widening | None,
    reach: Range | None, listed: Array | None, culls: Culls, radiance: Array,
) -> None:
    """Add norm sum I(w) c_x / r^2 <m . w>^P over glossy lights to every receiver: radiance over its reflectance.

    As `add_diffuse_lights`, with lights (13, K) and `widening` as for `lobe_sum.add_lobes`; the clamp's bound applies
    to c_x / r^2, and lobes that miss the tile are passed over where there are no lists. A term is off by at most the
    sum of the bounds of both, over their factors.
    """
    count = position.shape[1]
    bounds = bound_lobes(lights[9], whole_from(widening))
    if reach is not None and not reach.outside:
        bound_range(bounds, reach.square, reach.scale)
    for block in prange((count + LANES - 1) // LANES):
        first = block * LANES
        size = min(LANES, count - first)
        tile = np.zeros((TILE_ROWS, LANES), position.dtype)
        load_tile(tile, position, normal, first, size)
        load_lobes(tile, of, first, size)
        low, high = np.empty(CORNERS, position.dtype), np.empty(CORNERS, position.dtype)
        cosine = bound_receivers(tile, M, FARTHEST, size, low, high)
        spheres = np.empty((4, PARTS + 1), position.dtype)
        bound_part(tile, 0, size, spheres, PARTS)
        scratch, chosen = np.empty((MEASURES, AT_ONCE), position.dtype), np.empty(AT_ONCE, np.int64)
        for start in range(0, lights.shape[1], AT_ONCE):
            end = min(start + AT_ONCE, lights.shape[1])
            found = (list_all(start, end, chosen) if listed is None else
                     list_chosen(listed, block, start, end, chosen))
            if culls.behind and found > 0:
                found = lobes_in_reach(lights, bounds, spheres, found, scratch, chosen)
            if culls.off_lobes and found > 0:
                found = lights_in_lobes(lights, low, high, cosine, found, chosen)
            if found > 0:
                add_lobes_listed(tile, lights, bounds, clamp, widening, reach, chosen, found)
        _store(tile, of.exponent, first, size, radiance)


@kernel
def load_lobes(tile: Array, of: ReceiverLobes, first: int, size: int) -> None:
    """Copy the lobes of receivers first to first + size - 1 into a tile; lanes beyond have none."""
    start = np.uint64(first)
    for axis in range(3):
        for i in range(np.uint64(size)):
            tile[M + axis, i] = of.mirrored[axis, start + i]
    for i in range(np.uint64(size)):
        tile[EXPONENT, i] = of.exponent[start + i]
        tile[FARTHEST, i] = of.farthest[start + i]


@kernel
def _store(tile: Array, exponent: Array, first: int, size: int, radiance: Array) -> None:
    for c in range(3):
        for i in range(size):
            radiance[c, first + i] += receiver_norm(exponent[first + i]) * tile[TOTAL + c, i]
