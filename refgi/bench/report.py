"""The page of a bench: error over time, bars of split errors, several scenes at once.

Split errors have two panels: the change of the mean that each approximation makes, and its share of the whole's mean
square error. In both the parts add up exactly; what lies below 0 takes back what others did. A mark shows the sum.
"""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from refgi.bench.grid import FILES, TRUTH
from refgi.bench.pictures import named, provenance_of, view_of
from refgi.bench.results import (
    SPLIT_COLUMNS,
    Part,
    Result,
    Run,
    SceneResult,
    Split,
    in_percent,
    rows_of_split,
    said_of_split,
    taken,
    times,
)
from refgi.compare.album import album
from refgi.compare.pages import (
    CARD,
    INK,
    LINE,
    METHOD_COLOURS,
    Axes,
    Curve,
    curves_plot,
    figure_svg,
    markup,
    number,
    page_of,
    sort_key,
    style_plot,
)
from refgi.image import write_text
from refgi.provenance import Record

OVERVIEW_AXES = Axes("time of a frame, ms", "RMSE over the path tracer's in equal time", log_x=True, log_y=True,
                     decimal_x=True)


class Place(NamedTuple):
    """A scene and where its page is."""

    scene: SceneResult
    link: str


def overview(places: Sequence[Place]) -> dict[str, Any]:
    """Return `methods`, `rows` (one a scene, a cell a method) and `plot` over all scenes, in the page's order."""
    methods = list(dict.fromkeys(run.method for place in places for run in place.scene.runs))
    rows = [{"scene": place.scene.scene, "link": place.link, "size": f"{place.scene.width} x {place.scene.height}",
             "cells": [_cell([run for run in place.scene.runs if run.method == name]) for name in methods]}
            for place in places]
    return {"methods": methods, "rows": rows, "plot": markup(_plot(places, methods))}


def _cell(runs: Sequence[Run]) -> dict[str, str]:
    """Return a method's least ratio with its time and settings, and its nearest picture."""
    known = [run for run in runs if run.in_equal_time is not None]
    best = min(known, key=lambda run: run.in_equal_time or math.inf, default=None)
    nearest = min((run for run in runs if math.isfinite(run.rmse)), key=lambda run: run.rmse, default=None)
    return {"ratio": times(best.in_equal_time) if best else "", "sort": sort_key(best.in_equal_time if best else None),
            "at": f"{best.label}, {number(1e3 * best.seconds)} ms" if best else "",
            "nearest": f"{in_percent(nearest.rmse)} % in {number(1e3 * nearest.seconds)} ms" if nearest else "",
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
    return curves_plot([*curves, Curve("path tracer", ends, [1.0, 1.0], dashed=True)], OVERVIEW_AXES)


HATCHES = ("", "////", "\\\\\\\\")  # of approximations that share a colour; dots would be a quarter of a MB each
LEAST = 1e-4  # a part of less than that shows in no bar
WIDTH, HEIGHT, ROW = 9.2, 1.5, 0.45  # inches: of the plot, of what stands around the bars, and of a bar
LEGEND_ROW = 0.18  # inches, of a name
SPLIT_HOW = (
    "From the truth to the method as it is used, one approximation more at a time, in the order of its "
    "pipeline. Left: what each changes of the mean. Right: its share of the mean square error, its own "
    "square and half of its cross terms with others. Both add up to the mark; what lies on the other side "
    "takes back what others did. The tables also have what the error would be with one approximation "
    "alone switched off.")


def splits_of(splits: Sequence[Split]) -> dict[str, Any] | None:
    """Return what the page's template shows of a scene's splits; None without splits."""
    if not splits:
        return None
    return {"how": SPLIT_HOW, "plot": markup(bars(splits)), "columns": SPLIT_COLUMNS,
            "tables": [{"said": said_of_split(split), "rows": rows_of_split(split)} for split in splits]}


def bars(splits: Sequence[Split]) -> str:
    """Draw a bar for each split, top to bottom: an ``<svg>`` element that refers to nothing outside itself."""
    names = list(dict.fromkeys(part.name for split in splits for part in split.parts))

    def draw(figure: Any) -> None:
        left, right = figure.subplots(1, 2, sharey=True)
        _panel(left, [[part.mean for part in split.parts] for split in splits], splits, names)
        _panel(right, [[part.share for part in split.parts] for split in splits], splits, names)
        left.set(xlabel="change of the mean, %", yticks=range(len(splits)),
                 yticklabels=[split.label.replace(", ", "\n") for split in splits])
        right.set(xlabel="share of the square, %")
        left.invert_yaxis()
        handles, labels = _legend(names)
        legend = figure.legend(handles, labels, loc="outside right upper", frameon=False, fontsize=9)
        for text in (*left.get_yticklabels(), *legend.get_texts()):
            text.set_parse_math(False)  # a name is no formula

    return figure_svg(draw, (WIDTH, HEIGHT + max(len(splits) * ROW, len(names) * LEGEND_ROW)), "Error split")


def stacked(values: Sequence[float]) -> list[tuple[float, float]]:
    """Return where the parts of a signed bar begin, and their lengths.

    Those above 0 follow each other to the right of 0, those below to the left.

    >>> stacked([3, -1, 2, -4])
    [(0.0, 3), (0.0, -1), (3.0, 2), (-1.0, -4)]
    """
    ends, found = {True: 0.0, False: 0.0}, []
    for value in values:
        found.append((ends[value >= 0], value))
        ends[value >= 0] += value
    return found


def _panel(
    plot: Any, rows: Sequence[Sequence[float | None]], splits: Sequence[Split], names: Sequence[str]
) -> None:
    style_plot(plot)
    plot.grid(True, axis="x", color=LINE, linewidth=0.8)
    plot.use_sticky_edges = False
    plot.margins(x=0.06)
    plot.axvline(0, color=INK, linewidth=0.8)
    plot.tick_params(axis="y", length=0, labelsize=8)
    for row, (values, split) in enumerate(zip(rows, splits, strict=True)):
        known = [100 * (value or 0.0) for value in values]
        for part, (begin, length) in zip(split.parts, stacked(known), strict=True):
            if abs(length) > 100 * LEAST:
                plot.barh(row, length, left=begin, height=0.66, **_look(part, names))
        plot.plot([sum(known)], [row], "D", markersize=5, color=INK, markerfacecolor=CARD)


def _look(part: Part, names: Sequence[str]) -> dict[str, Any]:
    number = names.index(part.name)
    return {"facecolor": METHOD_COLOURS[number % len(METHOD_COLOURS)], "edgecolor": CARD, "linewidth": 0.8,
            "hatch": HATCHES[number // len(METHOD_COLOURS) % len(HATCHES)]}


def _legend(names: Sequence[str]) -> tuple[list[Any], list[str]]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    looks = [_look(Part.model_construct(name=name), names) for name in names]
    total = Line2D([], [], color=INK, marker="D", markerfacecolor=CARD, linestyle="")
    return [*(Patch(**look) for look in looks), total], [*names, "sum"]


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
    """Write index.html beside its pictures; a browser reads it again each `refresh` seconds unless in use."""
    write_text(folder / "index.html", page(result, folder, refresh))


def page(result: Result, folder: Path, refresh: int | None = None) -> str:
    """Return the page of a bench as HTML, the same for equal input; pictures that `folder` lacks are left out."""
    views = {number: found for number, scene in enumerate(result.scenes, 1)
             if (found := view_of(scene, number, folder)) is not None}
    pictures = album([view for view, _ in views.values()])
    shown = {number: position for position, number in enumerate(views)}
    scenes = [_scene(scene, number, shown.get(number), views[number][1] if number in views else {})
              for number, scene in enumerate(result.scenes, 1)]
    rows = overview([Place(scene, f"#scene{number}") for number, scene in enumerate(result.scenes, 1)])
    return page_of(
        "bench.html.j2", result.environment, FILES, kind="bench", title="Run time against error",
        lead=", ".join(scene.scene for scene in result.scenes), scenes=scenes, columns=COLUMNS, how=HOW,
        facts=[f"{sum(len(scene.runs) for scene in result.scenes)} runs"], refresh=refresh, album=pictures,
        overview=rows if len(result.scenes) > 1 else None)


def _scene(scene: SceneResult, number: int, view: int | None, record: Record) -> dict[str, Any]:
    runs = sorted(named(scene, number), key=lambda one: one[1].seconds)
    cold = {name: f"{one:.3g} s" for name, one in scene.cold.items()}
    return {"name": scene.scene, "number": number, "cold": cold, "size": f"{scene.width} x {scene.height}",
            "truth": scene.truth, "doubts": scene.doubts, "plot": markup(plot_of(scene, number)),
            "splits": splits_of(scene.splits), "said": list(said_of(scene)), "failures": scene.failures,
            "left_out": scene.left_out_said, "view": view, "rows": [_row(name, run) for name, run in runs],
            "provenance": list(provenance_of(record)), "made": [_made(run) for _, run in runs]}


def _made(run: Run) -> dict[str, Any]:
    return {"method": run.method, "label": run.label, "settings": run.settings, "picture": run.picture,
            "times": ", ".join(_ms(seconds) for seconds in run.times),
            "stages": {name: f"{_ms(seconds)} ms" for name, seconds in run.stages.items()}}


def _ms(seconds: float) -> str:
    """Return a time in ms with three digits."""
    return number(1e3 * seconds)


def plot_of(scene: SceneResult, position: int = 1) -> str:
    """Draw one curve a method, the path tracer's dashed; bars are 95 % intervals, marks lead to pictures."""
    if not any(0 < run.rmse < math.inf for run in (*scene.runs, *scene.line)):
        return ""
    runs = named(scene, position)
    methods = list(dict.fromkeys(run.method for run in scene.runs))
    drawn = [_curve(name, [one for one in runs if one[1].method == name]) for name in methods]
    line = [one for one in runs if one[1].method == TRUTH]
    return curves_plot([*drawn, *([_curve("path tracer", line, dashed=True)] if line else [])], AXES)


def said_of(scene: SceneResult) -> Iterator[str]:
    """Yield a sentence a method: its nearest picture, and whether the path tracer is better in that time."""
    best = {run.method: run for run in sorted(scene.runs, key=lambda one: -one.rmse)}
    for method, run in sorted(best.items(), key=lambda one: one[1].rmse):
        text = (f"{method} comes to {in_percent(run.errors[TRUTH].rmse)} % in {number(1e3 * run.seconds)} ms "
                f"({run.label})")
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
    links = [(name, f"{label}, {run.label}: {in_percent(run.rmse)} % in {_ms(run.seconds)} ms")
             for name, run in ordered]
    return Curve(label, [1e3 * run.seconds for _, run in ordered], [100 * run.rmse for _, run in ordered], dashed,
                 [_interval(run) for _, run in ordered], links)


def _interval(run: Run) -> tuple[float, float]:
    known = run.errors[TRUTH]
    return (math.nan, math.nan) if known.low is None or known.high is None else (100 * known.low, 100 * known.high)


def _row(name: str, run: Run) -> dict[str, Any]:
    known = run.errors[TRUTH]
    interval = "" if known.low is None else f"{in_percent(known.low)} to {in_percent(known.high)}"
    cells = [(_ms(run.seconds), run.seconds), (in_percent(known.rmse), known.rmse), (interval, known.low),
             (in_percent(known.bias), known.bias), (in_percent(known.spread), known.spread),
             (in_percent(run.own_limits), run.own_limits), (times(run.in_equal_time), run.in_equal_time),
             (times(run.flip), run.flip), (times(run.ssim), run.ssim),
             *taken(run.work)]
    return {"name": name, "method": run.method, "settings": run.label, "front": run.front,
            "cells": [(text, sort_key(value)) for text, value in cells]}
