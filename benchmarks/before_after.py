"""Run time against error of two states of the code: `python -m benchmarks before-after BEFORE AFTER --out DIR`.

BEFORE and AFTER are folders of `refgi bench` over the same scenes and settings, made on one machine, best a scene at a
time in turn. Writes the two fronts of each scene (SCENE.svg: nothing measured there is both faster and nearer) and
ratios.md: for each scene and method the median of the times after over those before, setting by setting, and by how
much an error has changed at most.
"""

import argparse
import math
import statistics
from collections.abc import Sequence
from pathlib import Path

from benchmarks.accuracy import standalone
from refgi.bench.error import front
from refgi.bench.folder import read_result
from refgi.bench.results import Run, SceneResult
from refgi.compare.pages import Axes, Curve, curves_plot
from refgi.image import write_text

AXES = Axes("time of a frame, ms", "RMSE / mean of the truth", log_x=True, log_y=True, decimal_x=True)


def ratio_table(before: Sequence[SceneResult], after: Sequence[SceneResult]) -> str:
    """Return what became of times and errors, setting by setting, as Markdown."""
    lines = ["| scene | method | settings | time after / before | least to largest | error changed at most |",
             "|---|---|--:|--:|--:|--:|"]
    for old, new in pairs_of(before, after):
        known = {(run.method, run.changes): run for run in (*old.runs, *old.line)}
        for method in dict.fromkeys(run.method for run in (*new.runs, *new.line)):
            both = [(known[key], run) for run in (*new.runs, *new.line)
                    if run.method == method and (key := (method, run.changes)) in known]
            if both:
                ratios = [now.seconds / then.seconds for then, now in both]
                changed = max(abs(now.rmse / then.rmse - 1.0) for then, now in both)
                name = "path tracer" if method == "truth" else method
                lines.append(f"| {new.scene} | {name} | {len(both)} | {statistics.median(ratios):.2f} | "
                             f"{min(ratios):.2f} to {max(ratios):.2f} | {100 * changed:.2g} % |")
    return "\n".join(lines) + "\n"


def pairs_of(
    before: Sequence[SceneResult], after: Sequence[SceneResult]
) -> list[tuple[SceneResult, SceneResult]]:
    """Return the scenes that both results have."""
    known = {scene.scene: scene for scene in before}
    return [(known[scene.scene], scene) for scene in after if scene.scene in known]


def fronts_plot(before: SceneResult, after: SceneResult) -> str:
    """Draw the front of all methods before and after, and the path tracer stopped early after."""
    curves = [_curve("before", _front(before.runs), dashed=True), _curve("after", _front(after.runs)),
              _curve("path tracer", sorted(after.line, key=lambda run: run.seconds), dashed=True)]
    return curves_plot([curve for curve in curves if curve.x], AXES)


def _front(runs: Sequence[Run]) -> list[Run]:
    points = [(run.seconds, run.rmse) for run in runs]
    return sorted((run for run, best in zip(runs, front(points), strict=True) if best), key=lambda run: run.seconds)


def _curve(name: str, runs: Sequence[Run], *, dashed: bool = False) -> Curve:
    known = [run for run in runs if math.isfinite(run.rmse)]
    return Curve(name, [1e3 * run.seconds for run in known], [run.rmse for run in known], dashed)


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks before-after", description=__doc__)
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args(arguments)
    before, after = (_scenes(folder) for folder in (options.before, options.after))
    options.out.mkdir(parents=True, exist_ok=True)
    table = ratio_table(before, after)
    write_text(options.out / "ratios.md", table)
    for old, new in pairs_of(before, after):
        write_text(options.out / f"{new.scene}.svg", standalone(fronts_plot(old, new)))
    print(table)
    return 0


def _scenes(folder: Path) -> list[SceneResult]:
    """Return the results of a folder, or those of its folders."""
    files = [folder / "results.json"] if (folder / "results.json").exists() else sorted(folder.glob("*/results.json"))
    return [scene for path in files for scene in read_result(path).scenes]
