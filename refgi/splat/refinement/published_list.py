"""The list of subsplats as the paper refines it (Nichols and Wyman 2009, Sec. 3.3): the whole list, pass by pass."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.splat.refinement.cells import EMPTY, REFINED, Cells
from refgi.splat.refinement.grid import Subsplats, representative
from refgi.splat.refinement.pyramid import COLUMNS, room, views

Array = npt.NDArray[Any]


def pass_by_pass(cells: Cells) -> Subsplats:
    """Refine the list of the coarsest cells until each subsplat had a chance to become pixels.

    Parameters
    ----------
    cells : Cells
        All cells and which of them are refined.

    Returns
    -------
    Subsplats
        Put in order: cells of the coarsest level row by row, depth first within them.

    Notes
    -----
    As printed, every pass tests every subsplat at its own level again, and those that stay fail each time. The order
    of the printed list, children of a pass behind each other, means nothing to the picture.
    """
    top, sizes = len(cells.sizes) - 1, cells.sizes
    grids = (cells.covered.view(np.uint8), *views(cells.state, sizes, first=1))
    rows, columns = np.nonzero(grids[top])
    listed = np.stack([np.full(len(rows), top), rows, columns])
    for _ in range(top):
        state = np.zeros(listed.shape[1], np.uint8)
        for level in range(1, top + 1):
            here = listed[0] == level
            state[here] = grids[level][listed[1, here], listed[2, here]]
        split = state == REFINED
        listed = np.concatenate([listed[:, ~split], _children(listed[:, split], grids)], axis=1)
    listed = listed[:, np.argsort(_place(listed, sizes))]
    return _subsplats(listed, cells)


def _children(parents: Array, grids: tuple[Array, ...]) -> Array:
    """Return the four children of each subsplat, but for those outside the picture or without surface."""
    level, row, column = np.repeat(parents, 4, axis=1)
    corner = np.tile(np.arange(4), parents.shape[1])
    children = np.stack([level - 1, 2 * row + corner // 2, 2 * column + corner % 2])
    shown = np.zeros(children.shape[1], np.bool_)
    for finer, grid in enumerate(grids):
        here = (children[0] == finer) & (children[1] < grid.shape[0]) & (children[2] < grid.shape[1])
        shown[here] = grid[children[1, here], children[2, here]] != EMPTY
    return children[:, shown]


def _place(listed: Array, sizes: Array) -> Array:
    """Return the place of each subsplat's first pixel: cells of the coarsest level by row, Morton order within."""
    top = len(sizes) - 1
    row, column = listed[1] << listed[0], listed[2] << listed[0]
    place = (row >> top) * sizes[top, COLUMNS] + (column >> top)
    for bit in reversed(range(top)):
        place = place << 2 | (row >> bit & 1) << 1 | column >> bit & 1
    return np.asarray(place)


def _subsplats(listed: Array, cells: Cells) -> Subsplats:
    count = listed.shape[1]
    level, row, column = listed[0].astype(np.uint8), listed[1].astype(np.int32), listed[2].astype(np.int32)
    pixel = np.empty(count, np.int64)
    _represent(cells.covered, level, row, column, pixel)
    leaf = np.zeros(room(cells.leaf_sizes), np.bool_)
    starts, _, columns = cells.leaf_sizes[listed[0]].T
    leaf[starts + listed[1] * columns + listed[2]] = True
    return Subsplats(level, row, column, pixel, views(leaf, cells.leaf_sizes), cells.covered.shape)


@kernel
def _represent(covered: Array, level: Array, row: Array, column: Array, pixel: Array) -> None:
    for k in range(len(pixel)):
        pixel[k] = representative(covered, int(level[k]), int(row[k]), int(column[k]))
