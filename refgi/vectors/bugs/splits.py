"""Splits of cells by the light of each pixel light, written out, to put bugs into (Nichols and Wyman 2009, 3.3.1)."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from refgi.vectors.spec import Array, Arrays, Bug, Run

SPLIT = "AMS Sec. 3.3.1: max - min of any channel over the quadrants exceeds T"
Levels = list[Array]


def down(plane: Array, shape: tuple[int, ...]) -> Array:
    """Return the value of its cell for each cell of the next finer level."""
    return np.repeat(np.repeat(plane, 2, axis=-2), 2, axis=-1)[..., : shape[-2], : shape[-1]]


def quadrants(plane: Array, fill: Any) -> Array:
    """Return the four cells of the finer level along the last axis; `fill` beyond the picture."""
    odd = [(0, 0)] * (plane.ndim - 2) + [(0, plane.shape[-2] % 2), (0, plane.shape[-1] % 2)]
    whole = np.pad(plane, odd, constant_values=fill)
    rows, columns = whole.shape[-2] // 2, whole.shape[-1] // 2
    four = whole.reshape(*plane.shape[:-2], rows, 2, columns, 2)
    return np.moveaxis(four, -3, -2).reshape(*plane.shape[:-2], rows, columns, 4)


def splits(
    samples: Levels, there: Levels, finest: int, threshold: float, form: str, *, upto: str = "all",
    channels: Callable[[Array], Array] = lambda a: a, holes: bool = False, parent: bool = False,
    spread: Callable[[Array, Array], Array] = lambda most, least: most - least, every: bool = False, level_of: int = 0,
) -> Levels:
    """Return which cells of levels 1 on each light splits, (light, row, column), with a bug.

    `samples` (light, 3, row, column) and `there` (row, column) of levels 0 on. `upto`: what T is a share of.
    """
    top, made = len(samples) - 1, [np.zeros((len(samples[0]), *one.shape), bool) for one in there]
    visited = np.broadcast_to(there[top], made[top].shape)
    largest = _largest(samples[top], visited)
    for level in range(top, max(finest - level_of, 0), -1):
        fine, known = samples[level - 1], there[level - 1]
        asked = down(visited, known.shape) & known
        if upto != "coarsest":
            largest = np.maximum(largest, _largest(fine, asked))
        scale = np.full_like(largest, largest.max(initial=0)) if upto == "lights" else largest
        limit = threshold * (scale if form == "relative" else 1) * np.ones_like(largest)
        here = quadrants(np.broadcast_to(known, fine.shape[-2:]), False)
        own = channels(quadrants(fine, 0.0))
        most, least = (np.where(here | holes, own, other) for other in (-np.inf, np.inf))
        most, least = most.max(axis=-1), least.min(axis=-1)
        if parent:
            most, least = np.maximum(most, channels(samples[level])), np.minimum(least, channels(samples[level]))
        with np.errstate(invalid="ignore"):
            differs = spread(most, least) > limit[:, None, None, None]
        made[level] = visited & (differs.all(axis=1) if every else differs.any(axis=1))
        visited = down(made[level], known.shape) & known
    return made[1:]


def _largest(samples: Array, visited: Array) -> Array:
    """Return the largest channel of the samples that each light has taken."""
    return np.asarray(np.where(visited[:, None], samples, 0).max(axis=(1, 2, 3), initial=0))


def split_bugs(names: tuple[str, ...], levels: Callable[[Arrays], tuple[Levels, Levels]], settings: Any) -> list[Bug]:
    """Return likely bugs of the splits; `levels` finds samples and which cells show a surface among arrays."""
    other = "absolute" if settings.form == "relative" else "relative"
    ways: Mapping[str, dict[str, Any]] = {
        f"T is {other}": {"form": other},
        "T is a share of the largest irradiance at the coarsest level alone": {"upto": "coarsest"},
        "T is a share of the largest irradiance of all lights": {"upto": "lights"},
        "T is half as large": {"threshold": settings.threshold / 2},
        "T is twice as large": {"threshold": settings.threshold * 2},
        "red alone is compared": {"channels": lambda a: a[:, :1]},
        "the sum of the channels is compared": {"channels": lambda a: a.sum(axis=1, keepdims=True)},
        "the mean of the channels is compared": {"channels": lambda a: a.mean(axis=1, keepdims=True)},
        "all channels must differ, not any": {"every": True},
        "quadrants without surface count as dark": {"holes": True},
        "the cell's own sample counts beside its quadrants'": {"parent": True},
        "the least is left out: the largest is compared": {"spread": lambda most, least: most + 0 * least},
        "the range is compared as a share of the largest quadrant": {
            "spread": lambda most, least: np.where(most > 0, (most - least) / np.where(most > 0, most, 1), 0)},
        "lists end a level too early": {"level_of": -1},
    }

    def by(how: dict[str, Any]) -> Run:
        def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
            knobs = {"threshold": settings.threshold, "form": settings.form} | how
            samples, there = levels(arrays)
            return dict(zip(names, splits(samples, there, settings.finest, **knobs), strict=True))

        return run

    return [Bug(cause, by(how), SPLIT) for cause, how in ways.items()]
