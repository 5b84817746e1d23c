"""Atomic file writes (whole or not at all), and the mark by which files of refgi are recognised.

The mark is a JSON object under one name: an attribute of an EXR, a tEXt chunk of a PNG, a key of a JSON file; a page
has a `generator` of that name, a checkpoint of the truth begins with it.
"""

import contextlib
import hashlib
import json
import os
import platform
import re
import secrets
import shutil
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from refgi.errors import InputError

LONGEST_STEM = 48  # characters of a file's name that its temporary name keeps
MARK = "refgi"
START_OF_PAGE = 4096  # bytes that hold a page's head
TEMPORARY = re.compile(r"\.(?P<machine>[0-9a-f]{8})-(?P<process>[0-9]+)-[0-9a-f]{8}\.part(\.[^.]*)?$")
GENERATOR = f'<meta name="generator" content="{MARK}'


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
    temporary = temporary_name(path)
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


def temporary_name(path: Path) -> Path:
    """Return a new name for a file or folder that is not whole yet; it tells who writes it.

    Parameters
    ----------
    path : Path
        What the file will be called. Files of killed processes are removed from its folder, once a process.

    Returns
    -------
    Path
        In the same folder.
    """
    remove_dead(path.parent)
    stem = path.stem[:LONGEST_STEM]  # a name as long as the file system allows leaves no room for more
    return path.with_name(f".{stem}.{_machine()}-{os.getpid()}-{secrets.token_hex(4)}.part{path.suffix}")


def is_dead(name: str) -> bool:
    """Return whether a temporary file's writer has ended without removing it.

    Parameters
    ----------
    name : str
        Of the file.

    Returns
    -------
    bool
        False where that cannot be told: for files of another machine, or of no `temporary_name`.
    """
    found = TEMPORARY.search(name)
    if found is None or found["machine"] != _machine() or os.name == "nt":  # where signal 0 would end a process
        return False
    try:
        os.kill(int(found["process"]), 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        return False
    return False


@cache
def remove_dead(folder: Path) -> None:
    """Remove temporary files and folders of ended processes from a folder when it is first written to; it may lack."""
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if is_dead(entry.name):
                with contextlib.suppress(OSError):
                    shutil.rmtree(entry.path) if entry.is_dir(follow_symlinks=False) else Path(entry.path).unlink()


@cache
def _machine() -> str:
    """Return a mark of this machine since it was started, and of the processes that this one can see."""
    seen = [platform.node()]
    for place in ("/proc/sys/kernel/random/boot_id", "/proc/self/ns/pid"):
        with contextlib.suppress(OSError):
            seen.append(str(Path(place).readlink()) if place.endswith("pid") else Path(place).read_text())
    return hashlib.sha256("\n".join(seen).encode()).hexdigest()[:8]


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


def is_from_refgi(path: str | Path) -> bool:
    """Return whether a file carries refgi's mark, so that it may be overwritten.

    Parameters
    ----------
    path : str or Path
        A file.

    Returns
    -------
    bool
        False where the file is another program's, or so damaged that its mark is lost.
    """
    path = Path(path)
    has_mark = {".exr": _exr, ".png": _png, ".json": _json, ".html": _page, ".csv": _table,
                ".md": _table, ".truth": _truth}.get(path.suffix.lower())
    try:
        return has_mark is not None and path.is_file() and has_mark(path)
    except Exception:  # a damaged header makes OpenEXR raise nearly anything
        return False


def _exr(path: Path) -> bool:
    import OpenEXR

    with OpenEXR.File(str(path), header_only=True) as file:
        header: dict[str, Any] = file.header()
        return MARK in header


def _png(path: Path) -> bool:
    with path.open("rb") as file:
        return f"tEXt{MARK}\0".encode() in file.read(START_OF_PAGE)


def _json(path: Path) -> bool:
    content = json.loads(path.read_text("utf-8"))
    return isinstance(content, dict) and MARK in content


def _table(path: Path) -> bool:
    """Return whether Markdown begins with refgi's comment, or the last column of a CSV file is named by its mark."""
    with path.open(encoding="utf-8") as file:
        first = file.readline(1000).rstrip("\n")
    return (first.startswith(f"<!-- {MARK} ") and first.endswith(" -->")) or first.endswith(f",{MARK}_format")


def _truth(path: Path) -> bool:
    with path.open("rb") as file:
        return file.readline(100).startswith(f"{MARK} truth checkpoint ".encode())


def _page(path: Path) -> bool:
    with path.open("rb") as file:
        return GENERATOR.encode() in file.read(START_OF_PAGE)
