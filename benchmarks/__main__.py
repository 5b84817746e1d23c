"""Run the benchmarks: `python -m benchmarks [--quick] [--out DIR] [--against results.json] [topic ...]`.

Every figure is a ratio within one run, or reported without an aim. Results: a table here, results.json in --out.
`python -m benchmarks paper NAME --out DIR` makes a paper's figures and tables again; `python -m benchmarks mutate` puts
faults into a copy of the sources and counts those that no test catches; `python -m benchmarks kit-score` puts bugs into
ports and counts those that the conformance kit names; `python -m benchmarks kill-batch` kills a batch at random
moments and counts what is lost; `python -m benchmarks skips` tells what each skip saves; `python -m benchmarks
accuracy` makes benchmarks/results again; `python -m benchmarks before-after` holds two results of `refgi bench` against
each other; `python -m benchmarks records` lists what was measured by older code, and makes it again;
`python -m benchmarks stability` tells what is promised of numbers, files and processes, and the worst that
was found.
"""

import argparse
import importlib
import json
import platform
import sys
from pathlib import Path

import numba
import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.harness import Row

FOLDER = Path(__file__).parent
COMMANDS = {"accuracy": "benchmarks.accuracy", "before-after": "benchmarks.before_after",
            "paper": "benchmarks.papers.runner", "mutate": "benchmarks.mutate.runner",
            "kit-score": "benchmarks.kit_score", "kill-batch": "benchmarks.kill_batch", "skips": "benchmarks.skips",
            "records": "benchmarks.records", "stability": "benchmarks.stability.runner"}


def topics() -> list[str]:
    """Return the names of the modules that have `rows`."""
    return sorted(path.stem for path in FOLDER.glob("*.py") if "\ndef rows(" in path.read_text("utf-8"))


def main() -> int:
    if sys.argv[1:2] and sys.argv[1] in COMMANDS:
        return importlib.import_module(COMMANDS[sys.argv[1]]).main(sys.argv[2:])
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("topics", nargs="*", metavar="topic", help=f"of {', '.join(topics())}; all if none")
    parser.add_argument("--quick", action="store_true", help="smaller sizes, fewer repeats")
    parser.add_argument("--out", type=Path, help="folder for results.json")
    parser.add_argument("--against", type=Path, help="results.json of another run: values over its values")
    options = parser.parse_args()
    if unknown := set(options.topics) - set(topics()):
        parser.error(f"no benchmark named {', '.join(sorted(unknown))}; there are {', '.join(topics())}")
    console = Console()
    before = _values(options.against) if options.against else {}
    results: dict[str, list[Row]] = {}
    for topic in options.topics or topics():
        module = importlib.import_module(f"benchmarks.{topic}")
        console.print(f"[bold]{topic}[/bold]  {(module.__doc__ or '').splitlines()[0]}")
        results[topic] = list(module.rows(options.quick))
        console.print(_table(results[topic], before))
    if options.out:
        _write(options.out, results)
        console.print(f"written: {options.out / 'results.json'}")
    return 0


def _table(rows: list[Row], before: dict[str, float]) -> Table:
    table = Table("what", "value", "unit", "aim", "", "note", *(["over before"] if before else []), box=None)
    for row in rows:
        verdict = {None: "", True: "[green]met[/green]", False: "[red]short[/red]"}[row.meets_aim]
        over = [f"{row.value / before[row.name]:.3g}" if before.get(row.name) else "-"] if before else []
        table.add_row(row.name, f"{row.value:.4g}", row.unit, row.aim, verdict, row.note, *over)
    return table


def _values(place: Path) -> dict[str, float]:
    """Return the values of an earlier run by their rows' names."""
    topics = json.loads(place.read_text())["results"]
    return {row["name"]: row["value"] for rows in topics.values() for row in rows}


def _write(folder: Path, results: dict[str, list[Row]]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    machine = {"python": platform.python_version(), "numba": numba.__version__, "numpy": np.__version__,
               "machine": platform.machine(), "threads": numba.get_num_threads()}
    rows = {topic: [row._asdict() | {"meets_aim": row.meets_aim} for row in found] for topic, found in results.items()}
    (folder / "results.json").write_text(json.dumps({"machine": machine, "results": rows}, indent=2) + "\n")


if __name__ == "__main__":
    sys.exit(main())
