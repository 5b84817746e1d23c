"""A colour picture of any program, from an EXR: which part and layer, where it lies, and in which primaries.

The display window is the picture that a camera sees; the data window are the pixels that are stored, which may be
fewer (a crop) or more (overscan). Colours are linear; `chromaticities` say of which primaries, Rec. 709 where absent.
"""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import InputError, RefgiWarning, expect, shortened
from refgi.image.exr import Part, read_parts, verified
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
