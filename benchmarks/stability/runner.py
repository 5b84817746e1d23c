"""Attack kernels, pictures, rays, files and processes: `python -m benchmarks stability [--part NAME ...] --out DIR`.

Each row of the table is a promise: the worst figure found beside its limit, where the limit comes from, and one line
that makes the worst case again. Finished tasks stand in DIR/tasks and are not run again while the sources are the same.
The whole table goes to DIR/stability.json and DIR/table.md; `--page docs/precision.md` puts it into the page. Exit
code 1 where a row keeps its limit not.
"""

import argparse
import hashlib
import importlib
import sys
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from multiprocessing import get_context
from pathlib import Path

from rich.console import Console

from benchmarks.stability.promise import Task
from refgi.provenance.record import environment
from refgi.stress.promises import Row, Stability, markdown, over_scenes, read_rows, write_rows

WAITING = ("kernels", "kills")  # parts whose tasks leave a processor idle: two are run at once
PARTS = ("kernels", "pictures", "rays", "files", "faults", "kills", "sameness")
ROOT = Path(__file__).parents[2]
BEGIN, END = "<!-- table -->", "<!-- end of table -->"


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks stability", description=__doc__)
    parser.add_argument("--part", action="append", choices=PARTS, help="repeatable; all where absent")
    parser.add_argument("--task", action="append", help="of these parts the task of this name alone; repeatable")
    parser.add_argument("--short", action="store_true", help="fewer cases: under a minute in all")
    parser.add_argument("--processes", type=int, help="tasks at once; 2 in the short form and of parts that use one")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--page", type=Path, help="page whose table is made anew")
    options = parser.parse_args(arguments)
    parts = options.part or PARTS
    beside = [part for part in parts if options.processes or options.short or part in WAITING]
    if (options.processes or 2) > 1:
        run_apart(beside, options.out, options.task, options.processes or 2, short=options.short)
    result = Stability(environment=environment(),
                       rows=tuple(run_parts(parts, options.out, options.task, short=options.short)))
    write_rows(result, options.out / "stability.json")
    (options.out / "table.md").write_text(markdown(over_scenes(result.rows)))
    if options.page:
        options.page.write_text(with_table(options.page.read_text(), markdown(over_scenes(result.rows))))
    for row in result.failed:
        print(f"FAIL {row.part}: {row.property}, {row.subject} {row.scene}: {row.figure:.3g} {row.unit} > "
              f"{row.limit:.3g}\n  {row.reproduce}")
    print(f"{len(result.rows)} rows, {len(result.failed)} failed: {options.out / 'table.md'}")
    return int(bool(result.failed))


def tasks_of(part: str, *, short: bool) -> list[Task]:
    """Return the tasks of a part; none where it is not there."""
    tasks: list[Task] = importlib.import_module(f"benchmarks.stability.{part}").tasks(short)
    return tasks


def run_parts(parts: Iterable[str], folder: Path, names: Sequence[str] | None = None, *,
              short: bool) -> Iterable[Row]:
    """Yield the rows of some parts, or of the tasks of some names; those of finished ones are read from `folder`."""
    console = Console(stderr=True)
    digest = sources_digest()
    for part in parts:
        tasks = [task for task in tasks_of(part, short=short) if names is None or task.name in names]
        if not tasks:
            raise SystemExit(f"no task of part {part} is named {', '.join(names or ())}")
        for number, task in enumerate(tasks, 1):
            kept = folder / "tasks" / digest / ("short" if short else "full") / part / f"{task.name}.json"
            if not kept.exists():
                begin = time.perf_counter()
                console.print(f"{part} {number}/{len(tasks)}: {task.name}", highlight=False)
                rows = tuple(task.run(lambda text: console.print(f"  {text}", highlight=False)))
                spent = time.perf_counter() - begin
                rows = tuple(row.model_copy(update={"seconds": round(spent / len(rows), 3)}) for row in rows)
                kept.parent.mkdir(parents=True, exist_ok=True)
                write_rows(Stability(environment={}, rows=rows), kept)
            yield from read_rows(kept).rows


def run_apart(parts: Iterable[str], folder: Path, names: Sequence[str] | None, processes: int, *, short: bool) -> None:
    """Run tasks in processes of their own, so that `run_parts` finds them finished."""
    tasks = [(part, task.name) for part in parts for task in tasks_of(part, short=short)
             if names is None or task.name in names]
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        list(pool.map(partial(_run_task, folder, short), reversed(tasks)))  # the longest of the short form come last


def _run_task(folder: Path, short: bool, task: tuple[str, str]) -> None:
    part, name = task
    for _ in run_parts([part], folder, [name], short=short):
        pass


@cache
def sources_digest() -> str:
    """Return a digest of all that a figure may depend on: the package and these benchmarks."""
    digest = hashlib.sha256()
    for file in sorted([*ROOT.glob("refgi/**/*.py"), *ROOT.glob("benchmarks/stability/*.py")]):
        digest.update(f"{file.relative_to(ROOT)}\0".encode() + file.read_bytes())
    return digest.hexdigest()[:16]


def with_table(page: str, table: str) -> str:
    """Return a page with its table made anew, between its marks."""
    head, _, rest = page.partition(BEGIN)
    _, mark, tail = rest.partition(END)
    if not mark:
        raise ValueError(f"expected {BEGIN} and {END} in the page")
    return f"{head}{BEGIN}\n{table}{END}{tail}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
