"""Light from near pixel lights, which no interpolation holds: what exceeds a bound on each light's share.

E = sum (Phi / pi) min(g, b) + sum (Phi / pi) max(0, g - b): the first sum is bounded and smooth, fit for subsplats; the
second, which is summed here, is not 0 only where r^2 < 1 / b, since g <= 1 / r^2. Tiles that no light is near to cost
a test of their box a light.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.splat.irradiance import Receivers, checked
from refgi.splat.pairs.blocks import block_by_block, put, taken
from refgi.splat.pairs.culling import bound_tile
from refgi.splat.pairs.pair_sum import NX, ROWS, SUM, TILE, Clamp, X, clamped_term, geometry_term, load_tile
from refgi.splat.settings import PairSettings
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.rsm import PixelLights

Array = npt.NDArray[Any]


@stage("splat.near")
def near_light(
    receivers: Receivers, lights: "PixelLights", settings: PairSettings, footprint: Array | None, most: float
) -> tuple[Array, int]:
    """Sum what single lights give each receiver beyond a bound, at full resolution.

    Parameters
    ----------
    receivers : Receivers
        Points that are lit.
    lights : PixelLights
        Lights; what their lobes give is left out.
    settings : PairSettings
        How one light lights one receiver.
    footprint : (N,) ndarray or None
        Surface area each light stands for, m^2.
    most : float
        The bound, W/m^2.

    Returns
    -------
    excess : (3, h, w) ndarray
        Irradiance, W/m^2; 0 where every light keeps below the bound.
    pairs : int
        Pairs that were looked at.

    Notes
    -----
    Virtual spherical lights have another term, which is bounded by itself: their excess counts as 0.
    """
    packed = checked(receivers, lights, settings, footprint)
    excess = np.zeros(receivers.position.shape, receivers.position.dtype)
    if packed.spheres is not None or packed.diffuse.shape[1] < 2 or not most > 0:
        return excess, 0
    places = block_by_block(receivers.covered)
    points, normals = taken(receivers.position, places), taken(receivers.normal, places)
    bound = (most / packed.diffuse[6:, :-1].astype(np.float64).max(axis=0)).astype(points.dtype)
    sums, pairs = np.zeros_like(points), np.zeros(-(-len(places) // TILE), np.int64)
    _sum_excess(points, normals, packed.diffuse, packed.clamp, bound, sums, pairs)
    put(excess, places, sums)
    return excess, int(pairs.sum())


@kernel(parallel=True)
def _sum_excess(
    position: Array, normal: Array, lights: Array, clamp: Clamp | None, bound: Array, irradiance: Array, pairs: Array
) -> None:
    zero = position.dtype.type(0.0)
    for block in prange(len(pairs)):
        first = block * TILE
        size = min(TILE, position.shape[1] - first)
        tile = np.zeros((ROWS, TILE), position.dtype)
        load_tile(tile, position, normal, first, size)
        low, high = np.empty(6, position.dtype), np.empty(6, position.dtype)
        bound_tile(tile, size, low, high)
        for k in range(len(bound)):
            if not _near(lights, k, low, high, bound[k]):
                continue
            pairs[block] += size
            lx, ly, lz, b = lights[3, k], lights[4, k], lights[5, k], bound[k]
            for i in range(TILE):
                dx, dy, dz = lights[0, k] - tile[X, i], lights[1, k] - tile[X + 1, i], lights[2, k] - tile[X + 2, i]
                nx, ny, nz = tile[NX, i], tile[NX + 1, i], tile[NX + 2, i]
                if clamp is None:
                    g = geometry_term(dx, dy, dz, lx, ly, lz, nx, ny, nz)
                else:
                    g = clamped_term(dx, dy, dz, lx, ly, lz, nx, ny, nz, clamp, k)
                over = g - b if g > b else zero
                tile[SUM, i] += over * lights[6, k]
                tile[SUM + 1, i] += over * lights[7, k]
                tile[SUM + 2, i] += over * lights[8, k]
        for c in range(3):
            for i in range(size):
                irradiance[c, first + i] = tile[SUM + c, i]


@kernel
def _near(lights: Array, k: int, low: Array, high: Array, bound: Any) -> bool:
    """Tell whether any point of a tile's box is nearer to a light than 1 / sqrt(bound)."""
    square = lights.dtype.type(0.0)
    for axis in range(3):
        outside = max(low[axis] - lights[axis, k], lights[axis, k] - high[axis], lights.dtype.type(0.0))
        square += outside * outside
    return bool(square * bound < lights.dtype.type(1.0))
