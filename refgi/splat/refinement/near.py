"""Light that no interpolation holds: what near pixel lights give beyond a bound on each one's share, and lobes.

E = sum (Phi / pi) min(g, b) + sum (Phi / pi) max(0, g - b): the first sum is bounded and smooth, fit for subsplats; the
second, which is summed here, is not 0 only where r^2 < 1 / b, since g <= 1 / r^2. Tiles that no light is near to cost
a test of their box a light. Lobes can be as narrow as a pixel at any distance, so they are summed here as a whole.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.splat.irradiance import Receivers, checked
from refgi.splat.pairs.blocks import block_by_block, put, taken
from refgi.splat.pairs.culling import bound_tile
from refgi.splat.pairs.lobe_sum import add_lobes
from refgi.splat.pairs.pair_sum import NX, ROWS, SUM, Clamp, X, clamped_term, geometry_term, load_tile
from refgi.splat.pairs.ranged_sum import LANES
from refgi.splat.settings import PairSettings
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.rsm import PixelLights

Array = npt.NDArray[Any]


@stage("splat.near")
def near_light(
    receivers: Receivers, lights: "PixelLights", settings: PairSettings, footprint: Array | None, most: float
) -> tuple[Array, int]:
    """Sum what single lights give each receiver beyond a bound, and by their lobes, at full resolution.

    Parameters
    ----------
    receivers : Receivers
        Points that are lit.
    lights : PixelLights
        Lights.
    settings : PairSettings
        How one light lights one receiver.
    footprint : (N,) ndarray or None
        Surface area each light stands for, m^2.
    most : float
        The bound, W/m^2.

    Returns
    -------
    excess : (3, h, w) ndarray
        Irradiance, W/m^2; 0 where every light keeps below the bound and none is glossy.
    pairs : int
        Pairs that were looked at.

    Notes
    -----
    Virtual spherical lights have another term, which is bounded by itself: their excess counts as 0.
    """
    packed = checked(receivers, lights, settings, footprint)
    excess, pairs = np.zeros(receivers.position.shape, receivers.position.dtype), 0
    bounded = packed.spheres is not None or packed.diffuse.shape[1] < 2 or not most > 0
    if bounded and packed.lobes is None:
        return excess, pairs
    places = block_by_block(receivers.covered)
    points, normals = taken(receivers.position, places), taken(receivers.normal, places)
    sums, looked = np.zeros_like(points), np.zeros(-(-len(places) // LANES), np.int64)
    if not bounded:
        bound = (most / packed.diffuse[6:, :-1].astype(np.float64).max(axis=0)).astype(points.dtype)
        _sum_excess(points, normals, packed.diffuse, packed.clamp, bound, sums, looked)
    if packed.lobes is not None:
        add_lobes(points, normals, *packed.lobes, None, None, sums)
        pairs = len(places) * packed.lobes.lights.shape[1]
    put(excess, places, sums)
    return excess, pairs + int(looked.sum())


@kernel(parallel=True)
def _sum_excess(
    position: Array, normal: Array, lights: Array, clamp: Clamp | None, bound: Array, irradiance: Array, pairs: Array
) -> None:
    zero = position.dtype.type(0.0)
    for block in prange(len(pairs)):
        first = block * LANES
        size = min(LANES, position.shape[1] - first)
        tile = np.zeros((ROWS, LANES), position.dtype)
        load_tile(tile, position, normal, first, size)
        low, high = np.empty(6, position.dtype), np.empty(6, position.dtype)
        bound_tile(tile, size, low, high)
        near = np.empty(len(bound), np.bool_)
        _mark_near(lights, bound, low, high, near)
        for k in range(len(bound)):
            if not near[k]:
                continue
            pairs[block] += size
            lx, ly, lz, b = lights[3, k], lights[4, k], lights[5, k], bound[k]
            for i in range(LANES):
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
def _mark_near(lights: Array, bound: Array, low: Array, high: Array, near: Array) -> None:
    """Mark the lights that some point of a tile's box is nearer to than 1 / sqrt(bound), on their lit side."""
    real = lights.dtype.type
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
