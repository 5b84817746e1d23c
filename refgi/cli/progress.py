"""Progress on stderr: a bar on a terminal, a plain line every few seconds elsewhere."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from refgi.cli.session import say

SECONDS_BETWEEN_LINES = 3.0

Tell = Callable[[str, float], None]


@contextmanager
def progress() -> Iterator[Tell]:
    """Show how far long work is while the block runs.

    Yields
    ------
    callable
        To be called with (what runs, fraction done).
    """
    if sys.stderr.isatty():
        with _bar() as tell:
            yield tell
    else:
        yield _lines()


@contextmanager
def _bar() -> Iterator[Tell]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"),
               TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("starting", total=1.0)

        def tell(what: str, done: float) -> None:
            if bar.tasks[0].description != what:
                bar.reset(task, description=what)
            bar.update(task, completed=done)

        yield tell


def _lines() -> Tell:
    last = time.monotonic()

    def tell(what: str, done: float) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= SECONDS_BETWEEN_LINES:
            last = now
            say(f"{what} {f'{done:.0%}' if done < 1 else 'done'}")

    return tell
