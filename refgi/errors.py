"""Exceptions and warnings.

Every error that a user can cause is an `InputError`; its message names the file, the key and the value, and the
command line prints it as one line. What a renderer sensibly passes over (zero-area faces, say) is a `RefgiWarning`
that says how many.
"""

import contextlib
import difflib
import re
from collections.abc import Iterable, Iterator, Sequence

MOST_FAULTS = 20  # reported of one file; a generated file can have as many as it has keys
LONGEST_VALUE = 400  # characters of a value in an error
LONGEST_MESSAGE = 2000  # bytes of an error in UTF-8, with all of a file's faults
ROOM_FOR_REST = 40  # bytes of it for "... and so many more"
MOST_EDITS = 3  # between a mistyped word and what was meant; one for each three letters before a suffix
# what ends a line beside \n, commands a terminal, or cannot be written in UTF-8
UNPRINTABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff]")


class RefgiError(Exception):
    """Anything refgi raises on purpose."""


class InputError(RefgiError, ValueError):
    """A scene, setting, file or array that cannot be used; the message says what, where and why.

    Of the message, characters that cannot be printed are kept as escapes, and 2,000 bytes in all. `key` (a setting,
    option or key of a file) and `file` are to blame, for programs that read errors.
    """

    def __init__(self, message: str = "", *, key: str | None = None, file: str | None = None) -> None:
        super().__init__(_cut(printable(message), LONGEST_MESSAGE))
        self.key, self.file = key, file


class RefgiWarning(UserWarning):
    """Something was passed over and the picture is still right; the message says what and how many."""


def expect(condition: bool, parameter: str, expected: str, got: object) -> None:
    """Raise `InputError` naming parameter, expectation and the start of the value unless `condition` holds."""
    if not condition:
        text = f"{parameter}: expected {expected}, got {shortened(repr(got))}"
        raise InputError(text.replace("\n", "\\n"), key=parameter)  # one fault, one line


@contextlib.contextmanager
def blame(*, key: str | None = None, file: str | None = None) -> Iterator[None]:
    """Set file and key (a setting or option) of an `InputError` raised inside the block, unless it has them."""
    try:
        yield
    except InputError as error:
        error.key, error.file = error.key or key, error.file or file
        raise


def shortened(text: str, most: int = LONGEST_VALUE) -> str:
    """Return a text on one line that fits in an error: the same, or its first `most` characters, the last three dots.

    >>> shortened("abcdefgh", 6)
    'abc...'
    """
    text = printable(text[: most + 1]).replace("\n", "\\n")
    return text if len(text) <= most else text[: most - 3] + "..."


def printable(text: str) -> str:
    r"""Return a text that any terminal shows and any file takes.

    Control characters, ends of line but ``\n``, and halves of surrogate pairs are escapes.

    >>> printable("a\x1b[0m\ud800")
    'a\\x1b[0m\\ud800'
    """
    return UNPRINTABLE.sub(lambda found: ascii(found[0])[1:-1], text)


def _cut(text: str, most: int) -> str:
    """Return a text of at most so many bytes in UTF-8."""
    content = text.encode()
    return text if len(content) <= most else content[: most - 3].decode(errors="ignore") + "..."


def first_faults(faults: Sequence[str], separator: str = "\n") -> str:
    """Join the first faults of a file, at most `MOST_FAULTS` and `LONGEST_MESSAGE`, and say how many more there are.

    >>> first_faults(["fault"] * 200_000).splitlines()[-1]
    '... and 199,980 more'
    """
    said: list[str] = []
    left = LONGEST_MESSAGE - ROOM_FOR_REST
    for fault in faults[:MOST_FAULTS]:
        text = _cut(printable(fault), LONGEST_MESSAGE - ROOM_FOR_REST)
        left -= len((separator + text).encode())
        if said and left < 0:
            break
        said.append(text)
    more = len(faults) - len(said)
    return separator.join([*said, *([f"... and {more:,} more"] if more > 0 else [])])


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the known word that a mistyped one is likely to mean.

    None where all are further off than a letter for each three of the word, suffix apart.

    >>> nearest("coutn", ["count", "cutoff"]), nearest("gone.mtl", ["n.mtl", "one.mtl"]), nearest("a.mtl", ["b.mtl"])
    ('count', 'one.mtl', None)
    """
    near = difflib.get_close_matches(word, list(known), n=3, cutoff=0.5)
    edits = {one: _edits(word, one) for one in near}
    most = min(MOST_EDITS, len(word.partition(".")[0]) // 3)
    return min((one for one in near if edits[one] <= most), key=edits.__getitem__, default=None)


def _edits(a: str, b: str) -> int:
    """Return how many letters to insert, leave out, replace or swap with their neighbour make one word of another."""
    before: list[int] = []
    row = list(range(len(b) + 1))
    for i, letter in enumerate(a):
        before, row, above = row, [i + 1], before
        for j, other in enumerate(b):
            cost = min(before[j] + (letter != other), before[j + 1] + 1, row[j] + 1)
            if i and j and letter == b[j - 1] and a[i - 1] == other:
                cost = min(cost, above[j - 1] + 1)
            row.append(cost)
    return row[-1]
