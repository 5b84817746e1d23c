"""One pixel light at a tile of receivers: the pair terms of Eq. 2 and of lobes, for lights that are taken one by one.

`pair_sum` and its sisters run all lights past a tile. Where each light lights points of its own, the same terms are
called light by light; the result is that of `irradiance` for this light alone, to the bit.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.pairs.lobe_culling import LIMIT, bound_lobes
from refgi.pairs.lobe_shape import Widening
from refgi.pairs.lobe_sum import add_lobe
from refgi.pairs.packing import Packed
from refgi.pairs.pair_sum import NX, ROWS, SUM, Clamp, X, clamped_term, geometry_term
from refgi.pairs.sphere_sum import TERM, cut_cones, whole_cones

Array = npt.NDArray[Any]

TILE_ROWS = ROWS + 5  # what lobes need
DIFFUSE, LOBE = 0, 1  # rows of the places


class Separate(NamedTuple):
    """Packed lights that are taken one by one."""

    places: Array  # (2, N) int32, index among diffuse lights and among lobes; -1: it is not there
    diffuse: Array  # (9, M + 1), of `Packed`
    lobes: Array  # (13, K), of `PackedLobes`
    limits: Array  # (K,), from which 1 - cos on each lobe is 0


def separate(packed: Packed) -> Separate:
    """Say where each light stands among the packed ones.

    Parameters
    ----------
    packed : Packed
        The lights.

    Returns
    -------
    Separate
        The same lights.
    """
    places = np.full((2, len(packed.shines)), -1, np.int32)
    for row, there in zip(places, (packed.shines, packed.glossy), strict=True):
        row[there] = np.arange(np.count_nonzero(there))
    diffuse = np.ascontiguousarray(packed.diffuse)  # of one layout, or kernels are compiled for each
    lobes = np.empty((13, 0), diffuse.dtype) if packed.lobes is None else np.ascontiguousarray(packed.lobes.lights)
    return Separate(places, diffuse, lobes, bound_lobes(lobes[9], -1.0)[LIMIT])


@kernel
def light_tile(
    tile: Array, size: int, lights: Separate, k: int, clamp: Clamp | None, spheres: Array | None,
    lobe_clamp: Clamp | None, widening: Widening | None,
) -> None:
    """Add what one light gives to the sums of a tile.

    Parameters
    ----------
    tile : (TILE_ROWS, TILE) ndarray
        Receivers of `load_cells`; rows SUM are added to, W/m^2.
    size : int
        How many of them count.
    lights : Separate
        All lights.
    k : int
        Which light.
    clamp : Clamp or None
        How near pairs are kept finite.
    spheres : (M,) ndarray or None
        Squares of radii, m^2, where diffuse lights are virtual spheres.
    lobe_clamp : Clamp or None
        How near pairs of lobes are kept finite; None where no light is glossy.
    widening : Widening or None
        How exponents of lobes fall near the light.
    """
    diffuse, lobe = lights.places[DIFFUSE, k], lights.places[LOBE, k]
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
        for i in range(size):
            dx, dy, dz = x - tile[X, i], y - tile[X + 1, i], z - tile[X + 2, i]
            nx, ny, nz = tile[NX, i], tile[NX + 1, i], tile[NX + 2, i]
            if clamp is None:
                tile[TERM, i] = geometry_term(dx, dy, dz, lx, ly, lz, nx, ny, nz)
            else:
                tile[TERM, i] = clamped_term(dx, dy, dz, lx, ly, lz, nx, ny, nz, clamp, k)
    for i in range(size):
        tile[SUM, i] += tile[TERM, i] * red
        tile[SUM + 1, i] += tile[TERM, i] * green
        tile[SUM + 2, i] += tile[TERM, i] * blue


@kernel
def load_cells(tile: Array, points: Array, normals: Array, cells: Array) -> None:
    """Put some points into a tile and clear its sums.

    Parameters
    ----------
    tile : (TILE_ROWS, TILE) ndarray
        Filled in rows X, NX and SUM.
    points, normals : (3, n) ndarray
        Points, m, and unit vectors.
    cells : (<= TILE,) ndarray of int
        Which of them.
    """
    for axis in range(3):
        for i in range(len(cells)):
            tile[X + axis, i] = points[axis, cells[i]]
            tile[NX + axis, i] = normals[axis, cells[i]]
            tile[SUM + axis, i] = tile.dtype.type(0.0)

