"""The sum over all pairs of pixel light and receiver (SII Eq. 2), for diffuse lights.

Receivers are the SIMD lanes: each of a tile of 256 adds its lights in their order, whatever the tile, the thread or the
picture around it. Lights come in groups of 64 whose sums are added with compensation. Symbols: d vector from receiver
to light (m), n_l, n_x normals of light and receiver, c_l = <n_l . -d>, c_x = <n_x . d> (not divided by |d|),
g = c_l c_x / r^4 the geometry term (1/m^2).
"""

from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.tiles import bound_tile, lights_in_reach, list_all
from refgi.types import Array

TILE = 256  # receivers a thread works on at once
GROUP = 64  # lights summed before they are added to the total
LEAST_SQUARE = 1e-30  # m^2; stands in for r^2 = 0, where both cosines are 0 as well

ROWS = 15
X, NX, SUM, TOTAL, COMPENSATION = 0, 3, 6, 9, 12  # first rows of a tile: position, normal, sum of the group, sum of all


class Clamp(NamedTuple):
    """Clamp of the geometry term: c_l c_x / (r^2 (max(r^2, least) + softness)), at most `bound`."""

    least: Any  # square of the minimum distance, m^2
    softness: Array  # (N,) footprint area / pi of each light, m^2
    bound: Any  # largest geometry term, 1/m^2


@kernel
def pair_cosines(dx: Any, dy: Any, dz: Any, lx: Any, ly: Any, lz: Any, nx: Any, ny: Any, nz: Any) -> Any:
    """Return r^2 (m^2), c_l and c_x (m, signed) of one pair: d, reversed normal of the light, normal of the receiver.

    Every sum over pairs takes distance and cosines from here.
    """
    square = dx * dx + dy * dy + dz * dz
    return square, dx * lx + dy * ly + dz * lz, dx * nx + dy * ny + dz * nz


@kernel
def geometry_term(dx: Any, dy: Any, dz: Any, lx: Any, ly: Any, lz: Any, nx: Any, ny: Any, nz: Any) -> Any:
    """Return g = c_l c_x / r^4 of one pair, 1/m^2; 0 where either faces away.

    Divides each cosine by r^2 by itself: r^4 would leave the range of float32 first.
    """
    real = type(dx)
    zero = real(0.0)
    square, cl, cx = pair_cosines(dx, dy, dz, lx, ly, lz, nx, ny, nz)
    inverse = real(1.0) / (square if square > real(LEAST_SQUARE) else real(LEAST_SQUARE))
    # Eq. (2), without the intensity
    return ((cl if cl > zero else zero) * inverse) * ((cx if cx > zero else zero) * inverse)


@kernel
def limits_of(clamp: Clamp | None, k: int) -> Any:
    """Return least square, softness and bound of light k, or None.

    Loops over lanes take these scalars from outside: an array read inside would keep them from running in lanes.
    """
    if clamp is None:
        return None
    return clamp.least, clamp.softness[k], clamp.bound


@kernel
def clamped_term(
    dx: Any, dy: Any, dz: Any, lx: Any, ly: Any, lz: Any, nx: Any, ny: Any, nz: Any, limits: Any
) -> Any:
    """Return the geometry term of one pair as a clamp's `limits_of` its light keep it finite, 1/m^2."""
    real = type(dx)
    least, softness, bound = limits
    zero = real(0.0)
    square, cl, cx = pair_cosines(dx, dy, dz, lx, ly, lz, nx, ny, nz)
    square = square if square > real(LEAST_SQUARE) else real(LEAST_SQUARE)
    softened = (square if square > least else least) + softness
    term = ((cl if cl > zero else zero) / square) * ((cx if cx > zero else zero) / softened)
    return term if term < bound else bound


@kernel
def pair_term(light: Any, receiver: Any, limits: Any) -> Any:
    """Return the geometry term of a packed light and a receiver (position, normal), 1/m^2; `limits` None: unclamped."""
    x, y, z, nx, ny, nz = receiver
    dx, dy, dz = light[0] - x, light[1] - y, light[2] - z
    lx, ly, lz = light[3], light[4], light[5]
    if limits is None:
        return geometry_term(dx, dy, dz, lx, ly, lz, nx, ny, nz)
    return clamped_term(dx, dy, dz, lx, ly, lz, nx, ny, nz, limits)


@kernel
def load_light(lights: Array, k: Any) -> Any:
    """Return rows 0 to 8 of packed light k: position, reversed normal, then flux / pi or a lobe's reversed axis."""
    return (lights[0, k], lights[1, k], lights[2, k], lights[3, k], lights[4, k], lights[5, k], lights[6, k],
            lights[7, k], lights[8, k])


@kernel(parallel=True)
def sum_pairs(
    position: Array, normal: Array, lights: Array, clamp: Clamp | None, culls: bool, irradiance: Array
) -> None:
    """Add up E = sum over lights of (Phi / pi) g for every receiver (SII Eq. 1 and 2).

    Position (m) and normal are (3, n), world space; `irradiance` (3, n) is filled with W/m^2, without albedo/pi and
    visibility. `lights` (9, N): position, reversed normal, flux / pi; the last one is black and stands in for an odd
    partner. No clamp sums the plain term. `culls` passes over lights that cannot reach a tile; without, each adds its
    zeros, to the same bits.
    """
    count = position.shape[1]
    for block in prange((count + TILE - 1) // TILE):
        first = block * TILE
        size = min(TILE, count - first)
        tile = np.zeros((ROWS, TILE), position.dtype)
        load_tile(tile, position, normal, first, size)
        low, high = np.empty(6, position.dtype), np.empty(6, position.dtype)
        bound_tile(tile, size, low, high)
        reach, chosen = np.empty(GROUP, np.bool_), np.empty(GROUP + 1, np.int64)
        black = lights.shape[1] - 1
        for group in range(0, black, GROUP):
            end = min(group + GROUP, black)
            listed = (lights_in_reach(lights, group, end, low, high, reach, chosen) if culls else
                      list_all(group, end, chosen))
            add_listed(tile, lights, clamp, chosen, listed)
        for c in range(3):
            for i in range(size):
                irradiance[c, first + i] = tile[TOTAL + c, i]


@kernel
def add_listed(tile: Array, lights: Array, clamp: Clamp | None, chosen: Array, listed: int) -> None:
    """Add the first `listed` lights of `chosen`, rising indices of one group, to the totals of a tile.

    Rows SUM of the tile (>= ROWS, TILE) hold 0 before. The entry of `chosen` after the last is overwritten with the
    black light, which stands in for an odd partner.
    """
    chosen[listed] = lights.shape[1] - 1
    for pair in range(0, listed, 2):
        a, b = chosen[pair], chosen[pair + 1]
        one, two = load_light(lights, a), load_light(lights, b)
        limits_a, limits_b = limits_of(clamp, a), limits_of(clamp, b)
        for i in range(TILE):
            receiver = tile[X, i], tile[X + 1, i], tile[X + 2, i], tile[NX, i], tile[NX + 1, i], tile[NX + 2, i]
            g1, g2 = pair_term(one, receiver, limits_a), pair_term(two, receiver, limits_b)
            # Eq. (2); written out: a loop over the channels would cost the compiler its even split into lanes
            tile[SUM, i] = tile[SUM, i] + g1 * one[6] + g2 * two[6]
            tile[SUM + 1, i] = tile[SUM + 1, i] + g1 * one[7] + g2 * two[7]
            tile[SUM + 2, i] = tile[SUM + 2, i] + g1 * one[8] + g2 * two[8]
    close_group(tile)


@kernel
def load_tile(tile: Array, position: Array, normal: Array, first: int, size: int) -> None:
    """Copy positions and normals of receivers first to first + size - 1 into rows X and NX of a tile.

    Lanes beyond them keep their zeros and receive nothing.
    """
    start = np.uint64(first)  # unsigned, which needs no check for places counted from the end
    for axis in range(3):
        for i in range(np.uint64(size)):
            tile[X + axis, i] = position[axis, start + i]
            tile[NX + axis, i] = normal[axis, start + i]


@kernel
def close_group(tile: Array) -> None:
    """Close the group of all lanes of a tile."""
    close_lanes(tile, np.uint64(0), np.uint64(tile.shape[1]))


@kernel
def close_lanes(tile: Array, start: Any, stop: Any) -> None:
    """Add rows SUM of lanes start to stop - 1 to rows TOTAL by Kahan's compensated summation (1965) and clear them.

    A sum of 0 changes nothing, so that a group which reaches no receiver of a tile may as well be left out.
    """
    zero = tile.dtype.type(0.0)
    for c in range(3):
        for i in range(start, stop):
            added, old, lost = tile[SUM + c, i], tile[TOTAL + c, i], tile[COMPENSATION + c, i]
            part = added - lost
            total = old + part
            tile[COMPENSATION + c, i] = lost if added == zero else (total - old) - part
            tile[TOTAL + c, i] = old if added == zero else total
            tile[SUM + c, i] = zero
