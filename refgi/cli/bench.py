"""`refgi bench`: a paper's figures and tables, made again beside the printed numbers."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from refgi.cli.options import speech, writing
from refgi.cli.session import FAILED, Session, say

if TYPE_CHECKING:
    from refgi.papers.outcome import Reproduction


@click.command("bench")
@click.option("--paper", required=True, help="Short name of a paper, such as sii.")
@click.option("--quick", is_flag=True, help="Smaller pictures, fewer repeats.")
@click.option("--only", metavar="KEY,KEY", help="Figures and tables to make, such as fig8,table1; all where absent.")
@click.option("--threads", type=click.IntRange(1), help="Threads of compiled kernels; all where absent.")
@click.option("--out", required=True, help="Folder for pictures, results.json and index.html.")
@writing
@speech
@click.pass_obj
def _bench(session: Session, /, paper: str, quick: bool, only: str | None, threads: int | None, out: str,
           parents: bool, force: bool) -> int:
    """Make a paper's figures and tables again.

    Writes index.html with every figure beside the paper's own numbers, results.json, and each picture as PNG and EXR.

    Times are medians of interleaved runs and are compared as ratios. A figure that fails leaves the others standing.
    """
    from refgi.cli.destination import Permission, folder
    from refgi.cli.options import on_threads
    from refgi.cli.session import progress
    from refgi.papers.catalogue import choose, find_paper
    from refgi.papers.runner import reproduce
    from refgi.papers.workbench import FULL, QUICK

    keys = None if only is None else [key.strip() for key in only.split(",") if key.strip()]
    chosen = choose(find_paper(paper), keys)
    there = (file.name for entry in chosen for file in Path(out).glob(f"{entry.key}_*"))
    folder(out, Permission(parents, force), ["results.json", "index.html", *there])
    with on_threads(threads), progress() as tell:
        made = reproduce(paper, scale=QUICK if quick else FULL, only=keys, out=out, progress=tell)
    _report(session, made, out)
    return 0 if made.is_sound else FAILED


command = _bench


def _report(session: Session, made: "Reproduction", out: str) -> None:
    from refgi.papers.files import as_json

    for key, reason in made.failures.items():
        say(f"{key} could not be made: {reason}")
    session.result(f"{_text(made)}\n\nopen {out.rstrip('/')}/index.html", as_json(made) | {"out": out})


def _text(made: "Reproduction") -> str:
    from refgi.cli.session import table
    from refgi.compare.report import number

    blocks = [f"{made.paper.title} ({made.paper.citation})"]
    for outcome in made.outcomes:
        for ratios in () if outcome.figure is None else outcome.figure.ratios:
            rows: list[tuple[str, ...]] = [(ratios.title, "here", "paper")]
            rows += [(label, number(here), "" if paper is None else number(paper))
                     for label, here, paper in ratios.bars]
            blocks.append(f"{outcome.entry.label}\n{table(rows, right=frozenset({1, 2}))}")
    return "\n\n".join(blocks)
