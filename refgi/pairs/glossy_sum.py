"""The sum over all pairs of pixel light and glossy receiver: radiance towards the eye (AMS Eq. 2 with its rho_s).

L_s = specular (P + 2) / (2 pi) sum over lights of <m . w>^P I(w) c_x / r^2, where I c_x / r^2 is the term of the
diffuse sum, clamped alike. Receivers are the SIMD lanes; norm and reflectance are theirs and are multiplied in last.
The power is taken as 2^(P log2(1 - h)), h = |m - w|^2 / 2, as for senders' lobes (`lobe_sum`). Tiles are of 64
receivers, each with lights of its own: those that planes, ranges and the receivers' lobes leave (`receiver_culling`).

Symbols as in `pair_sum`; m the direction to the eye mirrored at the receiver, w unit vector from it to the light.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.lobes import receiver_norm
from refgi.pairs.glossy_tile import EXPONENT, FARTHEST, TILE_ROWS, M, add_diffuse_listed, add_lobes_listed
from refgi.pairs.lobe_culling import (
    LIMIT,
    MEASURES,
    PARTS,
    bound_lobes,
    bound_part,
    bound_range,
    lobes_in_reach,
)
from refgi.pairs.lobe_shape import Widening
from refgi.pairs.lobe_sum import AT_ONCE, whole_from
from refgi.pairs.pair_sum import TOTAL, Clamp, load_tile
from refgi.pairs.pixel_lights import Range
from refgi.pairs.ranged_sum import LANES, list_chosen
from refgi.pairs.receiver_culling import CORNERS, bound_receivers, lights_in_lobes
from refgi.pairs.tiles import lights_in_reach, list_all

Array = npt.NDArray[Any]


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

    Position (m) and normal are (3, n), world space, `radiance` (3, n), W/m^2/sr; `lights` (9, N + 1) are packed, the
    last one black. `spheres` (N,): squared radii of virtual spherical lights, m^2; their lobe is that of the centre,
    and planes cull none. `reach`: which pairs count, and how much (procedure P3); None: all. `listed` (ceil(n / LANES),
    N) bool: lights that may count for each tile (the others must not count for any of its receivers), None: all; planes
    cull where there are no lists.
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
