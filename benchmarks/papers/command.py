"""`python -m benchmarks paper NAME --out DIR`: a paper's figures and tables made again beside the printed numbers.

Writes index.html with every figure beside the paper's own numbers, results.json, and each picture as PNG and EXR. Times
are medians of interleaved runs and are compared as ratios. A figure that fails leaves the others standing.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from benchmarks.papers.catalogue import choose, find_paper
from benchmarks.papers.outcome import Reproduction
from benchmarks.papers.runner import reproduce
from benchmarks.papers.workbench import FULL, QUICK
from refgi.cli.destination import Permission, folder
from refgi.cli.progress import progress
from refgi.cli.session import FAILED, say, table
from refgi.cli.threads import on_threads
from refgi.compare.report import number
from refgi.errors import RefgiError


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
