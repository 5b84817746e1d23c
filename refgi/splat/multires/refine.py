"""The list of subsplats (Nichols and Wyman 2009, Sec. 3.3, 5.2): cells are split until none is to be refined.

A cell is refined for its own discontinuity ("off"), or where a diagonal neighbour has one and the two cells that touch
both have none ("corner": no other rule would see it), where any diagonal neighbour has one ("literal", as the paper
says), or any of the eight ("full8"). The paper refines pass by pass; a depth-first visit of the coarsest cells gives
the same subsplats in a single pass. To read a level off by itself, as the authors' demo does, gives them only where all
cells around a refined one are refined too: not with "corner" and "literal".
"""

from typing import NamedTuple, get_args

import numpy as np

from refgi.error_target.grid import (
    COLUMNS,
    ROWS,
    START,
    Subsplats,
    any_of_four,
    element_count,
    layout,
    level_views,
    representative,
)
from refgi.jit import kernel, prange
from refgi.splat.multires.settings import Diagonal, Traversal
from refgi.stages import stage
from refgi.types import Array

RULES = get_args(Diagonal)
EMPTY, ENOUGH, REFINED = range(3)  # states of a cell


class CellStates(NamedTuple):
    """States of the cells of all levels."""

    covered: Array  # (h, w) bool
    state: Array  # (n,) uint8: EMPTY (no surface), ENOUGH or REFINED, levels 1 to top
    sizes: Array  # (top + 1, 3): layout of `state`
    leaf_sizes: Array  # (top + 1, 3): layout with level 0


def classify_cells(discontinuous: tuple[Array, ...], covered: Array, diagonal: Diagonal) -> CellStates:
    """Return the state of every cell: REFINED if it, or by the rule a neighbour, is discontinuous.

    discontinuous: levels 0 to top of (h_l, w_l) bool, of which level 0 is never refined; covered: (h, w) bool, where
    the picture shows a surface; diagonal: one of `RULES`.
    """
    rule = RULES.index(diagonal)
    height, width = covered.shape
    top = len(discontinuous) - 1
    sizes, leaf_sizes = layout(height, width, top, first=1), layout(height, width, top)
    state = np.empty(element_count(sizes) if top else 0, np.uint8)
    levels = level_views(state, sizes, first=1)
    finer = covered.view(np.uint8)
    for cells in levels:
        any_of_four(finer, cells)
        finer = cells
    for level, cells in enumerate(levels, start=1):
        framed = np.zeros((cells.shape[0] + 2, cells.shape[1] + 2), np.uint8)
        framed[1:-1, 1:-1] = discontinuous[level]
        _classify(framed, rule, cells)
    return CellStates(covered, state, sizes, leaf_sizes)


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
            # Sec. 5.2: diagonal neighbours
            refined |= up[j] & ~(above | left) | up[j + 2] & ~(above | right)
            refined |= down[j] & ~(below | left) | down[j + 2] & ~(below | right)
        if rule >= 2:
            refined |= up[j] | up[j + 2] | down[j] | down[j + 2]
        if rule == 3:
            refined |= up[j + 1] | here[j] | here[j + 2] | down[j + 1]
        cells[j] += cells[j] & refined


def pass_by_pass(cells: CellStates) -> Subsplats:
    """Refine the list of the coarsest cells pass by pass, as published.

    Every pass tests every subsplat at its own level again, as printed. The result is sorted, as that of `depth_first`.
    """
    top, sizes = len(cells.sizes) - 1, cells.sizes
    grids = (cells.covered.view(np.uint8), *level_views(cells.state, sizes, first=1))
    rows, columns = np.nonzero(grids[top])
    listed = np.stack([np.full(len(rows), top), rows, columns])
    for _ in range(top):
        state = np.zeros(listed.shape[1], np.uint8)
        for level in range(1, top + 1):
            here = listed[0] == level
            state[here] = grids[level][listed[1, here], listed[2, here]]
        split = state == REFINED
        listed = np.concatenate([listed[:, ~split], _children(listed[:, split], grids)], axis=1)
    listed = listed[:, np.argsort(_morton_order(listed, sizes))]
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


def _morton_order(listed: Array, sizes: Array) -> Array:
    """Return sort keys: cells of the coarsest level by row, Morton order of each subsplat's first pixel within."""
    top = len(sizes) - 1
    row, column = listed[1] << listed[0], listed[2] << listed[0]
    place = (row >> top) * sizes[top, COLUMNS] + (column >> top)
    for bit in reversed(range(top)):
        place = place << 2 | (row >> bit & 1) << 1 | column >> bit & 1
    return np.asarray(place)


def _subsplats(listed: Array, cells: CellStates) -> Subsplats:
    count = listed.shape[1]
    level, row, column = listed[0].astype(np.uint8), listed[1].astype(np.int32), listed[2].astype(np.int32)
    pixel = np.empty(count, np.int64)
    _fill_pixels(cells.covered, level, row, column, pixel)
    leaf = np.zeros(element_count(cells.leaf_sizes), np.bool_)
    starts, _, columns = cells.leaf_sizes[listed[0]].T
    leaf[starts + listed[1] * columns + listed[2]] = True
    return Subsplats(level, row, column, pixel, level_views(leaf, cells.leaf_sizes), cells.covered.shape)


@kernel
def _fill_pixels(covered: Array, level: Array, row: Array, column: Array, pixel: Array) -> None:
    for k in range(len(pixel)):
        pixel[k] = representative(covered, int(level[k]), int(row[k]), int(column[k]))


class _Columns(NamedTuple):
    """Columns of the list that the depth-first visit writes."""

    level: Array
    row: Array
    column: Array
    pixel: Array
    leaf: Array  # (n,) bool, levels 0 to top


@stage("multires.refine", steps="refgi.splat.multires.steps.refine_steps")
def refine(
    discontinuous: tuple[Array, ...], covered: Array, diagonal: Diagonal = "corner",
    traversal: Traversal = "single_pass",
) -> Subsplats:
    """Return the subsplats that cover every surface of the picture once.

    discontinuous tuple of (h_l, w_l) bool: Which cells hold a discontinuity, for levels 0 to top; level 0 is never
        refined.
    diagonal: Neighbours across a corner that count: "off", "corner", "literal" or "full8".
    traversal: "single_pass", depth first, or "list", as published; both give the same.
    -> Subsplats: Cells of the coarsest level row by row, depth first within them.
    """
    cells = classify_cells(discontinuous, np.ascontiguousarray(covered), diagonal)
    return pass_by_pass(cells) if traversal == "list" else depth_first(cells)


def depth_first(cells: CellStates) -> Subsplats:
    """Return the subsplats in a single pass: count those of each cell of the coarsest level, then write them."""
    counts = np.zeros(cells.leaf_sizes[-1, ROWS] * cells.leaf_sizes[-1, COLUMNS], np.int64)
    _count(cells, counts)
    ends = np.cumsum(counts)
    total = int(ends[-1])
    out = _Columns(np.empty(total, np.uint8), np.empty(total, np.int32), np.empty(total, np.int32),
                   np.empty(total, np.int64), np.zeros(element_count(cells.leaf_sizes), np.bool_))
    _write(cells, ends - counts, out)
    return Subsplats(*out[:4], level_views(out.leaf, cells.leaf_sizes), cells.covered.shape)


@kernel(parallel=True)
def _count(cells: CellStates, counts: Array) -> None:
    rows, columns = cells.leaf_sizes[-1, ROWS], cells.leaf_sizes[-1, COLUMNS]
    for k in prange(len(counts)):
        # column by column: threads take contiguous shares, and left and right cost more evenly than top and bottom
        i, j = k % rows, k // rows
        counts[i * columns + j] = _count_in(cells, i, j)


@kernel(parallel=True)
def _write(cells: CellStates, begins: Array, out: _Columns) -> None:
    rows, columns = cells.leaf_sizes[-1, ROWS], cells.leaf_sizes[-1, COLUMNS]
    for k in prange(len(begins)):
        i, j = k % rows, k // rows
        _write_in(cells, i, j, begins[i * columns + j], out)


@kernel
def _state_of(cells: CellStates, level: int, i: int, j: int) -> int:
    """Return the state of a cell; EMPTY outside the picture."""
    rows, columns = cells.sizes[level, ROWS], cells.sizes[level, COLUMNS]
    if i >= rows or j >= columns:
        return EMPTY
    return int(cells.state[cells.sizes[level, START] + i * columns + j]) if level else int(cells.covered[i, j])


@kernel
def _next_cell(level: int, i: int, j: int, top: int) -> tuple[int, int, int]:
    """Return the cell after one and all inside it, depth first; its level is above `top` where there is none."""
    while level < top and i & 1 and j & 1:
        level, i, j = level + 1, i >> 1, j >> 1
    if level == top:
        return top + 1, i, j
    return level, i + (j & 1), j ^ 1


@kernel
def _blocks_in(cells: CellStates, level: int, i: int, j: int) -> tuple[int, int, int, int]:
    """Return the first and last + 1 of the rows and columns of level 1 in a cell of level 1 or 2."""
    along = level - 1
    rows, columns = cells.sizes[1, ROWS], cells.sizes[1, COLUMNS]
    return i << along, min((i + 1) << along, rows), j << along, min((j + 1) << along, columns)


@kernel
def _count_in(cells: CellStates, i: int, j: int) -> int:
    """Return the subsplats in a cell of the coarsest level."""
    top = len(cells.sizes) - 1
    level, count = top, 0
    while level <= top:
        state = _state_of(cells, level, i, j)
        if state == REFINED and level > 2:
            level, i, j = level - 1, 2 * i, 2 * j
            continue
        if state == REFINED:
            first, last, left, right = _blocks_in(cells, level, i, j)
            for y in range(first, last):
                for x in range(left, right):
                    count += _count_of_block(cells, y, x)
        else:
            count += state == ENOUGH
        level, i, j = _next_cell(level, i, j, top)
    return count


@kernel
def _count_of_block(cells: CellStates, i: int, j: int) -> int:
    """Return the subsplats in a cell of level 1, whose level above is refined."""
    covered = cells.covered
    y, x = min(2 * i + 1, covered.shape[0] - 1), min(2 * j + 1, covered.shape[1] - 1)
    below, right = y > 2 * i, x > 2 * j
    # a number first: as plain Python a sum of truth values would be one itself
    pixels = int(covered[2 * i, 2 * j]) + (covered[2 * i, x] & right) + (covered[y, 2 * j] & below)
    pixels += covered[y, x] & below & right
    state = cells.state[i * cells.sizes[1, COLUMNS] + j]
    return pixels if state == REFINED else int(state)


@kernel
def _write_in(cells: CellStates, i: int, j: int, at: int, out: _Columns) -> None:
    """Write the subsplats in a cell of the coarsest level, from place `at` of the list on."""
    covered, _, sizes, leaf_sizes = cells
    levels, rows, columns, pixels, leaf = out
    top = len(sizes) - 1
    level = top
    while level <= top:
        state = _state_of(cells, level, i, j)
        if state == REFINED and level > 1:
            level, i, j = level - 1, 2 * i, 2 * j
            continue
        if state == ENOUGH:
            pixels[at] = representative(covered, level, i, j)
            levels[at], rows[at], columns[at] = level, i, j
            leaf[leaf_sizes[level, START] + i * leaf_sizes[level, COLUMNS] + j] = True
            at += 1
        elif state == REFINED:
            for y in range(2 * i, min(2 * i + 2, covered.shape[0])):
                for x in range(2 * j, min(2 * j + 2, covered.shape[1])):
                    if covered[y, x]:
                        levels[at], rows[at], columns[at], pixels[at] = 0, y, x, y * covered.shape[1] + x
                        leaf[y * covered.shape[1] + x] = True
                        at += 1
        level, i, j = _next_cell(level, i, j, top)
