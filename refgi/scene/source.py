"""Provenance of a scene: its name, and the files that were read for it."""

import contextlib
import hashlib
import os
from collections.abc import Iterator
from contextvars import ContextVar
from pathlib import Path
from typing import NamedTuple

_reading: ContextVar[dict[Path, str] | None] = ContextVar("_reading", default=None)


class Source(NamedTuple):
    """How a scene was named, and SHA-256 of every file read for it, named relative to the folder of the first."""

    name: str
    files: tuple[tuple[str, str], ...] = ()


@contextlib.contextmanager
def reading() -> Iterator[dict[Path, str]]:
    """Gather the files that are read inside the block.

    Result: SHA-256 by path, in the order of reading; complete when the block ends.
    """
    files: dict[Path, str] = {}
    token = _reading.set(files)
    try:
        yield files
    finally:
        _reading.reset(token)


def record_file(path: Path, content: bytes) -> None:
    """Record a file's content inside a block of `reading`."""
    files = _reading.get()
    if files is not None:
        files[path] = hashlib.sha256(content).hexdigest()


def source_of(name: str, files: dict[Path, str]) -> Source:
    """Return the source of a scene.

    `name`: the argument of `load_scene`. Result: with each file's path as seen from the first one's folder, so that it
    stays the same when all are moved.
    """
    folder = next(iter(files), Path()).parent
    return Source(name, tuple((Path(os.path.relpath(path, folder)).as_posix(), digest)
                              for path, digest in files.items()))
