"""Run time against error on six scenes: `python -m benchmarks accuracy --out benchmarks/results`, in under an hour.

Writes results.json, results.csv and results.md as `refgi bench` does, the plots as SVG, and cheapest.md: for each scene
what is cheapest at some errors. docs/accuracy.md reads them aloud. Scenes of the data folder are left out where it is
missing.
"""

import argparse
import math
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.harness import real_scene
from refgi.bench.error import without_noise
from refgi.bench.folder import write_results
from refgi.bench.grid import Grid, built_in
from refgi.bench.measure import bench_scene
from refgi.bench.report import Place, bars, overview, plot_of
from refgi.bench.results import Result, Run, SceneResult
from refgi.bench.split import with_splits
from refgi.cli.session import progress
from refgi.compare.pages import PAGE, number
from refgi.errors import RefgiWarning
from refgi.image import write_text
from refgi.provenance.record import environment
from refgi.scene import load_scene
from refgi.truth import TruthSettings

BUILT_IN, REAL = ("cornell_box", "atrium"), ("cornell_horse", "sponza", "kitchen", "dragon_bunny")
SIZE = {"width": 128, "height": 96, "shadows": "exact"}
ON_SCREEN = ("hssil", "gather")  # their errors depend on how many pixels there are
SMALL = {"width": 48, "height": 36, "shadows": "exact"}  # of what is split otherwise: a ray to each light is slow
TRUTH = TruthSettings(samples=2**31, seconds=20.0, target_error=0.007)
SPLIT_TRUTH = TruthSettings(samples=2**31, seconds=6.0, target_error=0.01)
ROUNDS, SPLIT_SEEDS = 3, 2
LEVELS = (0.3, 0.1, 0.03, 0.01)


Tell = Callable[[str, float], None]


def present() -> list[str]:
    """Return what the scenes that are there are loaded from."""
    return [*BUILT_IN, *(str(path) for name in REAL if (path := real_scene(name)))]


def error_of(run: Run) -> float:
    """Return the RMSE of a run without the truth's noise, over the truth's mean."""
    known = run.errors["truth"]
    return math.inf if known.rmse is None else without_noise(known.rmse, known.noise or 0.0)


def cheapest(runs: Sequence[Run], level: float) -> str:
    """Return the fastest run of at most an error; a dash where there is none."""
    best = min((run for run in runs if error_of(run) <= level), key=lambda run: run.seconds, default=None)
    if best is None:
        return "-"
    name = "path tracer" if best.method == "truth" else best.method
    return f"{name}, {best.label}: {number(1e3 * best.seconds)} ms"


def extrapolated(line: Sequence[Run], level: float) -> str:
    """Return when the path tracer comes to an error that its last stop has not, by the root of time."""
    last = max(line, key=lambda run: run.seconds, default=None)
    if last is None or not math.isfinite(error_of(last)):
        return "-"
    return f"path tracer, some {number(last.seconds * (error_of(last) / level) ** 2)} s"


def cheapest_table(scenes: Sequence[SceneResult]) -> str:
    """Return what is cheapest at each error, among all and among the methods, as Markdown."""
    lines = ["| scene | error at most | cheapest of all | cheapest method |", "|---|--:|---|---|"]
    for scene in scenes:
        for level in LEVELS:
            best = cheapest((*scene.runs, *scene.line), level)
            best = extrapolated(scene.line, level) if best == "-" else best
            lines.append(f"| {scene.scene} | {100 * level:g} % | {best} | {cheapest(scene.runs, level)} |")
    return "\n".join(lines) + "\n"


def nearest_table(scenes: Sequence[SceneResult]) -> str:
    """Return how near each method comes on each scene and in which time, as Markdown."""
    methods = list(dict.fromkeys(run.method for scene in scenes for run in scene.runs))
    lines = ["| scene | " + " | ".join(methods) + " |", "|---|" + "--:|" * len(methods)]
    for scene in scenes:
        cells = []
        for name in methods:
            best = min((run for run in scene.runs if run.method == name), key=error_of, default=None)
            cells.append("-" if best is None else f"{100 * error_of(best):.3g} % in {number(1e3 * best.seconds)} ms")
        lines.append(f"| {scene.scene} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def standalone(svg: str) -> str:
    """Return a plot of a page as a file of its own, in the page's light colours."""
    colours = dict(reversed(re.findall(r"--(\w+): (#\w{6})", (PAGE / "style.css").read_text("utf-8"))))
    drawn = re.sub(r"var\(--(\w+)\)", lambda found: colours[found[1]], svg)
    names = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    look = f"background: {colours['card']}; color: {colours['ink']}; font-family: sans-serif"
    return drawn.replace("<svg ", f'<svg {names} style="{look}" ', 1)


def write(result: Result, folder: Path) -> None:
    """Write tables and plots of what was measured so far."""
    (folder / "plots").mkdir(parents=True, exist_ok=True)
    write_results(result, folder)
    write_text(folder / "cheapest.md", cheapest_table(result.scenes))
    write_text(folder / "nearest.md", nearest_table(result.scenes))
    for scene in result.scenes:
        write_text(folder / "plots" / f"{scene.scene}.svg", standalone(plot_of(scene)))
        if scene.splits:
            write_text(folder / "plots" / f"{scene.scene}_split.svg", standalone(bars(scene.splits)))
    every = overview([Place(one, "") for one in result.scenes])["plot"]
    write_text(folder / "plots" / "all.svg", standalone(str(every)))


def measured(source: str, grid: Grid, tell: Tell) -> SceneResult:
    """Run the grid on one scene, then split the error of each curve's knee."""
    scene = load_scene(source)
    found = bench_scene(scene, grid, rounds=ROUNDS, truth=TRUTH, tell=tell, source=source, **SIZE)
    methods = dict.fromkeys(run.method for run in found.runs)
    for names, size in ((ON_SCREEN, SIZE), ([name for name in methods if name not in ON_SCREEN], SMALL)):
        part = found.model_copy(update={"runs": tuple(run for run in found.runs if run.method in names), "splits": ()})
        split = with_splits(part, scene, grid, seeds=SPLIT_SEEDS, truth=SPLIT_TRUTH, tell=tell, defaults=False, **size)
        found = found.model_copy(update={"splits": (*found.splits, *split.splits), "failures": split.failures})
    return found


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks accuracy", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--scenes", nargs="+", help="in place of the six")
    options = parser.parse_args(arguments)
    grid, found = built_in(quick=False), []
    with progress() as tell, warnings.catch_warnings():
        warnings.simplefilter("ignore", RefgiWarning)  # of each of many settings in each round
        for source in options.scenes or present():
            def told(what: str, done: float, name: str = Path(source).stem) -> None:
                tell(f"{name}: {what}", done)

            found.append(measured(source, grid, told))
            write(Result(environment=environment(), scenes=tuple(found)), options.out)
            print(f"{found[-1].scene}: {len(found[-1].runs)} runs", file=sys.stderr, flush=True)
    print((options.out / "cheapest.md").read_text(encoding="utf-8"))
    return 0
