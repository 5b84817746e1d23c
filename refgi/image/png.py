"""Tone-mapped PNG files: 8 bits, sRGB curve, an exposure factor.

A pixel that is not finite is magenta and counted in a warning, never black.
"""

import json
import struct
import warnings
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.errors import RefgiWarning, expect
from refgi.image.whole import MARK, canonical_json, whole_file
from refgi.types import Array

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
