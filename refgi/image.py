"""EXR and PNG in and out, and the one way refgi writes a file.

An EXR written here holds contiguous float32 planes (ids as uint32), ZIP compressed, and one string attribute: a
canonical JSON object with whatever the caller says (settings, units, versions) and a SHA-256 of everything. The file
is read back and compared to the bit before it gets its name, because OpenEXR can write wrong pixels and read damaged
ones without an error. A PNG is for looking at: 8 bits, sRGB curve, an exposure factor; a pixel that is not finite is
magenta there and counted in a warning, never black.
"""

import contextlib
import hashlib
import json
import os
import secrets
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.errors import InputError, RefgiWarning, expect

Array = npt.NDArray[Any]
Channels = dict[str, Array]

ATTRIBUTE = "refgi"
DIGEST = "sha256"  # reserved key of the attribute: over the other keys and all planes
LONGEST_STEM = 48  # characters of a file's name that its temporary name keeps
NOT_FINITE = (255, 0, 255)  # how a NaN or infinite pixel shows in a PNG


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


def write_exr(path: str | Path, channels: Mapping[str, Array], attributes: Mapping[str, Any] | None = None) -> None:
    """Write planes as one multi-channel EXR, verified after writing.

    Parameters
    ----------
    path : str or Path
        A name that ends in ``.exr``.
    channels : mapping of str to (h, w) ndarray
        Planes of one size, float32 or uint32. Every bit is kept, NaN and infinity included.
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

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, ATTRIBUTE: text}
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
        What `write_exr` was given; empty for another program's file.

    Raises
    ------
    InputError
        If the file is missing, is not an EXR, was cut short or differs from what was written.
    """
    path = Path(path)
    expect(path.is_file(), "path", "a file", str(path))
    import OpenEXR

    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: np.ascontiguousarray(channel.pixels) for name, channel in file.channels().items()}
            text = file.header().get(ATTRIBUTE)
    except Exception as error:  # OpenEXR raises RuntimeError, but also IndexError or TypeError on damaged headers
        raise InputError(f"{path}: not a readable EXR: {error}") from error
    expect(bool(channels), str(path), "an EXR with whole pixel data", "none: cut short or damaged")
    return channels, _verified(text, channels, path)


def tone_map(rgb: Array, exposure: float = 1.0) -> npt.NDArray[np.uint8]:
    """Turn linear colours into 8-bit sRGB: clip(exposure * rgb, 0, 1), sRGB curve, round.

    Parameters
    ----------
    rgb : (..., 3) ndarray
        Linear RGB, scene-referred.
    exposure : float
        Factor before the curve.

    Returns
    -------
    (..., 3) ndarray of uint8
        Display values; a pixel with a channel that is not finite is magenta.

    Examples
    --------
    >>> tone_map(np.array([[0.0, 0.5, 2.0]])).tolist()
    [[0, 188, 255]]
    """
    finite: Array = np.asarray(np.isfinite(rgb).all(axis=-1))
    linear = np.clip(np.where(finite[..., None], rgb, 0.0) * np.float64(exposure), 0.0, 1.0)
    curve = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    pixels = (curve * 255.0 + 0.5).astype(np.uint8)
    pixels[~finite] = NOT_FINITE
    return pixels


def write_png(path: str | Path, rgb: Array, exposure: float = 1.0) -> None:
    """Write a picture to look at.

    Parameters
    ----------
    path : str or Path
        A name that ends in ``.png``.
    rgb : (h, w, 3) ndarray
        Linear RGB, or uint8 display values that are written as they are.
    exposure : float
        Factor before the sRGB curve.

    Raises
    ------
    InputError
        If the name, shape or exposure is not usable or the file cannot be written.
    """
    path = Path(path)
    expect(path.suffix.lower() == ".png", "path", "a name that ends in .png", str(path))
    expect(rgb.ndim == 3 and rgb.shape[2] == 3 and rgb.size > 0, "rgb", "an (h, w, 3) array", rgb.shape)
    expect(bool(np.isfinite(exposure)) and exposure > 0, "exposure", "a finite number > 0", exposure)
    with whole_file(path) as temporary:
        temporary.write_bytes(png_bytes(rgb, exposure))


def png_bytes(rgb: Array, exposure: float = 1.0) -> bytes:
    """Return a PNG file's bytes.

    Parameters
    ----------
    rgb : (h, w, 3) ndarray
        Linear RGB, or uint8 display values.
    exposure : float
        Factor before the sRGB curve.

    Returns
    -------
    bytes
        The file's content.
    """
    import imageio.v3

    if rgb.dtype != np.uint8:
        _warn_of_non_finite(rgb)
        rgb = tone_map(rgb, exposure)
    encoded: bytes = imageio.v3.imwrite("<bytes>", rgb, extension=".png")
    return encoded


def _warn_of_non_finite(rgb: Array) -> None:
    count = int((~np.isfinite(rgb).all(axis=-1)).sum())
    if count:
        warnings.warn(RefgiWarning(f"{count} of {rgb.size // 3} pixels are NaN or infinite: shown magenta"),
                      stacklevel=4)


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


def _verified(text: Any, channels: Channels, path: Path) -> dict[str, Any]:
    if text is None:
        return {}
    try:
        attributes = json.loads(text)
        told = attributes.pop(DIGEST)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{path}: damaged: its {ATTRIBUTE!r} attribute is not what refgi writes") from error
    if told != _digest(attributes, channels):
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


def _sync_folder(folder: Path) -> None:
    if os.name == "nt":
        return  # Windows has no handle for a folder to sync
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
