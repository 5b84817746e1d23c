"""File access of the readers, what the caller chooses of it, and which files were read for a scene."""

import codecs
import contextlib
import hashlib
import itertools
import math
import os
import tomllib
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

from refgi.errors import InputError, RefgiWarning, expect, first_faults, nearest, shortened
from refgi.memory import physical_memory

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


LightUnit = Literal["cd", "lm", "W/sr"]
Emissive = Literal["seen", "lamps"]
LUMEN_PER_WATT = 683.0  # which defines the candela


class _Choice(NamedTuple):
    unit: LightUnit = "cd"
    emissive: Emissive = "seen"
    strict: bool = False


AS_FILES_SAY = _Choice()
_choice: ContextVar[_Choice] = ContextVar("_choice", default=AS_FILES_SAY)


@contextlib.contextmanager
def reading_as(unit: LightUnit = "cd", emissive: Emissive = "seen", *, strict: bool = False) -> Iterator[None]:
    """Let readers inside the block take glTF's lights in a unit, put lamps on emissive surfaces or none, be strict.

    `strict`: refuse what a picture can do without, such as an absent material file or an index of no normal.
    """
    expect(unit in get_args(LightUnit), "light_unit", " or ".join(get_args(LightUnit)), unit)
    expect(emissive in get_args(Emissive), "emissive", " or ".join(get_args(Emissive)), emissive)
    token = _choice.set(_Choice(unit, emissive, strict))
    try:
        yield
    finally:
        _choice.reset(token)


def per_watt(*, directional: bool) -> float:
    """Return what a number of a glTF light is divided by to be W/sr, or W/m^2 of a directional light.

    Of lumen an isotropic source of that flux is meant, of a spot too: its intensity is the flux over 4 pi sr. A
    directional light is in lux with either photometric unit.
    """
    unit = _choice.get().unit
    if unit == "W/sr":
        return 1.0
    return LUMEN_PER_WATT * (4.0 * math.pi if unit == "lm" and not directional else 1.0)


def wants_lamps() -> bool:
    """Return whether emissive surfaces get lamps."""
    return _choice.get().emissive == "lamps"


def is_strict() -> bool:
    """Return whether readers refuse what they could do without."""
    return _choice.get().strict


def tolerate(text: str) -> None:
    """Warn of what is passed over; raise `InputError` instead where readers are strict."""
    if is_strict():
        raise InputError(text)
    warnings.warn(RefgiWarning(text), stacklevel=5)


MOST_PARTS = 1000  # of a key in TOML
LONGEST_WORD, MOST_CANDIDATES = 200, 1000  # comparing words takes the square of their length, for each candidate


def read_bytes(path: Path) -> bytes:
    """Return the bytes of a regular file.

    Result: its content, not empty. Raises `InputError` if it is missing, a folder, not a regular file, empty or
    unreadable.
    """
    try:
        if path.is_dir():
            raise InputError(f"{path}: expected a file, got a folder")
        if not path.exists():
            raise InputError(f"{path}: no such file{_near(path)}")
        if not path.is_file():
            raise InputError(f"{path}: expected a regular file")
        content = _content(path)
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: cannot be read: {error}") from error
    if not content:
        raise InputError(f"{path}: the file is empty")
    record_file(path, content)
    return content


def warn_of_undefined(names: Sequence[str], where: str) -> None:
    """Say which materials a file uses and does not define, if any; `where`: the file."""
    if names:
        listed = first_faults([shortened(repr(name), 80) for name in names], ", ")
        text = f"{where}: {len(names):,} material(s) used and not defined, rendered grey: {listed}"
        warnings.warn(RefgiWarning(text), stacklevel=4)


def expect_utf8(content: bytes, path: Path) -> bytes:
    """Return the bytes of a text file without byte order mark; raises `InputError` if they are UTF-16."""
    start = content[:4]
    if start[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) or start.count(0) == len(start) // 2 > 0:
        raise InputError(f"{path}: expected text in UTF-8, got UTF-16; save it as UTF-8")
    return content.removeprefix(codecs.BOM_UTF8)


def read_text(path: Path) -> str:
    """Return the text of a file, UTF-8 or else Latin-1, its lines ended by a line feed; raises as `read_bytes`."""
    content = expect_utf8(read_bytes(path), path)
    try:
        text = content.decode()
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_toml(path: Path) -> dict[str, Any]:
    """Read the tables of a TOML file. Raises InputError if it cannot be read or is no TOML.

    A key of very many parts counts as damage: its parts take time that grows with the square of their number.
    """
    try:
        text = expect_utf8(read_bytes(path), path).decode()
        deepest = max((line.partition("=")[0].count(".") for line in text.splitlines()), default=0)
        if deepest > MOST_PARTS:
            raise ValueError(f"a key of {deepest + 1:,} parts")
        return tomllib.loads(text)
    except InputError as error:
        error.file = str(path)
        raise
    except (ValueError, RecursionError) as error:  # a number of 5,000 digits is no TOMLDecodeError
        raise InputError(f"{path}: no TOML: {error}", file=str(path)) from error


def _content(path: Path) -> bytes:
    size = path.stat().st_size
    try:
        if size > physical_memory():
            raise MemoryError
        return path.read_bytes()
    except MemoryError as error:
        raise InputError(f"{path}: expected a file that fits in memory, got {size:,} bytes") from error


def is_there(path: Path) -> bool:
    """Return whether a path exists.

    `path`: anything, even what no file system takes as a name. Result: false as well where the name is too long or
    holds a zero byte.
    """
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def text_of(name: str) -> str:
    r"""Return a file's name as text that can be written anywhere.

    `name`: as the operating system gave it. Result: with a question mark for each byte that is not UTF-8.

    Examples
    --------
    >>> text_of("gr\udcffe")
    'gr?e'
    """
    return name.encode(errors="replace").decode()


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Return "; did you mean ...?" for the known word nearest to a mistyped one, else nothing.

    `known`: what would have been right; the first `MOST_CANDIDATES` are looked at. Result: ready to follow an error's
    sentence.
    """
    if len(word) > LONGEST_WORD:
        return ""
    near = nearest(word, itertools.islice(known, MOST_CANDIDATES))
    return f"; did you mean {near!r}?" if near else ""


def _near(path: Path) -> str:
    siblings = (p.name for p in path.parent.iterdir()) if path.parent.is_dir() else ()
    return did_you_mean(path.name, siblings)
