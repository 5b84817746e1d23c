"""What ports get wrong in the list of subsplats (Nichols and Wyman 2009, Sec. 3.3): its literal form, cell by cell."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from refgi.vectors.recipe import writing
from refgi.vectors.spec import Array, Arrays, Bug, Run

IDS = "gbuffer.triangle_id"
NAMES = ("multires.level", "multires.row", "multires.column", "multires.pixel")
CENTRE = "E-AMS-11: right and below of the centre, or the nearest that shows a surface, the first of several"
LEAVES, ORDER = "leaves of the refinement that show a surface (AMS Sec. 3.3)", "order of the list"
CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))


def list_bugs(run: Run, states: tuple[str, ...], finest: int) -> Iterator[Bug]:
    """Yield likely bugs of the list; `run` is the stage, `states` its arrays of levels 1 to the coarsest."""
    def literal(**bugs: Any) -> Run:
        return lambda arrays, _: literal_list(arrays, states, **bugs)

    for cause, pixel in (
            ("the pixel left and above of the centre, not right and below, represents a cell", "above left"),
            ("the pixel right and above of the centre represents a cell", "above"),
            ("the pixel left and below of the centre represents a cell", "left"),
            ("the pixel at the cell's corner (upper left, its first pixel), not at its centre, is representative",
             "first"),
            ("the pixel at the cell's lower right corner, not at its centre, is representative", "last"),
            ("the pixel at the cell's upper left corner or the nearest that shows a surface is representative",
             "nearest first"),
            ("the first pixel of a cell that shows a surface is representative, not the nearest to the centre",
             "first covered"),
            ("the last pixel of a cell that shows a surface is representative, not the nearest to the centre",
             "last covered"),
            ("the pixel farthest from the centre", "farthest"),
            ("the pixel at the centre, whether it shows a surface or not", "centre"),
            ("of equally near pixels (ties) the last counts, not the first", "last of ties"),
            ("pixels are searched column by column: of equally near ones (ties) the leftmost counts", "columns first"),
            ("the nearest pixel by the larger of |dx| and |dy|, not by the square of the distance", "chebyshev"),
            ("the centre of what the border leaves of a cell, not of the whole cell", "cut centre"),
            ("the last row and column of a cell are left out of the search for its pixel", "cut search"),
            ("triangle 0 counts as no surface: ids above 0 alone", "ids above 0")):
        yield Bug(cause, literal(pixel=pixel), CENTRE)
    last = len(states)
    for cause, knobs in (
            ("refinement stops one level before the finest, too early", {"finest": finest + 1}),
            ("refinement begins one level below the coarsest: the coarsest cells are always refined",
             {"forced": True}),
            ("cells without a surface (background) are in the list: number of subsplats too large, longer", {
                "empty": "all"}),
            ("cells without a surface (background) are in the list, pixels are not", {"empty": "cells"}),
            ("refined cells stay in the list beside their children: number of subsplats too large", {"parents": True}),
            ("the last of the four cells in a refined one is left out", {"children": CORNERS[:3]}),
            ("the first of the four cells in a refined one is left out", {"children": CORNERS[1:]}),
            ("cells that the border cuts are left out: sizes are divided and cut off", {"border": "cut"}),
            ("every cell is refined to pixels", {"forced": "all"}),
            ("no cell is refined: cells of the coarsest level alone", {"finest": last})):
        yield Bug(cause, literal(**knobs), LEAVES)
    for cause, more in (
            ("the list is sorted by levels, the coarsest first", {"order": "coarsest"}),
            ("the list is sorted by levels, the finest first", {"order": "finest"}),
            ("the four cells in a refined one follow column by column: bottom left before top right",
             {"children": ((0, 0), (1, 0), (0, 1), (1, 1))}),
            ("the four cells in a refined one follow in reverse order", {"children": CORNERS[::-1]}),
            ("the four cells in a refined one follow clockwise", {"children": ((0, 0), (0, 1), (1, 1), (1, 0))}),
            ("cells of the coarsest level follow column by column", {"order": "columns"}),
            ("the list is sorted by rows and columns of pixels", {"order": "pixels"}),
            ("the list is in reverse order", {"order": "reverse"})):
        yield Bug(cause, literal(**more), ORDER)
    for cause, number in (("rows and columns of cells are exchanged", "exchanged"),
                          ("rows and columns are those of pixels, not of cells of the level", "pixels"),
                          ("levels count from the coarsest", "levels"),
                          ("levels count one too high", "above"), ("levels count one too low", "below"),
                          ("pixels are counted column by column: rows and columns are exchanged", "transposed"),
                          ("the pixel is row * height + column: rows have the wrong length", "stride")):
        yield Bug(cause, literal(number=number), "level; row and column in its grid; row * width + column")
    yield Bug("pixels are counted within their cell", writing(run, multires__pixel=np.zeros_like), CENTRE)


def literal_list(
    arrays: Arrays, states: tuple[str, ...], *, pixel: str = "", finest: int = 0, forced: Any = False, empty: str = "",
    parents: bool = False, children: tuple[tuple[int, int], ...] = CORNERS, border: str = "", order: str = "",
    number: str = "",
) -> dict[str, Array]:
    """Return the list of subsplats, with bugs."""
    ids, top = np.asarray(arrays[IDS]), len(states)
    (height, width), grids = ids.shape, [np.where(ids >= 0, 1, 0), *(np.asarray(arrays[name]) for name in states)]
    found: list[tuple[int, int, int]] = []

    def visit(level: int, i: int, j: int) -> None:
        rows, columns = grids[level].shape
        if border == "cut":
            rows, columns = height >> level, width >> level
        if i >= rows or j >= columns:
            return
        state = int(grids[level][i, j])
        if state == 0 and (not empty or (empty == "cells" and level == 0)):
            return
        must = level > 0 and (forced == "all" or (bool(forced) and level == top))
        refined = (state == 2 and level > finest) or (state > 0 and must)
        if not refined or parents:
            found.append((level, i, j))
        for y, x in children if refined else ():
            visit(level - 1, 2 * i + y, 2 * j + x)

    shape = grids[top].shape[::-1] if order == "columns" else grids[top].shape
    for i, j in np.ndindex(shape):
        visit(top, *((j, i) if order == "columns" else (i, j)))
    keys: dict[str, Callable[[tuple[int, int, int]], Any]] = {
        "coarsest": lambda cell: -cell[0], "finest": lambda cell: cell[0],
        "pixels": lambda cell: (cell[1] << cell[0], cell[2] << cell[0])}
    found = sorted(found, key=keys[order]) if order in keys else found
    found = found[::-1] if order == "reverse" else found
    shown = ids > 0 if pixel == "ids above 0" else ids >= 0
    pixels = np.array([_pixel(shown, *cell, pixel) for cell in found], np.int64)
    level, row, column = np.array(found, np.int64).reshape(-1, 3).T
    if number in ("transposed", "stride"):
        y, x = pixels // width, pixels % width
        pixels = x * height + y if number == "transposed" else y * height + x
    row, column = {"exchanged": (column, row), "pixels": (row << level, column << level)}.get(number, (row, column))
    level = {"levels": top - level, "above": level + 1, "below": level - 1}.get(number, level)
    return dict(zip(NAMES, (level, row, column, pixels), strict=True))


def _pixel(shown: Array, level: int, i: int, j: int, how: str) -> int:
    """Return the representative pixel of a cell; the first one where none shows a surface."""
    height, width = shown.shape
    side = 1 << level
    top, left, bottom, right = i * side, j * side, min((i + 1) * side, height), min((j + 1) * side, width)
    row, column = _centre((top, left, bottom, right), side, how)
    if how in ("first", "last", "centre"):
        return int(min(row, height - 1) * width + min(column, width - 1))
    cut = int(how == "cut search" and level > 0)
    y, x = (one.reshape(-1) for one in np.mgrid[top : max(bottom - cut, top + 1), left : max(right - cut, left + 1)])
    if how == "columns first":
        order = np.lexsort((y, x))
        y, x = y[order], x[order]
    here = shown[y, x]
    y, x = (y[here], x[here]) if here.any() else (y[:1], x[:1])
    dy, dx = np.abs(y - row), np.abs(x - column)
    apart = {"chebyshev": np.maximum(dy, dx), "farthest": -(dy * dy + dx * dx),
             "first covered": np.arange(len(y)), "last covered": -np.arange(len(y))}.get(how, dy * dy + dx * dx)
    best = len(apart) - 1 - int(np.argmin(apart[::-1])) if how == "last of ties" else int(np.argmin(apart))
    return int(y[best] * width + x[best])


def _centre(cell: tuple[int, int, int, int], side: int, how: str) -> tuple[int, int]:
    top, left, bottom, right = cell
    half, less = side // 2, int(side > 1)
    if how in ("first", "nearest first"):
        return top, left
    if how == "last":
        return top + side - 1, left + side - 1
    if how == "cut centre":
        return (top + bottom) // 2, (left + right) // 2
    return (top + half - less * (how in ("above left", "above")), left + half - less * (how in ("above left", "left")))
