"""Boxes of what is visible and illuminated, as a port gets them wrong."""

from collections.abc import Callable
from typing import Any

import numpy as np

from refgi.vectors.recipe import writing
from refgi.vectors.spec import Array, Arrays, Bug, Run


def box_bugs(run: Run) -> tuple[Bug, ...]:
    """Return likely bugs of boxes of points."""
    both = ("extents__visible", "extents__illuminated")

    def changed(change: Callable[[Array], Array]) -> Run:
        return writing(run, **dict.fromkeys(both, change))

    wider: dict[str, Callable[[Array], Array]] = {
        "least and greatest corner are exchanged": lambda a: a[::-1],
        "boxes are centre and half sides, not corners": lambda a: np.stack([(a[0] + a[1]) / 2, (a[1] - a[0]) / 2]),
        "boxes are corner and size, not two corners": lambda a: np.stack([a[0], a[1] - a[0]]),
        "boxes hold the world's origin: the least and greatest begin at 0": lambda a: np.stack([
            np.minimum(a[0], 0), np.maximum(a[1], 0)]),
        "the least corner begins at 0: not above it": lambda a: np.stack([np.minimum(a[0], 0), a[1]]),
        "the least corner for both": lambda a: np.stack([a[0], a[0]]),
        "the greatest corner for both": lambda a: np.stack([a[1], a[1]]),
    }
    return (*(Bug(cause, changed(change), "least and greatest, xyz") for cause, change in wider.items()),
            Bug("one box for both: what is visible and illuminated together", _as_one(run), "two boxes"),
            Bug("the visible and the illuminated box are exchanged", _exchanged(run), "visible: the camera's pixels"))


def _as_one(run: Run) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:
        a, b = run(arrays, real).values()
        one = np.stack([np.minimum(a[0], b[0]), np.maximum(a[1], b[1])])
        return {"extents.visible": one, "extents.illuminated": one}

    return altered


def _exchanged(run: Run) -> Run:
    def altered(arrays: Arrays, real: Any) -> Arrays:
        made = run(arrays, real)
        return {"extents.visible": made["extents.illuminated"], "extents.illuminated": made["extents.visible"]}

    return altered
