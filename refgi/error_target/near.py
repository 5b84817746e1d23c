"""What is summed at a pixel: near pairs without bound, glossy lobes, all lights as they are or under visibility.

E = sum (Phi / pi) min(g, b) + sum (Phi / pi) max(0, g - b), g the geometry term, b its bound: the first sum is smooth,
fit for subsplats; the second, summed here, is not 0 only where r^2 < 1 / b, since g <= 1 / r^2 (as bias compensation
splits the clamped sum: Kollig and Keller 2006). Lobes can be as narrow as a pixel: they are summed here as a whole.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from refgi.error_target.grid import level_shape
from refgi.jit import kernel, prange
from refgi.pairs.irradiance import Receivers, add_lights
from refgi.pairs.lobe_sum import add_lobes
from refgi.pairs.pair_sum import NX, SUM, Clamp, X, limits_of, pair_term
from refgi.pairs.pixel_lights import Packed
from refgi.pairs.tiles import block_by_block, put, taken
from refgi.rsm.pool import plane, zeros
from refgi.stages import stage
from refgi.types import Array

SIDE = 16  # pixels along a square that is tested as a whole
ROWS = 9  # of its tile: position, normal and sums


class NearLight(NamedTuple):
    """Irradiance of near pairs, by squares of `SIDE` x `SIDE` pixels."""

    irradiance: Array  # (3, h, w), W/m^2; of any content in squares that are not touched
    has_near: Array  # (rows, columns) bool
    pairs: int  # of light and point that were evaluated


@kernel
def near_irradiance_at(irradiance: Array, has_near: Array, c: int, row: int, column: int) -> Any:
    """Return channel c of the near irradiance at a pixel, W/m^2; 0 in squares that have none."""
    return irradiance[c, row, column] if has_near[row // SIDE, column // SIDE] else irradiance.dtype.type(0.0)


@stage("error_target.near")
def near_light(receivers: Receivers, packed: Packed, most: float) -> NearLight:
    """Sum what single lights give each receiver beyond a bound, and by their lobes, at full resolution.

    receivers: The picture's points; contiguous.
    most: The bound, W/m^2.
    -> NearLight: 0 where every light keeps below the bound and none is glossy.

    Virtual spherical lights have another term, which is bounded by itself: their excess counts as 0.
    """
    position, normal, covered = receivers
    irradiance, pairs = plane(position.shape, position.dtype), 0
    has_near = np.zeros(level_shape(covered.shape[0], covered.shape[1], SIDE.bit_length() - 1), np.bool_)
    if packed.lobes is not None:
        places = block_by_block(covered)
        sums = np.zeros((3, len(places)), position.dtype)
        add_lobes(taken(position, places), taken(normal, places), *packed.lobes, None, None, sums)
        irradiance[:], has_near[:] = 0, True
        put(irradiance, places, sums)
        pairs = len(places) * packed.lobes.lights.shape[1]
    if packed.spheres is None and packed.diffuse.shape[1] > 1 and most > 0:
        bound = (most / packed.diffuse[6:, :-1].astype(np.float64).max(axis=0)).astype(position.dtype)
        pair_counts = np.zeros(has_near.shape, np.int64)
        _add_excess(position, normal, covered, packed.diffuse, packed.clamp, bound, irradiance, has_near, pair_counts)
        pairs += int(pair_counts.sum())
    return NearLight(irradiance, has_near, pairs)


@kernel(parallel=True)
def _add_excess(
    position: Array, normal: Array, covered: Array, lights: Array, clamp: Clamp | None, bound: Array, irradiance: Array,
    has_near: Array, pairs: Array,
) -> None:
    rows, columns = has_near.shape
    for k in prange(rows * columns):
        i, j = k // columns, k % columns
        near, low, high = np.empty(len(bound), np.bool_), np.empty(3, position.dtype), np.empty(3, position.dtype)
        tile = np.zeros((ROWS, SIDE * SIDE), position.dtype)
        covered_count = _load_positions(position, covered, i * SIDE, j * SIDE, tile)
        _bounding_box(tile, low, high)
        near_count = _mark_near(lights, bound, low, high, near) if covered_count else 0
        if near_count:
            _load_normals(normal, covered, i * SIDE, j * SIDE, tile)
            _sum_near(tile, lights, clamp, bound, near)
            pairs[i, j] = covered_count * near_count
            _store(tile, has_near[i, j], i * SIDE, j * SIDE, irradiance)
            has_near[i, j] = True


@kernel
def _load_positions(position: Array, covered: Array, top: int, left: int, tile: Array) -> int:
    """Load a square's positions, for pixels without surface a copy of one that has; return how many have one."""
    count, last_covered = 0, 0
    for y in range(top, min(top + SIDE, covered.shape[0])):
        row_covered, first = covered[y, left : left + SIDE], (y - top) * SIDE
        for c in range(3):
            for x in range(len(row_covered)):
                tile[X + c, first + x] = position[c, y, left + x]
        for x in range(len(row_covered)):
            if row_covered[x]:
                count, last_covered = count + 1, first + x
    for k in range(SIDE * SIDE if 0 < count < SIDE * SIDE else 0):
        y, x = top + k // SIDE, left + k % SIDE
        if y >= covered.shape[0] or x >= covered.shape[1] or not covered[y, x]:
            for c in range(3):
                tile[X + c, k] = tile[X + c, last_covered]
    return count


@kernel
def _load_normals(normal: Array, covered: Array, top: int, left: int, tile: Array) -> None:
    """Load the normals of a square of pixels; 0 without a surface, so that nothing reaches it."""
    for y in range(top, min(top + SIDE, covered.shape[0])):
        for x in range(left, min(left + SIDE, covered.shape[1])):
            for c in range(3):
                tile[NX + c, (y - top) * SIDE + x - left] = normal[c, y, x] if covered[y, x] else 0


@kernel
def _bounding_box(tile: Array, low: Array, high: Array) -> None:
    """Compute the bounding box of a square's positions, whose rows are the lanes."""
    for axis in range(3):
        at = tile[X + axis]
        least, most = at[:SIDE].copy(), at[:SIDE].copy()
        for first in range(SIDE, SIDE * SIDE, SIDE):
            for k in range(SIDE):
                value = at[first + k]
                least[k] = value if value < least[k] else least[k]
                most[k] = value if value > most[k] else most[k]
        low[axis], high[axis] = least[0], most[0]
        for k in range(1, SIDE):
            low[axis], high[axis] = min(low[axis], least[k]), max(high[axis], most[k])


@kernel
def _sum_near(tile: Array, lights: Array, clamp: Clamp | None, bound: Array, near: Array) -> None:
    """Sum (Phi / pi) max(0, g - b) over the lights that are marked."""
    zero = tile.dtype.type(0.0)
    at = np.empty((ROWS, SIDE * SIDE), tile.dtype)  # of a known shape: else the loop below would not run in lanes
    for row in range(ROWS):
        for i in range(SIDE * SIDE):
            at[row, i] = tile[row, i]
    for k in range(len(bound)):
        if not near[k]:
            continue
        lx, ly, lz, b = lights[3, k], lights[4, k], lights[5, k], bound[k]
        px, py, pz = lights[0, k], lights[1, k], lights[2, k]
        red, green, blue = lights[6, k], lights[7, k], lights[8, k]
        limits = limits_of(clamp, k)
        for i in range(SIDE * SIDE):
            receiver = at[X, i], at[X + 1, i], at[X + 2, i], at[NX, i], at[NX + 1, i], at[NX + 2, i]
            g = pair_term((px, py, pz, lx, ly, lz), receiver, limits)
            over = g - b if g > b else zero  # max(0, g - b)
            at[SUM, i] += over * red
            at[SUM + 1, i] += over * green
            at[SUM + 2, i] += over * blue
    for row in range(SUM, ROWS):
        for i in range(SIDE * SIDE):
            tile[row, i] = at[row, i]


@kernel
def _store(tile: Array, add: bool, top: int, left: int, irradiance: Array) -> None:
    """Store a square's sums, or add them to what is there."""
    zero = irradiance.dtype.type(0.0)
    for c in range(3):
        for y in range(top, min(top + SIDE, irradiance.shape[1])):
            for x in range(left, min(left + SIDE, irradiance.shape[2])):
                more = tile[SUM + c, (y - top) * SIDE + x - left]
                irradiance[c, y, x] = more + (irradiance[c, y, x] if add else zero)


@kernel
def _mark_near(lights: Array, bound: Array, low: Array, high: Array, near: Array) -> int:
    """Mark the lights within 1 / sqrt(bound) of some point of a box on their front side; return how many are."""
    real, count = lights.dtype.type, 0
    zero, one = real(0.0), real(1.0)
    ax, ay, az, bx, by, bz = low[0], low[1], low[2], high[0], high[1], high[2]
    for k in range(len(bound)):
        # light - receiver lies between e and f
        ex, ey, ez = lights[0, k] - bx, lights[1, k] - by, lights[2, k] - bz
        fx, fy, fz = lights[0, k] - ax, lights[1, k] - ay, lights[2, k] - az
        dx, dy, dz = max(ex, -fx, zero), max(ey, -fy, zero), max(ez, -fz, zero)
        lx, ly, lz = lights[3, k], lights[4, k], lights[5, k]
        cl = max(ex * lx, fx * lx) + max(ey * ly, fy * ly) + max(ez * lz, fz * lz)
        square = dx * dx + dy * dy + dz * dz
        # g <= c_l / r^3 as well
        near[k] = (square * bound[k] < one) & (cl > zero) & (square * square * square * bound[k] * bound[k] < cl * cl)
        count += near[k]
    return count


class PixelSum(NamedTuple):
    """A sum of lights at the pixels of a picture, and its peaks."""

    at: Callable[[Array], Array]  # covered pixels, n flat indices -> irradiance (3, n), W/m^2
    near: Callable[[Receivers, float], NearLight]  # what single lights give all pixels beyond a bound, W/m^2


def unshadowed(receivers: Receivers, packed: Packed) -> PixelSum:
    """Return the sum of packed lights at contiguous receivers, without visibility."""

    def at(pixel: Array) -> Array:
        points, normals = taken(receivers.position, pixel), taken(receivers.normal, pixel)
        sums = np.zeros_like(points)
        add_lights(points, normals, packed, sums)
        return sums

    return PixelSum(at, lambda points, most: near_light(points, packed, most))


def shadowed_by_clusters(at: Callable[[Array], Array]) -> PixelSum:
    """Return a sum whose lights share the visibility of their clusters; `at` finds it."""
    return PixelSum(at, lambda receivers, _: nothing_near(receivers))


def nothing_near(receivers: Receivers) -> NearLight:
    """Return that no pair is near."""
    shape = receivers.covered.shape
    return NearLight(zeros(receivers.position.shape, receivers.position.dtype),
                     np.zeros(level_shape(shape[0], shape[1], SIDE.bit_length() - 1), np.bool_), 0)
