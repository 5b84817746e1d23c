"""All cells that show a surface as one tree, and the lists of subsplats that are cut out of it.

Cells follow level by level from the coarsest, the children of a cell next to each other in Morton order. A list that
refines cell after cell therefore reads positions and normals of neighbours from neighbouring places.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.splat.multires.refinement.grid import Subsplats, level_shape, representatives

Array = npt.NDArray[Any]


class Tree(NamedTuple):
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


def cell_tree(covered: Array, top: int, finest: int) -> Tree:
    """Link the cells that show a surface.

    Parameters
    ----------
    covered : (h, w) ndarray of bool
        Whether there is a surface.
    top, finest : int
        Coarsest and finest level; no cell is finer than the coarsest.

    Returns
    -------
    Tree
        The cells.
    """
    places = representatives(covered, top)
    least = min(finest, top)
    count = sum(int((place >= 0).sum()) for place in places[least:])
    first, cells = np.empty(count + 1, np.int32), np.empty((4, count), np.int32)
    pixel = np.empty(count, np.int64)
    offsets = np.cumsum([0, *(place.size for place in places)])
    row, column = np.nonzero(places[top] >= 0)
    roots = done = len(row)
    cells[:, :roots] = np.full_like(row, top), row, column, offsets[top] + row * places[top].shape[1] + column
    pixel[:roots] = places[top][row, column]
    begin = 0
    for level in range(top - 1, least - 1, -1):
        begin, done = done, _grow(places[level], level, int(offsets[level]), begin, done, first, cells, pixel)
    first[begin:] = count
    return Tree(first, cells[0].astype(np.uint8), cells[1], cells[2], pixel, cells[3], roots, top, covered.shape)


def cut(tree: Tree, cells: Array) -> Subsplats:
    """Return cells of the tree as a list of subsplats.

    Parameters
    ----------
    tree : Tree
        All cells.
    cells : (n,) ndarray of int32
        Leaves: every pixel with a surface in exactly one; depth first.

    Returns
    -------
    Subsplats
        The list.
    """
    sizes = [level_shape(*tree.shape, level) for level in range(tree.top + 1)]
    flat = np.zeros(sum(h * w for h, w in sizes), np.bool_)
    flat[tree.mask[cells]] = True
    ends = np.cumsum([h * w for h, w in sizes])
    leaf = tuple(flat[end - h * w : end].reshape(h, w) for (h, w), end in zip(sizes, ends, strict=True))
    return Subsplats(tree.level[cells], tree.row[cells], tree.column[cells], tree.pixel[cells], leaf, tree.shape)


def above_leaves(tree: Tree, subsplats: Subsplats) -> Array:
    """Tell which cells a list of subsplats refines.

    Parameters
    ----------
    tree : Tree
        All cells.
    subsplats : Subsplats
        A list of the same picture and levels.

    Returns
    -------
    (n,) ndarray of bool
        True for the cells that have leaves below them.
    """
    leaf = np.concatenate([mask.ravel() for mask in subsplats.leaf])[tree.mask]
    above = np.zeros(len(leaf), np.bool_)
    _descend(tree.first, leaf, tree.roots, above)
    return above


@kernel
def _grow(
    place: Array, level: int, offset: int, begin: int, end: int, first: Array, cells: Array, pixel: Array
) -> int:
    """Append the children, at `level`, of the cells begin to end - 1; return where they end."""
    height, width = place.shape
    done = end
    for k in range(begin, end):
        first[k] = done
        for quadrant in range(4):
            i, j = 2 * cells[1, k] + quadrant // 2, 2 * cells[2, k] + quadrant % 2
            if i < height and j < width and place[i, j] >= 0:
                cells[0, done], cells[1, done], cells[2, done] = level, i, j
                cells[3, done] = offset + i * width + j
                pixel[done] = place[i, j]
                done += 1
    return done


@kernel
def _descend(first: Array, leaf: Array, roots: int, above: Array) -> None:
    above[:roots] = ~leaf[:roots]
    for k in range(len(leaf)):
        for child in range(first[k], first[k + 1]):
            above[child] = above[k] and not leaf[child]
