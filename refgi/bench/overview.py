"""Several scenes at once: each method's best ratio to the path tracer in equal time, and its nearest picture."""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from refgi.bench.results import Run, SceneResult, percent, times
from refgi.compare.plot import Axes, Curve, curves_plot
from refgi.compare.report import number, sort_key

AXES = Axes("time of a frame, ms", "RMSE over the path tracer's in equal time", log_x=True, log_y=True, decimal_x=True)


class Place(NamedTuple):
    """A scene and where its page is."""

    scene: SceneResult
    link: str


def overview(places: Sequence[Place]) -> dict[str, Any]:
    """Return the table and the plot over all scenes, in the page's order.

    `methods`; `rows`, one a scene, with a cell a method; `plot`, an ``<svg>`` element.
    """
    from markupsafe import Markup

    methods = list(dict.fromkeys(run.method for place in places for run in place.scene.runs))
    rows = [{"scene": place.scene.scene, "link": place.link, "size": f"{place.scene.width} x {place.scene.height}",
             "cells": [_cell([run for run in place.scene.runs if run.method == name]) for name in methods]}
            for place in places]
    return {"methods": methods, "rows": rows, "plot": Markup(_plot(places, methods))}


def _cell(runs: Sequence[Run]) -> dict[str, str]:
    """Return a method's least ratio with its time and settings, and its nearest picture."""
    known = [run for run in runs if run.in_equal_time is not None]
    best = min(known, key=lambda run: run.in_equal_time or math.inf, default=None)
    nearest = min((run for run in runs if math.isfinite(run.rmse)), key=lambda run: run.rmse, default=None)
    return {"ratio": times(best.in_equal_time) if best else "", "sort": sort_key(best.in_equal_time if best else None),
            "at": f"{best.label}, {number(1e3 * best.seconds)} ms" if best else "",
            "nearest": f"{percent(nearest.rmse)} % in {number(1e3 * nearest.seconds)} ms" if nearest else "",
            "beaten": "yes" if best and (best.in_equal_time or 0) > 1 else ""}


def _plot(places: Sequence[Place], methods: Sequence[str]) -> str:
    """Draw every run of every scene by time and ratio, and the path tracer's own line at 1."""
    points = [(run.method, 1e3 * run.seconds, run.in_equal_time) for place in places for run in place.scene.runs
              if run.in_equal_time is not None and run.seconds > 0]
    if not points:
        return ""
    curves = [Curve(name, [x for method, x, _ in points if method == name],
                    [y for method, _, y in points if method == name], joined=False) for name in methods]
    ends = [min(x for _, x, _ in points), max(x for _, x, _ in points)]
    return curves_plot([*curves, Curve("path tracer", ends, [1.0, 1.0], dashed=True)], AXES)
