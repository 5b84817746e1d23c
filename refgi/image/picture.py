"""A colour picture of any program, from an EXR: which part and layer, where it lies, in which primaries; and as PNG.

The display window is the picture that a camera sees; the data window are the pixels that are stored, which may be
fewer (a crop) or more (overscan). Colours are linear; `chromaticities` say of which primaries, Rec. 709 where absent.
A PNG is tone-mapped: 8 bits, sRGB curve, an exposure factor; pixels that are not finite are magenta, and counted.
"""

import json
import struct
import warnings
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import InputError, RefgiWarning, expect, shortened
from refgi.image.exr import Part, read_parts, verified
from refgi.image.whole import MARK, canonical_json, whole_file
from refgi.types import Array

REC_709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)  # x, y of red, green, blue, white
SAME = 1e-3  # of chromaticities, which programs round


class Colour(NamedTuple):
    """A picture's colours and where they lie."""

    planes: Array  # (3, h, w), linear, Rec. 709: the stored pixels inside the display window
    names: tuple[str, ...]  # of the channels
    size: tuple[int, int]  # width and height of the display window
    rows: slice  # of the display window, from its upper left corner
    columns: slice

    @property
    def part_said(self) -> str:
        """Of which pixels this is, where it is not all; to follow a sentence."""
        width, height = self.size
        if self.planes.shape[1:] == (height, width):
            return ""
        rows, columns = self.rows, self.columns
        return (f"; of {width}x{height} the stored pixels, columns {columns.start} to {columns.stop - 1}, rows "
                f"{rows.start} to {rows.stop - 1}, counted from the first stored one")


def read_colour(
    path: Path, wanted: Sequence[str] = ("",), layer: str | None = None, part: str | None = None
) -> Colour:
    """Read one colour picture of an EXR, cut to the display window, in the primaries of Rec. 709.

    `wanted`: beginnings of the channels R, G, B; the first that is there is read. `layer`: what channels' names begin
    with ("ViewLayer.Combined"). `part`: name or number from 0; None: the one that has the channels. Raises InputError
    if the file cannot be read, or not exactly one part has such channels. Warns of converted colours, pixels that are
    not square and a file changed after refgi wrote it.
    """
    parts = read_parts(path)
    chosen, names = _channels(_asked(parts, part, path), wanted, layer, path, ask=part is None)
    _warn_of_change(chosen, path)
    planes = np.stack([chosen.channels[name] for name in names])
    planes = _in_rec_709(planes.astype(np.float32, copy=False), chosen.header, path)
    (ratio,) = _numbers(chosen.header, "pixelAspectRatio", 1, path) or (1.0,)
    if abs(ratio - 1) > SAME:
        warnings.warn(RefgiWarning(f"{path}: pixelAspectRatio {ratio:g}: pixels are taken as square"), stacklevel=2)
    return _cut(planes, names, chosen.header, path)


def _asked(parts: Sequence[Part], part: str | None, path: Path) -> list[Part]:
    if part is None:
        return list(parts)
    found = [one for one in parts if one.name == part]
    if not found and part.isdecimal() and int(part) < len(parts):
        found = [parts[int(part)]]
    there = ", ".join(one.name or str(number) for number, one in enumerate(parts))
    if not found:
        raise InputError(f"{path}: --part: expected one of {shortened(there)}, got {shortened(repr(part))}",
                         key="--part")
    return found


def _channels(
    parts: Sequence[Part], wanted: Sequence[str], layer: str | None, path: Path, *, ask: bool
) -> tuple[Part, tuple[str, ...]]:
    """Return the part that has the channels, and their names."""
    start = "" if not layer else layer.rstrip(".") + "."
    for prefix in wanted:
        names = tuple(f"{start}{prefix}{colour}" for colour in "RGB")
        found = [one for one in parts if all(name in one.channels for name in names)]
        if len(found) > 1:
            there = ", ".join(one.name for one in found)
            raise InputError(f"{path}: {len(found)} parts have channels {', '.join(names)}: --part names one of "
                             f"{shortened(there)}", key="--part")
        if found:
            return found[0], names
    layers = sorted({name[:-2] for one in parts for name in one.channels
                     if all(f"{name[:-2]}.{colour}" in one.channels for colour in "RGB")})
    channels = ", ".join(name for one in parts for name in one.channels)
    expected = " or ".join(", ".join(f"{start}{prefix}{colour}" for colour in "RGB") for prefix in reversed(wanted))
    hint = f"; --layer takes {shortened(', '.join(layers))}" if layers else ""
    where = "" if ask or not parts[0].name else f" in part {parts[0].name}"
    raise InputError(f"{path}: expected channels {expected}{where}, got {shortened(channels)}{hint}", key="--layer"
                     if layers else "channels")


def _warn_of_change(part: Part, path: Path) -> None:
    try:
        verified(part, path)
    except InputError:
        warnings.warn(RefgiWarning(f"{path}: its pixels or record differ from what refgi wrote: read as another "
                                   "program's"), stacklevel=3)


def _in_rec_709(planes: Array, header: dict[str, Any], path: Path) -> Array:
    given = _numbers(header, "chromaticities", 8, path)
    if not given or np.allclose(given, REC_709, rtol=0, atol=SAME):
        return planes
    text = ", ".join(f"{value:.4g}" for value in given)
    try:
        change = np.linalg.inv(xyz_of(REC_709)) @ xyz_of(given)
    except (np.linalg.LinAlgError, ZeroDivisionError, ValueError) as error:
        raise InputError(f"{path}: chromaticities {text}: expected primaries that span a space of colours") from error
    warnings.warn(RefgiWarning(f"{path}: chromaticities {text}: colours are converted to Rec. 709"), stacklevel=3)
    with np.errstate(over="ignore", invalid="ignore"):  # pixels that are not finite, or no longer
        return np.asarray(np.einsum("ij,jhw->ihw", change, planes.astype(np.float64)).astype(np.float32))


def _numbers(header: dict[str, Any], key: str, count: int, path: Path) -> tuple[float, ...]:
    """Return the numbers of an attribute, none where it is absent; raises `InputError` if it is another type's."""
    if key not in header:
        return ()
    try:
        found: tuple[float, ...] = tuple(np.asarray(header[key], np.float64).ravel().tolist())
    except (TypeError, ValueError):
        found = ()
    expect(len(found) == count, f"{path}: {key}", f"an attribute of {count} number(s)", type(header[key]).__name__)
    return found


def xyz_of(chromaticities: Sequence[float]) -> Array:
    """Return the (3, 3) float64 matrix from linear RGB to CIE XYZ, Y of white 1, without adaptation to another white.

    `chromaticities`: x, y of red, green, blue and white. Raises ValueError where they make no triangle with a white.
    """
    pairs = np.asarray(chromaticities, np.float64).reshape(4, 2)
    places = np.column_stack([pairs, 1 - pairs.sum(axis=1)])  # x, y, z
    if not np.isfinite(places).all() or places[3, 1] == 0:
        raise ValueError("white without luminance")
    primaries = places[:3].T
    strength = np.linalg.solve(primaries, places[3] / places[3, 1])
    if not np.isfinite(strength).all() or np.linalg.cond(primaries) > 1e6:
        raise ValueError("primaries on a line")
    return np.asarray(primaries * strength)


def _cut(planes: Array, names: tuple[str, ...], header: dict[str, Any], path: Path) -> Colour:
    """Return the stored pixels inside the display window."""
    (left, top), (right, bottom) = _window(header["displayWindow"])
    (first, highest), (last, lowest) = _window(header["dataWindow"])
    x0, x1, y0, y1 = max(left, first), min(right, last), max(top, highest), min(bottom, lowest)
    if x0 > x1 or y0 > y1:
        raise InputError(f"{path}: dataWindow: expected pixels inside the display window ({left}, {top})-({right}, "
                         f"{bottom}), got ({first}, {highest})-({last}, {lowest})", key="dataWindow")
    inside = planes[:, y0 - highest : y1 - highest + 1, x0 - first : x1 - first + 1]
    expect(inside.shape[1:] == (y1 - y0 + 1, x1 - x0 + 1), f"{path}: dataWindow", f"{planes.shape[1:]} pixels",
           header["dataWindow"])
    return Colour(np.ascontiguousarray(inside), names, (right - left + 1, bottom - top + 1),
                  slice(y0 - top, y1 - top + 1), slice(x0 - left, x1 - left + 1))


def _window(corners: Any) -> tuple[tuple[int, int], tuple[int, int]]:
    (left, top), (right, bottom) = (map(int, corner) for corner in corners)
    return (left, top), (right, bottom)


NOT_FINITE = (255, 0, 255)  # how a NaN or infinite pixel shows
END_OF_HEADER = 33  # bytes of the signature and the first chunk, IHDR, after which a text may stand


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


def write_png(path: str | Path, rgb: Array, exposure: float = 1.0, attributes: Mapping[str, Any] | None = None) -> None:
    """Write a tone-mapped PNG.

    Parameters
    ----------
    path : str or Path
        A name that ends in ``.png``.
    rgb : (h, w, 3) ndarray
        Linear RGB, or uint8 display values that are written as they are.
    exposure : float
        Factor before the sRGB curve.
    attributes : mapping, optional
        Settings, units, versions: finite JSON values, stored in the file.

    Raises
    ------
    InputError
        If the name, shape or exposure is not usable or the file cannot be written.
    """
    expect(rgb.ndim == 3 and rgb.shape[2] == 3 and rgb.size > 0, "rgb", "an (h, w, 3) array", rgb.shape)
    expect(bool(np.isfinite(exposure)) and exposure > 0, "exposure", "a finite number > 0", exposure)
    write_encoded(path, png_bytes(rgb, exposure), attributes)


def write_encoded(path: str | Path, encoded: bytes, attributes: Mapping[str, Any] | None = None) -> None:
    """Write the bytes of a PNG, marked as refgi's.

    Parameters
    ----------
    path : str or Path
        A name that ends in ``.png``.
    encoded : bytes
        A PNG file's content.
    attributes : mapping, optional
        Finite JSON values, stored in a tEXt chunk.

    Raises
    ------
    InputError
        If the name or an attribute is not usable or the file cannot be written.
    """
    path = Path(path)
    expect(path.suffix.lower() == ".png", "path", "a name that ends in .png", str(path))
    name, text = b"tEXt", f"{MARK}\0{canonical_json(attributes or {})}".encode("ascii")
    chunk = struct.pack(">I", len(text)) + name + text + struct.pack(">I", zlib.crc32(name + text))
    with whole_file(path) as temporary:
        temporary.write_bytes(encoded[:END_OF_HEADER] + chunk + encoded[END_OF_HEADER:])


def read_png_attributes(path: str | Path) -> dict[str, Any] | None:
    """Return the attributes passed to `write_png`.

    Parameters
    ----------
    path : str or Path
        A PNG.

    Returns
    -------
    dict or None
        The attributes; None where the file is not refgi's.
    """
    content = Path(path).read_bytes()
    start = content.find(b"tEXt" + MARK.encode() + b"\0", 0, END_OF_HEADER + 32)
    if start < 0:
        return None
    length, = struct.unpack(">I", content[start - 4 : start])
    attributes: dict[str, Any] = json.loads(content[start + 5 + len(MARK) : start + 4 + length])
    return attributes


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
