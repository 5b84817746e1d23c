"""PLY files, ASCII or binary: their header, and their entries as one array a property.

Files are read here and not by trimesh, which takes a header's counts on trust, refuses lists of differing lengths in
binary files and skips what it does not know.
"""

import struct
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.scene.files import expect_utf8, read_bytes
from refgi.types import Array

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


class Column(NamedTuple):
    """A property of all entries; `counts` (entries,): items of each entry's list, None where it is no list."""

    values: Array
    counts: Array | None = None


class Ply(NamedTuple):
    """A file: its elements, their columns by name, and the texts of its comments."""

    elements: dict[str, Element]
    columns: dict[str, dict[str, Column]]
    comments: list[str]


def read_entries(path: Path) -> Ply:
    """Read all entries of a PLY file; raises `InputError` if it is damaged, cut short, or a row lacks a number."""
    content = expect_utf8(read_bytes(path), path)
    elements, encoding, comments, start = read_header(content, path)
    if encoding == "ascii":
        return Ply(elements, _from_text(content[start:].decode("ascii", "replace"), elements, path), comments)
    return Ply(elements, _from_bytes(content, start, elements, ENCODINGS[encoding], path), comments)


def _from_bytes(content: bytes, start: int, elements: dict[str, Element], order: str,
                path: Path) -> dict[str, dict[str, Column]]:
    columns = {}
    for element in elements.values():
        least = sum((one.counted_by or one.kind).itemsize for one in element.properties) * element.length
        _expect_left(content, start, least, element, path)
        found = _regular(content, start, element)
        if found is None:
            columns[element.name], start = _walked(content, start, element, order, path)
        else:
            columns[element.name] = _native(found, element)
            start += found.nbytes
    return columns


def _expect_left(content: bytes, start: int, needed: int, element: Element, path: Path) -> None:
    left = len(content) - start
    where = f"{path}: element {element.name}"
    expect(left >= needed, where, f"{needed} bytes of entries (the file is cut short)", left)


def _regular(content: bytes, start: int, element: Element) -> Array | None:
    """Return the entries as records, None where lists differ in length or lead beyond the file."""
    fields: list[tuple[Any, ...]] = []
    place = start
    for k, one in enumerate(element.properties):
        items = 1
        if one.counted_by is not None and element.length:
            if place + one.counted_by.itemsize > len(content):
                return None
            items = int(np.frombuffer(content, one.counted_by, 1, place)[0])
            fields.append((f"count {k}", one.counted_by))
            place += one.counted_by.itemsize
            if not 0 <= items * one.kind.itemsize <= len(content) - place:
                return None
        fields.append((str(k), one.kind) if one.counted_by is None else (str(k), one.kind, (items,)))
        place += items * one.kind.itemsize
    records = np.dtype(fields)
    if records.itemsize * element.length > len(content) - start:
        return None
    found = np.frombuffer(content, records, element.length, start) if records.itemsize else np.zeros(0, records)
    counts = [found[name] for name in records.names or () if name.startswith("count")]
    return found if all((one == one[:1]).all() for one in counts) else None


def _native(records: Array, element: Element) -> dict[str, Column]:
    columns = {}
    for k, one in enumerate(element.properties):
        values = records[str(k)].astype(one.kind.newbyteorder("="))
        if one.counted_by is None:
            columns[one.name] = Column(values)
        else:
            width = values.shape[1] if values.ndim > 1 else 1
            columns[one.name] = Column(values.ravel(), np.full(len(values), width))
    return columns


def _walked(content: bytes, start: int, element: Element, order: str, path: Path) -> tuple[dict[str, Column], int]:
    """Return the columns of entries whose lists differ in length, and where the entries end."""
    places: list[list[int]] = [[] for _ in element.properties]
    counts: list[list[int]] = [[] for _ in element.properties]
    steps = [(places[k].append, counts[k].append, one.kind.itemsize,
              struct.Struct((order or "=") + one.counted_by.char) if one.counted_by is not None else None)
             for k, one in enumerate(element.properties)]
    try:
        for _ in range(element.length):
            for place, count, size, counter in steps:
                items = 1
                if counter is not None:
                    (items,) = counter.unpack_from(content, start)
                    start += counter.size
                    if items < 0:
                        expect(False, f"{path}: element {element.name}", "lists of no negative length", items)
                place(start)
                count(items)
                start += items * size
    except struct.error:
        start = len(content) + 1
    _expect_left(content, 0, start, element, path)
    raw = np.frombuffer(content, np.uint8)
    columns = {}
    for k, one in enumerate(element.properties):
        number = np.array(counts[k], np.int64)
        within = np.arange(number.sum()) - np.repeat(np.cumsum(number) - number, number)
        at = np.repeat(np.array(places[k], np.int64), number) + within * one.kind.itemsize
        values = raw[at[:, None] + np.arange(one.kind.itemsize)].view(one.kind).ravel()
        columns[one.name] = Column(values.astype(one.kind.newbyteorder("=")),
                                   None if one.counted_by is None else number)
    return columns, start


def _from_text(text: str, elements: dict[str, Element], path: Path) -> dict[str, dict[str, Column]]:
    rows = [row for row in text.splitlines() if row and not row.isspace()]
    needed = sum(element.length for element in elements.values() if element.properties)
    expect(len(rows) >= needed, f"{path}", f"{needed} lines of entries (the file is cut short)", len(rows))
    columns, start = {}, 0
    for element in elements.values():
        if element.properties:
            columns[element.name] = _parsed(rows[start : start + element.length], element, path)
            start += element.length
        else:
            columns[element.name] = {}
    return columns


def _parsed(rows: list[str], element: Element, path: Path) -> dict[str, Column]:
    """Return the columns of rows of text, one for each entry."""
    words: list[list[str]] = [[] for _ in element.properties]
    counts: list[list[int]] = [[] for _ in element.properties]
    lists = any(one.counted_by is not None for one in element.properties)
    table = None if lists else _table(rows, len(element.properties))
    if table is None:
        for number, row in enumerate(rows):
            _take(row.split(), element, words, counts, f"{path}: element {element.name} {number}")
    columns = {}
    for k, one in enumerate(element.properties):
        values = np.array(words[k], np.str_) if table is None else table[:, k]
        columns[one.name] = Column(_typed(values, one, f"{path}: element {element.name}: {one.name}"),
                                   None if one.counted_by is None else np.array(counts[k], np.int64))
    return columns


def _table(rows: list[str], width: int) -> Array | None:
    """Return (rows, width) numbers, None where a row is not so many."""
    if not rows:
        return np.zeros((0, width))
    try:
        table = np.loadtxt(rows, comments=None, ndmin=2)
    except ValueError:
        return None
    return table if table.shape == (len(rows), width) else None


def _take(row: list[str], element: Element, words: list[list[str]], counts: list[list[int]], where: str) -> None:
    """Share the words of a row out to the properties; raises `InputError` if there are too few or too many."""
    start = 0
    for k, one in enumerate(element.properties):
        items = 1
        if one.counted_by is not None:
            good = start < len(row) and row[start].isdecimal() and len(row[start]) < 10
            if not good:
                expect(False, where, "the length of a list", " ".join(row[start : start + 1]))
            items = int(row[start])
            counts[k].append(items)
            start += 1
        words[k] += row[start : start + items]
        start += items
    if start != len(row):
        expect(False, where, f"{start} numbers", f"{len(row)}: {' '.join(row)}")


def _typed(values: Array, one: Property, where: str) -> Array:
    """Return numbers or their words in the property's type."""
    try:
        numbers = values.astype(np.float64)
    except ValueError as error:
        expect(False, where, "numbers", str(error))
        raise AssertionError from error
    kind = one.kind.newbyteorder("=")
    if kind.kind == "f":
        with np.errstate(over="ignore"):
            return numbers.astype(kind)
    limits = np.iinfo(kind)
    good = (numbers >= limits.min) & (numbers <= limits.max) & (numbers == np.floor(numbers))
    if not good.all():
        expect(False, where, f"whole numbers of {kind.name}", float(numbers[np.argmin(good)]))
    return numbers.astype(kind)
