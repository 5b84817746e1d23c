"""Culling of glossy lights, and of lights of glossy receivers, tile by tile: what adds exactly 0 is not summed.

A lobe is culled when the bounding sphere of a tile, or of one of its PARTS, lies behind the light's surface, or so far
off the lobe's axis that (1 - h)^P is below the smallest normal number, which `exp2` makes 0, or where B < xi I_low
everywhere in it (procedure P3); for receivers' lobes a light when no direction and no position out of the tile's boxes
come as near to each other as its farthest lobe reaches. Each by more than rounding: the sum is the same to the bit.
Symbols: d vector from the sphere's centre (receivers' lobes: receiver) to the light, r its length, rho the sphere's
radius, h = 1 - cos of the angle to the lobe's axis; m the direction to the eye mirrored, h = 1 - m . d / |d|.
"""

import math
from typing import Any

import numpy as np

from refgi.elementary import exp2, log2p1
from refgi.jit import kernel
from refgi.pairs.pair_sum import TILE, X, load_light
from refgi.pairs.tiles import bound_rows, extremes
from refgi.types import Array

PARTS = 4  # of a tile; 8 x 8 pixels each where tiles are blocks of them
ROUNDING = 32.0  # units of rounding that h and cosines may be off; about 8 are possible
MARGIN = 1e-3  # on the root of B: the kernel's own test is off by less
VANISHED = 1.03  # times the logarithm of the smallest normal number
NEAR = 1e-3  # share of the range within which a threshold narrows no lobe: near - 1 must keep the digits of MARGIN
LIMIT, ROOT, SHARE, WHOLE, BOUNDS = range(5)  # rows of the lobes' bounds
ABOVE, NEAREST, GAP, RANGED, PASSED, MEASURES = range(BOUNDS, BOUNDS + 6)  # further rows of the scratch array
CENTER, RADIUS = 0, 3  # rows of bounding spheres


@kernel
def bound_lobes(exponent: Array, distance: float) -> Array:
    """Return per lobe (BOUNDS, N): from which h on it is 0, and how that depends on distance.

    LIMIT: from this h on, at most 1, the lobe is 0 where its exponent is whole; ROOT: 2 / P; SHARE: 0, for B of any
    size (`bound_range`); WHOLE: `distance` (m), within which exponents are widened; infinite: they may be anywhere.
    """
    real = exponent.dtype.type
    smallest = -87.33654 if np.finfo(exponent.dtype).eps > 1e-10 else -708.3964  # ln of the smallest normal number
    bounds = np.zeros((BOUNDS, len(exponent)), exponent.dtype)
    for k in range(len(exponent)):
        p = max(np.float64(exponent[k]), 1e-30)
        bounds[LIMIT, k] = real(-math.expm1(VANISHED * smallest / p))
        bounds[ROOT, k] = real(2.0 / p)
        bounds[WHOLE, k] = real(distance)
    return bounds


@kernel
def bound_range(bounds: Array, square: Array, scale: Array) -> None:
    """Fill row SHARE (1/m) from R_0^2 and xi of `Range`: at distance r nothing below (SHARE r)^2 of the peak counts."""
    real = bounds.dtype.type
    for k in range(len(square)):
        bounds[SHARE, k] = math.sqrt(scale[k] / square[k]) * real(1.0 - MARGIN)


@kernel
def bound_parts(tile: Array, size: int, spheres: Array) -> bool:
    """Fill the bounding spheres (4, PARTS + 1), centres and radii in m, of a tile's parts and, last, of the whole tile.

    The first `size` receivers count; parts without any lie in the first one. Return whether the parts are much smaller
    than the whole.
    """
    lanes = TILE // PARTS
    total = 0.0
    for part in range(PARTS):
        first = part * lanes if part * lanes < size else 0
        bound_part(tile, first, min(first + lanes, size), spheres, part)
        total += spheres[RADIUS, part]
    bound_part(tile, 0, size, spheres, PARTS)
    return bool(total < 0.7 * PARTS * spheres[RADIUS, PARTS])


@kernel
def bound_part(tile: Array, first: int, last: int, spheres: Array, column: int) -> None:
    """Fill a column of the bounding spheres with that of the receivers first to last - 1 of a tile."""
    real = tile.dtype.type
    for axis in range(3):
        low, high = extremes(tile, X + axis, first, last)
        spheres[CENTER + axis, column] = low + real(0.5) * (high - low)
    x, y, z = spheres[CENTER, column], spheres[CENTER + 1, column], spheres[CENTER + 2, column]
    a = b = real(0.0)
    for i in range(first, last, 2):  # two at a time, so that one comparison need not wait for another
        j = i + 1 if i + 1 < last else i
        p, q = _square_distance(tile, i, x, y, z), _square_distance(tile, j, x, y, z)
        a, b = p if p > a else a, q if q > b else b
    spheres[RADIUS, column] = math.sqrt(max(a, b)) * real(1.0001)


@kernel
def _square_distance(tile: Array, i: int, x: Any, y: Any, z: Any) -> Any:
    dx, dy, dz = tile[X, i] - x, tile[X + 1, i] - y, tile[X + 2, i] - z
    return dx * dx + dy * dy + dz * dz


@kernel
def lobes_in_reach(lights: Array, bounds: Array, spheres: Array, found: int, scratch: Array, chosen: Array) -> int:
    """Keep those of the first `found` lobes in `chosen` that may light a tile; return how many they are.

    `lights` (13, N) hold position, reversed normal and reversed axis first, `bounds` come from `bound_lobes`, `spheres`
    bound the tile in their last column. `scratch` is (MEASURES, >= found); its row LIMIT is left with 1 - cos from
    which on each lobe that is kept adds 0 everywhere in the tile.
    """
    real = lights.dtype.type
    slack = real(ROUNDING) * real(np.finfo(lights.dtype).eps)
    sphere = spheres[0, PARTS], spheres[1, PARTS], spheres[2, PARTS], spheres[3, PARTS]
    for i in range(found):
        k = np.uint64(chosen[i])  # unsigned, which needs no check for places counted from the end
        scratch[ABOVE, i], scratch[NEAREST, i], scratch[GAP, i] = _measure(load_light(lights, k), sphere)
        for row in range(BOUNDS):
            scratch[row, i] = bounds[row, k]
    _test_reach(scratch, found)
    count = 0
    for i in range(found):
        chosen[count] = chosen[i]
        scratch[LIMIT, count] = min(scratch[LIMIT, i], scratch[RANGED, i] + slack)
        count += scratch[PASSED, i] > 0
    return count


@kernel
def parts_in_reach(lights: Array, bounds: Array, k: int, spheres: Array, scratch: Array) -> Any:
    """Return the first part of a tile that lobe k may light and the one after the last; equal where there is none."""
    cone = load_light(lights, k)
    for i in range(PARTS):
        sphere = spheres[0, i], spheres[1, i], spheres[2, i], spheres[3, i]
        scratch[ABOVE, i], scratch[NEAREST, i], scratch[GAP, i] = _measure(cone, sphere)
        for row in range(BOUNDS):
            scratch[row, i] = bounds[row, k]
    _test_reach(scratch, PARTS)
    first, last = 0, PARTS
    while first < last and not scratch[PASSED, first] > 0:
        first += 1
    while last > first and not scratch[PASSED, last - 1] > 0:
        last -= 1
    return first, last


@kernel
def _measure(cone: Any, sphere: Any) -> Any:
    """Return how far at most receivers lie before the light's plane, the cosine of their least angle, r - rho."""
    px, py, pz, lx, ly, lz, ax, ay, az = cone
    x, y, z, rho = sphere
    real = type(px)
    zero, one = real(0.0), real(1.0)
    slack = real(ROUNDING) * real(np.finfo(real).eps)
    dx, dy, dz = px - x, py - y, pz - z
    r = math.sqrt(dx * dx + dy * dy + dz * dz)
    above = dx * lx + dy * ly + dz * lz + rho + slack * (r + rho)
    inverse = one / (r if r > rho else one)
    cosine, sine_sphere = (dx * ax + dy * ay + dz * az) * inverse, rho * inverse
    sine = math.sqrt(max(one - cosine * cosine, zero))
    cosine_sphere = math.sqrt(max(one - sine_sphere * sine_sphere, zero))
    # the least angle to the axis is that to the centre less the sphere's
    nearest = one if cosine >= cosine_sphere else cosine * cosine_sphere + sine * sine_sphere
    return above, nearest if r > rho else one, r - rho


@kernel
def _test_reach(scratch: Array, count: int) -> None:
    """Fill row PASSED with 1 where a lobe may light a sphere, else with 0; apart from the measures it runs in lanes."""
    real = scratch.dtype.type
    zero, one = real(0.0), real(1.0)
    slack = real(ROUNDING) * real(np.finfo(scratch.dtype).eps)
    for i in range(count):
        near = scratch[SHARE, i] * scratch[GAP, i]  # its square is s of the weakest pair that counts
        # log2p1 makes -127 (float64: -1023) of -1, which leaves LIMIT to decide
        scratch[RANGED, i] = one - exp2(scratch[ROOT, i] * log2p1((near if near > real(NEAR) else zero) - one))
    for i in range(count):
        whole = scratch[GAP, i] > scratch[WHOLE, i]
        limit = min(scratch[LIMIT, i], scratch[RANGED, i])
        limit = limit if whole else one
        inside = (one - scratch[NEAREST, i] < limit + slack) & (scratch[SHARE, i] * scratch[GAP, i] < one)
        scratch[PASSED, i] = one if inside & (scratch[ABOVE, i] > zero) else zero


MIRRORED = 6  # first entry of the box of m in a tile's corners: positions and normals come before
CORNERS = 9


@kernel
def bound_receivers(tile: Array, mirrored: int, farthest: int, size: int, low: Array, high: Array) -> Any:
    """Fill the corners (CORNERS,) of the boxes of a tile's positions, normals and m; return its least cosine to m.

    `mirrored` is the first row of m in the tile, `farthest` that of h from which on each lobe is 0; the first `size`
    receivers count. A light at which no m . d / |d| exceeds the cosine lies in no lobe.
    """
    bound_rows(tile, 0, MIRRORED, size, low, high, 0)
    bound_rows(tile, mirrored, 3, size, low, high, MIRRORED)
    real = tile.dtype.type
    most = real(0.0)
    for i in range(size):
        most = max(most, tile[farthest, i])
    return real(1.0) - most


@kernel
def lights_in_lobes(lights: Array, low: Array, high: Array, cosine: Any, found: int, chosen: Array) -> int:
    """Keep those of the first `found` lights in `chosen` that some lobe of a tile may hold; return how many they are.

    `lights` (>= 3, N) hold positions, `low`, `high` and `cosine` come from `bound_receivers`.
    """
    real = lights.dtype.type
    zero = real(0.0)
    slack = real(ROUNDING) * real(np.finfo(lights.dtype).eps)
    ax, ay, az, bx, by, bz = low[0], low[1], low[2], high[0], high[1], high[2]
    ux, uy, uz, vx, vy, vz = low[6], low[7], low[8], high[6], high[7], high[8]
    count = 0
    for j in range(found):
        k = np.uint64(chosen[j])  # unsigned, which needs no check for places counted from the end
        # d lies between e and f
        ex, ey, ez = lights[0, k] - bx, lights[1, k] - by, lights[2, k] - bz
        fx, fy, fz = lights[0, k] - ax, lights[1, k] - ay, lights[2, k] - az
        along = (max(max(ex * ux, ex * vx), max(fx * ux, fx * vx)) + max(max(ey * uy, ey * vy), max(fy * uy, fy * vy))
                 + max(max(ez * uz, ez * vz), max(fz * uz, fz * vz)))
        size = max(abs(ex), abs(fx)) + max(abs(ey), abs(fy)) + max(abs(ez), abs(fz))
        gx, gy, gz = max(max(ex, -fx), zero), max(max(ey, -fy), zero), max(max(ez, -fz), zero)
        nearest = np.sqrt(gx * gx + gy * gy + gz * gz)
        chosen[count] = chosen[j]
        count += along + slack * size > cosine * nearest
    return count
