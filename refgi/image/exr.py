"""Read and write EXR files, lossless and verified.

An EXR written here holds contiguous float32 planes (ids as uint32), ZIP compressed, and one string attribute: a
canonical JSON object with whatever the caller says (settings, units, versions) and a SHA-256 of everything. The file
is read back and compared to the bit before it gets its name, because OpenEXR can write wrong pixels and read damaged
ones without an error.
"""

import contextlib
import hashlib
import io
import json
import os
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from refgi.errors import InputError, expect
from refgi.image.whole import MARK, canonical_json, is_text, whole_file
from refgi.memory import available_bytes
from refgi.types import Array

Channels = dict[str, Array]


class Part(NamedTuple):
    """One picture of a file."""

    name: str
    header: dict[str, Any]
    channels: Channels  # (h, w) of the data window


LONGEST_COMPLAINT = 1000  # bytes
_STDERR = threading.Lock()  # one process has one stderr
DIGEST = "sha256"  # reserved key of the attribute: over the other keys and all planes


def write_exr(path: str | Path, channels: Mapping[str, Array], attributes: Mapping[str, Any] | None = None) -> None:
    """Write planes as one multi-channel EXR, verified after writing.

    Parameters
    ----------
    path : str or Path
        A name that ends in ``.exr``.
    channels : mapping of str to (h, w) ndarray
        Planes of one size, float32 or uint32. Every bit is stored, NaN and infinity included.
    attributes : mapping, optional
        Settings, units, versions: finite JSON values.

    Raises
    ------
    InputError
        If a plane or attribute is not usable or the file cannot be written, or reads back different.
    """
    path = Path(path)
    expect(path.suffix.lower() == ".exr", "path", "a name that ends in .exr", str(path))
    expect(is_text(str(path)), "path", "a name in UTF-8, which is all that OpenEXR opens", str(path))
    planes = _planes(channels)
    text = _signed(attributes or {}, planes)
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, MARK: text}
    with whole_file(path) as temporary:
        try:
            OpenEXR.File(header, dict(planes)).write(str(temporary))
        except RuntimeError as error:
            raise InputError(f"{path}: cannot be written: {error}") from error
        if not _same_planes(planes, read_exr(temporary)[0]):
            raise InputError(f"{path}: reads back different from what was written")


def read_exr(path: str | Path) -> tuple[Channels, dict[str, Any]]:
    """Read the planes and attributes of an EXR.

    Parameters
    ----------
    path : str or Path
        A single-part EXR, ours or another program's.

    Returns
    -------
    channels : dict of str to (h, w) ndarray
        One contiguous plane a channel: float32, uint32 or (never ours) float16.
    attributes : dict
        The attributes passed to `write_exr`; empty for another program's file.

    Raises
    ------
    InputError
        If the file is missing, is not an EXR, was cut short or differs from what was written.
    """
    path = Path(path)
    first = read_parts(path)[0]
    return first.channels, verified(first, path)


def read_parts(path: Path) -> list[Part]:
    """Read all parts of an EXR of any program, with their planes as the file has them.

    Raises InputError if the file is missing, is not an EXR, was cut short, is deep, has channels without a value for
    each pixel, or says that it holds more than memory does.
    """
    expect(path.is_file(), "path", "a file", str(path))
    import OpenEXR

    try:
        with _complaints() as complaints:
            with OpenEXR.File(_source(path), header_only=True) as file:
                headers = [part.header for part in file.parts]
                for header in headers:
                    _expect_flat(header, path)
                _expect_room(headers, path)
            with OpenEXR.File(_source(path), separate_channels=True) as file:
                parts = [_part(part) for part in file.parts]
        if complaints:  # rows that cannot be decoded stay black, and nothing is raised
            raise ValueError(complaints[0])
    except InputError:
        raise
    except Exception as error:  # OpenEXR raises RuntimeError, but also IndexError or TypeError on damaged headers
        raise InputError(f"{path}: not a readable EXR: {error}") from error
    expect(all(part.channels for part in parts) and bool(parts), str(path), "an EXR with whole pixel data",
           "none: cut short or damaged")
    return parts


def _source(path: Path) -> str | BinaryIO:
    """Return what OpenEXR opens: a name in UTF-8, else the content."""
    return str(path) if is_text(str(path)) else io.BytesIO(path.read_bytes())


def _part(part: Any) -> Part:
    channels = {name: np.ascontiguousarray(channel.pixels) for name, channel in part.channels.items()}
    return Part(str(part.header.get("name", "")), dict(part.header), channels)


def _expect_flat(header: Mapping[str, Any], path: Path) -> None:
    """Refuse what OpenEXR for Python cannot give as one value a pixel and channel."""
    kind = str(header.get("type", "")).rpartition(".")[2]
    expect(not kind.startswith("deep"), f"{path}: type", "an image of one value a pixel, not deep", kind)
    sparse = [channel.name for channel in header["channels"] if (channel.xSampling, channel.ySampling) != (1, 1)]
    expect(not sparse, f"{path}: channels", "a value for each pixel, not every other", sparse)


def _expect_room(headers: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Refuse a file whose headers say that its pixels, held twice for a moment, do not fit in memory."""
    needed = 0
    for header in headers:
        (left, top), (right, bottom) = (map(int, corner) for corner in header["dataWindow"])
        needed += 2 * 4 * len(header["channels"]) * (right - left + 1) * (bottom - top + 1)
    available = available_bytes()
    if available is not None and needed > available:
        raise InputError(f"{path}: its pixels need about {needed:,} bytes of memory, {available:,} are available")


@contextlib.contextmanager
def _complaints() -> Iterator[list[str]]:
    """Gather what OpenEXR prints of damage, where somebody may want to read JSON or one line of error.

    It prints to the process's own stderr, which therefore leads elsewhere for the time of the block.
    """
    said: list[str] = []
    with _STDERR, _file_without_name() as file, contextlib.redirect_stdout(io.StringIO()):
        try:
            kept = os.dup(2)
        except OSError:  # closed: nothing is printed
            yield said
            return
        os.dup2(file.fileno(), 2)
        try:
            yield said
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            file.seek(0)
            said += file.read(LONGEST_COMPLAINT).decode(errors="replace").splitlines()[:1]


def _file_without_name() -> BinaryIO:
    """Return an empty file, in memory where the platform can: a full disk is no reason not to read."""
    if hasattr(os, "memfd_create"):
        return os.fdopen(os.memfd_create("complaints"), "w+b")
    return tempfile.TemporaryFile()


def _planes(channels: Mapping[str, Array]) -> Channels:
    expect(len(channels) > 0, "channels", "at least one plane", "none")
    shape = next(iter(channels.values())).shape
    for name, plane in channels.items():
        expect(plane.ndim == 2 and plane.size > 0 and plane.shape == shape, f"channel {name!r}",
               f"a plane of shape {shape}, (h, w)", plane.shape)
        expect(plane.dtype in (np.float32, np.uint32), f"channel {name!r}", "float32 or uint32", plane.dtype.name)
    return {name: np.ascontiguousarray(plane) for name, plane in sorted(channels.items())}


def _signed(attributes: Mapping[str, Any], planes: Channels) -> str:
    expect(DIGEST not in attributes, "attributes", f"no key {DIGEST!r}, which is reserved", list(attributes))
    return canonical_json({**attributes, DIGEST: _digest(attributes, planes)})


def verified(part: Part, path: Path) -> dict[str, Any]:
    """Return the attributes of a picture, empty where it is another program's; `InputError` where it was changed."""
    text, channels = part.header.get(MARK), part.channels
    if text is None:
        return {}
    try:
        attributes = json.loads(text)
        recorded = attributes.pop(DIGEST)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{path}: damaged: its {MARK!r} attribute is not what refgi writes") from error
    if recorded != _digest(attributes, channels):
        raise InputError(f"{path}: damaged: the pixels or attributes differ from what was written ({DIGEST})")
    return dict(attributes)


def _digest(attributes: Mapping[str, Any], planes: Channels) -> str:
    digest = hashlib.sha256(canonical_json(attributes).encode())
    for name, plane in sorted(planes.items()):
        digest.update(f"\0{name} {plane.dtype.name} {plane.shape[0]}x{plane.shape[1]}\0".encode())
        digest.update(plane.astype(plane.dtype.newbyteorder("<"), copy=False).data)
    return digest.hexdigest()


def _same_planes(a: Channels, b: Channels) -> bool:
    return a.keys() == b.keys() and all(
        a[name].dtype == b[name].dtype and np.array_equal(a[name].view(np.uint32), b[name].view(np.uint32))
        for name in a
    )
