"""The look-up of filtered maps by mip levels as a port writes it, and as it gets it wrong (VAL Sec. 6)."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from refgi.vectors.spec import Array, Arrays, Bug, Run

LEVEL = "level max(0, log2(radius * texels a side) - 1)"
READ = "8 texels of two levels, texel centres at + 1/2"


class Lookup(NamedTuple):
    """How a disc's means are read; by default as the stages do."""

    place: Callable[[Any], Any] = lambda s: (s + 1) / 2  # of [-1, 1], in sides of the map
    alone: str = ""  # "s" or "t": the one that `place` and `half` are of, the other is right
    axes: tuple[int, int] = (0, 1)
    level: Callable[[Any, int], Any] = lambda radius, n: np.log2(radius * n) - 1
    least: float = 0.0
    blend: Callable[[Any, Any, Any], Any] = lambda a, b, part: a + part * (b - a)
    half: float = 0.5  # texel's centre
    inner: Callable[[Any], Any] = lambda part: part  # of bilinear weights
    across: bool = True  # bilinear along columns
    down: bool = True
    exchanged: bool = False  # weights of rows and columns
    by_side: bool = False  # places by the level's own side, not by halving
    level_0: bool = False  # places in texels of level 0 on all levels
    edge: str = "clamp"
    first_map: bool = False
    first_channel: bool = False


RIGHT = Lookup()


def means_by(name: str, flag: str, how: Lookup) -> Run:
    """Return the stage of means over discs as a port writes it."""
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        names = sorted((one for one in arrays if one.startswith("basis.")), key=lambda one: int(one[6:]))
        levels = [np.asarray(arrays[one], np.float64) for one in names]
        region, flags = np.asarray(arrays[f"{name}.region"], np.float64), np.asarray(arrays[flag])
        m = (levels[0].shape[1] - 1) // 4
        channels = 4 * m + 1 if name == "search" else 2 * m
        made = np.zeros((len(flags), channels, *flags.shape[1:]))
        for k in np.flatnonzero(flags.any(axis=(1, 2))):
            maps = [level[0 if how.first_map else k, :channels] for level in levels]
            s, t, radius = region[k][:, flags[k]]
            read = _read(maps, s, t, radius, how)
            made[k][:, flags[k]] = read[:1] if how.first_channel else read
        return {f"{name}.means": made}

    return run


def _read(maps: list[Array], s: Array, t: Array, radius: Array, how: Lookup) -> Array:
    n, top = maps[0].shape[1], len(maps) - 1
    place = s, t
    x, y = ((how if how.alone in ("", one) else RIGHT).place(place[axis]) * n for one, axis in zip("st", how.axes,
            strict=True))
    with np.errstate(all="ignore"):
        fine = np.clip(np.nan_to_num(how.level(radius, n)), min(how.least, top), top)
    low = np.floor(fine).astype(int)
    both = []
    for level in (low, np.minimum(low + 1, top)):
        made = np.zeros((len(maps[0]), len(s)))
        for one in np.unique(level):
            here = level == one
            side = maps[one].shape[1]
            shrink = side / n if how.by_side else 1.0 if how.level_0 else 0.5**one
            made[:, here] = _bilinear(maps[one], x[here] * shrink, y[here] * shrink, how)
        both.append(made)
    return np.asarray(how.blend(both[0], both[1], fine - low))


def _bilinear(plane: Array, x: Array, y: Array, how: Lookup) -> Array:
    side = plane.shape[1]
    x, y = (at - (how if how.alone in ("", one) else RIGHT).half for one, at in (("s", x), ("t", y)))
    if how.edge == "clamp":
        x, y = (np.clip(one, 0, side - 1) for one in (x, y))
    i, j = (np.floor(one).astype(int) for one in (x, y))
    a, b = how.inner(x - i), how.inner(y - j)
    a, b = (b, a) if how.exchanged else (a, b)
    a, b = a * how.across, b * how.down

    def at(row: Array, column: Array) -> Array:
        if how.edge == "dark":
            inside = (row >= 0) & (row < side) & (column >= 0) & (column < side)
            return np.where(inside, plane[:, np.clip(row, 0, side - 1), np.clip(column, 0, side - 1)], 0)
        if how.edge == "wrap":
            return plane[:, row % side, column % side]
        return plane[:, np.clip(row, 0, side - 1), np.clip(column, 0, side - 1)]

    upper, lower = ((1 - a) * at(row, i) + a * at(row, i + 1) for row in (j, j + 1))
    return np.asarray((1 - b) * upper + b * lower)


LOOKUPS: Mapping[str, Lookup] = {
    "the disc's places are taken for [0, 1], not [-1, 1]: s n in place of (s + 1) / 2 n": Lookup(place=lambda s: s),
    "places are not halved: s + 1 in place of (s + 1) / 2": Lookup(place=lambda s: s + 1),
    "places count from the other end: 1 - s for 1 + s, columns and rows mirrored": Lookup(place=lambda s: (1 - s) / 2),
    "both coordinates take s: the column for the row too": Lookup(axes=(0, 0)),
    "both coordinates take t: the row for the column too": Lookup(axes=(1, 1)),
    "the finer of two levels alone: no mean between levels (not trilinear)": Lookup(blend=lambda a, b, part: a),  # noqa: ARG005
    "the coarser of two levels alone: no mean between levels (not trilinear)": Lookup(blend=lambda a, b, part: b),  # noqa: ARG005
    "the nearest of two levels, rounded: no mean between levels (not trilinear)": Lookup(
        blend=lambda a, b, part: np.where(part < 0.5, a, b)),
    "the weights of the finer and the coarser level are exchanged": Lookup(blend=lambda a, b, part: b + part * (a - b)),
    "the plain mean of both levels: the level's fraction does not count": Lookup(
        blend=lambda a, b, part: (a + b) / 2),  # noqa: ARG005
    "the sum of two levels: the finer one is not weighed by 1 - fraction": Lookup(
        blend=lambda a, b, part: a + part * b),
    "the coarsest level for all": Lookup(level=lambda radius, n: 99 + 0 * radius),  # noqa: ARG005
    "the level by the natural logarithm, ln for log2": Lookup(level=lambda radius, n: np.log(radius * n) - 1),
    "the level by the logarithm to base 10, for log2": Lookup(level=lambda radius, n: np.log10(radius * n) - 1),
    "the level by the radius and not its logarithm: log2 is missing": Lookup(level=lambda radius, n: radius * n - 1),
    "two levels too coarse: 1 is added, not subtracted": Lookup(level=lambda radius, n: np.log2(radius * n) + 1),
    "half a level too coarse: 1/2 is subtracted in place of 1": Lookup(
        level=lambda radius, n: np.log2(radius * n) - 0.5),
    "the level by the side's count less 1: n - 1 texels": Lookup(level=lambda radius, n: np.log2(radius * (n - 1)) - 1),
    "half of the level: log4, as of an area": Lookup(level=lambda radius, n: 0.5 * np.log2(radius * n) - 0.5),
    "level 0 is never read: levels begin at 1": Lookup(least=1.0),
    "half a texel off: texel centres at 0, not at 1/2 (0.5 is not subtracted)": Lookup(half=0.0),
    "half a texel off: 0.5 is added, not subtracted": Lookup(half=-0.5),
    "the nearest texel of each level: not bilinear": Lookup(inner=np.round),
    "the texel to the upper left of each level: bilinear weights are left out": Lookup(across=False, down=False),
    "bilinear along rows (down) alone: neighbouring columns do not count": Lookup(across=False),
    "bilinear along columns (across) alone: neighbouring rows do not count": Lookup(down=False),
    "bilinear weights are exchanged, a for 1 - a": Lookup(inner=lambda part: 1 - part),
    "bilinear weights of rows and columns are exchanged": Lookup(exchanged=True),
    "bilinear weights are smooth (smoothstep), not linear": Lookup(inner=lambda part: part * part * (3 - 2 * part)),
    "places on a level by its own side, not by halving: odd sides are squeezed": Lookup(by_side=True),
    "places are not halved from level to level: texels of level 0 on all levels": Lookup(level_0=True),
    "the look-up wraps at the map's rim: the opposite texel, not clamped": Lookup(edge="wrap"),
    "beyond the map's rim is 0, not the border texel: not clamped": Lookup(edge="dark"),
    "the first map for all area lights": Lookup(first_map=True),
    "the first channel for all": Lookup(first_channel=True),
}


def lookup_bugs(name: str, flag: str) -> tuple[Bug, ...]:
    """Return likely bugs of the look-up in mip levels."""
    return tuple(Bug(cause, means_by(name, flag, how), LEVEL if "level" in cause else READ)
                 for cause, how in {**LOOKUPS, **_one_alone()}.items())


def _one_alone() -> dict[str, Lookup]:
    """Return look-ups that are wrong in one coordinate alone."""
    words = {"s": "of columns (s) alone", "t": "of rows (t) alone"}
    return {cause.format(word): how._replace(alone=one) for one, word in words.items() for cause, how in (
        ("places {} are taken for [0, 1], not [-1, 1]: no 0.5 (s + 1)", Lookup(place=lambda s: s)),
        ("places {} are not halved: s + 1 in place of (s + 1) / 2", Lookup(place=lambda s: s + 1)),
        ("places {} are mirrored: 1 - s for 1 + s", Lookup(place=lambda s: (1 - s) / 2)),
        ("half a texel {} is missing: centres at 0, not at 0.5", Lookup(half=0.0)),
        ("half a texel {} is added, not subtracted", Lookup(half=-0.5)))}
