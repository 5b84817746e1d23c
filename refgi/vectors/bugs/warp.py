"""What ports get wrong in the hierarchical warp (SII Sec. 3.5, Eq. 4 to 6): its literal form, point by point."""

from collections.abc import Callable, Iterator
from itertools import permutations
from typing import Any

import numpy as np

from refgi.lights.importance import border
from refgi.lights.warp import Warp
from refgi.vectors.bugs.points import below_1
from refgi.vectors.recipe import reading
from refgi.vectors.spec import Array, Arrays, Bug, Run

EQ, FACE = "SII Eq. 4 to 6", "SII Sec. 3.6: v chooses the map in proportion to its importance"
BELOW_1 = 1.0 - 2.0**-24
FOUR = ("upper left", "upper right", "lower left", "lower right")


def warp_bugs(name: str, maps: int, warp: Warp, run: Run) -> Iterator[Bug]:
    """Yield likely bugs of the warp of a map's points; `run` is the stage."""
    def literal(how: Warp = warp, **bugs: Any) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:
            points, weights = literal_warp(np.asarray(arrays[f"{name}.points"], np.float64),
                                           np.asarray(arrays[f"{name}.importance"], np.float64), maps, how, **bugs)
            return {f"{name}.warped": points, f"{name}.density_weight": weights.astype(real)}

        return altered

    a, levels = warp.method == "A", warp.levels
    for cause, knobs in (
            ("points of the second half do not count from its begin: the share of the first is not subtracted",
             {"subtracted": False}),
            ("places are not stretched over the half that is chosen: not divided by its share", {"stretched": False}),
            ("places in the second half are divided by the first half's share", {"stretch_by": "first"}),
            ("places in either half are divided by the second half's share", {"stretch_by": "second"}),
            ("places are multiplied by 2, not divided by the share of their half", {"stretch_by": "even"}),
            ("places are multiplied by their half's share, not divided by it", {"stretch_by": "inverse"}),
            ("halves are chosen at 1/2, whatever their importance", {"chosen_at": "even"}),
            ("halves are chosen by the second half's share: first and second are exchanged", {"chosen_at": "second"}),
            ("first and second half are exchanged", {"turned": "both"}),
            ("left and right half are exchanged", {"turned": "columns"}),
            ("top and bottom half are exchanged", {"turned": "rows"}),
            ("columns are halved before rows: x first, then y", {"columns_first": True}),
            ("rows alone are warped: columns stay as they are", {"axes": "rows"}),
            ("columns alone are warped: rows stay as they are", {"axes": "columns"}),
            ("1/2 is missing in the weight: the even share of a half's texels", {"evened": False}),
            ("the weight holds the factors of rows alone", {"weighed": "rows"}),
            ("the weight holds the factors of columns alone", {"weighed": "columns"}),
            ("the weight is that of the last level alone: it is overwritten, not multiplied", {"weighed": "last"}),
            ("the weight is that of the first level alone", {"weighed": "first"}),
            ("factors of the weight are added, not multiplied", {"weighed": "sum"}),
            ("weights of first and second half are exchanged", {"weighed": "other"}),
            ("the weight is the mean importance over that of the texel, not of the cell", {"weighed": "texel"}),
            ("the larger of a cell's upper quarters in place of their sum in the mip", {"joined": "upper"}),
            ("the larger of a cell's lower quarters in place of their sum in the mip", {"joined": "lower"}),
            ("the mip holds the largest of four quarters, not their sum", {"joined": "max"}),
            ("the mip holds the first of four quarters, not their sum", {"joined": "one"}),
            ("the fourth quarter is left out of the sum of the mip", {"joined": "three"}),
            ("the index of a cell is not doubled from level to level", {"doubled": False}),
            ("the first (coarsest) level is left out", {"from_level": 1}),
            ("sums are read from the coarser level, one level off", {"read": -1}),
            ("sums are read from the finer level, one level off", {"read": 1}),
            ("one level too few, its cells are placed as those of the last level", {"loops": -1}),
            ("places within the cell are left out: the cell's corner", {"within": "corner"}),
            ("places within the cell are left out: the cell's centre", {"within": "centre"}),
            ("the cell is left out: places within it alone (no offset)", {"within": "alone"}),
            ("importance is squared", {"power": 2.0}), ("the root of importance", {"power": 0.5}),
            ("the lower half's row of cells is always taken for columns", {"row_of": 1}),
            ("the upper half's row of cells is always taken for columns", {"row_of": 0}),
            ("columns are chosen by the row of cells that was not chosen", {"row_of": 2}),
            ("rows are halved by the sums of columns: left and right in place of top and bottom", {"crossed": "rows"}),
            ("columns are halved by the sums of rows: top and bottom in place of left and right",
             {"crossed": "columns"}),
            ("rows are halved by the sums of columns and columns by those of rows", {"crossed": "both"})):
        if "row_of" not in knobs or a:
            yield Bug(cause, literal(**knobs), EQ)
    for twice, never in permutations(range(4), 2):
        yield Bug(f"the {FOUR[twice]} quarter counts twice in the sum of the mip, the {FOUR[never]} one never",
                  literal(joined=f"{twice}{never}"), EQ)
    yield from _renormalised(name, run)
    yield Bug("nothing is warped: points stay and weights are 1", literal(Warp(warp.method, 0)), EQ)
    if levels:
        yield Bug("one level too few", literal(Warp(warp.method, levels - 1)), "SII Sec. 3.5")
    yield Bug("one level too many", literal(Warp(warp.method, levels + 1)), "SII Sec. 3.5")
    yield Bug("the importance map is read upside down and mirrored",
              reading(run, **{f"{name}__importance": lambda one: one[::-1, ::-1]}), "row 0 is the top row")
    yield Bug("the importance map is mirrored: columns run leftwards",
              reading(run, **{f"{name}__importance": lambda one: one[:, ::-1]}), "column 0 is the left one")
    yield Bug("cells of odd sides count as halved evenly: 1/2 in place of the share of their texels",
              literal(even=True), EQ)
    yield Bug("borders of cells as if sides were powers of two: (i + x) / 2^levels", literal(powers=True), EQ)
    yield from _face_bugs(literal) if maps > 1 else ()


def _renormalised(name: str, run: Run) -> Iterator[Bug]:
    weight = f"{name}.density_weight"
    for cause, change in (("weights are scaled to a sum of N, a mean of 1", lambda w: w * len(w) / w.sum()),
                          ("weights are scaled to a sum of 1", lambda w: w / w.sum()),
                          ("weights are squared", np.square), ("the root of the weights", np.sqrt)):
        def altered(arrays: Arrays, real: Any, change: Callable[[Array], Array] = change) -> Arrays:
            made = run(arrays, real)
            return {**made, weight: change(made[weight])}

        yield Bug(cause, altered, EQ)


def _face_bugs(literal: Any) -> Iterator[Bug]:
    for cause, knobs in (
            ("the number of faces of a cube (maps) is left out of the weight: the share of a face alone",
             {"face_weight": "share"}),
            ("the choice of a cube's face has no weight", {"face_weight": "none"}),
            ("the weight of a cube's face is its density, not the inverse", {"face_weight": "density"}),
            ("the weight of a cube's face is multiplied by the number of faces (maps), not divided by it",
             {"face_weight": "multiplied"}),
            ("the face of a cube that was chosen is lost: places count within it, as on the first face of the "
             "stacked maps", {"face_place": "lost"}),
            ("places on stacked faces of a cube are not divided by the number of maps", {"face_place": "undivided"}),
            ("faces of a cube are stacked in reverse order", {"face_place": "reversed"}),
            ("faces of a cube are chosen with equal chance, whatever their importance", {"face_chosen": "even"}),
            ("faces of a cube are chosen by u, not by v", {"face_chosen": "u"}),
            ("v is not stretched over the share of the cube's face", {"face_stretched": "none"}),
            ("v does not count from the begin of the cube's face's share", {"face_stretched": "begin"}),
            ("the first face's importance for all faces of a cube", {"face_map": "first"}),
            ("the next face's importance for each face of a cube", {"face_map": "next"}),
            ("stacked faces of a cube are warped as one map", {"face_map": "whole"}),
            ("the last face of a cube is never chosen", {"face_chosen": "no last"}),
            ("the first face of a cube is never chosen", {"face_chosen": "no first"})):
        yield Bug(cause, literal(**knobs), FACE)


def literal_warp(
    points: Array, importance: Array, maps: int, warp: Warp, *, face_weight: str = "", face_place: str = "",
    face_chosen: str = "", face_stretched: str = "", face_map: str = "", power: float = 1.0, joined: str = "",
    **bugs: Any,
) -> tuple[Array, Array]:
    """Return warped points and their weights, with bugs, point by point."""
    importance = importance**power
    maps = 1 if face_map == "whole" else maps
    faces = np.split(importance, maps)
    mips = [_mip(face, joined) for face in faces]
    sums = np.array([face.sum() for face in faces])
    sums = np.ones(maps) if face_chosen == "even" or not sums.any() else sums
    sums = np.where(np.arange(maps) == (maps - 1 if face_chosen == "no last" else 0), 0, sums) if face_chosen in (
        "no last", "no first") else sums
    ends = np.cumsum(sums) / sums.sum()
    warped, weights = np.empty_like(points), np.ones(len(points))
    for k, (u, v) in enumerate(points):
        face = 0
        if maps > 1:
            face = int(np.searchsorted(ends, u if face_chosen == "u" else v, side="right"))
            share, begin = sums[face] / sums.sum(), ends[face] - sums[face] / sums.sum()
            v = v if face_stretched == "none" else (v - (0 if face_stretched == "begin" else begin)) / share
            v = float(np.clip(v, 0, BELOW_1))
            weights[k] = {"share": 1 / share, "none": 1.0, "density": maps * share,
                          "multiplied": maps / share}.get(face_weight, 1 / (maps * share))
        read = {"first": 0, "next": (face + 1) % maps}.get(face_map, face)
        x, y, own = _warp_one(u, v, faces[read], mips[read], warp, **bugs)
        place = {"lost": 0, "reversed": maps - 1 - face}.get(face_place, face)
        warped[k] = x, (place + y) / (1 if face_place in ("lost", "undivided") else maps)
        weights[k] *= own
    return below_1(warped), weights


def _warp_one(
    x: float, y: float, plane: Array, sums: list[Array], warp: Warp, *, doubled: bool = True, from_level: int = 0,
    read: int = 0, loops: int = 0, within: str = "", even: bool = False, powers: bool = False, axes: str = "both",
    columns_first: bool = False, weighed: str = "", row_of: int | None = None, turned: str = "",
    crossed: str = "", **halving: Any,
) -> tuple[float, float, float]:
    rows, columns = plane.shape
    depth = len(sums) - 1
    levels = min(warp.levels, depth)
    i, j, factors = 0, 0, []
    for level in range(from_level, levels + loops):
        at = min(max(level + 1 + read, 1), depth)
        cell = [[_at(sums[at], 2 * i + a, 2 * j + b) for b in (0, 1)] for a in (0, 1)]
        cells = {axis: [list(one) for one in zip(*cell, strict=True)] if crossed in ("both", name) else cell
                 for axis, name in enumerate(("rows", "columns"))}
        shares = [0.5 if even else _even(size, level, index) for size, index in ((rows, i), (columns, j))]
        down = across = 0
        for axis in (1, 0) if columns_first else (0, 1):
            if axis == 0 and axes != "columns":
                tops = [sum(cells[0][half]) for half in (0, 1)] if not columns_first or warp.method == "B" else [
                    cells[0][half][across] for half in (0, 1)]
                down, y, factor = _halve(y, tops, shares[0], turned in ("both", "rows"), weighed, **halving)
                factors.append(("rows", factor))
            if axis == 1 and axes != "rows":
                row = down if row_of is None else (row_of, 1 - down)[row_of == 2]
                whole = warp.method == "B" or columns_first
                sides = [cells[1][0][half] + cells[1][1][half] if whole else cells[1][row][half] for half in (0, 1)]
                across, x, factor = _halve(x, sides, shares[1], turned in ("both", "columns"), weighed, **halving)
                factors.append(("columns", factor))
        i, j = (2 * i + down, 2 * j + across) if doubled else (i + down, j + across)
    u, v = (_place(local, size, levels, index, within, powers)
            for local, size, index in ((x, columns, j), (y, rows, i)))
    return min(u, BELOW_1), min(v, BELOW_1), _weight(factors, weighed, plane, u, v)


def _weight(factors: list[tuple[str, float]], weighed: str, plane: Array, u: float, v: float) -> float:
    if weighed == "texel":
        found = plane[min(int(v * plane.shape[0]), plane.shape[0] - 1), min(int(u * plane.shape[1]), len(plane[0]) - 1)]
        return float(plane.mean() / found) if found > 0 else 1.0
    if weighed in ("last", "first") and factors:
        factors = factors[-2:] if weighed == "last" else factors[:2]
    if weighed == "sum":
        return float(sum(factor for _, factor in factors)) if factors else 1.0
    return float(np.prod([factor for name, factor in factors if weighed not in ("rows", "columns") or name == weighed]))


def _halve(
    x: float, halves: list[float], share: float, turned: bool, weighed: str, *, subtracted: bool = True,
    stretched: bool = True, stretch_by: str = "", chosen_at: str = "", evened: bool = True,
) -> tuple[int, float, float]:
    total = sum(halves)
    first = halves[0] / total if total > 0 else share
    first = 1 - first if turned else first
    edge = {"even": 0.5, "second": 1 - first}.get(chosen_at, first)
    half = int(x >= edge)
    kept = (first, 1 - first)[half]
    even = (share, 1 - share)[half] if evened else 1.0
    local = x - (first if half and subtracted else 0)
    by = {"first": first, "second": 1 - first, "even": 0.5, "inverse": 1 / kept if kept else 1.0}.get(stretch_by, kept)
    local = local / by if stretched and by > 0 else local
    counted = (1 - first, first)[half] if weighed == "other" else kept
    return half ^ turned, min(max(local, 0.0), BELOW_1), even / counted if counted > 0 else 1.0


def _place(local: float, size: int, levels: int, index: int, within: str, powers: bool) -> float:
    local = {"corner": 0.0, "centre": 0.5}.get(within, local)
    if within == "alone":
        return local
    if powers:
        return (index + local) / (1 << levels)
    start, end = border(index, levels, size), border(index + 1, levels, size)
    return (start + local * (end - start)) / size


def _even(size: int, level: int, index: int) -> float:
    start, middle, end = (border(2 * index + k, level + 1, size) for k in (0, 1, 2))
    return (middle - start) / (end - start) if end > start else 0.5


def _at(sums: Array, i: int, j: int) -> float:
    return float(sums[i, j]) if i < len(sums) and j < len(sums) else 0.0


def _mip(plane: Array, joined: str) -> list[Array]:
    """Return sums of cells, the coarsest level first, or what a port may hold in their place."""
    rows, columns = plane.shape
    depth = (max(rows, columns) - 1).bit_length()
    finest = np.zeros((1 << depth, 1 << depth))
    for i, j in np.ndindex(finest.shape):
        row, column = border(i, depth, rows), border(j, depth, columns)
        if row < border(i + 1, depth, rows) and column < border(j + 1, depth, columns):
            finest[i, j] = plane[row, column]
    join: dict[str, Callable[..., Array]] = {
        "": lambda a, b, c, d: (a + b) + (c + d), "upper": lambda a, b, c, d: np.maximum(a, b) + (c + d),
        "lower": lambda a, b, c, d: (a + b) + np.maximum(c, d), "one": lambda a, *_: a,
        "max": lambda *four: np.max(four, axis=0), "three": lambda a, b, c, _d: a + b + c,
        **{f"{twice}{never}": lambda *four, twice=twice, never=never: sum(four) + four[twice] - four[never]
           for twice, never in permutations(range(4), 2)}}
    levels = [finest]
    for _ in range(depth):
        below = levels[0]
        levels.insert(0, join[joined](below[::2, ::2], below[::2, 1::2], below[1::2, ::2], below[1::2, 1::2]))
    return levels
