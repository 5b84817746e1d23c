"""Time that each skip saves: `python -m benchmarks skips SCENE ... [--size 192x144] [--rounds 9]`, as Markdown.

A table a scene, with a row a skip and a column a method at its defaults; `vpl` has fewer lights, for a ray for each
pair takes long. Times are the processor's on one thread, which other work on the machine changes little. Exit code 1
where a skip changes a bit.
"""

import argparse
import statistics
import sys
import time
import warnings
from collections.abc import Iterator

from refgi.bench.skips import SkipReport, measure_skips
from refgi.errors import RefgiWarning
from refgi.jit import threads
from refgi.methods import METHODS
from refgi.scene import load_scene
from refgi.settings import from_text
from refgi.skips import SKIPS

CHANGES = {"sii": (), "multires": (), "val": (), "hssil": (), "gather": (), "vpl": ("lights=64",)}


def table(reports: list[SkipReport]) -> str:
    """Return milliseconds saved, and of whole frames; bold where every round saved some."""
    head = "| skip | " + " | ".join(report.method for report in reports) + " |\n|---|" + "--:|" * len(reports)
    frame = "| whole frame, ms | " + " | ".join(f"{1e3 * statistics.median(r.times):.3g}" for r in reports) + " |"
    rows = [f"| `{name}` | " + " | ".join(cell(report, name) for report in reports) + " |" for name in SKIPS
            if any(skip.name == name for report in reports for skip in report.skips)]
    return "\n".join([head, frame, *rows])


def cell(report: SkipReport, name: str) -> str:
    for skip in report.skips:
        if skip.name == name:
            text = f"{1e3 * skip.saves:.2g}" if skip.same_bits else "other bits"
            return f"**{text}**" if min(skip.saved) > 0 else text
    return ""


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks skips", description=__doc__)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--size", default="192x144")
    parser.add_argument("--rounds", type=int, default=9)
    options = parser.parse_args(arguments)
    width, height = map(int, options.size.split("x"))
    same = True
    for name in options.scenes:
        scene = load_scene(name)
        reports = []
        for method, changes in CHANGES.items():
            settings = from_text(METHODS[method].settings(), changes)
            with warnings.catch_warnings(), threads(1):
                warnings.simplefilter("ignore", RefgiWarning)
                reports.append(measure_skips(scene, method, settings, rounds=options.rounds, clock=time.process_time,
                                             width=width, height=height))
            print(f"{scene.name}: {method} measured", file=sys.stderr, flush=True)
        same &= all(report.same_bits for report in reports)
        print(f"### {scene.name}, {options.size}\n\n{table(reports)}\n", flush=True)
        print("| method | what is left out | ms | then | RMSE % |\n|---|---|--:|--:|--:|")
        for report in reports:
            for meaning, times, changed, error in costs(report):
                print(f"| {report.method} | {meaning} | {1e3 * statistics.median(times):.3g} | "
                      f"{1e3 * statistics.median(changed):.3g} | {100 * error:.2g} |")
        print(flush=True)
    return 0 if same else 1


def costs(report: SkipReport) -> Iterator[tuple[str, tuple[float, ...], tuple[float, ...], float]]:
    """Yield what may be left out at the cost of a difference: times before and after, s, and the difference."""
    lights = report.dim_lights
    if lights is not None:
        yield (f"the dimmest {lights.lights - lights.carrying} of {lights.lights} lights (the sum alone)", lights.times,
               lights.times_carrying, lights.error)
    for trade in report.trades:
        if trade.difference is not None:
            yield f"{trade.meaning}: `{' '.join(trade.changes)}`", trade.times, trade.times_changed, trade.difference
