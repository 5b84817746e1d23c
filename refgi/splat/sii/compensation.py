"""Bias compensation in screen space (Novak, Engelhardt and Dachsbacher 2011): what a bound on G takes, from pixels.

With the geometry term bounded to b, lights give the integral of L min(G, b); the rest, L max(0, G - b), comes from
surfaces nearer than b^(-1/2), which mostly the same picture shows. Pixels are the senders of level 0 of `hssil`, each
with its diffusely reflected direct light L and its area ds, and each receiver sums those around it, without visibility
as `sii` does. What lies off screen, hidden, or seen at a slant is missing, and each pixel is a point.
"""

import math
from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.rsm.raster.projection import Projection
from refgi.sssil.levels import levels
from refgi.stages import stage
from refgi.types import Array


@stage("sii.compensation")
def screen_compensation(
    depth: Array, normal: Array, albedo: Array, direct: Array, projection: Projection, bound: float
) -> Array:
    """Sum L ds max(0, G - b) over the pixels near each one.

    depth (h, w): Along the view direction, m; inf without surface.
    direct (3, h, w): Direct irradiance, W/m^2.
    projection: The camera's map.
    bound: b, 1/m^2.
    -> (3, h, w): Irradiance, W/m^2, linear RGB, without albedo/pi and visibility.
    """
    (pixels,) = levels(depth, normal, albedo, direct, projection, 0, 1)
    result = np.zeros_like(direct)
    _sum_near(pixels.position, pixels.depth, pixels.normal, pixels.radiance, pixels.area, float(bound),
              np.asarray(projection.half, np.float64), result)
    return result


@kernel(parallel=True)
def _sum_near(
    position: Array, depth: Array, normal: Array, radiance: Array, area: Array, bound: float, half: Array, result: Array
) -> None:
    height, width = depth.shape
    for i in prange(height):
        for j in range(width):
            if depth[i, j] < math.inf:
                rows = _within(i, height, float(depth[i, j]), float(half[1]), bound)
                columns = _within(j, width, float(depth[i, j]), float(half[0]), bound)
                _sum_one(position, normal, radiance, area, bound, i, j, rows, columns, result)


@kernel
def _within(index: Any, count: int, depth: float, half: float, bound: float) -> tuple[int, int]:
    """Return the first row or column, and one past the last, that may show a point nearer than b^(-1/2)."""
    reach = 1.0 / math.sqrt(bound)
    if depth <= reach:
        return 0, count
    # |x'/z' - x/z| <= (reach + |x/z| reach) / z', z' >= z - reach
    pixels = math.ceil(reach * (1.0 + half) / (depth - reach) * count / (2.0 * half)) + 1
    here = int(index)
    return max(0, here - pixels), min(count, here + pixels + 1)


@kernel
def _sum_one(
    position: Array, normal: Array, radiance: Array, area: Array, bound: float, i: Any, j: Any, rows: tuple[int, int],
    columns: tuple[int, int], result: Array,
) -> None:
    # L ds max(0, G - b), G = cos cos / r^2
    x, y, z = float(position[0, i, j]), float(position[1, i, j]), float(position[2, i, j])
    nx, ny, nz = float(normal[0, i, j]), float(normal[1, i, j]), float(normal[2, i, j])
    red, green, blue = 0.0, 0.0, 0.0
    for a in range(rows[0], rows[1]):
        for b in range(columns[0], columns[1]):
            dx, dy, dz = position[0, a, b] - x, position[1, a, b] - y, position[2, a, b] - z
            square = dx * dx + dy * dy + dz * dz
            cx = nx * dx + ny * dy + nz * dz
            cl = -(normal[0, a, b] * dx + normal[1, a, b] * dy + normal[2, a, b] * dz)
            if cx > 0.0 and cl > 0.0 and cx * cl > bound * square * square:
                share = area[a, b] * (cx * cl / (square * square) - bound)
                red += share * radiance[0, a, b]
                green += share * radiance[1, a, b]
                blue += share * radiance[2, a, b]
    result[0, i, j], result[1, i, j], result[2, i, j] = red, green, blue
