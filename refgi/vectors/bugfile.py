"""Likely bugs of a case on disk: one packed file, `bugs.npz`, that the checker alone reads.

`index` is JSON: by stage the cause, where the paper says how it should be, shapes, and of each array that shows it a
piece of `places` (flat indices) and of `bits` (what the array holds there with the bug, as 4-byte words, changed from
the expected ones by exclusive or: most are 0 and take no room).
"""

import io
import json
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pydantic

from refgi.types import Array

BUGS = "bugs.npz"


class Piece(pydantic.BaseModel):
    """Where the elements of one array lie in `places` and `bits`."""

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)
    start: int
    count: int


class BugEntry(pydantic.BaseModel):
    """A likely bug of a stage."""

    model_config = pydantic.ConfigDict(extra="forbid", frozen=True)
    cause: str
    paper: str = ""
    shapes: dict[str, tuple[int, ...]]  # of the arrays with the bug
    arrays: dict[str, Piece]  # elements of those that show it
    blind: bool = False  # this case cannot tell it from the right stage


class Told(NamedTuple):
    """What a bug makes of some elements of an array."""

    places: Array  # (n,) flat indices
    values: Array  # (n,) of the array's type


class BugWriter:
    """Likely bugs of a case, gathered stage by stage."""

    def __init__(self) -> None:
        self._index: dict[str, list[BugEntry]] = {}
        self._places: list[Array] = []
        self._bits: list[Array] = []
        self._count = 0

    def add(self, stage: str, entry: BugEntry, told: Mapping[str, Told], expected: Mapping[str, Array]) -> None:
        """Keep a bug; the pieces of its entry follow from what it tells."""
        pieces = {}
        for name, (places, values) in told.items():
            pieces[name] = Piece(start=self._count, count=len(places))
            self._places.append(places.astype(np.int32))
            self._bits.append(_words(values) ^ _words(expected[name].reshape(-1)[places]))
            self._count += len(places)
        self._index.setdefault(stage, []).append(entry.model_copy(update={"arrays": pieces}))

    def content(self) -> bytes:
        """Return the file."""
        index = {stage: [one.model_dump(mode="json", exclude_defaults=True) for one in entries]
                 for stage, entries in self._index.items()}
        text = np.frombuffer(json.dumps(index, ensure_ascii=False).encode(), np.uint8)
        stream = io.BytesIO()
        np.savez_compressed(stream, index=text, places=np.concatenate([np.zeros(0, np.int32), *self._places]),
                            bits=np.concatenate([np.zeros(0, np.uint32), *self._bits]))
        return stream.getvalue()


class Bugs:
    """Likely bugs of a case, from the bytes of its file; ValueError if it is none."""

    def __init__(self, content: bytes) -> None:
        try:
            with np.load(io.BytesIO(content), allow_pickle=False) as file:
                text, self._places, self._bits = (file[name] for name in ("index", "places", "bits"))
            index = json.loads(text.tobytes().decode())
            self._of = {stage: [BugEntry.model_validate(one) for one in entries] for stage, entries in index.items()}
        except Exception as error:  # a damaged archive raises nearly any, a size beyond memory among them
            raise ValueError(str(error)) from error

    def of(self, stage: str) -> list[BugEntry]:
        """Return those of a stage."""
        return self._of.get(stage, [])

    def told(self, bug: BugEntry, name: str, expected: Array) -> Told:
        """Return what a bug makes of an array whose expected values are given."""
        piece = slice(bug.arrays[name].start, bug.arrays[name].start + bug.arrays[name].count)
        places = self._places[piece]
        right = expected.reshape(-1)[places]
        words = self._bits[piece] ^ _words(right)
        return Told(places, words.astype(np.bool_) if right.dtype.kind == "b" else words.view(right.dtype))


def _words(array: Array) -> Array:
    """Return the elements of a stored array as 4-byte words."""
    array = np.ascontiguousarray(array)
    return array.astype(np.uint32) if array.dtype.kind == "b" else array.view(np.uint32)
