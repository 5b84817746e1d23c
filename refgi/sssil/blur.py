"""Geometry-aware blur of a level's irradiance: the mean over the texels of an interleaved tile on one surface.

A window of n x n texels has the whole set of samples that a tile's texels share out (Keller and Heidrich 2001). As in
val, texel q counts for p where ``|n_p . (x_q - x_p)| <= plane_tolerance z_p`` and ``n_p . n_q >= cosine``. Texels that
the rim of an even window halves weigh 1/2. The box is taken along rows, then columns; a row's texels are SIMD lanes.
"""

from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.rsm.pool import plane
from refgi.sssil.settings import LARGEST_WINDOW, GeometryBlur
from refgi.sssil.view import Level
from refgi.stages import stage
from refgi.types import Array

TALL, WIDE = 32, 128  # texels of a tile of work
PAD = LARGEST_WINDOW // 2  # lanes to either side of a tile
SPAN = WIDE + 2 * PAD  # lanes of a plane in a row
LINE = 14 * SPAN  # planes of a row: light, position x, normal n, n . x, its largest change on a surface, mean light
LIGHT, POSITION, NORMAL, PLANE, LIMIT, MEAN = 0, 3 * SPAN, 6 * SPAN, 9 * SPAN, 10 * SPAN, 11 * SPAN


def blur(irradiance: Array, level: Level, settings: GeometryBlur) -> Array:
    """Average the irradiance of a level, (3, h, w) W/m^2, over windows of texels of the same surface."""
    return window_means(irradiance, level.position, level.normal, level.depth, settings.size, settings.plane_tolerance,
                        settings.cosine)


@stage("sssil.blur", each="level")
def window_means(
    light: Array, position: Array, normal: Array, depth: Array, size: int, plane_tolerance: float, cosine: float
) -> Array:
    """Average over a window of texels on the texel's tangent plane that face as it does (docs/methods/hssil).

    The mean over a row, then over a column (after Keller and Heidrich 2001).

    light (3, h, w): Irradiance of a level's texels, W/m^2.
    position (3, h, w): Their surface points, m.
    depth (h, w): Their depths, m; inf without surface.
    size: n: the window has n x n texels.
    plane_tolerance: Largest distance from the tangent plane, a share of the depth.
    cosine: Least cosine between normals.
    -> (3, h, w): Irradiance by this level, averaged, W/m^2; 0 without surface. Equal irradiance stays as it is, to the
        bit.

    Notes
    -----
    Not in the paper. The mean is taken of differences to the texel itself. Texels outside the picture do not count.
    """
    real = position.dtype.type
    values = np.ascontiguousarray(light, position.dtype)
    result = plane(values.shape, values.dtype)
    _blur(values, position, normal, depth, size, real(plane_tolerance), real(cosine), result)
    return result


@kernel(parallel=True)
def _blur(
    irradiance: Array, position: Array, normal: Array, depth: Array, size: int, tolerance: Any, cosine: Any,
    result: Array,
) -> None:
    rows, columns = depth.shape
    across, half = (columns + WIDE - 1) // WIDE, size // 2
    for task in prange(across * ((rows + TALL - 1) // TALL)):
        left, top = np.int64(task) % across * WIDE, np.int64(task) // across * TALL
        tall = min(TALL, rows - top)
        tile, sums = np.empty((tall + 2 * half) * LINE, depth.dtype), np.empty(4 * WIDE, depth.dtype)
        for row in range(tall + 2 * half):
            _load(tile, row * LINE, irradiance, position, normal, depth, top - half + row, left, tolerance)
            _average(tile, row * LINE, LIGHT, size, 1, cosine, sums)
            for c in range(3):
                mean = np.uint64(row * LINE + MEAN + c * SPAN + PAD)
                for i in range(np.uint64(WIDE)):
                    tile[mean + i] = sums[np.uint64(c * WIDE) + i]
        for row in range(tall):
            _average(tile, (row + half) * LINE, MEAN, size, LINE, cosine, sums)
            for c in range(3):
                for i in range(np.uint64(min(WIDE, columns - left))):
                    result[c, top + row, np.uint64(left) + i] = sums[np.uint64(c * WIDE) + i]


@kernel
def _load(
    tile: Array, to: int, irradiance: Array, position: Array, normal: Array, depth: Array, row: int, left: int,
    tolerance: Any,
) -> None:
    """Copy a row of texels and those beside it; one without surface has a position that is no number: no weight."""
    rows, columns = depth.shape
    real = depth.dtype.type
    low, high = max(0, PAD - left), min(SPAN, columns - left + PAD)  # lanes that are texels
    if row < 0 or row >= rows:
        low, high = SPAN, SPAN
    for k in range(11):
        value, start = real(np.nan) if 3 <= k < 6 else real(0.0), np.uint64(to + k * SPAN)
        for i in range(np.uint64(low)):
            tile[start + i] = value
        for i in range(np.uint64(high), np.uint64(SPAN)):
            tile[start + i] = value
    y, first = np.uint64(row), np.uint64(left - PAD)  # may stand for a number below 0: places wrap to the right ones
    for c in range(3):
        e, x, n = np.uint64(to + c * SPAN), np.uint64(to + POSITION + c * SPAN), np.uint64(to + NORMAL + c * SPAN)
        for i in range(np.uint64(low), np.uint64(high)):
            covered = depth[y, first + i] < real(np.inf)
            tile[e + i] = irradiance[c, y, first + i] if covered else real(0.0)
            tile[x + i] = position[c, y, first + i] if covered else real(np.nan)
            tile[n + i] = normal[c, y, first + i]
    x, n, at, limit = (np.uint64(to + POSITION), np.uint64(to + NORMAL), np.uint64(to + PLANE), np.uint64(to + LIMIT))
    for i in range(np.uint64(low), np.uint64(high)):
        tile[limit + i] = tolerance * depth[y, first + i]
    for i in range(np.uint64(SPAN)):
        tile[at + i] = _dot(tile, n + i, x + i)


@kernel
def _dot(tile: Array, first: Any, second: Any) -> Any:
    span = np.uint64(SPAN)
    return (tile[first] * tile[second] + tile[first + span] * tile[second + span]
            + tile[first + span + span] * tile[second + span + span])


@kernel
def _average(tile: Array, start: int, light: int, size: int, step: int, cosine: Any, sums: Array) -> None:
    """Average over the box of `size` texels that are `step` places apart; `sums` gets the means of a row."""
    real, half = tile.dtype.type, size // 2
    for k in range(4):
        value = real(1.0) if k == 3 else real(0.0)
        for i in range(np.uint64(WIDE)):
            sums[np.uint64(k * WIDE) + i] = value
    for by in range(1, half + 1):
        weight = real(0.5) if 2 * by == size else real(1.0)
        _add_two(tile, start + PAD, by * step, light, weight, cosine, sums)
    total = np.uint64(3 * WIDE)
    for c in range(3):
        own, mean = np.uint64(start + PAD + light + c * SPAN), np.uint64(c * WIDE)
        for i in range(np.uint64(WIDE)):
            sums[mean + i] = tile[own + i] + sums[mean + i] / sums[total + i]


@kernel
def _add_two(tile: Array, here: int, by: int, light: int, weight: Any, cosine: Any, sums: Array) -> None:
    """Add the differences of the texels `by` places before and after to those from `here` on, and their weights."""
    red, green, blue, total = np.uint64(0), np.uint64(WIDE), np.uint64(2 * WIDE), np.uint64(3 * WIDE)
    e, g, b = np.uint64(light), np.uint64(light + SPAN), np.uint64(light + 2 * SPAN)
    p, q, r = np.uint64(here), np.uint64(here - by), np.uint64(here + by)
    for i in range(np.uint64(WIDE)):
        v = _weight_of(tile, p + i, q + i, weight, cosine)
        w = _weight_of(tile, p + i, r + i, weight, cosine)
        e0, e1, e2 = tile[p + e + i], tile[p + g + i], tile[p + b + i]
        sums[red + i] = sums[red + i] + (v * (tile[q + e + i] - e0) + w * (tile[r + e + i] - e0))
        sums[green + i] = sums[green + i] + (v * (tile[q + g + i] - e1) + w * (tile[r + g + i] - e1))
        sums[blue + i] = sums[blue + i] + (v * (tile[q + b + i] - e2) + w * (tile[r + b + i] - e2))
        sums[total + i] = sums[total + i] + (v + w)


@kernel
def _weight_of(tile: Array, p: Any, q: Any, weight: Any, cosine: Any) -> Any:
    """Return `weight` where texel q is of p's surface, else 0."""
    x, n = np.uint64(POSITION), np.uint64(NORMAL)
    off = _dot(tile, p + n, q + x) - tile[p + np.uint64(PLANE)]
    on_surface = (abs(off) <= tile[p + np.uint64(LIMIT)]) & (_dot(tile, p + n, q + n) >= cosine)
    return weight if on_surface else weight - weight
