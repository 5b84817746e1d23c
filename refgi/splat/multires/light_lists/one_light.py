"""One pixel light at a tile of receivers: Eq. 2 and Phong lobes, for lights that are evaluated one by one.

`pair_sum` and its sisters sum all lights over a tile. Here each light has receivers of its own, and the same pair terms
are summed light by light; the result is that of `irradiance` for this light alone, to the bit.
"""

from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel
from refgi.pairs.glossy_sum import ReceiverLobes
from refgi.pairs.lobe_culling import LIMIT, bound_lobes
from refgi.pairs.lobe_sum import add_lobe
from refgi.pairs.packing import Packed
from refgi.pairs.pair_sum import NX, ROWS, SUM, Clamp, X, limits_of, pair_term
from refgi.pairs.pixel_lights import Widening
from refgi.pairs.sphere_sum import TERM, cut_cones, whole_cones
from refgi.radiometry import receiver_lobe
from refgi.types import Array

TILE_ROWS = ROWS + 5  # what lobes need
DIFFUSE, LOBE = 0, 1  # rows of the places


class SingleLights(NamedTuple):
    """Packed lights that are evaluated one by one."""

    packed_index: Array  # (2, N) int32, index among diffuse lights and among lobes; -1: it is not there
    diffuse: Array  # (9, M + 1), of `Packed`
    lobes: Array  # (13, K), of `PackedLobes`
    limits: Array  # (K,), from which 1 - cos on each lobe is 0


def single_lights(packed: Packed) -> SingleLights:
    """Return packed lights with the index of each among the diffuse ones and among the lobes."""
    packed_index = np.full((2, len(packed.shines)), -1, np.int32)
    for row, is_packed in zip(packed_index, (packed.shines, packed.glossy), strict=True):
        row[is_packed] = np.arange(np.count_nonzero(is_packed))
    diffuse = np.ascontiguousarray(packed.diffuse)  # of one layout, or kernels are compiled for each
    lobes = np.empty((13, 0), diffuse.dtype) if packed.lobes is None else np.ascontiguousarray(packed.lobes.lights)
    return SingleLights(packed_index, diffuse, lobes, bound_lobes(lobes[9], -1.0)[LIMIT])


@kernel
def add_light(
    tile: Array, size: int, lights: SingleLights, k: int, clamp: Clamp | None, spheres: Array | None,
    lobe_clamp: Clamp | None, widening: Widening | None,
) -> None:
    """Add the irradiance of light k to the sums of a tile of receivers, W/m^2 (Eq. 2, and its lobe).

    tile: (TILE_ROWS, TILE) of `load_cells`, of which `size` lanes count; clamp: of diffuse pairs; spheres: (M,) squared
    radii, m^2, where diffuse lights are virtual spherical lights; lobe_clamp: None where no light is glossy.
    """
    diffuse, lobe = lights.packed_index[DIFFUSE, k], lights.packed_index[LOBE, k]
    if diffuse >= 0:
        _add_diffuse(tile, size, lights.diffuse, diffuse, clamp, spheres)
    if lobe_clamp is not None and lobe >= 0:
        lanes = np.uint64(0), np.uint64(size)
        add_lobe(tile, lanes, lights.lobes, lobe, lights.limits[lobe], lobe_clamp, widening, None)


@kernel
def _add_diffuse(tile: Array, size: int, lights: Array, k: int, clamp: Clamp | None, spheres: Array | None) -> None:
    """Add (Phi / pi) g of one light to rows SUM (Eq. 2)."""
    x, y, z, lx, ly, lz = lights[0, k], lights[1, k], lights[2, k], lights[3, k], lights[4, k], lights[5, k]
    red, green, blue = lights[6, k], lights[7, k], lights[8, k]
    if spheres is not None:
        whole_cones(tile, (x, y, z, lx, ly, lz), spheres[k])
        cut_cones(tile, (x, y, z, lx, ly, lz), spheres[k], size)
    else:
        limits = limits_of(clamp, k)
        for i in range(size):
            receiver = tile[X, i], tile[X + 1, i], tile[X + 2, i], tile[NX, i], tile[NX + 1, i], tile[NX + 2, i]
            tile[TERM, i] = pair_term((x, y, z, lx, ly, lz), receiver, limits)
    for i in range(size):
        # Eq. (2): E += (Phi / pi) g
        tile[SUM, i] += tile[TERM, i] * red
        tile[SUM + 1, i] += tile[TERM, i] * green
        tile[SUM + 2, i] += tile[TERM, i] * blue


@kernel
def weigh_by_lobes(
    tile: Array, size: int, lights: SingleLights, k: int, lobes: ReceiverLobes | None, cells: Array
) -> None:
    """Turn the irradiance of light k in the sums of a tile into radiance of the cells' lobes over their reflectance.

    lobes: of all points, None where irradiance is asked for; cells: which points the tile holds.
    """
    if lobes is not None:
        diffuse, lobe = lights.packed_index[DIFFUSE, k], lights.packed_index[LOBE, k]
        if diffuse >= 0:
            _weigh(tile, size, (lights.diffuse[0, diffuse], lights.diffuse[1, diffuse], lights.diffuse[2, diffuse]),
                   lobes, cells)
        elif lobe >= 0:
            _weigh(tile, size, (lights.lobes[0, lobe], lights.lobes[1, lobe], lights.lobes[2, lobe]), lobes, cells)


@kernel
def _weigh(tile: Array, size: int, light: Any, lobes: ReceiverLobes, cells: Array) -> None:
    mirror = lobes.mirrored
    for i in range(size):
        m = cells[i]
        # rho_s of AMS Eq. (2)
        reflected = receiver_lobe(mirror[0, m], mirror[1, m], mirror[2, m], light[0] - tile[X, i],
                                  light[1] - tile[X + 1, i], light[2] - tile[X + 2, i], lobes.exponent[m])
        tile[SUM, i] *= reflected
        tile[SUM + 1, i] *= reflected
        tile[SUM + 2, i] *= reflected


@kernel
def load_cells(tile: Array, points: Array, normals: Array, cells: Array) -> None:
    """Load points and normals of some cells (<= TILE indices) into rows X and NX of a tile, and clear its sums.

    points, normals: (3, n), m and unit vectors.
    """
    for axis in range(3):
        for i in range(len(cells)):
            tile[X + axis, i] = points[axis, cells[i]]
            tile[NX + axis, i] = normals[axis, cells[i]]
            tile[SUM + axis, i] = tile.dtype.type(0.0)

