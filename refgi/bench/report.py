"""The page of a bench: error over time of every method on each scene, and what it costs against the path tracer."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from refgi.bench.grid import FILES, TRUTH
from refgi.bench.results import Result, Run, SceneResult, percent, times
from refgi.bench.split_plot import splits_of
from refgi.compare.plot import Axes, Curve, curves_plot
from refgi.compare.report import PAGE, machine, number, templates
from refgi.image import write_text

COLUMNS = ("method", "settings", "time, ms", "RMSE, %", "95 % interval", "bias, %", "spread, %",
           "without visibility, %", "over truth's in equal time", "FLIP", "SSIM")
AXES = Axes("time of a frame, ms", "RMSE of indirect irradiance, %", log_x=True, log_y=True, decimal_x=True)
HOW = ("Each round runs every choice once on a frame of its own, buffers included, with a seed of its own; times are "
       "medians. RMSE is plain, over all pixels that show a surface. Spread is the deviation between seeds, bias what "
       "is left without it and without the truth's own noise. Bold rows are on the front: nothing here is both faster "
       "and nearer.")


def write_page(result: Result, folder: Path) -> None:
    """Write index.html, whole or not at all.

    Parameters
    ----------
    result : Result
        Of all scenes.
    folder : Path
        An existing folder.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    from markupsafe import Markup

    scenes = [{"name": scene.scene, "size": f"{scene.width} x {scene.height}", "truth": scene.truth,
               "plot": Markup(plot_of(scene)), "splits": splits_of(scene.splits),
               "said": list(said_of(scene)), "failures": scene.failures,
               "rows": [_row(run) for run in sorted((*scene.runs, *scene.line), key=lambda one: one.seconds)]}
              for scene in result.scenes]
    names = ", ".join(scene.scene for scene in result.scenes)
    text = templates(FILES).get_template("bench.html.j2").render(
        style=Markup((PAGE / "style.css").read_text("utf-8")), script="", kind="bench", title="Run time against error",
        lead=names, facts=[f"{sum(len(scene.runs) for scene in result.scenes)} runs"], verdict="", failures=[],
        scenes=scenes, columns=COLUMNS, how=HOW, versions=result.environment["versions"],
        machine=machine(result.environment))
    write_text(folder / "index.html", text)


def plot_of(scene: SceneResult) -> str:
    """Draw one curve a method, and the path tracer's dashed.

    Parameters
    ----------
    scene : SceneResult
        Of one scene.

    Returns
    -------
    str
        An ``<svg>`` element, points of a method in the order of their times; nothing where no error is known.
    """
    if not any(0 < run.rmse < math.inf for run in (*scene.runs, *scene.line)):
        return ""
    methods = list(dict.fromkeys(run.method for run in scene.runs))
    drawn = [_curve(name, [run for run in scene.runs if run.method == name]) for name in methods]
    return curves_plot([*drawn, *([_curve("path tracer", list(scene.line), dashed=True)] if scene.line else [])], AXES)


def said_of(scene: SceneResult) -> Iterator[str]:
    """Yield what the curves say: each method's nearest picture, and whether the path tracer is better in that time.

    Parameters
    ----------
    scene : SceneResult
        Of one scene.

    Yields
    ------
    str
        A sentence a method, in the order of their errors.
    """
    best = {run.method: run for run in sorted(scene.runs, key=lambda one: -one.rmse)}
    for method, run in sorted(best.items(), key=lambda one: one[1].rmse):
        text = f"{method} comes to {percent(run.errors[TRUTH].rmse)} % in {number(1e3 * run.seconds)} ms ({run.label})"
        ahead = [one for one in scene.runs if one.method == method and (one.in_equal_time or 0) <= 1]
        if not scene.line:
            yield f"{text}."
        elif not ahead:
            yield f"{text}; the path tracer is nearer in the time of each of its settings."
        elif len(ahead) == sum(one.method == method for one in scene.runs):
            yield f"{text}; no setting of it is beaten by the path tracer in equal time."
        else:
            slowest = max(ahead, key=lambda one: one.seconds)
            yield f"{text}; from {number(1e3 * slowest.seconds)} ms on the path tracer is nearer in equal time."


def _curve(name: str, runs: list[Run], *, dashed: bool = False) -> Curve:
    ordered = sorted(runs, key=lambda one: one.seconds)
    return Curve(name, [1e3 * run.seconds for run in ordered], [100 * run.rmse for run in ordered], dashed)


def _row(run: Run) -> dict[str, Any]:
    known, unoccluded = run.errors[TRUTH], run.errors.get("unoccluded")
    interval = "" if known.low is None else f"{percent(known.low)} to {percent(known.high)}"
    cells = (number(1e3 * run.seconds), percent(known.rmse), interval, percent(known.bias),
             percent(known.spread), percent(unoccluded.rmse) if unoccluded else "", times(run.in_equal_time),
             times(run.flip), times(run.ssim))
    return {"method": run.method, "settings": run.label, "cells": cells, "front": run.front}
