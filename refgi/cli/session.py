"""What one run of the command knows of itself: how to speak, and what it has warned of.

Progress on stderr: a bar on a terminal, a plain line every few seconds elsewhere.
"""

import contextlib
import dataclasses
import json
import re
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from refgi.texts import table as table  # of the commands

if TYPE_CHECKING:
    from refgi.types import Tell

DONE, FAILED, USAGE, INTERRUPTED, TERMINATED = 0, 1, 2, 130, 143
PERCENTAGE = re.compile(r"\d+(?= %)")
SECONDS_BETWEEN_LINES = 3.0


@dataclasses.dataclass
class Session:
    """State of one run, the context's `obj`."""

    debug: bool = False
    as_json: bool = False
    _warned: dict[str, list[str]] = dataclasses.field(default_factory=dict)  # by text without percentages

    @property
    def warnings(self) -> list[str]:
        """Warnings so far; those that differ only in percentages are one, with their range."""
        return [_with_range(texts) for texts in self._warned.values()]

    def warn(self, message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
        """Print a warning as one line unless one like it has been; takes what `warnings.showwarning` gives."""
        kind = "" if category.__name__ == "RefgiWarning" else f"{category.__name__}: "
        text = kind + " ".join(str(message).split())
        alike = self._warned.setdefault(PERCENTAGE.sub("", text), [])
        if not alike:
            say(f"warning: {text}")
        if text not in alike:
            alike.append(text)

    def result(self, text: str, content: dict[str, Any]) -> None:
        """Print the result to stdout, with --json as one object with all warnings; say ranges of percentages."""
        for texts in self._warned.values():
            if len(texts) > 1:
                say(f"warning, over the whole run: {_with_range(texts)}")
        if self.as_json:
            from refgi.provenance import plain

            text = self._object(plain(content))
        try:
            click.echo(text)
        except BrokenPipeError:  # whoever read has had enough
            raise
        except OSError as error:
            from refgi.errors import InputError

            raise InputError(f"stdout: cannot be written: {error.strerror or error}") from error

    def fault(self, fault: "Fault") -> None:
        """Print an error to stderr, and with --json one object to stdout, where somebody can still read it."""
        for line in fault.message.splitlines():  # a scene file's errors come all at once
            say(line)
        if self.as_json:
            with contextlib.suppress(OSError):
                click.echo(self._object({"error": fault._asdict()}))

    def _object(self, content: dict[str, Any]) -> str:
        return json.dumps({**content, "warnings": self.warnings}, indent=2, allow_nan=False)


def _with_range(texts: list[str]) -> str:
    """Return the first of texts that differ only in percentages, with the range of each."""
    columns = zip(*(map(int, PERCENTAGE.findall(text)) for text in texts), strict=True)
    ranges = iter([f"{min(column)} to {max(column)}" if len(set(column)) > 1 else str(column[0]) for column in columns])
    return PERCENTAGE.sub(lambda _: next(ranges), texts[0])


class Fault(NamedTuple):
    """What ended a run before its result."""

    code: int  # exit code
    message: str
    file: str | None = None
    key: str | None = None  # setting, option or key of the file


def say(text: str) -> None:
    """Print one line to stderr, after the command's name; where nobody listens the work goes on."""
    with contextlib.suppress(OSError):
        click.echo(f"refgi: {text}", file=sys.stderr)


@contextmanager
def progress() -> "Iterator[Tell]":
    """Show how far long work is while the block runs: yield what is to be called with (what runs, fraction done)."""
    if sys.stderr.isatty():
        with _bar() as tell:
            yield tell
    else:
        yield _lines()


@contextmanager
def _bar() -> "Iterator[Tell]":
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


def _lines() -> "Tell":
    last = time.monotonic()

    def tell(what: str, done: float) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= SECONDS_BETWEEN_LINES:
            last = now
            say(f"{what} {f'{done:.0%}' if done < 1 else 'done'}")

    return tell
