"""The header of PLY files: encoding, elements with their properties, comments."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import expect

TYPES = {"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
         "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
         "double": "f8", "float64": "f8"}
ENCODINGS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
LONGEST_HEADER = 65536  # bytes


class Property(NamedTuple):
    """A property as the header has it."""

    name: str
    kind: np.dtype[Any]
    counted_by: np.dtype[Any] | None  # of a list


class Element(NamedTuple):
    """An element as the header has it."""

    name: str
    length: int
    properties: tuple[Property, ...]

    @property
    def names(self) -> list[str]:
        """Those of its properties."""
        return [one.name for one in self.properties]


def read_header(content: bytes, path: Path) -> tuple[dict[str, Element], str, list[str], int]:
    """Return the elements by name, the encoding, comments, and where the entries start."""
    expect(content[:3].lower() == b"ply", f"{path}", "a PLY file (first line 'ply')", content[:8])
    end = content.find(b"end_header", 0, LONGEST_HEADER)
    after = content[end + 10 : end + 12]
    good = end > 0 and after[:1] in (b"\n", b"\r")
    expect(good, f"{path}", "a header that ends (the file is cut short)", f"{len(content)} bytes")
    texts = content[:end].decode("utf-8", "replace").splitlines()[1:]
    lines = [text.split() for text in texts]
    encoding = next((line[1] for line in lines if line[:1] == ["format"] and len(line) > 1), "")
    expect(encoding in ENCODINGS, f"{path}: format", f"one of {', '.join(ENCODINGS)}", encoding)
    elements: dict[str, Element] = {}
    name = ""
    for line in lines:
        if line[:1] == ["element"]:
            expect(len(line) == 3 and line[2].isdecimal() and len(line[2]) < 16, f"{path}: element",
                   "a name and a count of at most 15 digits", " ".join(line))
            name = line[1]
            expect(name not in elements, f"{path}: element", "each once", name)
            elements[name] = Element(name, int(line[2]), ())
        elif line[:1] == ["property"]:
            expect(bool(name), f"{path}: property", "an element before it", " ".join(line))
            one = _property(line, path, ENCODINGS[encoding])
            elements[name] = elements[name]._replace(properties=(*elements[name].properties, one))
    comments = [text.split(None, 1)[1] for text, line in zip(texts, lines, strict=True)
                if line[:1] == ["comment"] and len(line) > 1]
    return elements, encoding, comments, end + 10 + (2 if after == b"\r\n" else 1)


def _property(line: list[str], path: Path, order: str) -> Property:
    is_list = line[1:2] == ["list"]
    types = line[2:4] if is_list else line[1:2]
    good = len(line) == (5 if is_list else 3) and all(name in TYPES for name in types)
    kinds = [np.dtype(order + TYPES[name]) for name in types] if good else []
    expect(good and (not is_list or kinds[0].kind in "iu"), f"{path}: property", "known types and a name",
           " ".join(line))
    return Property(line[-1], kinds[-1], kinds[0] if is_list else None)
