"""Geometry-aware blur, a joint bilateral box filter: the mean over n x n pixels of the same surface (Sec. 6).

[Laine et al. 2007] A pixel q counts for p where ``|x_q - x_p| <= extent`` and ``<n_p . n_q> >= cosine``. All weights
are 1: a window of n x n pixels sees each subset of lights once wherever it lies, moved inwards at the picture's rim.
Threads take tiles with their surroundings; where bounds say that all pixels around count, nothing is compared.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.cluster.blur_tile import (
    COLUMNS,
    END,
    FAR,
    TALL,
    WIDE,
    E,
    N,
    X,
    add_missing,
    is_one_surface,
    load_pixels,
    places_of_subsets,
)
from refgi.cluster.settings import MOST_BLOCK, GeometryBlur
from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.pairs.irradiance import Receivers
from refgi.rsm.buffers.extent import Extent
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.cluster.settings import BoxBlur

TASKS = 64  # parts that tiles are split into, whatever the number of threads
NOWHERE = np.zeros((0, 0, 0, 2), np.int64)  # places of missing subsets where these are left out


@stage("cluster.blur")
def blur(
    irradiance: Array, receivers: Receivers, size: int, settings: "BoxBlur | GeometryBlur", visible: Extent
) -> Array:
    """Average irradiance over n x n pixels of a surface, each subset once (VAL Sec. 6, E-VAL-13; docs/methods/val).

    irradiance (3, h, w): W/m^2.
    receivers: Receivers; their dtype is that of the result.
    size: n, 1 to 64: pixels along a side of the window.
    settings: How far apart points of one surface may be and how their normals may differ; a box asks neither.
    visible: Box of what the camera sees, of whose diagonal distances are shares.
    -> (3, h, w): W/m^2; 0 where there is no surface. Equal irradiance stays as it is, to the bit.

    Raises
    ------
    InputError
        If shapes do not fit or the size is out of range.

    Notes
    -----
    [Dong09] Sec. 6 takes a tenth of the scene's extent and a cosine of 0.8, and blurs what leaves the surface; here it
    is the irradiance, so that textures stay sharp. The window of pixel x starts at x - n // 2. The mean is taken of
    differences to the pixel itself. The paper does not say what becomes of subsets that an edge cuts off; here they
    are looked for up to a window away (`every_subset`).
    """
    position, covered = np.ascontiguousarray(receivers.position), np.ascontiguousarray(receivers.covered, np.bool_)
    normal = np.ascontiguousarray(receivers.normal, position.dtype)
    values = np.ascontiguousarray(irradiance, position.dtype)
    expect(values.shape == position.shape, "irradiance", f"shape {position.shape}", values.shape)
    expect(1 <= size <= MOST_BLOCK, "size", f"1 to {MOST_BLOCK} pixels", size)
    real = position.dtype.type
    extent, cosine, places = FAR / 4, -np.inf, NOWHERE
    if isinstance(settings, GeometryBlur):
        extent = min(settings.extent * visible.diagonal, FAR / 4)
        cosine = settings.cosine if settings.cosine > -1 else -np.inf
        places = places_of_subsets(size) if settings.every_subset else NOWHERE
    result = np.empty_like(values)
    _blur(values, position, normal, covered, size, real(extent) ** 2, real(cosine), places, result)
    return result


@kernel(parallel=True)
def _blur(
    irradiance: Array, position: Array, normal: Array, covered: Array, size: int, square_extent: Any, cosine: Any,
    places: Array, result: Array,
) -> None:
    height, width = covered.shape
    planes = (irradiance, position, normal, covered)
    across = (width + WIDE - 1) // WIDE
    tiles = across * ((height + TALL - 1) // TALL)
    for task in prange(TASKS):
        scratch = np.empty((TALL + size - 1, END), position.dtype)  # once: pages of memory cost more than their use
        sums, counts = np.empty((4, WIDE), position.dtype), np.empty(MOST_BLOCK, np.bool_)
        for t in range(np.int64(task), tiles, TASKS):
            top, left = t // across * TALL, t % across * WIDE
            tall, wide = min(TALL, height - top), min(WIDE, width - left)
            tile = scratch[: tall + size - 1]
            load_pixels(tile, irradiance, position, normal, covered, top - size // 2, left - size // 2, wide, size)
            whole = is_one_surface(tile, wide + size - 1, square_extent, cosine)
            for row in range(tall):
                if whole:
                    _add_all(tile, row, size, sums)
                else:
                    _add_accepted(tile, row, size, square_extent, cosine, sums)
                    if places.size > 0:
                        add_missing(tile, row, size, square_extent, cosine, places, planes, top + row, left, wide,
                                    counts, sums)
                _store(tile, row + size // 2, size // 2, sums, covered, top + row, left, wide, result)


@kernel
def _add_all(tile: Array, row: int, size: int, sums: Array) -> None:
    """Add up differences to the pixels of a row where all pixels count."""
    one, four = tile.dtype.type(1.0), np.uint64(4)
    for c in range(3):
        for i in range(WIDE):
            sums[c, i] = 0
    middle, line = row + size // 2, np.uint64(size // 2)
    quads = np.uint64(size // 4)
    for y in range(row, row + size):
        for quad in range(quads):
            first = four * quad
            for i in range(np.uint64(WIDE)):
                sums[0, i] = _four(tile, middle, np.uint64(E) + line + i, y, np.uint64(E) + first + i, sums[0, i])
                sums[1, i] = _four(tile, middle, np.uint64(E + COLUMNS) + line + i, y,
                                   np.uint64(E + COLUMNS) + first + i, sums[1, i])
                sums[2, i] = _four(tile, middle, np.uint64(E + 2 * COLUMNS) + line + i, y,
                                   np.uint64(E + 2 * COLUMNS) + first + i, sums[2, i])
        for q in range(four * quads, np.uint64(size)):
            for i in range(np.uint64(WIDE)):
                p = line + i
                for c in range(3):
                    plane = np.uint64(E + c * COLUMNS)
                    sums[c, i] += tile[y, plane + q + i] - tile[middle, plane + p]
    for i in range(WIDE):
        sums[3, i] = one * (size * size)


@kernel
def _four(tile: Array, middle: int, p: Any, y: int, q: Any, total: Any) -> Any:
    here = tile[middle, p]
    total = total + (tile[y, q] - here)
    total = total + (tile[y, q + np.uint64(1)] - here)
    total = total + (tile[y, q + np.uint64(2)] - here)
    return total + (tile[y, q + np.uint64(3)] - here)


@kernel
def _add_accepted(tile: Array, row: int, size: int, square_extent: Any, cosine: Any, sums: Array) -> None:
    """Add up differences to the pixels of a row where pixels count for each other, and how many do."""
    real = tile.dtype.type
    one, zero = real(1.0), real(0.0)
    for k in range(4):
        for i in range(WIDE):
            sums[k, i] = zero
    middle, line = row + size // 2, np.uint64(size // 2)
    e0, e1, e2 = np.uint64(E), np.uint64(E + COLUMNS), np.uint64(E + 2 * COLUMNS)
    for y in range(row, row + size):
        for first in range(np.uint64(0), np.uint64(size), np.uint64(2)):
            pair = first + np.uint64(1) < np.uint64(size)
            for i in range(np.uint64(WIDE)):
                p, q, r = line + i, first + i, first + i + np.uint64(1)
                with_q = _near(tile, middle, p, y, q, square_extent) & _faces(tile, middle, p, y, q, cosine)
                with_r = _near(tile, middle, p, y, r, square_extent) & _faces(tile, middle, p, y, r, cosine) & pair
                # read whether they count or not, so that nothing branches
                red, green, blue = tile[middle, e0 + p], tile[middle, e1 + p], tile[middle, e2 + p]
                dr, dg, db = tile[y, e0 + q] - red, tile[y, e1 + q] - green, tile[y, e2 + q] - blue
                er, eg, eb = tile[y, e0 + r] - red, tile[y, e1 + r] - green, tile[y, e2 + r] - blue
                sums[0, i] = sums[0, i] + (dr if with_q else zero) + (er if with_r else zero)
                sums[1, i] = sums[1, i] + (dg if with_q else zero) + (eg if with_r else zero)
                sums[2, i] = sums[2, i] + (db if with_q else zero) + (eb if with_r else zero)
                sums[3, i] = sums[3, i] + (one if with_q else zero) + (one if with_r else zero)


@kernel
def _near(tile: Array, middle: int, p: Any, y: int, q: Any, square_extent: Any) -> bool:
    x0, x1, x2 = np.uint64(X), np.uint64(X + COLUMNS), np.uint64(X + 2 * COLUMNS)
    dx, dy, dz = (tile[y, x0 + q] - tile[middle, x0 + p], tile[y, x1 + q] - tile[middle, x1 + p],
                  tile[y, x2 + q] - tile[middle, x2 + p])
    return bool(dx * dx + dy * dy + dz * dz <= square_extent)


@kernel
def _faces(tile: Array, middle: int, p: Any, y: int, q: Any, cosine: Any) -> bool:
    n0, n1, n2 = np.uint64(N), np.uint64(N + COLUMNS), np.uint64(N + 2 * COLUMNS)
    return bool(tile[y, n0 + q] * tile[middle, n0 + p] + tile[y, n1 + q] * tile[middle, n1 + p]
                + tile[y, n2 + q] * tile[middle, n2 + p] >= cosine)


@kernel
def _store(
    tile: Array, middle: int, middle_column: int, sums: Array, covered: Array, row: int, left: int, wide: int,
    result: Array,
) -> None:
    one, zero = tile.dtype.type(1.0), tile.dtype.type(0.0)
    line, start = np.uint64(middle_column), np.uint64(left)  # unsigned: no check for places counted from the end
    for i in range(np.uint64(WIDE)):
        sums[3, i] = sums[3, i] if sums[3, i] > one else one
    for c in range(3):
        plane = np.uint64(E + c * COLUMNS) + line
        for i in range(np.uint64(WIDE)):
            sums[c, i] = tile[middle, plane + i] + sums[c, i] / sums[3, i]
        for i in range(np.uint64(wide)):
            result[c, row, start + i] = sums[c, i] if covered[row, start + i] else zero
