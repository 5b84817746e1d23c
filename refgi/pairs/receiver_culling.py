"""Culling of pixel lights per tile of glossy receivers: a light that lies in no receiver's lobe adds exactly 0.

A tile's mirrored directions and positions are bounded by boxes. A light is passed over when no direction and no
position out of them come as near to each other as the farthest of the tile's lobes reaches, by more than rounding:
the sum is the same to the bit.

Symbols: d vector from receiver to light, m the direction to the eye mirrored, h = 1 - m . d / |d| as in `glossy_sum`.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.pairs.tiles import bound_rows

Array = npt.NDArray[Any]

ROUNDING = 32.0  # units of rounding that h and m . d / |d| may be off; about 12 are possible, most of them of |m|
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
