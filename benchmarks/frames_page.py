"""Write the tables and the plot of docs/frames.md: `python -m benchmarks.frames_page FOLDER`.

FOLDER holds results.json of `python -m benchmarks frames modes scaling`. Tables go to benchmarks/results as frames.md,
stages.md and modes.md, the plot to docs/images.
"""

import json
import re
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

from benchmarks.frames import MOTIONS, SUBJECTS
from benchmarks.harness import Row
from benchmarks.modes import MODES, SCENES
from benchmarks.records import ROOT
from benchmarks.scaling import draw
from refgi.image import write_text

TABLES, PLOT = ROOT / "benchmarks" / "results", ROOT / "docs" / "images" / "scaling.svg"
MOVING = [name for name, motion in MOTIONS.items() if any(motion)]


def frames_table(rows: Mapping[str, Row]) -> str:
    """Return frames a second by what moves, with the range where both do, and the error, as Markdown."""
    lines = [f"| | {' | '.join(MOVING)} | paper | RMSE / mean |", "|---|" + "--:|" * len(MOVING) + "---|--:|"]
    for name, subject in SUBJECTS.items():
        rates = [f"{rows[f'{name}: {motion}'].value:.3g}" for motion in MOVING]
        rates[0] += f" ({rows[f'{name}: {MOVING[0]}'].note.partition(';')[0]})"
        error = next(row.value for row in rows.values() if row.name.startswith(f"{name}: RMSE"))
        lines.append(f"| {name} | {' | '.join(rates)} | {subject.paper} | {100 * error:.2g} % |")
    return "\n".join(lines) + "\n"


def stages_table(rows: Mapping[str, Row]) -> str:
    """Return the stages that take most of a frame in which light and camera move, ms, as Markdown."""
    return "\n".join(["| frame | ms |", "|---|---|", *(
        f"| {name} | {rows[f'{name}: {MOVING[0]}'].note.partition('ms: ')[2]} |" for name in SUBJECTS)]) + "\n"


def modes_table(rows: Mapping[str, Row]) -> str:
    """Return error and speed of each mode on each scene, as Markdown."""
    lines = [f"| mode | {' | '.join(SCENES)} |", "|---|" + "--:|" * len(SCENES)]
    for mode in MODES:
        found = [rows[f"{scene}: {mode}"] for scene in SCENES]
        lines.append(f"| {mode} | " + " | ".join(
            f"{100 * row.value:.2g} %, {re.match(r'[0-9.]+', row.note)[0]}" for row in found) + " |")
    return "\n".join(lines) + "\n"


def by_name(found: Iterable[Mapping[str, object]]) -> dict[str, Row]:
    """Return rows of results.json by their names."""
    return {row.name: row for row in (Row(**{key: one[key] for key in Row._fields}) for one in found)}


def main(folder: Path, tables: Path = TABLES, plot: Path = PLOT) -> None:
    """Write what a folder's results.json tells."""
    results = json.loads((folder / "results.json").read_text())["results"]
    found = {topic: by_name(rows) for topic, rows in results.items()}
    write_text(tables / "frames.md", frames_table(found["frames"]))
    write_text(tables / "stages.md", stages_table(found["frames"]))
    write_text(tables / "modes.md", modes_table(found["modes"]))
    draw(folder, plot)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
