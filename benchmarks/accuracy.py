"""Run time against error on six scenes: `python -m benchmarks accuracy --out benchmarks/results`, in under an hour.

Writes results.json, results.csv and results.md as `refgi bench` does, the plots as SVG, and cheapest.md: for each scene
what is cheapest at some errors. docs/accuracy.md reads them aloud. Scenes of the data folder are left out where it is
missing.
"""

import argparse
import math
import sys
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

from refgi.bench.grid import Grid, built_in
from refgi.bench.measure import bench_scene
from refgi.bench.overview import Place, overview
from refgi.bench.report import plot_of
from refgi.bench.results import Result, Run, SceneResult, write_results
from refgi.bench.split import with_splits
from refgi.bench.split_plot import bars
from refgi.cli.session import progress
from refgi.compare.provenance import environment
from refgi.compare.report import number
from refgi.errors import RefgiWarning
from refgi.image import write_text
from refgi.scene import load_scene
from refgi.truth import TruthSettings

DATA = Path(__file__).parents[1].parent / "shared" / "data"
SCENES = ("cornell_box", "atrium", "cornell_horse.json", "sponza.json", "kitchen.json", "dragon_bunny.json")
SIZE = {"width": 128, "height": 96, "shadows": "exact"}
SPLIT_SIZE = {"width": 64, "height": 48, "shadows": "exact"}  # `val` with a ray to each light is slow
TRUTH = TruthSettings(samples=2**31, seconds=25.0, target_error=0.005)
SPLIT_TRUTH = TruthSettings(samples=2**31, seconds=10.0, target_error=0.005)
ROUNDS, SPLIT_SEEDS = 3, 2
LEVELS = (0.3, 0.1, 0.03, 0.01)


Tell = Callable[[str, float], None]


def present() -> list[str]:
    """Return what the scenes that are there are loaded from."""
    paths = (DATA / name if name.endswith(".json") else Path(name) for name in SCENES)
    return [str(path) for path in paths if path.suffix != ".json" or path.exists()]


def error_of(run: Run) -> float:
    """Return the RMSE of a run without the truth's noise, over the truth's mean."""
    known = run.errors["truth"]
    return math.inf if known.rmse is None else math.sqrt(max(0.0, known.rmse**2 - (known.noise or 0.0) ** 2))


def cheapest(runs: Sequence[Run], level: float) -> str:
    """Return the fastest run of at most an error; a dash where there is none."""
    best = min((run for run in runs if error_of(run) <= level), key=lambda run: run.seconds, default=None)
    if best is None:
        return "-"
    name = "path tracer" if best.method == "truth" else best.method
    return f"{name}, {best.label}: {number(1e3 * best.seconds)} ms"


def cheapest_table(scenes: Sequence[SceneResult]) -> str:
    """Return what is cheapest at each error, among all and among the methods, as Markdown."""
    lines = ["| scene | error at most | cheapest of all | cheapest method |", "|---|--:|---|---|"]
    for scene in scenes:
        for level in LEVELS:
            lines.append(f"| {scene.scene} | {100 * level:g} % | {cheapest((*scene.runs, *scene.line), level)} | "
                         f"{cheapest(scene.runs, level)} |")
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


def write(result: Result, folder: Path) -> None:
    """Write tables and plots of what was measured so far."""
    (folder / "plots").mkdir(parents=True, exist_ok=True)
    write_results(result, folder)
    write_text(folder / "cheapest.md", cheapest_table(result.scenes))
    write_text(folder / "nearest.md", nearest_table(result.scenes))
    for scene in result.scenes:
        write_text(folder / "plots" / f"{scene.scene}.svg", plot_of(scene))
        if scene.splits:
            write_text(folder / "plots" / f"{scene.scene}_split.svg", bars(scene.splits))
    write_text(folder / "plots" / "all.svg", str(overview([Place(one, "") for one in result.scenes])["plot"]))


def measured(source: str, grid: Grid, tell: Tell) -> SceneResult:
    """Run the grid on one scene, then split the errors of each method's default and knee."""
    scene = load_scene(source)
    found = bench_scene(scene, grid, rounds=ROUNDS, truth=TRUTH, tell=tell, source=source, **SIZE)
    return with_splits(found, scene, grid, seeds=SPLIT_SEEDS, truth=SPLIT_TRUTH, tell=tell, **SPLIT_SIZE)


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
