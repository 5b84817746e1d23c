"""Classification of cells: empty, fine enough or refined (Nichols and Wyman 2009, Sec. 3.3 and 5.2).

A cell is refined for its own discontinuity or for its neighbours'. Discontinuities just across a cell's corner leave
artefacts (Fig. 15 bottom), so neighbours at the same level can count; outside the screen there is no discontinuity::

    off        the cell's own discontinuity alone
    corner     a diagonal neighbour has one and the two cells that touch both have none: no other rule would see it
    literal    any diagonal neighbour has one, as the paper says
    full8      any of the eight neighbours has one
"""

from typing import Any, NamedTuple, get_args

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.splat.multires.refinement.mipmap import element_count, layout, level_views
from refgi.splat.multires.settings import Diagonal

Array = npt.NDArray[Any]

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
        _mark_covered(finer, cells)
        finer = cells
    for level, cells in enumerate(levels, start=1):
        framed = np.zeros((cells.shape[0] + 2, cells.shape[1] + 2), np.uint8)
        framed[1:-1, 1:-1] = discontinuous[level]
        _classify(framed, rule, cells)
    return CellStates(covered, state, sizes, leaf_sizes)


@kernel
def _mark_covered(finer: Array, cells: Array) -> None:
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
            # Sec. 5.2: diagonal neighbours
            refined |= up[j] & ~(above | left) | up[j + 2] & ~(above | right)
            refined |= down[j] & ~(below | left) | down[j + 2] & ~(below | right)
        if rule >= 2:
            refined |= up[j] | up[j + 2] | down[j] | down[j + 2]
        if rule == 3:
            refined |= up[j + 1] | here[j] | here[j + 2] | down[j + 1]
        cells[j] += cells[j] & refined
