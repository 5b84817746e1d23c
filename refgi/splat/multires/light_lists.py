"""Lists of subsplats cut out of the tree of all cells, for each light by its own irradiance (AMS Sec. 3.3.1).

Per light the list is a queue of cells, level after level. A level's cells are tested together: their children are
appended and evaluated, at their representatives, and only the children of the cells that are split stay. So each cell
is evaluated once, as a sample of its parent, and that is also its irradiance as a subsplat: that of `irradiance` for
this light alone, to the bit. Symbols: T threshold on max - min over a cell's children of any channel, W/m^2.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.pairs.glossy_sum import ReceiverLobes
from refgi.pairs.lobe_culling import LIMIT, bound_lobes
from refgi.pairs.lobe_sum import add_lobe
from refgi.pairs.pair_sum import NX, ROWS, SUM, TILE, Clamp, X, limits_of, pair_term
from refgi.pairs.pixel_lights import Packed, Widening
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
            _weigh(tile, size, lights.diffuse, diffuse, lobes, cells)
        elif lobe >= 0:
            _weigh(tile, size, lights.lobes, lobe, lobes, cells)


@kernel
def _weigh(tile: Array, size: int, lights: Array, k: int, lobes: ReceiverLobes, cells: Array) -> None:
    mirror, x, y, z = lobes.mirrored, lights[0, k], lights[1, k], lights[2, k]
    for i in range(size):
        m = cells[i]
        # rho_s of AMS Eq. (2)
        reflected = receiver_lobe(mirror[0, m], mirror[1, m], mirror[2, m], x - tile[X, i], y - tile[X + 1, i],
                                  z - tile[X + 2, i], lobes.exponent[m])
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


DEEPEST = 64  # cells that wait while a tree of up to 20 levels is walked depth first


class ReceiverTree(NamedTuple):
    """Cells that lists are cut out of, with the points at which they are evaluated."""

    first: Array  # (n + 1,) int32, of `Tree`
    roots: int
    points: Array  # (3, n) m
    normals: Array  # (3, n)
    refined: Array  # (n,) bool: cells that the shared list refines; none without such a list
    lobes: ReceiverLobes | None = None  # of the points, where not irradiance is asked for but what they make of it


class SubsplatLists(NamedTuple):
    """Queues of B lights: entries of a tree of n cells."""

    cell: Array  # (B, n) int32, index in the tree
    child: Array  # (B, n) int32, entry of the first child; -1: a leaf
    irradiance: Array  # (B, 3, n) W/m^2
    entries: Array  # (B,) int64, how many are in use
    largest: Array  # (B,) the largest channel of all samples, W/m^2


def empty_lists(lights: int, cells: int, dtype: npt.DTypeLike) -> SubsplatLists:
    """Return uninitialised lists of some lights over a tree of some cells."""
    return SubsplatLists(np.empty((lights, cells), np.int32), np.empty((lights, cells), np.int32),
                         np.empty((lights, 3, cells), dtype), np.empty(lights, np.int64), np.empty(lights, dtype))


@kernel(parallel=True)
def refine_for_lights(
    cells: ReceiverTree, lights: SingleLights, clamp: Clamp | None, spheres: Array | None, lobe_clamp: Clamp | None,
    widening: Widening | None, begin: int, threshold: tuple[float, float], lists: SubsplatLists,
) -> None:
    """Refine the cells of a tree for the B lights from `begin` on, each by itself, and fill `lists`.

    threshold: (a, b), T = a + b times the largest channel of all samples of this light at a level and above; clamp,
    spheres, lobe_clamp and widening are those of `add_light`.
    """
    for b in prange(len(lists.entries)):
        _refine(cells, lights, begin + b, clamp, spheres, lobe_clamp, widening, threshold, lists, b)


@kernel
def _refine(
    cells: ReceiverTree, lights: SingleLights, k: int, clamp: Clamp | None, spheres: Array | None,
    lobe_clamp: Clamp | None, widening: Widening | None, threshold: tuple[float, float], lists: SubsplatLists, b: int,
) -> None:
    cell, child, irradiance = lists.cell[b], lists.child[b], lists.irradiance[b]
    tile = np.zeros((TILE_ROWS, TILE), irradiance.dtype)
    for n in range(cells.roots):
        cell[n], child[n] = n, -1
    start = last = 0
    stop = cells.roots
    lane_max = np.zeros(TILE, irradiance.dtype)
    largest = lane_max[0]
    while last < stop:
        for first in range(last, stop, TILE):
            size = min(TILE, stop - first)
            load_cells(tile, cells.points, cells.normals, cell[first : first + size])
            add_light(tile, size, lights, k, clamp, spheres, lobe_clamp, widening)
            weigh_by_lobes(tile, size, lights, k, cells.lobes, cell[first : first + size])
            _store_sums(tile, size, irradiance, first, lane_max)
        end, largest = stop, lane_max[0]
        for i in range(1, TILE):
            largest = max(largest, lane_max[i])
        if last > 0:
            end = keep_split(cells, cell, child, irradiance, start, last, threshold[0] + threshold[1] * largest)
        start, last = last, end
        stop = append_children(cells.first, cell, start, last)
    lists.entries[b], lists.largest[b] = last, largest


@kernel
def read_leaves(
    first: Array, roots: int, cell: Array, child: Array, irradiance: Array, cells: Array, values: Array
) -> int:
    """Read the leaves of one light's list, depth first; return how many there are.

    first, roots: of `ReceiverTree`; cell, child, irradiance: one light's part of `SubsplatLists`. Fills cells, (<= n,),
    and values, (3, <= n) W/m^2.
    """
    stack = np.empty(DEEPEST, np.int64)
    found = 0
    for root in range(roots):
        stack[0], depth = root, 1
        while depth > 0:
            depth -= 1
            n = stack[depth]
            if child[n] < 0:
                cells[found] = cell[n]
                for c in range(3):
                    values[c, found] = irradiance[c, n]
                found += 1
            else:
                for i in range(first[cell[n] + 1] - first[cell[n]] - 1, -1, -1):
                    stack[depth] = child[n] + i
                    depth += 1
    return found


@kernel
def _store_sums(tile: Array, size: int, irradiance: Array, first: int, lane_max: Array) -> None:
    """Store the sums of a tile, and update the largest value of each of its lanes."""
    for c in range(3):
        for i in range(size):
            value = tile[SUM + c, i]
            irradiance[c, first + i] = value
            lane_max[i] = value if value > lane_max[i] else lane_max[i]


@kernel
def append_children(first: Array, cell: Array, start: int, last: int) -> int:
    """Append the children of the entries start to last - 1; return where they end."""
    stop = last
    for n in range(start, last):
        for inner in range(first[cell[n]], first[cell[n] + 1]):
            cell[stop] = inner
            stop += 1
    return stop


@kernel
def keep_split(
    cells: ReceiverTree, cell: Array, child: Array, irradiance: Array, start: int, last: int, threshold: Any
) -> int:
    """Drop the appended children of the entries that need no split; return where the list ends."""
    end = sample = last
    for n in range(start, last):
        size = cells.first[cell[n] + 1] - cells.first[cell[n]]
        if size > 0 and (cells.refined[cell[n]] or _sample_range(irradiance, sample, size) > threshold):
            child[n] = end
            for i in range(size):
                cell[end], child[end] = cell[sample + i], -1
                for c in range(3):
                    irradiance[c, end] = irradiance[c, sample + i]
                end += 1
        sample += size
    return end


@kernel
def _sample_range(irradiance: Array, sample: int, size: int) -> Any:
    """Return the largest max - min of a channel over some entries (SamplesDiffer of Sec. 3.3.1)."""
    spread = irradiance.dtype.type(0.0)
    for c in range(3):
        upper = lower = irradiance[c, sample]
        for i in range(1, size):
            value = irradiance[c, sample + i]
            upper = value if value > upper else upper
            lower = value if value < lower else lower
        # Sec. 3.3.1, SamplesDiffer: max - min over the quadrants
        spread = upper - lower if upper - lower > spread else spread
    return spread
