"""Texts that several commands print: tables, annotations of GitHub Actions."""

from collections.abc import Sequence

ESCAPES = {"%": "%25", "\r": "%0D", "\n": "%0A"}  # of GitHub's workflow commands
IN_TITLES = {":": "%3A", ",": "%2C"}


def table(rows: Sequence[tuple[str, ...]], *, right: frozenset[int] = frozenset()) -> str:
    """Lay rows of equally many cells out as lines of aligned columns, those numbered in `right` flush right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    cells = ((cell.rjust(width) if i in right else cell.ljust(width)
              for i, (cell, width) in enumerate(zip(row, widths, strict=True))) for row in rows)
    return "\n".join("  ".join(row).rstrip() for row in cells)


def annotation(title: str, text: str, kind: str = "error") -> str:
    r"""Return an error or a warning as a workflow command, which GitHub Actions shows beside a change.

    >>> annotation("a: b", "50 %\nand more")
    '::error title=a%3A b::50 %25%0Aand more'
    """
    return f"::{kind} title={_escaped(title, ESCAPES | IN_TITLES)}::{_escaped(text, ESCAPES)}"


def _escaped(text: str, escapes: dict[str, str]) -> str:
    return "".join(escapes.get(character, character) for character in text)
