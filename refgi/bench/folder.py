"""Folders of results: their files and pages, of one bench or batch, or of several with an index over all scenes."""

import csv
import io
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import quote

import pydantic

from refgi.bench.grid import FILES
from refgi.bench.report import Place, overview, write_page
from refgi.bench.results import LIMITED, Result, markdown, rmse_against
from refgi.compare.pages import machine, page_of
from refgi.errors import InputError
from refgi.image import write_text

COLUMNS = ("scene", "method", "settings", "seconds", "fastest", "slowest", "rmse", "low", "high", "bias", "spread",
           "noise", "in_doubt", *(f"rmse_{name}" for name in LIMITED), "pairs", "rays", "bytes", "peak_bytes", "flip",
           "ssim", "against_truth_in_equal_time", "on_the_front", "refgi_format")
RESULTS, INDEX = "results.json", "index.html"
SECONDS_BETWEEN_LOOKS = 2.0
REFRESH = 10  # s after which a browser reads a page again that is kept up to date

Say = Callable[[str], None]


class Held(NamedTuple):
    """A folder with results."""

    folder: Path
    result: Result


def read_result(file: Path, option: str | None = None) -> Result:
    """Read the results.json of a bench or batch; an InputError names the first key that is wrong, or an option."""
    try:
        return Result.model_validate_json(file.read_bytes())
    except OSError as error:
        raise InputError(f"{file}: cannot be read: {error.strerror}", file=str(file), key=option) from error
    except pydantic.ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(map(str, first["loc"])) or "JSON"
        raise InputError(f"{file}: {key}: expected results of `refgi bench` or `refgi batch`, got another kind: "
                         f"{first['msg'].lower()}", file=str(file), key=option or key) from error


def write_results(result: Result, folder: Path) -> None:
    """Write results.json, results.csv and results.md, each whole or not at all; InputError where it cannot be done."""
    table = io.StringIO()
    writer = csv.DictWriter(table, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows_of(result))
    write_text(folder / "results.json", result.model_dump_json(indent=1) + "\n")
    write_text(folder / "results.csv", table.getvalue())
    write_text(folder / "results.md", markdown(result))


def rows_of(result: Result) -> Iterable[dict[str, Any]]:
    """Yield one row a run by `COLUMNS`, the path tracer's among them; None where there is nothing to say."""
    for scene in result.scenes:
        for run in (*scene.runs, *scene.line):
            yield {"scene": scene.scene, "method": run.method, "settings": run.label, "seconds": run.seconds,
                   "fastest": min(run.times), "slowest": max(run.times), **run.errors["truth"].model_dump(),
                   **{f"rmse_{name}": rmse_against(run, name) for name in LIMITED},
                   **({} if run.work is None else run.work.model_dump()), "flip": run.flip, "ssim": run.ssim,
                   "against_truth_in_equal_time": run.in_equal_time, "on_the_front": run.front,
                   "refgi_format": result.refgi}


def folders_of(folder: Path) -> list[Path]:
    """Return the folders with results: the folder itself, or those in it by name; InputError if there are none."""
    if (folder / RESULTS).is_file():
        return [folder]
    found = sorted(file.parent for file in folder.glob(f"*/{RESULTS}"))
    if not found:
        raise InputError(f"{folder}: expected {RESULTS}, or folders with one, got neither", file=str(folder))
    return found


def remake(folder: Path, folders: Sequence[Path], refresh: int | None = None) -> list[Held]:
    """Write the pages of folders with results, and the index over them; browsers read them each `refresh` seconds."""
    held = [Held(one, read_result(one / RESULTS)) for one in folders]
    for one in held:
        write_page(one.result, one.folder, refresh)
    if list(folders) != [folder]:
        write_text(folder / INDEX, index_page(folder, held, refresh))
    return held


def index_page(folder: Path, held: Sequence[Held], refresh: int | None = None) -> str:
    """Return the HTML page over all scenes of several folders below `folder`; it leads to their own pages."""
    places = [Place(scene, f"{quote(one.folder.name)}/{INDEX}#scene{number}")
              for one in held for number, scene in enumerate(one.result.scenes, 1)]
    made = [{"name": one.folder.name, "machine": machine(one.result.environment),
             "runs": sum(len(scene.runs) for scene in one.result.scenes)} for one in held]
    return page_of("index.html.j2", held[0].result.environment, FILES, kind="report", title=folder.resolve().name,
                   lead=f"{len(places)} scenes of {len(held)} folders", overview=overview(places), held=made,
                   refresh=refresh)


def watch(folder: Path, say: Say, wait: Callable[[float], None] = time.sleep) -> None:
    """Keep pages of folders up to date until interrupted; `say` gets a line a time, `wait` seconds between looks."""
    known: dict[Path, int] = {}
    try:
        while True:
            if (now := _stamps(folder)) != known:
                say(_remade(folder, REFRESH))
                known = now
            wait(SECONDS_BETWEEN_LOOKS)
    except KeyboardInterrupt:
        say(_remade(folder, None))


def _remade(folder: Path, refresh: int | None) -> str:
    try:
        return "; ".join(_counted(remake(folder, folders_of(folder), refresh)))
    except InputError as error:
        return str(error)


def _counted(held: Sequence[Held]) -> Iterator[str]:
    for one in held:
        yield f"{one.folder}: {sum(len(scene.runs) for scene in one.result.scenes)} runs"


def _stamps(folder: Path) -> dict[Path, int]:
    files = [folder / RESULTS, *folder.glob(f"*/{RESULTS}")]
    return {file: file.stat().st_mtime_ns for file in files if file.is_file()}
