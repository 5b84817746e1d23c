"""A list of subsplats for each light by itself, refined where its own light differs (Sec. 3.3.1).

Per light the list is a queue of cells, level after level. A level's cells are tested together: their children are
appended and lit, at their representatives, and only the children of the cells that are split are kept. So each cell
is lit once, as a sample of its parent, and that is also its light as a subsplat.

Symbols: T threshold on max - min over a cell's children of any channel, W/m^2.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.pairs.lobe_shape import Widening
from refgi.pairs.pair_sum import SUM, TILE, Clamp
from refgi.splat.multires.light_lists.one_light import TILE_ROWS, Separate, light_tile, load_cells

Array = npt.NDArray[Any]

DEEPEST = 64  # cells that wait while a tree of up to 20 levels is walked depth first


class Cells(NamedTuple):
    """The tree that lists are cut out of, and where its cells are lit."""

    first: Array  # (n + 1,) int32, of `Tree`
    roots: int
    points: Array  # (3, n) m
    normals: Array  # (3, n)
    refined: Array  # (n,) bool: cells that the shared list refines; none without such a list


class Lists(NamedTuple):
    """Room for the queues of B lights: entries of a tree of n cells."""

    cell: Array  # (B, n) int32, index in the tree
    child: Array  # (B, n) int32, entry of the first child; -1: a leaf
    light: Array  # (B, 3, n) W/m^2
    entries: Array  # (B,) int64, how many are in use
    largest: Array  # (B,) the largest channel of all samples, W/m^2


def room_for(lights: int, cells: int, dtype: npt.DTypeLike) -> Lists:
    """Return room for the lists of some lights.

    Parameters
    ----------
    lights, cells : int
        B and n.
    dtype : dtype
        Of irradiance.

    Returns
    -------
    Lists
        Not filled.
    """
    return Lists(np.empty((lights, cells), np.int32), np.empty((lights, cells), np.int32),
                 np.empty((lights, 3, cells), dtype), np.empty(lights, np.int64), np.empty(lights, dtype))


@kernel(parallel=True)
def refine_for_lights(
    cells: Cells, lights: Separate, clamp: Clamp | None, spheres: Array | None, lobe_clamp: Clamp | None,
    widening: Widening | None, begin: int, threshold: tuple[float, float], lists: Lists,
) -> None:
    """Refine the cells of a tree for each light by itself.

    Parameters
    ----------
    cells : Cells
        The tree.
    lights : Separate
        All lights.
    clamp, spheres, lobe_clamp, widening : None or what they are
        As for `light_tile`.
    begin : int
        The first light; B of them are taken.
    threshold : tuple of 2 floats
        (a, b): T = a + b times the largest channel of all samples of this light at a level and above.
    lists : Lists
        Filled.
    """
    for b in prange(len(lists.entries)):
        _refine(cells, lights, begin + b, clamp, spheres, lobe_clamp, widening, threshold, lists, b)


@kernel
def _refine(
    cells: Cells, lights: Separate, k: int, clamp: Clamp | None, spheres: Array | None, lobe_clamp: Clamp | None,
    widening: Widening | None, threshold: tuple[float, float], lists: Lists, b: int,
) -> None:
    cell, child, light = lists.cell[b], lists.child[b], lists.light[b]
    tile = np.zeros((TILE_ROWS, TILE), light.dtype)
    for n in range(cells.roots):
        cell[n], child[n] = n, -1
    start = last = 0
    stop = cells.roots
    most = np.zeros(TILE, light.dtype)
    largest = most[0]
    while last < stop:
        for first in range(last, stop, TILE):
            size = min(TILE, stop - first)
            load_cells(tile, cells.points, cells.normals, cell[first : first + size])
            light_tile(tile, size, lights, k, clamp, spheres, lobe_clamp, widening)
            _unload(tile, size, light, first, most)
        end, largest = stop, most.max()
        if last > 0:
            end = _keep(cells, cell, child, light, start, last, threshold[0] + threshold[1] * largest)
        start, last = last, end
        stop = _append_children(cells.first, cell, start, last)
    lists.entries[b], lists.largest[b] = last, largest


@kernel
def leaves(first: Array, roots: int, cell: Array, child: Array, light: Array, cells: Array, values: Array) -> int:
    """Read the leaves of one light's list, depth first.

    Parameters
    ----------
    first : (n + 1,) ndarray of int32
        Children of each cell.
    roots : int
        Cells the list began with.
    cell, child, light : ndarray
        One light's part of `Lists`.
    cells : (<= n,) ndarray of int32
        Filled with cells.
    values : (3, <= n) ndarray
        Filled with their light, W/m^2.

    Returns
    -------
    int
        How many there are.
    """
    waiting = np.empty(DEEPEST, np.int64)
    found = 0
    for root in range(roots):
        waiting[0], left = root, 1
        while left > 0:
            left -= 1
            n = waiting[left]
            if child[n] < 0:
                cells[found] = cell[n]
                for c in range(3):
                    values[c, found] = light[c, n]
                found += 1
            else:
                for i in range(first[cell[n] + 1] - first[cell[n]] - 1, -1, -1):
                    waiting[left] = child[n] + i
                    left += 1
    return found


@kernel
def _unload(tile: Array, size: int, light: Array, first: int, most: Array) -> None:
    """Store the sums of a tile, and keep the largest that each of its places has held."""
    for c in range(3):
        for i in range(size):
            value = tile[SUM + c, i]
            light[c, first + i] = value
            most[i] = value if value > most[i] else most[i]


@kernel
def _append_children(first: Array, cell: Array, start: int, last: int) -> int:
    """Append the children of the entries start to last - 1; return where they end."""
    stop = last
    for n in range(start, last):
        for inner in range(first[cell[n]], first[cell[n] + 1]):
            cell[stop] = inner
            stop += 1
    return stop


@kernel
def _keep(
    cells: Cells, cell: Array, child: Array, light: Array, start: int, last: int, threshold: Any
) -> int:
    """Drop the appended children of the entries that need no split; return where the list ends."""
    kept = sample = last
    for n in range(start, last):
        size = cells.first[cell[n] + 1] - cells.first[cell[n]]
        if size > 0 and (cells.refined[cell[n]] or _spread(light, sample, size) > threshold):
            child[n] = kept
            for i in range(size):
                cell[kept], child[kept] = cell[sample + i], -1
                for c in range(3):
                    light[c, kept] = light[c, sample + i]
                kept += 1
        sample += size
    return kept


@kernel
def _spread(light: Array, sample: int, size: int) -> Any:
    """Return the largest max - min of a channel over some entries (the paper's SamplesDiffer)."""
    spread = light.dtype.type(0.0)
    for c in range(3):
        upper = lower = light[c, sample]
        for i in range(1, size):
            value = light[c, sample + i]
            upper = value if value > upper else upper
            lower = value if value < lower else lower
        spread = upper - lower if upper - lower > spread else spread
    return spread
