"""The list of subsplats (Nichols and Wyman 2009, Sec. 3.3): cells are split until none needs it or the finest is met.

The paper refines a list pass by pass, each subsplat tested at its own level. Visiting the cells of the coarsest level
one by one, depth first, and going down only where a cell is refined gives the same subsplats in one visit, whatever
the criteria. Reading a level off by itself ("own level enough, level above not", as in the authors' demo) does so only
where a cell that needs refinement lies in cells that all do: true of ranges, not of "corner" and "literal" below.

Discontinuities just across a cell's corner leave artefacts (Sec. 5.2, Fig. 15 bottom), so a cell can be refined for
its neighbours' sake, at the same level; outside the screen there is no discontinuity::

    off        its own alone
    corner     a diagonal neighbour has one and the two cells that touch both have none: no other rule would tell
    literal    any diagonal neighbour has one, as the paper says
    full8      any of the eight neighbours has one
"""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.splat.refinement.grid import Subsplats, representative
from refgi.splat.refinement.pyramid import COLUMNS, ROWS, START, layout, room, views
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.splat.multires import MultiresSettings

Array = npt.NDArray[Any]

RULES = ("off", "corner", "literal", "full8")
EMPTY, ENOUGH, REFINED = range(3)  # states of a cell


class _Cells(NamedTuple):
    """What is known of the cells of all levels."""

    covered: Array  # (h, w) bool
    state: Array  # (n,) uint8: EMPTY, ENOUGH or REFINED, levels 1 to top
    sizes: Array  # (top + 1, 3): layout of `state`
    leaf_sizes: Array  # (top + 1, 3): layout with level 0


class _List(NamedTuple):
    """Where the subsplats are written."""

    level: Array
    row: Array
    column: Array
    pixel: Array
    leaf: Array  # (n,) bool, levels 0 to top


@stage("splat.refine")
def refine(need: tuple[Array, ...], covered: Array, settings: "MultiresSettings") -> Subsplats:
    """Return the subsplats that cover every surface of the picture once.

    Parameters
    ----------
    need : tuple of (h_l, w_l) ndarray of bool
        Which cells hold a discontinuity, for levels 0 to top; level 0 is never refined.
    covered : (h, w) ndarray of bool
        Whether there is a surface.
    settings : MultiresSettings
        `diagonal`, and `refinement`: "single_pass", depth first, or "list", as published; both give the same.

    Returns
    -------
    Subsplats
        Cells of the coarsest level row by row, depth first within them.
    """
    cells = _classified(need, np.ascontiguousarray(covered), RULES.index(settings.diagonal))
    return _pass_by_pass(cells) if settings.refinement == "list" else _depth_first(cells)


def _classified(need: tuple[Array, ...], covered: Array, rule: int) -> _Cells:
    """Return the state of every cell: whether it shows a surface, and is refined by its own or its neighbours' need."""
    top = len(need) - 1
    sizes, leaf_sizes = layout(*covered.shape, top, first=1), layout(*covered.shape, top)
    state = np.empty(room(sizes) if top else 0, np.uint8)
    levels = views(state, sizes, first=1)
    finer = covered.view(np.uint8)
    for level, cells in enumerate(levels, start=1):
        _fill(finer, cells)
        finer = cells
    for level, cells in enumerate(levels, start=1):
        framed = np.zeros((cells.shape[0] + 2, cells.shape[1] + 2), np.uint8)
        framed[1:-1, 1:-1] = need[level]
        _classify(framed, rule, cells)
    return _Cells(covered, state, sizes, leaf_sizes)


@kernel
def _fill(finer: Array, cells: Array) -> None:
    """Store whether any of the finer cells (0 or not) within each cell shows a surface."""
    columns = finer.shape[1]
    pairs = columns // 2
    for i in range(cells.shape[0]):
        upper, lower, out = finer[2 * i], finer[min(2 * i + 1, finer.shape[0] - 1)], cells[i]
        for j in range(pairs):
            out[j] = upper[2 * j] | upper[2 * j + 1] | lower[2 * j] | lower[2 * j + 1]
        if columns % 2:
            out[pairs] = upper[columns - 1] | lower[columns - 1]


@kernel
def _classify(framed: Array, rule: int, cells: Array) -> None:
    """Turn cells that show a surface (1) into REFINED ones where they or, by the rule, neighbours have a need."""
    for i in range(cells.shape[0]):
        _classify_row(framed[i], framed[i + 1], framed[i + 2], rule, cells[i])


@kernel
def _classify_row(up: Array, here: Array, down: Array, rule: int, cells: Array) -> None:
    for j in range(len(cells)):
        refined = here[j + 1]
        if rule == 1:
            left, right, above, below = here[j], here[j + 2], up[j + 1], down[j + 1]
            refined |= up[j] & ~(above | left) | up[j + 2] & ~(above | right)
            refined |= down[j] & ~(below | left) | down[j + 2] & ~(below | right)
        if rule >= 2:
            refined |= up[j] | up[j + 2] | down[j] | down[j + 2]
        if rule == 3:
            refined |= up[j + 1] | here[j] | here[j + 2] | down[j + 1]
        cells[j] += cells[j] & refined


def _depth_first(cells: _Cells) -> Subsplats:
    """Return the subsplats from one visit: count those of each cell of the coarsest level, then write them."""
    counts = np.zeros(cells.leaf_sizes[-1, ROWS] * cells.leaf_sizes[-1, COLUMNS], np.int64)
    _count(cells, counts)
    ends = np.cumsum(counts)
    total = int(ends[-1])
    out = _List(np.empty(total, np.uint8), np.empty(total, np.int32), np.empty(total, np.int32),
                np.empty(total, np.int64), np.zeros(room(cells.leaf_sizes), np.bool_))
    _write(cells, ends - counts, out)
    return Subsplats(*out[:4], views(out.leaf, cells.leaf_sizes), cells.covered.shape)


@kernel(parallel=True)
def _count(cells: _Cells, counts: Array) -> None:
    columns = cells.leaf_sizes[-1, COLUMNS]
    for k in prange(len(counts)):
        counts[k] = _count_in(cells, k // columns, k % columns)


@kernel(parallel=True)
def _write(cells: _Cells, begins: Array, out: _List) -> None:
    columns = cells.leaf_sizes[-1, COLUMNS]
    for k in prange(len(begins)):
        _write_in(cells, k // columns, k % columns, begins[k], out)


@kernel
def _state(cells: _Cells, level: int, i: int, j: int) -> int:
    """Return the state of a cell; EMPTY outside the picture."""
    rows, columns = cells.sizes[level, ROWS], cells.sizes[level, COLUMNS]
    if i >= rows or j >= columns:
        return EMPTY
    return int(cells.state[cells.sizes[level, START] + i * columns + j]) if level else int(cells.covered[i, j])


@kernel
def _next(level: int, i: int, j: int, top: int) -> tuple[int, int, int]:
    """Return the cell after one and all inside it, depth first; its level is above `top` where there is none."""
    while level < top and i & 1 and j & 1:
        level, i, j = level + 1, i >> 1, j >> 1
    if level == top:
        return top + 1, i, j
    return level, i + (j & 1), j ^ 1


@kernel
def _count_in(cells: _Cells, i: int, j: int) -> int:
    """Return the subsplats in a cell of the coarsest level."""
    top = len(cells.sizes) - 1
    level, count = top, 0
    while level <= top:
        state = _state(cells, level, i, j)
        if state == REFINED:
            level, i, j = level - 1, 2 * i, 2 * j
        else:
            count += state == ENOUGH
            level, i, j = _next(level, i, j, top)
    return count


@kernel
def _write_in(cells: _Cells, i: int, j: int, at: int, out: _List) -> None:
    """Write the subsplats in a cell of the coarsest level, from place `at` of the list on."""
    top = len(cells.sizes) - 1
    level = top
    while level <= top:
        state = _state(cells, level, i, j)
        if state == REFINED:
            level, i, j = level - 1, 2 * i, 2 * j
            continue
        if state == ENOUGH:
            out.level[at], out.row[at], out.column[at] = level, i, j
            out.pixel[at] = representative(cells.covered, level, i, j)
            out.leaf[cells.leaf_sizes[level, START] + i * cells.leaf_sizes[level, COLUMNS] + j] = True
            at += 1
        level, i, j = _next(level, i, j, top)


def _pass_by_pass(cells: _Cells) -> Subsplats:
    """Return the subsplats from the published list (Sec. 3.3), put in the order of the visit."""
    top, sizes = len(cells.sizes) - 1, cells.sizes
    grids = (cells.covered.view(np.uint8), *views(cells.state, sizes, first=1))
    rows, columns = np.nonzero(grids[top])
    listed = np.stack([np.full(len(rows), top), rows, columns])
    for _ in range(top):
        # those that stay are tested again in every pass, as printed
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


def _subsplats(listed: Array, cells: _Cells) -> Subsplats:
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
