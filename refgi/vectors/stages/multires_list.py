"""Stages of the list of subsplats: states of cells, leaves, points they are evaluated at (Nichols and Wyman 2009)."""

from typing import Any, get_args

import numpy as np

from refgi.literal import multires as literal
from refgi.splat.multires.refinement.cells import CellStates, classify_cells
from refgi.splat.multires.refinement.grid import Subsplats, level_shape
from refgi.splat.multires.refinement.mipmap import layout, level_views
from refgi.splat.multires.refinement.refine import depth_first
from refgi.splat.multires.settings import Diagonal
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages.multires_ranges import IDS, covered_of, of_levels

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

    form = Form(literal.states, {"triangle_id": IDS, "discontinuous": marks}, states, {"diagonal": diagonal})

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 decisions alone
        covered = covered_of(arrays)
        cells = classify_cells((np.zeros_like(covered), *(np.asarray(arrays[name]) for name in marks)), covered,
                               diagonal)
        return dict(zip(states, level_views(cells.state, cells.sizes, first=1), strict=True))

    lists = [f"states/not {rule}" for rule in get_args(Diagonal) if rule != diagonal]
    lists += (["states/neighbours"] if diagonal != "off" else []) + [f"states/{diagonal}"]
    recipe.add("multires.states", "which cells are refined, by their own need or across a corner", run, (IDS, *marks), {
        name: Spec("row, column", "1", "0 no surface, 1 a subsplat may end here, 2 refined", tier="T0")
        for name in states},
        paper="AMS Sec. 3.3, 5.2; E-AMS-10", variants=(form,), bugs=form.bugs("states", *lists))


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

    form = Form(literal.subsplats, {"triangle_id": IDS, "cell_states": states}, SUBSPLATS,
                {"finest": recipe.facts["multires"]["finest_level"]})
    what = {"level": "cell of 2^level pixels a side", "row": "in the grid of its level", "column": "in the grid of its "
            "level", "pixel": "row * width + column of the pixel right and below of the cell's centre, or of the "
            "nearest that shows a surface, the first of several"}
    recipe.add("multires.subsplats", "the list of subsplats: cells of the coarsest level row by row, in each depth "
               "first, top left, top right, bottom left, bottom right", run, (IDS, *states),
               {f"multires.{key}": Spec("subsplat", "1", one, tier="T0") for key, one in what.items()},
               paper="AMS Sec. 3.3; E-AMS-08, E-AMS-11", variants=(form,), bugs=form.bugs("subsplats"))
