"""Subsets of lights that the blur's window misses, taken from farther along the surface (Sec. 6).

A window of n x n pixels holds each of the n^2 subsets once, so each place of it stands for one subset, and for all
pixels n apart that sum the same lights. Beside an edge some places of the window lie on another surface. Without them
the mean is that of some subsets alone, other ones from pixel to pixel, and their squares show. Each such place takes
the nearest pixel of its subset on the surface instead, up to `REACH` n away: along a straight edge the window moves
inwards as it does at the rim of the picture.
"""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.cluster.lighting.blur_tile import COLUMNS, E, N, X
from refgi.jit import kernel

Array = npt.NDArray[Any]

REACH = 1  # windows on each side that are searched


@lru_cache(maxsize=8)
def places_of_subsets(size: int) -> Array:
    """Return where else each place of a window of n x n pixels finds its subset, from near to far.

    (n, n, (2 REACH + 1)^2 - 1, 2) int64: rows and columns from the pixel that the window is of; equally far ones by
    row, then column.
    """
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
    """Add differences to pixels farther off for each place of a window that does not count.

    `sums` (4, WIDE) has the sums over the window of the pixels from (`top`, `left`) on, and how many pixels counted;
    `planes` are irradiance, position, normal and covered of the whole picture, `places` of `places_of_subsets`.
    `counts` (>= n,) of bool is overwritten.
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
