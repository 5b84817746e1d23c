"""The one way refgi writes a file: whole, or not at all.

What refgi writes into each of its files, so that it is known again: one JSON object under one name.

An EXR has it as an attribute, a PNG as a tEXt chunk, a JSON file as a key; a page has a `generator` of that name.
"""

import contextlib
import json
import os
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from refgi.errors import InputError

LONGEST_STEM = 48  # characters of a file's name that its temporary name keeps
MARK = "refgi"


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Write a file so that a kill leaves the whole file or what was there before.

    Parameters
    ----------
    path : str or Path
        The file's name; its folder must exist.

    Yields
    ------
    Path
        A temporary name in the same folder, to be written inside the block; it is renamed when the block ends well
        and removed when it does not.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    path = Path(path)
    stem = path.stem[:LONGEST_STEM]  # a name as long as the file system allows leaves no room for more
    temporary = path.with_name(f".{stem}.{secrets.token_hex(4)}.part{path.suffix}")
    try:
        yield temporary
        with temporary.open("rb+") as stream:
            os.fsync(stream.fileno())
        temporary.replace(path)
        _sync_folder(path.parent)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file whole or not at all, in UTF-8.

    Parameters
    ----------
    path : str or Path
        The file's name.
    text : str
        Its content.
    """
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def is_text(name: str) -> bool:
    r"""Return whether a file's name is text, not bytes of some other encoding.

    Parameters
    ----------
    name : str
        As the operating system gave it.

    Returns
    -------
    bool
        False where it cannot be written in UTF-8.

    Examples
    --------
    >>> is_text("größe"), is_text("gr\udcffe")
    (True, False)
    """
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def _sync_folder(folder: Path) -> None:
    if os.name == "nt":
        return  # Windows has no handle for a folder to sync
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def canonical_json(value: Any) -> str:
    """Return JSON with sorted keys, no spaces and ASCII only; equal values give equal text.

    Parameters
    ----------
    value : object
        What JSON knows; NaN and infinity are refused.

    Returns
    -------
    str
        The text.

    Raises
    ------
    InputError
        If the value holds something JSON does not know.

    Examples
    --------
    >>> canonical_json({"b": 1, "a": (0.5, None)})
    '{"a":[0.5,null],"b":1}'
    """
    try:
        return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"attributes: expected finite JSON values, {error}") from error
