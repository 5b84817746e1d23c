"""Makes a paper's figures one after another; one that fails leaves the others standing.

After each figure its pictures, results.json and the page are written whole, so a run that is interrupted leaves
everything up to there.
"""

import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.papers.catalogue import Entry, Paper, choose, find_paper
from benchmarks.papers.outcome import Outcome, Reproduction
from benchmarks.papers.workbench import FULL, Scale, Workbench
from refgi.compare.environment import environment
from refgi.errors import InputError, RefgiError, RefgiWarning

Progress = Callable[[str, float], None]


def reproduce(
    paper: str | Paper,
    *,
    scale: Scale = FULL,
    only: Sequence[str] | None = None,
    out: str | Path | None = None,
    progress: Progress | None = None,
) -> Reproduction:
    """Make a paper's figures and tables again.

    Parameters
    ----------
    paper : str or Paper
        The paper or its short name.
    scale : Scale
        Sizes and repeats.
    only : sequence of str, optional
        Keys of the figures to make; all where absent.
    out : str or Path, optional
        Folder for pictures, results.json and index.html; nothing is written where absent.
    progress : callable, optional
        Called with (what is made, fraction done).

    Returns
    -------
    Reproduction
        Every figure, or why it could not be made.

    Raises
    ------
    InputError
        If the paper or a key is unknown, or the folder cannot be written.
    """
    paper = find_paper(paper) if isinstance(paper, str) else paper
    entries = choose(paper, only)
    folder = None if out is None else _folder(Path(out))
    bench, outcomes, machine = Workbench(scale), [], environment()
    made = Reproduction(paper, scale, len(entries), (), machine)
    for number, entry in enumerate(entries):
        if progress is not None:
            progress(f"{entry.label} ({number + 1} of {len(entries)})", number / len(entries))
        outcomes.append(_outcome(entry, bench))
        made = Reproduction(paper, scale, len(entries), tuple(outcomes), machine)
        if folder is not None:
            _write(made, folder)
    if progress is not None:
        progress(paper.name, 1.0)
    return made


def _outcome(entry: Entry, bench: Workbench) -> Outcome:
    started = time.perf_counter()
    try:
        with warnings.catch_warnings():  # a figure says itself what the settings of its paper cost
            warnings.filterwarnings("ignore", ".* of the indirect light", RefgiWarning)
            figure = entry.make(bench)
    except RefgiError as error:
        return Outcome(entry, None, str(error), time.perf_counter() - started)
    except Exception as error:  # a fault of one figure is not one of the others
        return Outcome(entry, None, f"{type(error).__name__}: {error}", time.perf_counter() - started)
    return Outcome(entry, figure, "", time.perf_counter() - started)


def _folder(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"out: {folder} cannot be written: {error.strerror or error}") from error
    return folder


def _write(made: Reproduction, folder: Path) -> None:
    from benchmarks.papers.files import write_pictures, write_record
    from benchmarks.papers.report import write_report

    write_pictures(made, made.outcomes[-1], folder)
    write_record(made, folder)
    write_report(made, folder)
