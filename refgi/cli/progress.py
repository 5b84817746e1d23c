"""Progress on stderr: a bar on a terminal, a plain line every few seconds elsewhere. Heeds interrupts."""

import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

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

    Raises
    ------
    KeyboardInterrupt
        Where the user interrupts; at the next call or at the end if Python dropped the interrupt, as it does when one
        arrives inside a callback of the compiler.
    """
    with _interrupts() as heed:
        if sys.stderr.isatty():
            with _bar() as tell:
                yield _heeding(tell, heed)
        else:
            yield _heeding(_lines(), heed)
        heed()


@contextmanager
def _interrupts() -> Iterator[Callable[[], None]]:
    """Remember SIGINT while the block runs, and yield what raises it again."""
    seen = False

    def remember(*_: Any) -> None:
        nonlocal seen
        seen = True
        raise KeyboardInterrupt

    def heed() -> None:
        if seen:
            raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield heed
        return
    before = signal.signal(signal.SIGINT, remember)
    try:
        yield heed
    finally:
        signal.signal(signal.SIGINT, before)


def _heeding(tell: Tell, heed: Callable[[], None]) -> Tell:
    def tell_or_stop(what: str, done: float) -> None:
        heed()
        tell(what, done)

    return tell_or_stop


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
