"""Stages of the list of subsplats: states of cells, leaves, points they are evaluated at (Nichols and Wyman 2009)."""

from functools import partial
from typing import Any, get_args

import numpy as np

from refgi.splat.multires.refinement.cells import EMPTY, ENOUGH, REFINED, CellStates, classify_cells
from refgi.splat.multires.refinement.grid import Subsplats, level_shape, representatives
from refgi.splat.multires.refinement.mipmap import layout, level_views
from refgi.splat.multires.refinement.refine import depth_first
from refgi.splat.multires.settings import Diagonal
from refgi.vectors.bugs.list import list_bugs
from refgi.vectors.bugs.states import states_bugs
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Spec
from refgi.vectors.stages.multires_ranges import IDS, covered_of, everywhere, of_levels

SUBSPLATS = ("multires.level", "multires.row", "multires.column", "multires.pixel")


def subsplats_of(arrays: Arrays, top: int) -> Subsplats:
    """Return the list of subsplats among arrays."""
    shape: tuple[int, int] = np.asarray(arrays[IDS]).shape
    level, row, column = (np.asarray(arrays[name]) for name in SUBSPLATS[:3])
    leaf = tuple(np.zeros(level_shape(shape[0], shape[1], one), np.bool_) for one in range(top + 1))
    for k in range(len(level)):
        leaf[level[k]][row[k], column[k]] = True
    pixel = np.asarray(arrays.get(SUBSPLATS[3], np.zeros_like(level)), np.int64)
    return Subsplats(level.astype(np.uint8), row.astype(np.int32), column.astype(np.int32), pixel, leaf, shape)


def add_states(recipe: Recipe, diagonal: Diagonal, top: int) -> None:
    """Add what becomes of the cells of levels 1 to `top`: empty, fine enough or refined."""
    marks, states = of_levels("discontinuous", top), of_levels("state", top)

    def run(arrays: Arrays, real: Any, rule: Diagonal = diagonal) -> Arrays:  # noqa: ARG001 decisions alone
        covered = covered_of(arrays)
        cells = classify_cells((np.zeros_like(covered), *(np.asarray(arrays[name]) for name in marks)), covered, rule)
        return dict(zip(states, level_views(cells.state, cells.sizes, first=1), strict=True))

    whole = {name.replace(".", "__"): lambda a: np.where(a == EMPTY, ENOUGH, a) for name in states}
    beside = {name.replace(".", "__"): _spread_to_sides for name in marks}
    names = {"off": "cells are not refined for their neighbours' sake, across a corner",
             "corner": "of neighbours across a corner only those count that no cell between shows",
             "literal": "every neighbour across a corner counts",
             "full8": "all eight neighbours count"}
    recipe.add("multires.states", "which cells are refined, by their own need or across a corner", run, (IDS, *marks), {
        name: Spec("row, column", "1", "0 no surface, 1 a subsplat may end here, 2 refined", tier="T0")
        for name in states},
        paper="AMS Sec. 3.3, 5.2; E-AMS-10", bugs=(
            *(Bug(names[rule], partial(run, rule=rule), "E-AMS-10")
              for rule in get_args(Diagonal) if rule != diagonal),
            Bug("cells without surface are kept", writing(run, **whole), "they are never evaluated"),
            Bug("neighbours across an edge count, not those across a corner", reading(
                lambda a, r: run(a, r, "off"), **beside), "E-AMS-10"),
            *states_bugs(run, diagonal, marks, states)))


def _spread_to_sides(marks: Array) -> Array:
    around = np.pad(np.asarray(marks), 1)
    return np.asarray(marks | around[:-2, 1:-1] | around[2:, 1:-1] | around[1:-1, :-2] | around[1:-1, 2:])


def add_subsplats(recipe: Recipe, top: int) -> None:
    """Add the list of subsplats."""
    states = of_levels("state", top)

    def cells(arrays: Arrays) -> CellStates:
        covered = covered_of(arrays)
        flat = [np.asarray(arrays[name], np.uint8).reshape(-1) for name in states]
        height, width = covered.shape
        return CellStates(covered, np.concatenate([np.zeros(0, np.uint8), *flat]), layout(height, width, top, first=1),
                          layout(height, width, top))

    def named(level: Array, row: Array, column: Array, pixel: Array) -> Arrays:
        columns = (np.asarray(one, np.int32) for one in (level, row, column, pixel))
        return dict(zip(SUBSPLATS, columns, strict=True))

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 decisions alone
        return named(*depth_first(cells(arrays))[:4])

    def by_levels(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        covered = covered_of(arrays)
        grids = (covered.astype(np.uint8), *(np.asarray(arrays[name]) for name in states))
        pixels, found = representatives(covered, top), []
        for level, grid in enumerate(grids):
            row, column = np.nonzero(grid == ENOUGH)
            above = np.ones(len(row), np.bool_) if level == top else grids[level + 1][row // 2, column // 2] == REFINED
            row, column = row[above], column[above]
            found.append(np.stack([np.full(len(row), level), row, column, pixels[level][row, column]]))
        listed = np.concatenate(found, axis=1)
        place = _place(listed[0], listed[1], listed[2], top, grids[top].shape[1])
        return named(*(column[np.argsort(place, kind="stable")] for column in listed))

    what = {"level": "cell of 2^level pixels a side", "row": "in the grid of its level", "column": "in the grid of its "
            "level", "pixel": "row * width + column of the pixel right and below of the cell's centre, or of the "
            "nearest that shows a surface, the first of several"}
    recipe.add("multires.subsplats", "the list of subsplats: cells of the coarsest level row by row, in each depth "
               "first, top left, top right, bottom left, bottom right", run, (IDS, *states),
               {f"multires.{key}": Spec("subsplat", "1", one, tier="T0") for key, one in what.items()},
               paper="AMS Sec. 3.3; E-AMS-08, E-AMS-11", bugs=(
                   Bug("each level is read off by itself, whatever becomes of coarser cells", by_levels, "E-AMS-08"),
                   Bug("pixels without surface (background) are listed", reading(run, gbuffer__triangle_id=everywhere),
                       "never evaluated"),
                   *list_bugs(run, states, recipe.facts["multires"]["finest_level"])))


def _place(level: Array, row: Array, column: Array, top: int, columns: int) -> Array:
    """Return keys that sort cells as the list is sorted."""
    y, x = row << level, column << level
    place = (y >> top) * columns + (x >> top)
    for bit in reversed(range(top)):
        place = place << 2 | (y >> bit & 1) << 1 | x >> bit & 1
    return np.asarray(place)
