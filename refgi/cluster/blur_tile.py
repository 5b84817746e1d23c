"""Tiles of a picture as the blur reads them, and subsets of lights that its window misses (Sec. 6).

Beside an edge some places of a window lie on another surface, and its mean is that of some subsets alone, whose squares
show. Each such place takes the nearest pixel of its subset on the surface, up to `REACH` windows away.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from refgi.cluster.settings import MOST_BLOCK
from refgi.jit import kernel
from refgi.types import Array

TALL, WIDE = 16, 64  # pixels of a tile
COLUMNS = WIDE + MOST_BLOCK  # of each plane in a row of a tile; fixed, which lets loops run in lanes
E, X, N, END = 0, 3 * COLUMNS, 6 * COLUMNS, 9 * COLUMNS  # irradiance, position, normal: three planes each
FAR = 1e18  # m; where pixels without surface are put. Its square is within float32
MARGIN = 1e-5  # by which bounds must hold: distances and cosines are off by less


@kernel
def load_pixels(
    tile: Array, irradiance: Array, position: Array, normal: Array, covered: Array, top: int, left: int, wide: int,
    size: int,
) -> None:
    """Copy a tile with its surroundings: planes of irradiance, position and normal next to each other in each row.

    Outside the picture from n = `size` pixels further inside. Pixels that are not covered are put FAR away; `top` and
    `left` may lie outside the picture; `wide` is without the surroundings.
    """
    height, width = covered.shape
    last = wide + size - 1
    low, high = min(max(-left, 0), last), max(min(width - left, last), 0)  # what lies in the picture
    for row in range(len(tile)):
        y = _within(top + row, height, size)
        for c in range(3):
            inside = low
            if y >= 0:
                _copy(tile, row, c, irradiance, position, normal, covered, y, left, np.uint64(low), np.uint64(high))
                inside = max(low, high)
            for i in range(low):
                _copy_one(tile, row, c, i, irradiance, position, normal, covered, y, _within(left + i, width, size))
            for i in range(inside, last):
                _copy_one(tile, row, c, i, irradiance, position, normal, covered, y, _within(left + i, width, size))


@kernel
def _copy(
    tile: Array, row: int, c: int, irradiance: Array, position: Array, normal: Array, covered: Array, y: int,
    left: int, low: Any, high: Any,
) -> None:
    far = tile.dtype.type(FAR)
    e, x, n = np.uint64(E + c * COLUMNS), np.uint64(X + c * COLUMNS), np.uint64(N + c * COLUMNS)
    shift = np.uint64(left)  # may stand for a number below 0: places wrap round to the right ones
    for i in range(low, high):
        tile[row, e + i] = irradiance[c, y, shift + i]
    for i in range(low, high):
        tile[row, x + i] = position[c, y, shift + i] if covered[y, shift + i] else far
    for i in range(low, high):
        tile[row, n + i] = normal[c, y, shift + i]


@kernel
def _copy_one(
    tile: Array, row: int, c: int, i: int, irradiance: Array, position: Array, normal: Array, covered: Array, y: int,
    x: int,
) -> None:
    known = y >= 0 and x >= 0 and covered[max(y, 0), max(x, 0)]
    tile[row, E + c * COLUMNS + i] = irradiance[c, y, x] if known else 0
    tile[row, X + c * COLUMNS + i] = position[c, y, x] if known else FAR
    tile[row, N + c * COLUMNS + i] = normal[c, y, x] if known else 0


@kernel
def _within(place: int, count: int, size: int) -> int:
    """Return the place, moved by n into the picture; -1 where that does not help."""
    if place < 0:
        place += size
    elif place >= count:
        place -= size
    return place if 0 <= place < count else -1


@kernel
def is_one_surface(tile: Array, wide: int, square_extent: Any, cosine: Any) -> bool:
    """Return whether all pixels around a tile surely count for each other, by bounds; cosine -inf: any normal."""
    real = tile.dtype.type
    one = real(1.0)
    bounds = np.empty((7, COLUMNS), tile.dtype)  # least and most of x, y, z; least cosine
    middle = np.uint64(wide // 2)
    ux, uy, uz = (tile[len(tile) // 2, np.uint64(N) + middle], tile[len(tile) // 2, np.uint64(N + COLUMNS) + middle],
                  tile[len(tile) // 2, np.uint64(N + 2 * COLUMNS) + middle])
    for i in range(np.uint64(wide)):
        bounds[0, i] = bounds[3, i] = tile[0, np.uint64(X) + i]
        bounds[1, i] = bounds[4, i] = tile[0, np.uint64(X + COLUMNS) + i]
        bounds[2, i] = bounds[5, i] = tile[0, np.uint64(X + 2 * COLUMNS) + i]
        bounds[6, i] = 1
    for row in range(len(tile)):
        for i in range(np.uint64(wide)):
            x, y, z = (tile[row, np.uint64(X) + i], tile[row, np.uint64(X + COLUMNS) + i],
                       tile[row, np.uint64(X + 2 * COLUMNS) + i])
            dot = (ux * tile[row, np.uint64(N) + i] + uy * tile[row, np.uint64(N + COLUMNS) + i]
                   + uz * tile[row, np.uint64(N + 2 * COLUMNS) + i])
            bounds[0, i] = x if x < bounds[0, i] else bounds[0, i]
            bounds[1, i] = y if y < bounds[1, i] else bounds[1, i]
            bounds[2, i] = z if z < bounds[2, i] else bounds[2, i]
            bounds[3, i] = x if x > bounds[3, i] else bounds[3, i]
            bounds[4, i] = y if y > bounds[4, i] else bounds[4, i]
            bounds[5, i] = z if z > bounds[5, i] else bounds[5, i]
            bounds[6, i] = dot if dot < bounds[6, i] else bounds[6, i]
    square = real(0.0)
    for c in range(3):
        least, most = bounds[c, 0], bounds[3 + c, 0]
        for i in range(1, wide):
            least, most = min(least, bounds[c, i]), max(most, bounds[3 + c, i])
        square += (most - least) * (most - least)
    near = bounds[6, 0]
    for i in range(1, wide):
        near = min(near, bounds[6, i])
    # two normals that are within an angle of a third are within twice that angle of each other
    facing = (near > real(0.0)) & (near * near + near * near - real(1.0 + MARGIN) >= cosine)
    return bool((square * real(1.0 + MARGIN) <= square_extent) & (facing | (cosine < -one)))


REACH = 1  # windows on each side that are searched


@lru_cache(maxsize=8)
def places_of_subsets(size: int) -> Array:
    """Return where else each place of a window finds its subset, near to far, (n, n, places, 2) from the pixel."""
    steps = np.arange(-REACH, REACH + 1) * size
    aside = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    aside = aside[aside.any(axis=1)]
    window = np.stack(np.meshgrid(*[np.arange(size) - size // 2] * 2, indexing="ij"), axis=-1)
    places = window[:, :, None] + aside
    order = np.lexsort((places[..., 1], places[..., 0], (places**2).sum(axis=-1)), axis=-1)
    return np.take_along_axis(places, order[..., None], axis=2)


@kernel
def add_missing(
    tile: Array, row: int, size: int, square_extent: Any, cosine: Any, places: Array, planes: Any, top: int, left: int,
    wide: int, counts: Array, sums: Array,
) -> None:
    """Add differences to pixels farther off, at `places` of `places_of_subsets`, for each place that does not count.

    `sums` (4, WIDE) has the sums over the window of the pixels from (`top`, `left`) on, and how many counted; `planes`
    are of the whole picture; `counts` is scratch.
    """
    middle, one, whole = row + size // 2, tile.dtype.type(1.0), tile.dtype.type(size * size)
    irradiance, position, normal, covered = planes
    for i in range(wide):
        if sums[3, i] == whole or not covered[top, left + i]:
            continue
        p = np.uint64(size // 2 + i)
        here = Here(tile[middle, np.uint64(X) + p], tile[middle, np.uint64(X + COLUMNS) + p],
                    tile[middle, np.uint64(X + 2 * COLUMNS) + p], tile[middle, np.uint64(N) + p],
                    tile[middle, np.uint64(N + COLUMNS) + p], tile[middle, np.uint64(N + 2 * COLUMNS) + p],
                    square_extent, cosine)
        for y in range(size):
            _flag_row(tile, row + y, i, size, here, counts)
            for x in range(size):
                if counts[x]:
                    continue
                found, v, u = _nearest(position, normal, covered, top, left + i, places, y, x, here)
                if found:
                    for c in range(3):
                        sums[c, i] += irradiance[c, v, u] - tile[middle, np.uint64(E + c * COLUMNS) + p]
                    sums[3, i] += one


class Here(NamedTuple):
    """The pixel that a window is of, and what may count for it."""

    x: Any  # position, m
    y: Any
    z: Any
    a: Any  # normal
    b: Any
    c: Any
    square_extent: Any  # m^2
    cosine: Any


@kernel
def _flag_row(tile: Array, y: int, left: int, size: int, here: Here, counts: Array) -> None:
    """Flag which of `size` pixels of a row of the tile, from `left` on, count."""
    start = np.uint64(left)
    for x in range(np.uint64(size)):
        q = start + x
        dx, dy, dz = (tile[y, np.uint64(X) + q] - here.x, tile[y, np.uint64(X + COLUMNS) + q] - here.y,
                      tile[y, np.uint64(X + 2 * COLUMNS) + q] - here.z)
        dot = (tile[y, np.uint64(N) + q] * here.a + tile[y, np.uint64(N + COLUMNS) + q] * here.b
               + tile[y, np.uint64(N + 2 * COLUMNS) + q] * here.c)
        counts[x] = (dx * dx + dy * dy + dz * dz <= here.square_extent) & (dot >= here.cosine)


@kernel
def _nearest(
    position: Array, normal: Array, covered: Array, row: int, column: int, places: Array, y: int, x: int, here: Here,
) -> tuple[bool, Any, Any]:
    """Return whether any of the places for (y, x) of a window lies on its surface; row and column of the first."""
    height, width = covered.shape
    for k in range(np.uint64(places.shape[2])):
        v, u = row + places[np.uint64(y), np.uint64(x), k, 0], column + places[np.uint64(y), np.uint64(x), k, 1]
        if v < 0 or v >= height or u < 0 or u >= width:
            continue
        j, i = np.uint64(v), np.uint64(u)
        if not covered[j, i]:
            continue
        dot = normal[0, j, i] * here.a + normal[1, j, i] * here.b + normal[2, j, i] * here.c
        dx, dy, dz = position[0, j, i] - here.x, position[1, j, i] - here.y, position[2, j, i] - here.z
        if dot >= here.cosine and dx * dx + dy * dy + dz * dz <= here.square_extent:
            return True, j, i
    return False, np.uint64(0), np.uint64(0)
