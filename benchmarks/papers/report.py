"""The page of a paper: one file that works from disk, each figure beside the numbers that were printed."""

import base64
from pathlib import Path
from typing import Any

from markupsafe import Markup

from benchmarks.papers.records import Cell, Figure, Outcome, Picture, Ratios, Reproduction, Table
from refgi.compare.pages import PAGE as COMMON
from refgi.compare.pages import TIMES, machine, number, page_of
from refgi.image import png_bytes, write_text
from refgi.provenance import plain

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
