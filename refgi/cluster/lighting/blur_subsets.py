"""Subsets of lights that the blur's window misses, taken from farther along the surface (Sec. 6).

A window of n x n pixels holds each of the n^2 subsets once, so each place of it stands for one subset, and for all
pixels n apart that sum the same lights. Beside an edge some places of the window lie on another surface. Without them
the mean is that of some subsets alone, other ones from pixel to pixel, and their squares show. Each such place takes
the nearest pixel of its subset on the surface instead, up to `REACH` n away: along a straight edge the window moves
inwards as it does at the rim of the picture.
"""

from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.cluster.lighting.blur_tile import COLUMNS, E, N, X
from refgi.jit import kernel

Array = npt.NDArray[Any]

REACH = 2  # windows on each side that are searched


@lru_cache(maxsize=8)
def places_of_subsets(size: int) -> Array:
    """Return where else each place of a window of n x n pixels finds its subset, from near to far.

    Parameters
    ----------
    size : int
        n.

    Returns
    -------
    (n, n, (2 REACH + 1)^2 - 1, 2) ndarray
        Int64: rows and columns from the pixel that the window is of; equally far ones by row, then column.
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
    wide: int, sums: Array,
) -> None:
    """Add differences to pixels farther off for each place of a window that does not count.

    `sums` (4, WIDE) has the sums over the window of the pixels from (`top`, `left`) on, and how many pixels counted;
    `planes` are irradiance, position, normal and covered of the whole picture, `places` of `places_of_subsets`.
    """
    middle, one, whole = row + size // 2, tile.dtype.type(1.0), tile.dtype.type(size * size)
    covered = planes[3]
    for i in range(wide):
        if sums[3, i] == whole or not covered[top, left + i]:
            continue
        p = size // 2 + i
        for y in range(size):
            for x in range(size):
                if _counts(tile, middle, p, row + y, x + i, square_extent, cosine):
                    continue
                found, v, u = _nearest(planes, tile, middle, p, top, left + i, places[y, x], square_extent, cosine)
                if found:
                    for c in range(3):
                        sums[c, i] += planes[0][c, v, u] - tile[middle, E + c * COLUMNS + p]
                    sums[3, i] += one


@kernel
def _counts(tile: Array, middle: int, p: int, y: int, q: int, square_extent: Any, cosine: Any) -> bool:
    square, dot = tile.dtype.type(0.0), tile.dtype.type(0.0)
    for c in range(3):
        away = tile[y, X + c * COLUMNS + q] - tile[middle, X + c * COLUMNS + p]
        square += away * away
        dot += tile[y, N + c * COLUMNS + q] * tile[middle, N + c * COLUMNS + p]
    return bool((square <= square_extent) & (dot >= cosine))


@kernel
def _nearest(
    planes: Any, tile: Array, middle: int, p: int, row: int, column: int, places: Array, square_extent: Any, cosine: Any
) -> tuple[bool, int, int]:
    """Return whether any place lies on the surface of a pixel, p of the tile, and the first that does."""
    _, position, normal, covered = planes
    height, width = covered.shape
    for k in range(len(places)):
        v, u = row + places[k, 0], column + places[k, 1]
        if v < 0 or v >= height or u < 0 or u >= width or not covered[v, u]:
            continue
        square, dot = tile.dtype.type(0.0), tile.dtype.type(0.0)
        for c in range(3):
            away = position[c, v, u] - tile[middle, X + c * COLUMNS + p]
            square += away * away
            dot += normal[c, v, u] * tile[middle, N + c * COLUMNS + p]
        if square <= square_extent and dot >= cosine:
            return True, v, u
    return False, 0, 0
