"""The page of `refgi stress`: the table of promises, and pictures of the worst row of each method."""

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from refgi.compare.pages import number, page_of, sort_key
from refgi.image import write_text
from refgi.image.picture import png_bytes
from refgi.stress.promises import Row, Stability, strain
from refgi.stress.run import Found, Silence
from refgi.types import Array

FILES = Path(__file__).parent / "files"
COLUMNS = ("of", "after", "", "worst", "limit", "where the limit comes from", "what it is")
RED, BLUE, MARK = np.array([1.0, 0.25, 0.15]), np.array([0.2, 0.45, 1.0]), np.array([1.0, 0.9, 0.0])
BRIGHT = 0.35  # what the mean is shown as, linear


def write_page(result: Stability, found: Sequence[Found], silent: Sequence[Silence], folder: Path, title: str) -> None:
    """Write index.html of a run, whole or not at all: rows with their pictures, and what methods were not asked."""
    page = page_of(
        "stress.html.j2", result.environment, FILES, kind="stress", title=f"What is promised of {title}",
        facts=[f"{len(result.rows)} promises"],
        verdict=markdown_summary(result),
        failures=[(row.subject, f"{row.property}: {_figure(row)}, limit {row.limit:.3g}") for row in result.failed],
        methods=list(dict.fromkeys(row.subject for row in result.rows)), matrix=_matrix(result.rows),
        columns=COLUMNS, rows=[_cells(row) for row in result.rows], shown=[_shown(one) for one in _worst(found)],
        silent=[(f"{one.method}: {one.change}", one.why) for one in silent])
    write_text(folder / "index.html", page)


def markdown_summary(result: Stability) -> str:
    """Return how many promises are kept, in a sentence."""
    count = len(result.failed)
    if not count:
        return f"All {len(result.rows)} promises are kept on this scene."
    return f"{count} of {len(result.rows)} promises {'is' if count == 1 else 'are'} broken on this scene."


def _figure(row: Row) -> str:
    return f"{number(row.figure)} {row.unit}".strip()


def _cells(row: Row) -> dict[str, Any]:
    return {"of": row.subject, "property": row.property, "passed": row.passed, "figure": _figure(row),
            "short": number(row.figure),
            "sort": sort_key(strain(row)), "limit": number(row.limit), "source": f"{row.kind}: {row.source}",
            "detail": row.detail}


def _matrix(rows: Sequence[Row]) -> list[tuple[str, list[dict[str, Any] | None]]]:
    """Return for each property the cells of all subjects; none where one was not asked."""
    subjects = dict.fromkeys(row.subject for row in rows)
    known = {(row.property, row.subject): _cells(row) for row in rows}
    return [(name, [known.get((name, subject)) for subject in subjects])
            for name in dict.fromkeys(row.property for row in rows)]


def _worst(found: Sequence[Found]) -> list[Found]:
    """Return broken rows that have pictures, and of each method the one nearest to its limit."""
    seen = [one for one in found if one.shown is not None]
    nearest = {one.row.subject: one for one in sorted(seen, key=lambda one: strain(one.row))}
    return [one for one in seen if not one.row.passed or nearest[one.row.subject] is one]


def _shown(one: Found) -> dict[str, Any]:
    assert one.shown is not None
    row, (before, after) = one.row, (np.asarray(plane, np.float64) for plane in one.shown)
    apart = np.abs(after - before).max(axis=0)
    place = np.unravel_index(int(np.argmax(np.where(np.isfinite(apart), apart, np.inf))), apart.shape)
    values = ", ".join(f"{before[c][place]:.6g} and {after[c][place]:.6g}" for c in range(3))
    mean = float(before.mean()) or 1.0
    return {"name": f"{row.subject}-{row.property}".replace(" ", "-"), "of": row.subject, "property": row.property,
            "said": f"{_figure(row)}, limit {number(row.limit)}; pixel ({place[1]}, {place[0]}) has {values} W/m²",
            "width": before.shape[2], "reproduce": row.reproduce,
            "pictures": [("as it is", _picture(before * (BRIGHT / mean))),
                         ("after the change", _picture(after * (BRIGHT / mean))),
                         ("difference", _picture(_difference(after - before, place)))]}


def _picture(linear: Array) -> str:
    finite = np.nan_to_num(np.asarray(linear, np.float32), posinf=1e30)
    return "data:image/png;base64," + base64.b64encode(png_bytes(np.moveaxis(finite, 0, -1))).decode()


def _difference(apart: Array, place: Any) -> Array:
    """Return the differences in colour, scaled to the largest, with a ring around the worst pixel, (3, h, w)."""
    apart = np.nan_to_num(apart.mean(axis=0))
    share = apart / (np.abs(apart).max() or 1.0)
    colour: Array = np.where(share[None] > 0, RED[:, None, None], BLUE[:, None, None]) * np.abs(share)
    rows, columns = np.indices(apart.shape)
    ring = np.abs(np.hypot(rows - place[0], columns - place[1]) - 4.0) < 0.6
    colour[:, ring] = MARK[:, None]
    return colour
