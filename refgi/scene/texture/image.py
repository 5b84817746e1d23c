"""Images of textures: PNG and JPEG files (TGA and BMP as well) decoded to codes, and the sRGB curve to linear light.

An image keeps the codes of its file, 8 or 16 bits a channel, so that it is small and has a digest that means the same
everywhere; `linear` applies the curve texel by texel through a table of all codes. Alpha is kept apart, where it is not
1 throughout; grey and palettes become RGB, CMYK becomes (1 - C)(1 - K). Colour profiles, gamma and orientation notes of
a file are ignored, as glTF asks for.
"""

import contextlib
import functools
import hashlib
import io
import warnings
import weakref
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from refgi.errors import InputError, expect
from refgi.memory import available_bytes, physical_memory
from refgi.scene.files import read_bytes
from refgi.types import Array

MOST_TEXELS = 1 << 27  # of one image: 16384 x 8192
FORMATS = ("PNG", "JPEG", "BMP")
CODES = {"uint8": 256, "uint16": 65536}
# Of a texel: float32 with mip levels and what these are made from; codes and float32 of alpha, if asked for.
BYTES_OF_COLOUR, BYTES_OF_ALPHA = 28, 12
BYTES_OF_TEXEL = BYTES_OF_COLOUR + BYTES_OF_ALPHA

_decoded: "weakref.WeakValueDictionary[str, Image]" = weakref.WeakValueDictionary()  # by digest of the file


class Image:
    """A picture as it was stored; equal to another if all pixels are, and their alpha.

    `pixels`: (h, w, 3), row 0 is v = 0; uint8 or uint16: sRGB codes; float32 or float64: linear RGB from 0 to 1.
    `alpha`: (h, w), in their type, codes without a curve or numbers from 0 to 1; absent: 1 throughout. `name`: for
    messages. Raises InputError if shape, type or a value is not usable.
    """

    def __init__(self, pixels: Array, name: str = "image", alpha: Array | None = None) -> None:
        kind = pixels.dtype.name
        expect(pixels.ndim == 3 and pixels.shape[2] == 3 and pixels.size > 0, name, "an (h, w, 3) array of texels",
               pixels.shape)
        expect(kind in CODES or kind in ("float32", "float64"), name, "uint8, uint16, float32 or float64 texels", kind)
        if kind not in CODES:
            expect(bool((pixels >= 0).all() and (pixels <= 1).all()), name, "linear texels from 0 to 1",
                   [float(pixels.min()), float(pixels.max())])
        self.name = name
        self.pixels = np.ascontiguousarray(pixels)
        self.alpha = None if alpha is None else self._checked(alpha)

    def _checked(self, alpha: Array) -> Array | None:
        """Return alpha, None where it is 1 throughout."""
        kind, shape = self.pixels.dtype.name, self.pixels.shape[:2]
        expect(alpha.shape == shape and alpha.dtype.name == kind, f"{self.name}: alpha", f"{kind} texels {shape}",
               f"{alpha.dtype.name} {alpha.shape}")
        if kind not in CODES:
            expect(bool((alpha >= 0).all() and (alpha <= 1).all()), f"{self.name}: alpha", "numbers from 0 to 1",
                   [float(alpha.min()), float(alpha.max())])
        return None if (alpha == CODES.get(kind, 2) - 1).all() else np.ascontiguousarray(alpha)

    @property
    def height(self) -> int:
        """Rows."""
        return int(self.pixels.shape[0])

    @property
    def width(self) -> int:
        """Columns."""
        return int(self.pixels.shape[1])

    @functools.cached_property
    def digest(self) -> str:
        """SHA-256 of type, shape and texels, and of alpha where there is any."""
        digest = hashlib.sha256()
        for plane in (self.pixels, *(() if self.alpha is None else (self.alpha,))):
            little = plane.astype(plane.dtype.newbyteorder("<"), copy=False)
            digest.update(f"{little.dtype.str} {plane.shape}\0".encode() + little.tobytes())
        return digest.hexdigest()

    @functools.cached_property
    def alpha_range(self) -> tuple[float, float]:
        """Least and most alpha, 0 to 1."""
        alpha = self.linear_alpha()
        return float(alpha.min()), float(alpha.max())

    def linear(self) -> Array:
        """Return (h, w, 3) float32 in linear light, each texel by itself."""
        kind = self.pixels.dtype.name
        if kind in CODES:
            return np.asarray(srgb_table(CODES[kind]).astype(np.float32)[self.pixels])
        return self.pixels.astype(np.float32)

    def linear_alpha(self) -> Array:
        """Return alpha, (h, w) float32 from 0 to 1."""
        if self.alpha is None:
            return np.ones(self.pixels.shape[:2], np.float32)
        return (self.alpha / (CODES.get(self.alpha.dtype.name, 2) - 1)).astype(np.float32)

    def __eq__(self, other: object) -> bool:
        return self is other or (isinstance(other, Image) and self.digest == other.digest)

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        return f"Image({self.name!r}, {self.width} x {self.height}, {self.pixels.dtype.name})"


@functools.cache
def srgb_table(codes: int) -> Array:
    """Return the linear value of each of so many sRGB codes, (codes,) float64 (IEC 61966-2-1)."""
    share = np.arange(codes) / (codes - 1)
    table = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    table.setflags(write=False)
    return table


def image_file(path: Path) -> Image:
    """Return the image of a file.

    Result: the very object of an earlier call where the file's content is the same and that is still in use. Raises
    `InputError` naming it if it is missing, cut short, no image or too large.
    """
    return decoded(read_bytes(path), str(path))


def decoded(content: bytes, where: str) -> Image:
    """Return the image that the bytes of a file hold.

    `where`: what the error's text names. Result: the very object of an earlier call with the same content. Raises
    `InputError` if it is cut short, no image or too large.
    """
    key = hashlib.sha256(content).hexdigest()
    found = _decoded.get(key)
    if found is None:
        found = _decoded[key] = Image(*_codes(content, where))
    return found


def _codes(content: bytes, where: str) -> tuple[Array, str, Array | None]:
    """Return (h, w, 3) codes of the file, uint8 or uint16, its name, and (h, w) alpha in the same type, if any."""
    from PIL import Image as Pictures
    from PIL import UnidentifiedImageError

    formats = [*FORMATS, "TGA"] if where.lower().endswith(".tga") else list(FORMATS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of doubts about a file that decodes all the same; sizes are judged here
        try:
            with Pictures.open(io.BytesIO(content), formats=formats) as picture:
                _expect_size(picture.size, where)
                codes, alpha = _read(picture, content)
                return np.array(codes, order="C"), where, alpha
        except InputError:
            raise
        except UnidentifiedImageError as error:
            raise InputError(f"{where}: expected an image ({', '.join(formats)}), got {content[:8]!r}") from error
        except Pictures.DecompressionBombError as error:
            raise InputError(f"{where}: expected at most {MOST_TEXELS:,} texels: {error}") from error
        except Exception as error:  # a damaged file raises nearly any
            raise InputError(f"{where}: damaged or cut short: {error}") from error


def expect_all_fit(images: Iterable[Path | bytes], where: str) -> None:
    """Raise `InputError` naming `where` unless images that are to be decoded fit in memory together, by their headers.

    `images`: files, or what is in them; each counts once. What has no header is left to be told when it is decoded.
    """
    from PIL import Image as Pictures

    texels, known = 0, set()
    for one in images:
        with warnings.catch_warnings(), contextlib.suppress(Exception):
            warnings.simplefilter("ignore")
            if hash(one) not in known and (isinstance(one, bytes) or one.is_file()):
                with Pictures.open(io.BytesIO(one) if isinstance(one, bytes) else one, formats=(*FORMATS, "TGA")) as it:
                    texels += it.width * it.height
                known.add(hash(one))
    _expect_memory(texels, where, f"{len(known)} images that fit", f"{texels:,} texels")


def _expect_size(size: tuple[int, int], where: str) -> None:
    texels = size[0] * size[1]
    expect(texels <= MOST_TEXELS, where, f"at most {MOST_TEXELS:,} texels", f"{size[0]} x {size[1]}")
    _expect_memory(texels, where, "an image that fits", f"{size[0]} x {size[1]}")


def _expect_memory(texels: int, where: str, expected: str, got: str) -> None:
    left = available_bytes()
    present = min(physical_memory(), float("inf") if left is None else left)
    expect(texels * BYTES_OF_TEXEL <= present, where, f"{expected} in {present / 2**30:.1f} GiB of memory",
           f"{got} ({texels * BYTES_OF_TEXEL / 2**30:.1f} GiB)")


def _read(picture: Any, content: bytes) -> tuple[Array, Array | None]:
    """Return (h, w, 3) codes of an opened picture, and its alpha, if any."""
    if picture.mode in ("I", "I;16", "I;16B", "I;16L"):
        return np.repeat(np.asarray(picture).astype(np.uint16)[..., None], 3, axis=2), None
    raw = picture.tile[0][3] if picture.format == "PNG" and picture.tile else None
    if raw in ("RGB;16B", "RGBA;16B"):
        return _parted(_both_bytes(picture, content, raw))
    if picture.mode == "CMYK":
        ink = 255 - np.asarray(picture).astype(np.uint32)
        return ((ink[..., :3] * ink[..., 3:] + 127) // 255).astype(np.uint8), None
    if picture.mode in ("LA", "PA", "RGBA", "P") or "transparency" in picture.info:
        return _parted(np.asarray(picture.convert("RGBA")))
    return np.asarray(picture.convert("RGB")), None


def _parted(codes: Array) -> tuple[Array, Array | None]:
    """Return colour and alpha apart."""
    return codes[..., :3], np.array(codes[..., 3], order="C") if codes.shape[2] == 4 else None


def _both_bytes(picture: Any, content: bytes, raw: str) -> Array:
    """Return the codes of a 16-bit colour PNG, which Pillow decodes to one byte of each: the upper, then the lower."""
    from PIL import Image as Pictures

    upper = np.asarray(picture).astype(np.uint16)
    with Pictures.open(io.BytesIO(content), formats=["PNG"]) as again:
        again.tile = [again.tile[0]._replace(args=raw.replace("16B", "16L"))]
        lower = np.asarray(again).astype(np.uint16)
    return upper << 8 | lower
