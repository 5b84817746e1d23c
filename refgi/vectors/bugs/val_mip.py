"""Mip levels of the basis as a port gets them wrong (VAL Sec. 6)."""

from collections.abc import Callable, Mapping
from itertools import permutations
from typing import Any

import numpy as np

from refgi.vectors.spec import Array, Arrays, Bug, Run

MEANS = "means of texels 2 i and 2 i + 1; of an odd side the last counts twice"
FOUR = ("upper left", "upper right", "lower left", "lower right")
Half = Callable[[Array], Array]


def _four(level: Array, wrapped: bool = False, step: int = 0) -> list[Array]:
    """Return upper left, upper right, lower left and lower right texels; `step`: so many further."""
    side = level.shape[2]
    begin = 2 * np.arange((side + 1) // 2) + step
    pairs = [np.clip(begin + k, 0, side - 1) for k in (0, 1)]
    if not wrapped:
        return [level[:, :, row][:, :, :, column] for row in pairs for column in pairs]
    flat = level.reshape(*level.shape[:2], -1)
    places = [np.minimum((begin + y)[:, None] * side + begin + x, side * side - 1) for y in (0, 1) for x in (0, 1)]
    return [flat[:, :, place] for place in places]


def _of(change: Callable[..., Any], **how: Any) -> Half:
    return lambda level: np.asarray(change(*_four(level, **how)))


def mean_of_four(level: Array) -> Array:
    """Return the next level."""
    return np.asarray(sum(_four(level)) / 4)


def _cut(level: Array) -> Array:
    """Return means over what covers an odd side as halves of it, one texel for two."""
    side = level.shape[2]
    half = (side + 1) // 2
    place = np.minimum((np.arange(half) + 0.5) * side / half - 0.5, side - 1)
    low = np.floor(place).astype(int)
    part, high = place - low, np.minimum(low + 1, side - 1)
    rows = level[:, :, low] * (1 - part)[:, None] + level[:, :, high] * part[:, None]
    return np.asarray(rows[..., low] * (1 - part) + rows[..., high] * part)


HALVES: Mapping[str, Half] = {
    "two of four texels: the upper two, rows are not averaged": _of(lambda a, b, c, d: (a + b) / 2),  # noqa: ARG005
    "two of four texels: the left two, columns are not averaged": _of(lambda a, b, c, d: (a + c) / 2),  # noqa: ARG005
    "two of four texels: the diagonal": _of(lambda a, b, c, d: (a + d) / 2),  # noqa: ARG005
    "three of four texels: the lower right is missing, divided by 4": _of(lambda a, b, c, d: (a + b + c) / 4),  # noqa: ARG005
    "three of four texels: the lower right is missing, divided by 3": _of(lambda a, b, c, d: (a + b + c) / 3),  # noqa: ARG005
    **{f"the {FOUR[twice]} texel counts twice: for the {FOUR[never]}, which is left out": _of(
        lambda *four, twice=twice, never=never: (sum(four) + four[twice] - four[never]) / 4)
       for twice, never in permutations(range(4), 2)},
    "half of the sum of four texels: divided by 2": _of(lambda a, b, c, d: (a + b + c + d) / 2),
    "divided by 3 in place of 4": _of(lambda a, b, c, d: (a + b + c + d) / 3),
    "divided by 8 in place of 4": _of(lambda a, b, c, d: (a + b + c + d) / 8),
    "the largest of four texels": _of(lambda *four: np.max(four, axis=0)),
    "the least of four texels": _of(lambda *four: np.min(four, axis=0)),
    "the lower right of four texels": _of(lambda a, b, c, d: d),  # noqa: ARG005
    "texels 2 i + 1 and 2 i + 2: one too far": _of(lambda *four: sum(four) / 4, step=1),
    "texels 2 i - 1 and 2 i: one too low": _of(lambda *four: sum(four) / 4, step=-1),
    "beyond an odd side the next row's first texel is taken: columns and rows are not clamped": _of(
        lambda *four: sum(four) / 4, wrapped=True),
    "levels are resized: of an odd side texels are spread evenly": _cut,
    "rows and columns of each level are exchanged (transposed)": lambda level: mean_of_four(level).swapaxes(2, 3),
    "rows of each level run upwards": lambda level: mean_of_four(level)[:, :, ::-1],
    "the first map's levels for all": lambda level: mean_of_four(level[:1].repeat(len(level), 0)),
    "the first channel for all": lambda level: mean_of_four(level[:, :1].repeat(level.shape[1], 1)),
    "the last channel, the depth, is left out": lambda level: np.concatenate(
        [mean_of_four(level)[:, :-1], 0 * _four(level)[0][:, -1:]], axis=1),
}


def mip_bugs(names: list[str], kept: Half = np.asarray) -> tuple[Bug, ...]:
    """Return likely bugs of the levels of these names; `kept`: how a level is stored."""
    def stored(half: Half) -> Half:
        return lambda level: kept(half(level))

    return (*(Bug(cause, levels_by(names, stored(half)), MEANS) for cause, half in HALVES.items()),
            Bug("all levels are made of level 0's upper left texels", _of_level_0(names, kept), "of the level before"),
            Bug("the coarsest level is not written: one too few", levels_by(
                names, stored(mean_of_four), last=False), "down to one texel"))


def levels_by(names: list[str], half: Half, last: bool = True) -> Run:
    """Return the mip levels as a port writes them."""
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        level, made = np.asarray(arrays["basis.0"], np.float64), {}
        for name in names:
            level = made[name] = half(level)
        return made if last else made | {names[-1]: 0 * level}

    return run


def _of_level_0(names: list[str], kept: Half) -> Run:
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        made, side = {}, arrays["basis.0"].shape[2]
        whole = kept(mean_of_four(np.asarray(arrays["basis.0"], np.float64)))
        for name in names:
            side = (side + 1) // 2
            made[name] = whole[:, :, :side, :side]
        return made

    return run
