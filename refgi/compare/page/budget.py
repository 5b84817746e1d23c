"""Planes of a page within a limit of bytes.

Where all planes are more than the limit, the least important ones are replaced by means over blocks of 2 x 2, 4 x 4 ...
pixels until they fit; what a page says of a picture tells by how much.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.compare.page.floats import block_means, every, halves, packed

Array = npt.NDArray[Any]

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
