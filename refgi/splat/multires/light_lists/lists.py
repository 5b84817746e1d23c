"""Lists of subsplats cut out of the tree of all cells, for each light by its own irradiance (AMS Sec. 3.3.1).

Cells follow level by level from the coarsest, the children of a cell next to each other in Morton order. A list that
refines cell after cell therefore reads positions and normals of neighbours from neighbouring places.

Per light the list is a queue of cells, level after level. A level's cells are tested together: their children are
appended and evaluated, at their representatives, and only the children of the cells that are split stay. So each cell
is evaluated once, as a sample of its parent, and that is also its irradiance as a subsplat.

Symbols: T threshold on max - min over a cell's children of any channel, W/m^2.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.error_target.grid import Subsplats, level_shape, representatives
from refgi.jit import kernel, prange
from refgi.pairs.glossy_sum import ReceiverLobes
from refgi.pairs.pair_sum import SUM, TILE, Clamp
from refgi.pairs.pixel_lights import Widening
from refgi.splat.multires.light_lists.one_light import TILE_ROWS, SingleLights, add_light, load_cells, weigh_by_lobes
from refgi.types import Array


class CellTree(NamedTuple):
    """The n cells that show a surface, of levels `top` down to the finest."""

    first: Array  # (n + 1,) int32, children of cell k are first[k] to first[k + 1] - 1
    level: Array  # (n,) uint8
    row: Array  # (n,) int32, in the grid of its level
    column: Array  # (n,) int32
    pixel: Array  # (n,) int64, flat index of the pixel that stands for it
    mask: Array  # (n,) int32, its place in the masks of all levels one after the other
    roots: int  # cells of the coarsest level, which come first
    top: int
    shape: tuple[int, int]  # (h, w) of the picture


def cell_tree(covered: Array, top: int, finest: int) -> CellTree:
    """Return the tree of the cells of levels `top` to `finest`, or of `top` alone if `finest` is coarser."""
    representative = representatives(covered, top)
    least = min(finest, top)
    count = sum(int((pixels >= 0).sum()) for pixels in representative[least:])
    first, cells = np.empty(count + 1, np.int32), np.empty((4, count), np.int32)
    pixel = np.empty(count, np.int64)
    offsets = np.cumsum([0, *(pixels.size for pixels in representative)])
    row, column = np.nonzero(representative[top] >= 0)
    roots = done = len(row)
    masks = offsets[top] + row * representative[top].shape[1] + column
    cells[:, :roots] = np.full_like(row, top), row, column, masks
    pixel[:roots] = representative[top][row, column]
    begin = 0
    for level in range(top - 1, least - 1, -1):
        begin, done = done, _append_level(representative[level], level, int(offsets[level]), begin, done, first, cells,
                                          pixel)
    first[begin:] = count
    return CellTree(first, cells[0].astype(np.uint8), cells[1], cells[2], pixel, cells[3], roots, top, covered.shape)


def subsplats_of_leaves(tree: CellTree, cells: Array) -> Subsplats:
    """Return cells of the tree (every covered pixel in exactly one, depth first) as a list of subsplats."""
    sizes = [level_shape(*tree.shape, level) for level in range(tree.top + 1)]
    flat = np.zeros(sum(h * w for h, w in sizes), np.bool_)
    flat[tree.mask[cells]] = True
    ends = np.cumsum([h * w for h, w in sizes])
    leaf = tuple(flat[end - h * w : end].reshape(h, w) for (h, w), end in zip(sizes, ends, strict=True))
    return Subsplats(tree.level[cells], tree.row[cells], tree.column[cells], tree.pixel[cells], leaf, tree.shape)


def interior_cells(tree: CellTree, subsplats: Subsplats) -> Array:
    """Return which cells of the tree a list of subsplats refines, (n,) bool: those with leaves below them."""
    leaf = np.concatenate([mask.ravel() for mask in subsplats.leaf])[tree.mask]
    interior = np.zeros(len(leaf), np.bool_)
    _mark_interior(tree.first, leaf, tree.roots, interior)
    return interior


@kernel
def _append_level(
    pixels: Array, level: int, offset: int, begin: int, end: int, first: Array, cells: Array, pixel: Array
) -> int:
    """Append the children, at `level`, of the cells begin to end - 1; return where they end."""
    height, width = pixels.shape
    done = end
    for k in range(begin, end):
        first[k] = done
        for quadrant in range(4):
            i, j = 2 * cells[1, k] + quadrant // 2, 2 * cells[2, k] + quadrant % 2
            if i < height and j < width and pixels[i, j] >= 0:
                cells[0, done], cells[1, done], cells[2, done] = level, i, j
                cells[3, done] = offset + i * width + j
                pixel[done] = pixels[i, j]
                done += 1
    return done


@kernel
def _mark_interior(first: Array, leaf: Array, roots: int, interior: Array) -> None:
    interior[:roots] = ~leaf[:roots]
    for k in range(len(leaf)):
        for child in range(first[k], first[k + 1]):
            interior[child] = interior[k] and not leaf[child]


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
        end, largest = stop, lane_max.max()
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
