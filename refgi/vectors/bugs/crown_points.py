"""Likely bugs of the sequence of points and of its shifts: both written out, with a keyword for each bug."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from refgi.sampling import FIRST_STEP, SECOND_STEP
from refgi.vectors.spec import Array, Arrays, Bug, Run

TURN = 2.0 * math.pi
SEQUENCE, SKIPPED = "(1/2 + j step) mod 1", "n crown points further on"
STEPS = "1/g and 1/g^2, g^3 = g + 1"
GOLDEN = 0.6180339887498949


def sequence(
    inner: int, crown: int, *, steps: tuple[float, float] = (FIRST_STEP, SECOND_STEP),
    first: tuple[float, float] = (0.5, 0.5), begin: int = 0, on: bool = False, turn: float = TURN,
    wrapped: bool = True, sine: float = 1.0, exchanged: bool = False,
) -> Array:
    """Return the points (u, cos 2 pi v, sin 2 pi v) of disc and crown, in float64, with a bug."""
    count = begin + (np.arange(inner + crown) if on else np.concatenate([np.arange(inner), np.arange(crown)]))
    u, v = (start + count * step for start, step in zip(first, steps, strict=True))
    x, y = np.cos(turn * (v % 1)), sine * np.sin(turn * (v % 1))
    return np.stack([u % 1 if wrapped else u, *((y, x) if exchanged else (x, y))], axis=1)


def shifted(
    start: Array, tile: tuple[int, int], stretch: float, *, steps: tuple[float, float] = (FIRST_STEP, SECOND_STEP),
    begin: int = 0, wrapped: bool = True, number: Callable[[Array, Array], Array] | None = None, sign: float = 1.0,
    real: Any = np.float64,
) -> Array:
    """Return the shifts of a tile's texels, with a bug; `number` of a texel by its row and column."""
    row, column = np.indices(tile)
    n = begin + (row * tile[1] + column if number is None else number(row, column))
    shifts = np.asarray(start, real) + sign * n[..., None].astype(real) * real(stretch) * np.array(steps, real)
    return np.asarray(np.minimum(shifts % 1, 1.0 - 2.0**-24) if wrapped else shifts, np.float64)


def sequence_bugs(name: str, inner: int, crown: int, tile: tuple[int, int]) -> list[Bug]:
    """Return the bugs of the sequence and of its shifts, of a number of samples in disc and crown."""
    def bug(cause: str, points: dict[str, Any] | None, shifts: dict[str, Any] | None, paper: str) -> Bug:
        def wrong(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 one precision: double
            start = np.asarray(arrays[f"{name}.shift"], np.float64)
            knobs: dict[str, Any] = {"stretch": crown, "start": start} | (shifts or {})
            knobs["start"] = knobs["start"](start) if callable(knobs["start"]) else start
            return {f"{name}.points": sequence(inner, crown, **(points or {})),
                    f"{name}.shifts": shifted(tile=tile, **knobs)}

        return Bug(cause, wrong, paper)

    one, two, other = (FIRST_STEP, FIRST_STEP), (SECOND_STEP, SECOND_STEP), (SECOND_STEP, FIRST_STEP)
    golden = (GOLDEN, GOLDEN**2)
    bugs = [
        bug("the sequence starts at 0 instead of 1/2: u and v both", {"first": (0.0, 0.0)}, None, SEQUENCE),
        bug("u of the points starts at 0 instead of 1/2", {"first": (0.0, 0.5)}, None, SEQUENCE),
        bug("v of the points starts at 0 instead of 1/2", {"first": (0.5, 0.0)}, None, SEQUENCE),
        bug("points are counted from 1 instead of 0", {"begin": 1}, None, SEQUENCE),
        bug("steps of the golden ratio", {"steps": golden}, {"steps": golden}, STEPS),
        bug("the angle of the points is v, not 2 pi v: a share of a turn is taken for radians", {"turn": 1.0}, None,
            "angle 2 pi v"),
        bug("the angle of the points is pi v: half a turn, a factor 2 is missing", {"turn": math.pi}, None,
            "angle 2 pi v"),
        bug("the angle of the points is in degrees, not in radians", {"turn": 360.0}, None, "angle 2 pi v"),
        bug("the points' cosine and sine are exchanged", {"exchanged": True}, None, "(u, cos, sin)"),
        bug("the points' sine has the wrong sign: a turn the other way", {"sine": -1.0}, None, "(u, cos, sin)"),
        bug("u of the points is not taken modulo 1", {"wrapped": False}, None, SEQUENCE),
        bug("all texels of the tile have the same shift", None, {"stretch": 0.0}, SKIPPED),
        bug("texel n is shifted by n steps, not by n times the number of samples of the crown", None, {"stretch": 1.0},
            SKIPPED),
        bug("texels of the tile are counted from 1: the first one is shifted as well", None, {"begin": 1}, SKIPPED),
        bug("the tile's texels are counted column by column", None, {"number": lambda i, j: j * tile[0] + i},
            "row by row"),
        bug("the tile's row is left out: texels are counted by their column alone", None,
            {"number": lambda i, j: j}, "row by row"),  # noqa: ARG005
        bug("the tile's column is left out: texels are counted by their row alone", None,
            {"number": lambda i, j: i}, "row by row"),  # noqa: ARG005
        bug("the random start of the shifts is left out", None, {"start": np.zeros_like}, SKIPPED),
        bug("u and v begin at the same random number: the first shift for both coordinates", None,
            {"start": lambda a: a[[0, 0]]}, SKIPPED),
        bug("u and v begin at the same random number: the second shift for both coordinates", None,
            {"start": lambda a: a[[1, 1]]}, SKIPPED),
        bug("the random shifts of u and v are exchanged", None, {"start": lambda a: a[::-1]}, SKIPPED),
        bug("shifts are not taken modulo 1", None, {"wrapped": False}, SKIPPED),
        bug("shifts run backwards: steps are subtracted, not added", None, {"sign": -1.0}, SKIPPED),
    ]
    for what, steps in (("both coordinates take the first step: u's 0.7549 for v as well", one),
                        ("both coordinates take the second step: v's 0.5698 for u as well", two),
                        ("the steps of u and v are exchanged", other)):
        bugs += [bug(what, {"steps": steps}, {"steps": steps}, STEPS),
                 bug(f"{what}, in the points alone", {"steps": steps}, None, STEPS),
                 bug(f"{what}, in the shifts alone", None, {"steps": steps}, STEPS)]
    if inner:
        bugs += [bug("the disc's points count as skipped as well", None, {"stretch": inner + crown}, SKIPPED),
                 bug("the crown's points are counted on from the disc's, not from 0", {"on": True}, None, SEQUENCE)]
    if tile[0] != tile[1]:
        bugs.append(bug("a row of the tile has as many texels as a column: rows in place of columns", None, {
            "number": lambda i, j: i * tile[0] + j}, "row by row"))
    return bugs


def point_bugs(name: str, inner: int, crown: int) -> list[Bug]:
    """Return the bugs of the sequence where every texel has a random shift of its own."""
    def points_of(run: Run) -> Run:
        start = {f"{name}.shift": np.zeros(2)}
        return lambda arrays, real: {f"{name}.points": run({**arrays, **start}, real)[f"{name}.points"]}

    blind = "shift", "texels of the tile", "the tile's", "u and v begin", "count as skipped"
    return [Bug(one.cause, points_of(one.run), one.paper) for one in sequence_bugs(name, inner, crown, (1, 1))
            if not any(word in one.cause for word in blind)]
