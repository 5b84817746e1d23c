"""Planes of numbers as text inside a page: half floats, predicted, deflated, base64, within a limit of bytes.

A plane is divided by a power of two that brings its largest number just below 2^15, so that no number overflows and all
above 2^-29 of the largest keep 11 bits; the page multiplies it back. Half floats are compared as the integers of their
bits, which grow with the logarithm of the number: what is stored is the difference to the second channel (channels
differ by a nearly constant factor, noise included), then to the pixel on the left; high bytes stand before low bytes.

Where all planes are more than the limit, the least important ones are replaced by means over blocks of 2 x 2, 4 x 4 ...
pixels until they fit; what a page says of a picture tells by how much.
"""

import base64
import math
import zlib
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.types import Array

Bits = npt.NDArray[np.uint16]

LARGEST_EXPONENT = 15  # numbers are scaled below 2^15; half floats end at 65504
LEVEL = 6  # of deflate: 9 takes three times as long for 1 % less
BASE = 1  # the channel that others are predicted from: green


def halves(planes: Array) -> tuple[Bits, int]:
    """Return numbers, (c, h, w), over 2^exponent as the bits of half floats, uint16, and the exponent.

    NaN and infinity may be among them.

    >>> bits, exponent = halves(np.array([[[1.0, 0.5]]]))
    >>> (bits.view(np.float16) * 2.0**exponent).tolist()
    [[[1.0, 0.5]]]
    """
    finite = np.abs(planes[np.isfinite(planes)])
    largest = float(finite.max()) if finite.size else 0.0
    exponent = math.frexp(largest)[1] - LARGEST_EXPONENT if largest > 0 else 0
    scaled = np.ldexp(np.asarray(planes, np.float64), -exponent).astype(np.float16)
    return np.ascontiguousarray(scaled).view(np.uint16), exponent


def packed(bits: Bits) -> str:
    """Return planes of 16 bits, (c, h, w), as the text that the page's script unpacks: Base64 of a zlib stream."""
    if len(bits) > BASE:
        base = bits[BASE].copy()
        bits = bits - base  # modulo 2^16, as all sums here and in the script
        bits[BASE] = base
    steps = np.diff(bits, axis=2, prepend=np.uint16(0)).astype(np.uint16)
    content = np.concatenate([(steps >> 8).astype(np.uint8).ravel(), (steps & 0xFF).astype(np.uint8).ravel()])
    return base64.b64encode(zlib.compress(content.tobytes(), LEVEL)).decode("ascii")


def block_means(values: Array, covered: Array, level: int) -> Array:
    """Return the mean of covered pixels in each block of 2^level x 2^level.

    (c, h, w) to (c, h / 2^level, w / 2^level), rounded up at the far edges; 0 where nothing is covered.
    """
    if level == 0:
        return values
    counts = _block_sums(covered.astype(np.float64), level)
    sums = _block_sums(np.where(covered, values, 0), level)
    means: Array = sums / np.maximum(counts, 1)
    return means


def every(values: Array, level: int) -> Array:
    """Return the upper left pixel of each block of 2^level x 2^level, for planes that have no mean, such as ids.

    (..., h, w) to (..., h / 2^level, w / 2^level), rounded up.
    """
    step = 1 << level
    return values[..., ::step, ::step]


def _block_sums(values: Array, level: int) -> Array:
    step = 1 << level
    height, width = values.shape[-2:]
    rows = np.add.reduceat(values, np.arange(0, height, step), axis=-2)
    sums: Array = np.add.reduceat(rows, np.arange(0, width, step), axis=-1)
    return sums


COARSEST = 5  # means over 32 x 32 pixels
FIRST, SECOND, THIRD = 0, 1, 2  # importance: references and what all pictures need; the front; all others
GRACE = 1.5  # levels that each step of importance is spared


class Blob:
    """Planes of one size at every level of coarseness, from all pixels on, and the level that is used.

    Each level has its `text` and what the script must know to unpack it; planes of higher `importance` are made coarse
    first.
    """

    def __init__(self, importance: int, levels: Iterable[Mapping[str, Any]]) -> None:
        self.importance = importance
        self.levels = tuple(levels)
        self.level = 0

    @property
    def text(self) -> str:
        """What the page holds."""
        text: str = self.levels[self.level]["text"]
        return text

    @property
    def size(self) -> int:
        """Characters on the page."""
        return len(self.text)


class Store:
    """All planes of a page; what is put in is known by its number."""

    def __init__(self) -> None:
        self._blobs: list[Blob] = []

    def add(self, planes: Array, covered: Array, importance: int = FIRST) -> int:
        """Put in planes, (c, h, w), which have a mean over blocks of covered pixels; return their number.

        `importance`: `FIRST`, `SECOND` or `THIRD`.
        """
        return self._put(importance, (_numbers(block_means(planes, covered, level)) for level in range(COARSEST + 1)))

    def add_mask(self, covered: Array) -> int:
        """Put in which pixels, (h, w), show a surface; it is never made coarse. Return its number."""
        return self._put(FIRST, [_numbers(covered[None].astype(np.float64))])

    def add_ids(self, ids: Array) -> int:
        """Put in ids, (h, w), uint32: two planes of 16 bits, the lower one first. Return their number."""
        return self._put(SECOND, (_words(every(ids, level)) for level in range(COARSEST + 1)))

    def fit(self, limit: int) -> None:
        """Make planes coarser until all are within `limit` characters, the least important and the last first."""
        size = sum(blob.size for blob in self._blobs)
        steps = sorted((level + GRACE * (THIRD - importance), importance, level)
                       for importance in (FIRST, SECOND, THIRD) for level in range(1, COARSEST + 1))
        for _, importance, level in steps:
            for blob in reversed(self._blobs):
                if size <= limit:
                    return
                if blob.importance == importance and level < len(blob.levels):
                    size -= blob.size
                    blob.level = level
                    size += blob.size

    def texts(self) -> list[str]:
        """Return what the page holds as Base64, by number."""
        return [blob.text for blob in self._blobs]

    def facts(self) -> list[dict[str, Any]]:
        """Return what the script must know to unpack each, by number: channels, exponent and level."""
        return [{**{key: value for key, value in blob.levels[blob.level].items() if key != "text"},
                 "level": blob.level} for blob in self._blobs]

    def _put(self, importance: int, levels: Iterable[Mapping[str, Any]]) -> int:
        self._blobs.append(Blob(importance, levels))
        return len(self._blobs) - 1


def _numbers(planes: Array) -> dict[str, Any]:
    bits, exponent = halves(planes)
    return {"text": packed(bits), "channels": len(bits), "exponent": exponent}


def _words(ids: Array) -> dict[str, Any]:
    words = np.stack([ids & 0xFFFF, ids >> 16]).astype(np.uint16)
    return {"text": packed(words), "channels": 2, "exponent": 0}
