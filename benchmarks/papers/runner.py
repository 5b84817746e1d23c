"""`python -m benchmarks paper NAME --out DIR`: a paper's figures and tables made again beside the printed numbers.

Writes index.html with every figure beside the paper's own numbers, results.json, and each picture as PNG and EXR. One
figure is made after another, and one that fails leaves the others standing; after each all files are written whole, so
a run that is interrupted leaves everything up to there. Times are medians of interleaved runs, compared as ratios.
"""

import argparse
import base64
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from benchmarks.papers.records import (
    Cell,
    Entry,
    Figure,
    Outcome,
    Paper,
    Picture,
    Ratios,
    Reproduction,
    Table,
    choose,
    find_paper,
)
from benchmarks.papers.workbench import FULL, QUICK, Scale, Workbench
from refgi.cli.destination import Permission, folder
from refgi.cli.session import FAILED, progress, say, table
from refgi.cli.view import on_threads
from refgi.compare.comparison import require_folder
from refgi.compare.pages import PAGE as COMMON
from refgi.compare.pages import TIMES, machine, number, page_of
from refgi.errors import RefgiError, RefgiWarning
from refgi.image import canonical_json, png_bytes, write_exr, write_png, write_text
from refgi.provenance import plain, program
from refgi.provenance.record import environment

PAGE = Path(__file__).with_name("page")


def write_report(made: Reproduction, folder: Path) -> None:
    """Write index.html, whole or not at all."""
    write_text(folder / "index.html", page(made))


def page(made: Reproduction) -> str:
    """Return the page as HTML that refers to nothing outside itself; the same text for equal input."""
    style = (COMMON / "style.css").read_text("utf-8") + (PAGE / "paper.css").read_text("utf-8")
    lead = (f"{made.paper.citation}. Its figures and tables, made again and set beside the numbers that were printed. "
            "Times are ratios within each machine\N{RIGHT SINGLE QUOTATION MARK}s own run.")
    return page_of(
        "paper.html.j2", made.environment, PAGE, style=Markup(style),
        script=Markup((PAGE / "lightbox.js").read_text("utf-8")), kind=f"papers · {made.paper.name}",
        title=made.paper.title, lead=lead, facts=_facts(made),
        verdict=_verdict(made), failures=[(outcome.entry.label, f"could not be made: {outcome.failure}")
                                          for outcome in made.outcomes if outcome.figure is None],
        figures=[_figure(outcome, outcome.figure) for outcome in made.outcomes if outcome.figure is not None])


def _facts(made: Reproduction) -> list[str]:
    scale = made.scale
    return [f"{scale.name} run", f"{scale.size} {TIMES} {scale.size} pixels",
            f"shadow maps of {scale.rsm_resolution} {TIMES} {scale.rsm_resolution}",
            f"medians of {scale.repeats} interleaved rounds", machine(made.environment)]


def _verdict(made: Reproduction) -> str:
    done = len(made.outcomes) - len(made.failures)
    pending = made.asked - len(made.outcomes)
    whole = f"{done} of {made.asked} figures and tables made"
    return f"{whole}; the run ended before the other {pending}." if pending else f"{whole}."


def _figure(outcome: Outcome, figure: Figure) -> dict[str, Any]:
    return outcome.entry._asdict() | {
        "facts": figure.facts, "notes": figure.notes, "seconds": f"{number(outcome.seconds)} s",
        "pictures": [_picture(picture) for picture in figure.pictures],
        "ratios": [_ratios(ratios) for ratios in figure.ratios],
        "tables": [_table(table) for table in figure.tables],
        "plots": figure.plots,
        "settings": [(picture.title, plain(picture.settings)) for picture in figure.pictures if picture.settings],
    }


def _picture(picture: Picture) -> dict[str, Any]:
    height, width = picture.pixels.shape[:2]
    return {"title": picture.title, "said": picture.said, "width": width, "height": height,
            "source": "data:image/png;base64," + base64.b64encode(png_bytes(picture.pixels)).decode("ascii")}


def _ratios(ratios: Ratios) -> dict[str, Any]:
    longest = max((value for bar in ratios.bars for value in bar[1:] if value is not None), default=1.0) or 1.0

    def bar(value: float | None) -> dict[str, str] | None:
        return None if value is None else {"said": number(value), "share": f"{100 * value / longest:.2f}"}

    return {"title": ratios.title, "bars": [{"label": label, "here": bar(here), "paper": bar(paper)}
                                            for label, here, paper in ratios.bars]}


def _table(table: Table) -> dict[str, Any]:
    texts = {i for row in table.rows for i, cell in enumerate(row) if i and isinstance(cell, str)}
    return {"title": table.title, "columns": table.columns, "paper": table.paper, "texts": texts,
            "rows": [[_cell(cell) for cell in row] for row in table.rows]}


def _cell(cell: Cell) -> str:
    if cell is None:
        return ""
    return cell if isinstance(cell, str) else number(cell)


SCHEMA = 1
Progress = Callable[[str, float], None]


def reproduce(paper: str | Paper, *, scale: Scale = FULL, only: Sequence[str] | None = None,
              out: str | Path | None = None, progress: Progress | None = None) -> Reproduction:
    """Make a paper's figures and tables again.

    `only` has the keys of the figures to make, all where absent; `out` is a folder for the files; `progress` is called
    with (what is made, fraction done). Raises InputError if the paper or a key is unknown, or the folder cannot be
    written.
    """
    paper = find_paper(paper) if isinstance(paper, str) else paper
    entries = choose(paper, only)
    if out is not None:
        require_folder(Path(out))
    bench, outcomes, machine = Workbench(scale), [], environment()
    made = Reproduction(paper, scale, len(entries), (), machine)
    for index, entry in enumerate(entries):
        if progress is not None:
            progress(f"{entry.label} ({index + 1} of {len(entries)})", index / len(entries))
        outcomes.append(_outcome(entry, bench))
        made = Reproduction(paper, scale, len(entries), tuple(outcomes), machine)
        if out is not None:
            _write_pictures(made, outcomes[-1], Path(out))
            write_text(Path(out) / "results.json", canonical_json(as_json(made)) + "\n")
            write_report(made, Path(out))
    if progress is not None:
        progress(paper.name, 1.0)
    return made


def _outcome(entry: Entry, bench: Workbench) -> Outcome:
    started, figure, failure = time.perf_counter(), None, ""
    try:
        with warnings.catch_warnings():  # a figure says itself what the settings of its paper cost
            warnings.filterwarnings("ignore", ".* of the indirect light", RefgiWarning)
            figure = entry.make(bench)
    except RefgiError as error:
        failure = str(error)
    except Exception as error:  # a fault of one figure is not one of the others
        failure = f"{type(error).__name__}: {error}"
    return Outcome(entry, figure, failure, time.perf_counter() - started)


def _write_pictures(made: Reproduction, outcome: Outcome, folder: Path) -> None:
    for picture in () if outcome.figure is None else outcome.figure.pictures:
        png, exr = (folder / name for name in _names(outcome, picture))
        write_png(png, picture.pixels)
        if picture.planes:
            write_exr(exr, {name: np.asarray(plane, np.float32) for name, plane in picture.planes.items()},
                      {"paper": made.paper.name, "figure": outcome.entry.key, "title": picture.title,
                       "settings": plain(picture.settings), "versions": made.environment["versions"]})


def as_json(made: Reproduction) -> dict[str, Any]:
    """Return everything but the pixels as JSON values: the content of results.json."""
    content: dict[str, Any] = plain({
        "schema": SCHEMA,
        "refgi": program(),
        "paper": made.paper._asdict(),
        "scale": made.scale,
        "asked": made.asked,
        "figures": {outcome.entry.key: _figure_written(outcome) for outcome in made.outcomes},
        "environment": made.environment,
        "failures": made.failures,
        "sound": made.is_sound,
    })
    return content


def _figure_written(outcome: Outcome) -> dict[str, Any]:
    entry, figure = outcome.entry, outcome.figure
    head = {"label": entry.label, "title": entry.title, "shows": entry.shows, "seconds": outcome.seconds}
    if figure is None:
        return head | {"failure": outcome.failure}
    return head | {
        "facts": figure.facts, "notes": figure.notes,
        "ratios": [{"title": one.title, "bars": [bar._asdict() for bar in one.bars]} for one in figure.ratios],
        "tables": [{"title": one.title, "columns": one.columns, "rows": one.rows,
                    "columns_of_the_paper": [one.columns[index] for index in one.paper]} for one in figure.tables],
        "pictures": [_described(outcome, picture) for picture in figure.pictures],
    }


def _described(outcome: Outcome, picture: Picture) -> dict[str, Any]:
    png, exr = _names(outcome, picture)
    return {"title": picture.title, "said": picture.said, "settings": picture.settings,
            "files": [png, exr] if picture.planes else [png]}


def _names(outcome: Outcome, picture: Picture) -> tuple[str, str]:
    stem = f"{outcome.entry.key}_{picture.name}"
    return f"{stem}.png", f"{stem}.exr"


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks paper", description=__doc__)
    parser.add_argument("paper", help="short name of a paper, such as sii")
    parser.add_argument("--quick", action="store_true", help="smaller pictures, fewer repeats")
    parser.add_argument("--only", metavar="KEY,KEY", help="figures and tables to make, such as fig8,table1")
    parser.add_argument("--threads", type=int, help="threads of compiled kernels; all where absent")
    parser.add_argument("--out", required=True, help="folder for pictures, results.json and index.html")
    parser.add_argument("--parents", action="store_true", help="make every missing folder of --out")
    parser.add_argument("--force", action="store_true", help="overwrite files that are not from refgi")
    options = parser.parse_args(arguments)
    try:
        return _run(options)
    except RefgiError as error:
        parser.error(str(error))


def _run(options: argparse.Namespace) -> int:
    only = None if options.only is None else [key.strip() for key in options.only.split(",") if key.strip()]
    chosen = choose(find_paper(options.paper), only)
    present = (file.name for entry in chosen for file in Path(options.out).glob(f"{entry.key}_*"))
    folder(options.out, Permission(options.parents, options.force), ["results.json", "index.html", *present])
    with on_threads(options.threads), progress() as tell:
        made = reproduce(options.paper, scale=QUICK if options.quick else FULL, only=only, out=options.out,
                         progress=tell)
    for key, reason in made.failures.items():
        say(f"{key} could not be made: {reason}")
    print(f"{_text(made)}\n\nopen {options.out.rstrip('/')}/index.html")
    return 0 if made.is_sound else FAILED


def _text(made: Reproduction) -> str:
    blocks = [f"{made.paper.title} ({made.paper.citation})"]
    for outcome in made.outcomes:
        for ratios in () if outcome.figure is None else outcome.figure.ratios:
            rows: list[tuple[str, ...]] = [(ratios.title, "here", "paper")]
            rows += [(label, number(here), "" if paper is None else number(paper))
                     for label, here, paper in ratios.bars]
            blocks.append(f"{outcome.entry.label}\n{table(rows, right=frozenset({1, 2}))}")
    return "\n\n".join(blocks)
