"""What one run of the command knows of itself: how to speak, and what it has warned of."""

import contextlib
import dataclasses
import json
import sys
from collections.abc import Sequence
from typing import Any, NamedTuple

import click

DONE, FAILED, USAGE, INTERRUPTED = 0, 1, 2, 130


@dataclasses.dataclass
class Session:
    """State of one run, the context's `obj`."""

    debug: bool = False
    as_json: bool = False
    warnings: list[str] = dataclasses.field(default_factory=list)

    def warn(self, message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
        """Print a warning as one line, each text once; takes what `warnings.showwarning` gives."""
        kind = "" if category.__name__ == "RefgiWarning" else f"{category.__name__}: "
        text = kind + " ".join(str(message).split())
        if text not in self.warnings:
            self.warnings.append(text)
            say(f"warning: {text}")

    def result(self, text: str, content: dict[str, Any]) -> None:
        """Print the result to stdout: the text, or with --json one object that also has the warnings."""
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


class Fault(NamedTuple):
    """What ended a run before its result."""

    code: int  # exit code
    message: str
    file: str | None = None
    key: str | None = None  # setting, option or key of the file


def say(text: str) -> None:
    """Print one line to stderr, after the command's name; where nobody listens the work goes on.

    Parameters
    ----------
    text : str
        The line.
    """
    with contextlib.suppress(OSError):
        click.echo(f"refgi: {text}", file=sys.stderr)


def table(rows: Sequence[tuple[str, ...]], *, right: frozenset[int] = frozenset()) -> str:
    """Lay rows out as lines of aligned columns.

    Parameters
    ----------
    rows : sequence of tuple of str
        Equally many cells in each.
    right : frozenset of int
        Columns that are flush right.

    Returns
    -------
    str
        One line a row.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    cells = ((cell.rjust(width) if i in right else cell.ljust(width)
              for i, (cell, width) in enumerate(zip(row, widths, strict=True))) for row in rows)
    return "\n".join("  ".join(row).rstrip() for row in cells)
