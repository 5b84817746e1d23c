"""Checkpoints: all passes so far in one file, which a later run of the same computation continues.

The file holds a first line, SHA-256 digests of the computation and of the content, and the content: number of passes
(int64), means and sums of each series (float64), how many values those are of (int32), the unit of the tails (float64)
and their counts (int32), little-endian. Its length follows from the
computation, so nothing of a file that is damaged, or another's, is ever read.
"""

import contextlib
import hashlib
import os
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from refgi.errors import InputError, RefgiWarning, expect
from refgi.image import temporary_name
from refgi.truth.result import SERIES, Moments, no_passes

FIRST_LINE = b"refgi truth checkpoint 5\n"
KINDS = ("<i8", "<f8", "<f8", "<i4", "<f8", "<i4")  # of the fields of `Moments`
DIGEST = 32  # bytes of SHA-256
SECONDS_BETWEEN = 10.0  # saves are at least that far apart


class Checkpoint:
    """A checkpoint file of one computation.

    `computation`: SHA-256 digest of everything that the passes depend on; `values`: numbers a pass has; `blocks`: of
    how many blocks tails are counted. Raises InputError, before anything is computed, if the file is damaged, belongs
    to another computation or cannot be written.
    """

    def __init__(self, path: Path, computation: bytes, values: int, blocks: int = 0) -> None:
        self._path, self._computation, self._warned = path, computation, False
        with _clear_errors(path, "a file in a folder that is there"):
            expect(path.parent.is_dir(), f"checkpoint {path}", "a file in a folder that is there", str(path.parent))
        self.moments = (_load(path, computation, no_passes(values, blocks)) if os.path.lexists(path)
                        else no_passes(values, blocks))
        self._saved = int(self.moments.passes)
        with _clear_errors(path, "a place for a file of its size"), _temporary(path, self._content()):
            pass
        self._due = time.monotonic() + SECONDS_BETWEEN

    def save_when_due(self) -> None:
        """Save if the last attempt is long enough ago."""
        if time.monotonic() >= self._due:
            self.save()

    def save(self) -> None:
        """Write the file whole or not at all; a failure is a warning, once, and the file stays as it was."""
        if self._saved == int(self.moments.passes):
            return
        try:
            with _temporary(self._path, self._content()) as temporary:
                temporary.replace(self._path)
            self._saved = int(self.moments.passes)
        except OSError as trouble:
            if not self._warned:
                warnings.warn(RefgiWarning(f"checkpoint {self._path}: not saved ({trouble.strerror or trouble}); "
                                           f"it still holds {self._saved} passes, and computing goes on"), stacklevel=3)
            self._warned = True
        self._due = time.monotonic() + SECONDS_BETWEEN

    def _content(self) -> bytes:
        content = b"".join(np.asarray(field, kind).tobytes() for field, kind in zip(self.moments, KINDS, strict=True))
        return FIRST_LINE + self._computation + _digest(self._computation, content) + content


def _load(path: Path, computation: bytes, empty: Moments) -> Moments:
    with _clear_errors(path, "a checkpoint file"):
        expect(path.is_file(), f"checkpoint {path}", "a checkpoint file", "something else")
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(len(FIRST_LINE) + 2 * DIGEST)
            expect(head.startswith(FIRST_LINE) and len(head) == len(FIRST_LINE) + 2 * DIGEST, f"checkpoint {path}",
                   "a checkpoint file of this version", f"{size} bytes of something else")
            whose, digest = head[len(FIRST_LINE):-DIGEST], head[-DIGEST:]
            expect(whose == computation, f"checkpoint {path}",
                   "one of this scene, picture, settings and version of refgi", "another's")
            whole = len(head) + sum(field.nbytes for field in empty)
            expect(size == whole, f"checkpoint {path}", f"a whole file of {whole} bytes", size)
            content = file.read(whole - len(head))
    expect(_digest(computation, content) == digest, f"checkpoint {path}", "its own SHA-256 digest", "a damaged file")
    parts, start = [], 0
    for field, kind in zip(empty, KINDS, strict=True):
        parts.append(np.frombuffer(content, kind, field.size, start).astype(field.dtype).reshape(field.shape))
        start += field.nbytes
    found = Moments(*parts)
    finite = all(np.isfinite(one).all() for one in (found.mean, found.sums, found.scale))
    most = (found.passes + np.arange(SERIES)[::-1, None]) // SERIES  # passes of each series
    counted = (found.counts >= 0).all() and (found.counts <= most).all()
    sound = found.passes >= 0 and finite and counted and found.scale >= 0 and (found.tails >= 0).all()
    expect(bool(sound), f"checkpoint {path}", "finite moments", "others")
    return found


def _digest(computation: bytes, content: bytes) -> bytes:
    return hashlib.sha256(computation + content).digest()


@contextlib.contextmanager
def _temporary(path: Path, content: bytes) -> Iterator[Path]:
    """Write a file beside a path, on the disk itself, and remove it unless it is renamed inside the block."""
    name = temporary_name(path)
    try:
        with name.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        yield name
    finally:
        name.unlink(missing_ok=True)


@contextlib.contextmanager
def _clear_errors(path: Path, expected: str) -> Iterator[None]:
    try:
        yield
    except (OSError, ValueError) as trouble:
        if isinstance(trouble, InputError):
            raise
        raise InputError(f"checkpoint {path}: expected {expected}, got {trouble}") from trouble
