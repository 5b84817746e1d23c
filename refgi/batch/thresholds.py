"""Thresholds of a plan: `"atrium.sii.relmse" = "<= 0.31"` under `[expect]`.

A key is scene, method, the setting as tables label it where one alone is meant, and figure, with dots between. Without
a setting all of the method's have to hold, and a scene on a path stands for each of its frames.
"""

import operator
import re
from collections.abc import Callable, Collection, Iterator
from typing import NamedTuple

from refgi.bench.results import Result, Run, SceneResult
from refgi.errors import expect

FRAME = "@"  # between a scene and the number of a frame
ERRORS = ("rmse", "bias", "spread", "noise")  # against the truth, over its mean
FIGURES = (*ERRORS, "relmse", "flip", "ssim", "seconds", "rmse_unoccluded")
OVER_TIME = ("flicker", "lag")
COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    "<=": operator.le, ">=": operator.ge, "<": operator.lt, ">": operator.gt}


class Threshold(NamedTuple):
    """What is expected of one figure."""

    key: str  # as in the plan
    scene: str
    method: str
    label: str | None  # of the setting; None for all
    figure: str
    sign: str  # of `COMPARISONS`
    bound: float


class Finding(NamedTuple):
    """What is not as it should be."""

    place: str  # scene, method and setting
    figure: str
    text: str  # what was expected and what was found
    pictures: tuple[str, ...] = ()
    stage: str | None = None  # the first whose output is another

    def __str__(self) -> str:
        first = [] if self.stage is None else [f"first stage that changed: {self.stage}"]
        return "; ".join([f"{self.place}: {self.figure} {self.text}", *self.pictures, *first])


def read_threshold(key: str, text: object, scenes: Collection[str], methods: Collection[str], file: str) -> Threshold:
    """Read one line of a plan's `[expect]`.

    `key`: such as ``atrium.sii.relmse`` or ``atrium.val.clusters.count=8, lights=256.rmse``; `text`: such as ``<=
    0.31``. An InputError, which names `file`, if scene, method, figure or comparison is unknown.
    """
    where = f'{file}: expect."{key}"'
    scene = max((name for name in scenes if key.startswith(f"{name}.")), key=len, default="")
    expect(scene != "", where, f"a scene of the plan ({', '.join(scenes)}) first", key)
    method, *middle = key[len(scene) + 1:].split(".")
    expect(method in methods, where, f"a method of the plan ({', '.join(sorted(methods))}) after the scene", method)
    figure = middle.pop() if middle else ""
    known = (*FIGURES, *OVER_TIME)
    expect(figure in known, where, f"a figure at the end, one of {', '.join(known)}", figure)
    found = re.fullmatch(r"\s*(<=|>=|<|>)\s*([-+\d.eE]+)\s*", text) if isinstance(text, str) else None
    bound = _number(found[2]) if found else None
    expect(bound is not None, where, 'a comparison such as "<= 0.31"', text)
    assert found is not None
    assert bound is not None
    return Threshold(key, scene, method, ".".join(middle) or None, figure, found[1], bound)


def broken(thresholds: Collection[Threshold], result: Result, *, whole: bool = True) -> list[Finding]:
    """Return a finding for each threshold that does not hold.

    Its figure is missed, or judged by a truth whose error is not to be trusted, or, where the `whole` plan is done, not
    there.
    """
    found = []
    for one in thresholds:
        values = list(_values(one, result))
        if not values and whole:
            found.append(Finding(one.key, one.figure, f"expected {one.sign} {one.bound:g}, nothing was measured"))
        for place, value, picture, in_doubt in values:
            if value is None or not COMPARISONS[one.sign](value, one.bound):
                text = "is not known" if value is None else f"is {value:.4g}"
                found.append(Finding(place, one.figure, f"{text}, expected {one.sign} {one.bound:g}",
                                     () if picture is None else (picture,)))
            elif in_doubt:
                found.append(Finding(place, one.figure, f"is {value:.4g}, expected {one.sign} {one.bound:g}, but in "
                                     "doubt: the truth's error is not to be trusted",
                                     () if picture is None else (picture,)))
    return found


def figure_of(run: Run, figure: str) -> float | None:
    """Return a figure, of `FIGURES`, of a run; None where it is not known."""
    if figure in ERRORS:
        value: float | None = getattr(run.errors["truth"], figure)
        return value
    if figure == "rmse_unoccluded":
        return run.errors["unoccluded"].rmse if "unoccluded" in run.errors else None
    own: float | None = getattr(run, figure)
    return own


def place_of(scene: str, method: str, label: str) -> str:
    """Return how a run is named in a finding: scene, method and setting."""
    return f"{scene}.{method} ({label})"


def _values(one: Threshold, result: Result) -> Iterator[tuple[str, float | None, str | None, bool]]:
    """Yield place, value and picture of each figure that a threshold speaks of, and whether it is in doubt."""
    runs = [(scene, run) for scene in result.scenes for run in _runs(scene) if run.method == one.method
            and (scene.scene == one.scene or scene.scene.startswith(f"{one.scene}{FRAME}"))]
    if one.figure in OVER_TIME:
        for way in result.paths:
            if (way.scene, way.method) == (one.scene, one.method) and one.label in (None, way.label):
                doubted = any(_in_doubt(run, one.figure) for _, run in runs if run.label == way.label)
                yield place_of(way.scene, way.method, way.label), getattr(way, one.figure), None, doubted
        return
    for scene, run in runs:
        if one.label in (None, run.label):
            yield (place_of(scene.scene, run.method, run.label), figure_of(run, one.figure), run.picture,
                   _in_doubt(run, one.figure))


def _in_doubt(run: Run, figure: str) -> bool:
    """Return whether a figure rests on a reference whose error is not to be trusted."""
    judge = "unoccluded" if figure == "rmse_unoccluded" else "truth"
    return figure != "seconds" and judge in run.errors and run.errors[judge].in_doubt


def _runs(scene: SceneResult) -> tuple[Run, ...]:
    return (*scene.runs, *scene.line)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
