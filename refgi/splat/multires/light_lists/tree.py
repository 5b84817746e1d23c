"""The tree of all cells that show a surface, out of which lists of subsplats are cut.

Cells follow level by level from the coarsest, the children of a cell next to each other in Morton order. A list that
refines cell after cell therefore reads positions and normals of neighbours from neighbouring places.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.splat.multires.refinement.grid import Subsplats, level_shape, representatives

Array = npt.NDArray[Any]


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
