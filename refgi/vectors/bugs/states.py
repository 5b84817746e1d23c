"""What ports get wrong in the states of cells: empty, kept or refined (Nichols and Wyman 2009, Sec. 3.3)."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from refgi.splat.multires.settings import Diagonal
from refgi.vectors.recipe import reading
from refgi.vectors.spec import Array, Arrays, Bug, Run

IDS = "gbuffer.triangle_id"
CORNER = "E-AMS-10"


def states_bugs(run: Run, diagonal: Diagonal, marks: tuple[str, ...], states: tuple[str, ...]) -> Iterator[Bug]:
    """Yield likely bugs of which cells are refined; `run` is the stage."""
    def literal(**bugs: Any) -> Run:
        return lambda arrays, _: literal_states(arrays, diagonal, marks, states, **bugs)

    for cause, knobs in (
            ("kept and refined cells are exchanged: 1 and 2", {"codes": (0, 2, 1)}),
            ("states 0, 1 and 2 begin at 1", {"codes": (1, 2, 3)}),
            ("cells without surface are marked by -1, not by 0", {"codes": (-1, 1, 2)}),
            ("empty and kept cells are exchanged: 0 and 1", {"codes": (1, 0, 2)}),
            ("the cell's own discontinuity does not count, its neighbours' alone", {"own": False}),
            ("cells without surface are refined where they are marked or neighbours are", {"surface": "marked"}),
            ("cells count as empty unless all of their pixels show a surface", {"surface": "all"}),
            ("cells count as empty unless their first pixel (upper left) shows a surface", {"surface": "first"}),
            ("cells count as empty unless the pixel at their centre shows a surface", {"surface": "centre"}),
            ("the last row of each cell is left out of the search for a surface", {"surface": "no last row"}),
            ("triangle 0 counts as no surface: ids above 0 alone", {"surface": "above 0"}),
            ("a cell is refined only where the coarser cell is refined too", {"carried": True})):
        yield Bug(cause, literal(**knobs), "AMS Sec. 3.3")
    if diagonal == "off":
        return
    for cause, more in (
            ("neighbours in the row above do not count", {"left_out": (-1, None)}),
            ("neighbours in the row below do not count", {"left_out": (1, None)}),
            ("neighbours in the column to the left do not count", {"left_out": (None, -1)}),
            ("neighbours in the column to the right do not count", {"left_out": (None, 1)}),
            ("beyond the rim the picture starts again from the other side (wrap): neighbours there count",
             {"border": "wrap"}),
            ("beyond the rim of the picture the next row's cell counts as a neighbour", {"border": "next row"}),
            ("beyond the rim of the picture cells repeat (clamp): they count as marked neighbours", {"border": "edge"}),
            ("refined neighbours refine further ones: marks are changed while they are read", {"in_place": True})):
        yield Bug(cause, literal(**more), CORNER)
    if diagonal == "corner":
        for cause, beside in (
                ("only one of the two cells beside a corner must be smooth, not both", np.logical_and),
                ("the cells beside a corner must be discontinuous, not smooth",
                 lambda a, b: ~(a & b)),
                ("only the cell above or below beside a corner must be smooth, the other is not looked at",
                 lambda a, _b: a),
                ("only the cell left or right beside a corner must be smooth, the other is not looked at",
                 lambda _a, b: b)):
            yield Bug(cause, literal(beside=beside), CORNER)
    yield Bug("marks of rows and columns are exchanged", reading(run, **{
        name.replace(".", "__"): _turned for name in marks}), "row, column")


def _turned(marks: Array) -> Array:
    rows, columns = marks.shape
    i, j = np.mgrid[:rows, :columns]
    return np.asarray(marks.reshape(-1)[(j * rows + i) % marks.size].reshape(marks.shape))


def literal_states(
    arrays: Arrays, diagonal: Diagonal, marks: tuple[str, ...], states: tuple[str, ...], *,
    codes: tuple[int, int, int] = (0, 1, 2), own: bool = True, surface: str = "any", carried: bool = False,
    left_out: tuple[int | None, int | None] = (None, None), border: str = "", in_place: bool = False,
    beside: Callable[..., Array] = np.logical_or,
) -> dict[str, Array]:
    """Return the states of cells of each level, with bugs."""
    ids, made = np.asarray(arrays[IDS]), dict[str, Array]()
    levels = [np.asarray(arrays[name], np.bool_) for name in marks]
    for level, found in enumerate(levels, start=1):
        needed = _across(found, diagonal, left_out, border, in_place, beside) | (found & own)
        shown = _shown(ids, level, surface, found.shape)
        shown = shown | needed if surface == "marked" else shown
        made[states[level - 1]] = np.where(shown, np.where(needed, codes[2], codes[1]), codes[0])
    if carried:
        for fine, coarse in zip(states[-2::-1], states[:0:-1], strict=True):
            i, j = np.mgrid[: made[fine].shape[0], : made[fine].shape[1]]
            made[fine] = np.where(made[coarse][i // 2, j // 2] == 2, made[fine], np.minimum(made[fine], 1))
    return made


def _shown(ids: Array, level: int, surface: str, shape: tuple[int, ...]) -> Array:
    here = ids > 0 if surface == "above 0" else ids >= 0
    side = 1 << level
    join: dict[str, Any] = {
        "all": np.all, "first": lambda cell: cell[0, 0],
        "centre": lambda cell: cell[min(side // 2, len(cell) - 1), min(side // 2, len(cell[0]) - 1)],
        "no last row": lambda cell: cell[: side - 1].any()}
    return _cells(here, level, join.get(surface, np.any), shape)


def _cells(plane: Array, level: int, join: Any, shape: tuple[int, ...]) -> Array:
    side = 1 << level
    return np.array([[bool(join(plane[i * side : (i + 1) * side, j * side : (j + 1) * side]))
                      for j in range(shape[1])] for i in range(shape[0])])


def _across(
    marks: Array, diagonal: Diagonal, left_out: tuple[int | None, int | None], border: str, in_place: bool,
    beside: Callable[..., Array],
) -> Array:
    """Return which cells neighbours ask to be refined."""
    if diagonal == "off":
        return np.zeros_like(marks)
    rows, columns = marks.shape
    work, needed = marks.copy(), np.zeros_like(marks)

    def at(i: int, j: int) -> bool:
        if border == "wrap":
            i, j = i % rows, j % columns
        if border == "edge":
            i, j = min(max(i, 0), rows - 1), min(max(j, 0), columns - 1)
        if border == "next row" and 0 <= i * columns + j < marks.size:
            return bool(work.reshape(-1)[i * columns + j])
        return 0 <= i < rows and 0 <= j < columns and bool(work[i, j])

    for i, j in np.ndindex(rows, columns):
        for y, x in np.ndindex(3, 3):
            y, x = y - 1, x - 1
            counts = (y and x) or (diagonal == "full8" and (y or x))
            if not counts or y == left_out[0] or x == left_out[1] or not at(i + y, j + x):
                continue
            if diagonal != "corner" or not beside(np.bool_(at(i + y, j)), np.bool_(at(i, j + x))):
                needed[i, j] = True
                work[i, j] |= in_place
    return needed
