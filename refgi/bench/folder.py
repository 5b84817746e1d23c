"""Folders of results and their pages: one bench or batch, or a folder of such folders with an index over all scenes."""

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from refgi.bench.grid import FILES
from refgi.bench.report import Place, overview, write_page
from refgi.bench.results import Result, read_result
from refgi.compare.pages import machine, page_of
from refgi.errors import InputError
from refgi.image import write_text

RESULTS, INDEX = "results.json", "index.html"
SECONDS_BETWEEN_LOOKS = 2.0
REFRESH = 10  # s after which a browser reads a page again that is kept up to date

Say = Callable[[str], None]


class Held(NamedTuple):
    """A folder with results."""

    folder: Path
    result: Result


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
