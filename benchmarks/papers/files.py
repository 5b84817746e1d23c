"""A paper's files: PNG and EXR of every picture, and results.json with everything else; each whole or not at all."""

from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.papers.outcome import Outcome, Reproduction
from benchmarks.papers.records import Picture, Ratios, Table
from refgi.image import canonical_json, write_exr, write_png, write_text
from refgi.provenance import plain, program

SCHEMA = 1


def write_pictures(made: Reproduction, outcome: Outcome, folder: Path) -> None:
    """Write the pictures of one figure.

    Parameters
    ----------
    made : Reproduction
        Whose figure it is.
    outcome : Outcome
        The figure; nothing is written of one that failed.
    folder : Path
        An existing folder.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    for picture in () if outcome.figure is None else outcome.figure.pictures:
        png, exr = (folder / name for name in _names(outcome, picture))
        write_png(png, picture.pixels)
        if picture.planes:
            write_exr(exr, {name: np.asarray(plane, np.float32) for name, plane in picture.planes.items()},
                      {"paper": made.paper.name, "figure": outcome.entry.key, "title": picture.title,
                       "settings": plain(picture.settings), "versions": made.environment["versions"]})


def write_record(made: Reproduction, folder: Path) -> None:
    """Write results.json.

    Parameters
    ----------
    made : Reproduction
        What `reproduce` gave, whole or as far as it has come.
    folder : Path
        An existing folder.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    write_text(folder / "results.json", canonical_json(as_json(made)) + "\n")


def as_json(made: Reproduction) -> dict[str, Any]:
    """Return everything but the pixels as JSON values.

    Parameters
    ----------
    made : Reproduction
        What `reproduce` gave.

    Returns
    -------
    dict
        The content of results.json.
    """
    content: dict[str, Any] = plain({
        "schema": SCHEMA,
        "refgi": program(),
        "paper": {"name": made.paper.name, "title": made.paper.title, "citation": made.paper.citation},
        "scale": made.scale,
        "asked": made.asked,
        "figures": {outcome.entry.key: _figure(outcome) for outcome in made.outcomes},
        "environment": made.environment,
        "failures": made.failures,
        "sound": made.is_sound,
    })
    return content


def _figure(outcome: Outcome) -> dict[str, Any]:
    head = {"label": outcome.entry.label, "title": outcome.entry.title, "seconds": outcome.seconds}
    figure = outcome.figure
    if figure is None:
        return head | {"failure": outcome.failure}
    return head | {
        "shows": figure.shows, "facts": figure.facts, "notes": figure.notes,
        "ratios": [_ratios(ratios) for ratios in figure.ratios],
        "tables": [_table(table) for table in figure.tables],
        "pictures": [_picture(outcome, picture) for picture in figure.pictures],
    }


def _ratios(ratios: Ratios) -> dict[str, Any]:
    return {"title": ratios.title, "bars": [bar._asdict() for bar in ratios.bars]}


def _table(table: Table) -> dict[str, Any]:
    return {"title": table.title, "columns": table.columns, "rows": table.rows,
            "columns_of_the_paper": [table.columns[index] for index in sorted(table.paper)]}


def _picture(outcome: Outcome, picture: Picture) -> dict[str, Any]:
    png, exr = _names(outcome, picture)
    return {"title": picture.title, "said": picture.said, "settings": picture.settings,
            "files": [png, exr] if picture.planes else [png]}


def _names(outcome: Outcome, picture: Picture) -> tuple[str, str]:
    stem = f"{outcome.entry.key}_{picture.name}"
    return f"{stem}.png", f"{stem}.exr"
