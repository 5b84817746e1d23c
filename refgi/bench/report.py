"""The page of a bench: error over time of every method on each scene, and what it costs against the path tracer."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from refgi.bench.grid import FILES, TRUTH
from refgi.bench.overview import Place, overview
from refgi.bench.results import Result, Run, SceneResult, percent, taken, times
from refgi.bench.split_plot import splits_of
from refgi.bench.views import named, provenance_of, view_of
from refgi.compare.page.album import album
from refgi.compare.plot import Axes, Curve, curves_plot
from refgi.compare.report import PAGE, machine, number, script, sort_key, templates
from refgi.image import write_text
from refgi.provenance import Record

COLUMNS = ("method", "settings", "time, ms", "RMSE, %", "95 % interval", "bias, %", "spread, %",
           "own limits, %", "over truth's in equal time", "FLIP", "SSIM", "pairs, M", "rays, M", "stages, MiB",
           "memory, MiB")
AXES = Axes("time of a frame, ms", "RMSE of indirect irradiance, %", log_x=True, log_y=True, decimal_x=True)
HOW = ("Each round runs every choice once on a frame of its own, buffers included, with a seed of its own; times are "
       "medians. RMSE is plain, over all pixels that show a surface. Spread is the deviation between seeds, bias what "
       "is left without it and without the truth's own noise. Own limits: against the truth that leaves out what the "
       "method cannot know. Stages is what the arrays hold that stages make, memory the most that arrays and objects "
       "hold above the scene. Bold rows are on the front: nothing here is both faster and nearer. Bars are 95 % "
       "intervals of the RMSE. A click on a mark or on a method's name opens the picture of its first seed; a click on "
       "a column's name sorts by it.")


def write_page(result: Result, folder: Path, refresh: int | None = None) -> None:
    """Write index.html into a folder that holds the pictures, whole or not at all.

    A browser reads it again each `refresh` seconds unless it is in use; never where absent. InputError if it cannot be
    written, or a picture is damaged.
    """
    write_text(folder / "index.html", page(result, folder, refresh))


def page(result: Result, folder: Path, refresh: int | None = None) -> str:
    """Return the page of a bench as HTML that refers to nothing outside itself; the same for equal input.

    Pictures that `folder` lacks are left out; `refresh` as in `write_page`.
    """
    from markupsafe import Markup

    views = {number: found for number, scene in enumerate(result.scenes, 1)
             if (found := view_of(scene, number, folder)) is not None}
    pictures = album([view for view, _ in views.values()])
    shown = {number: position for position, number in enumerate(views)}
    scenes = [_scene(scene, number, shown.get(number), views[number][1] if number in views else {})
              for number, scene in enumerate(result.scenes, 1)]
    rows = overview([Place(scene, f"#scene{number}") for number, scene in enumerate(result.scenes, 1)])
    return templates(FILES).get_template("bench.html.j2").render(
        style=Markup((PAGE / "style.css").read_text("utf-8")), script=script(), kind="bench",
        title="Run time against error", lead=", ".join(scene.scene for scene in result.scenes),
        facts=[f"{sum(len(scene.runs) for scene in result.scenes)} runs"], verdict="", failures=[], scenes=scenes,
        columns=COLUMNS, how=HOW, overview=rows if len(result.scenes) > 1 else None, album=pictures, refresh=refresh,
        versions=result.environment["versions"], machine=machine(result.environment))


def _scene(scene: SceneResult, number: int, view: int | None, record: Record) -> dict[str, Any]:
    from markupsafe import Markup

    runs = sorted(named(scene, number), key=lambda one: one[1].seconds)
    cold = {name: f"{one:.3g} s" for name, one in scene.cold.items()}
    return {"name": scene.scene, "number": number, "cold": cold, "size": f"{scene.width} x {scene.height}",
            "truth": scene.truth, "doubts": scene.doubts, "plot": Markup(plot_of(scene, number)),
            "splits": splits_of(scene.splits), "said": list(said_of(scene)), "failures": scene.failures, "view": view,
            "rows": [_row(name, run) for name, run in runs], "provenance": list(provenance_of(record)),
            "made": [_made(run) for _, run in runs]}


def _made(run: Run) -> dict[str, Any]:
    return {"method": run.method, "label": run.label, "settings": run.settings, "picture": run.picture,
            "times": ", ".join(_ms(seconds) for seconds in run.times),
            "stages": {name: f"{_ms(seconds)} ms" for name, seconds in run.stages.items()}}


def _ms(seconds: float) -> str:
    """Return a time in ms with three digits."""
    return number(1e3 * seconds)


def plot_of(scene: SceneResult, position: int = 1) -> str:
    """Draw one curve a method, and the path tracer's dashed; bars are 95 % intervals, marks lead to pictures.

    An ``<svg>`` element, points of a method in the order of their times; nothing where no error is known. `position`:
    of the scene on the page.
    """
    if not any(0 < run.rmse < math.inf for run in (*scene.runs, *scene.line)):
        return ""
    runs = named(scene, position)
    methods = list(dict.fromkeys(run.method for run in scene.runs))
    drawn = [_curve(name, [one for one in runs if one[1].method == name]) for name in methods]
    line = [one for one in runs if one[1].method == TRUTH]
    return curves_plot([*drawn, *([_curve("path tracer", line, dashed=True)] if line else [])], AXES)


def said_of(scene: SceneResult) -> Iterator[str]:
    """Yield what the curves say: each method's nearest picture, and whether the path tracer is better in that time.

    A sentence a method, in the order of their errors.
    """
    best = {run.method: run for run in sorted(scene.runs, key=lambda one: -one.rmse)}
    for method, run in sorted(best.items(), key=lambda one: one[1].rmse):
        text = f"{method} comes to {percent(run.errors[TRUTH].rmse)} % in {number(1e3 * run.seconds)} ms ({run.label})"
        own = [one for one in scene.runs if one.method == method]
        ahead = [one for one in own if (one.in_equal_time or 0) <= 1]
        if not scene.line:
            yield f"{text}."
        elif all(one.in_equal_time is None for one in own):
            yield f"{text}; each of its settings is done before the path tracer's first picture."
        elif not ahead:
            yield f"{text}; the path tracer is nearer in the time of each of its settings."
        elif len(ahead) == len(own):
            yield f"{text}; no setting of it is beaten by the path tracer in equal time."
        else:
            slowest = max(ahead, key=lambda one: one.seconds)
            yield f"{text}; from {number(1e3 * slowest.seconds)} ms on the path tracer is nearer in equal time."


def _curve(label: str, runs: list[tuple[str, Run]], *, dashed: bool = False) -> Curve:
    ordered = sorted(runs, key=lambda one: one[1].seconds)
    links = [(name, f"{label}, {run.label}: {percent(run.rmse)} % in {_ms(run.seconds)} ms")
             for name, run in ordered]
    return Curve(label, [1e3 * run.seconds for _, run in ordered], [100 * run.rmse for _, run in ordered], dashed,
                 [_interval(run) for _, run in ordered], links)


def _interval(run: Run) -> tuple[float, float]:
    known = run.errors[TRUTH]
    return (math.nan, math.nan) if known.low is None or known.high is None else (100 * known.low, 100 * known.high)


def _row(name: str, run: Run) -> dict[str, Any]:
    known = run.errors[TRUTH]
    interval = "" if known.low is None else f"{percent(known.low)} to {percent(known.high)}"
    cells = [(_ms(run.seconds), run.seconds), (percent(known.rmse), known.rmse), (interval, known.low),
             (percent(known.bias), known.bias), (percent(known.spread), known.spread),
             (percent(run.own_limits), run.own_limits), (times(run.in_equal_time), run.in_equal_time),
             (times(run.flip), run.flip), (times(run.ssim), run.ssim),
             *taken(run.work)]
    return {"name": name, "method": run.method, "settings": run.label, "front": run.front,
            "cells": [(text, sort_key(value)) for text, value in cells]}
