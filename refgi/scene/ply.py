"""PLY meshes, parsed by trimesh between two checks of our own.

trimesh trusts the header's counts and silently keeps what it could read, so the header is held against the file's
size before, and the result against the header after. Its import takes more than a second and is therefore left until
a PLY file is met.
"""

import io
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import InputError, RefgiWarning, expect
from refgi.scene.files import Contents, read_bytes
from refgi.scene.model import Array, Mesh

SIZES = {"char": 1, "uchar": 1, "int8": 1, "uint8": 1, "short": 2, "ushort": 2, "int16": 2, "uint16": 2, "int": 4,
         "uint": 4, "int32": 4, "uint32": 4, "float": 4, "float32": 4, "double": 8, "float64": 8}
LONGEST_HEADER = 65536  # bytes
COLOURS = {"red", "green", "blue", "r", "g", "b"}


class _Element(NamedTuple):
    name: str
    length: int
    properties: list[str]
    least_bytes: int  # of one entry in a binary file; lists hold at least three items in a face


def read_ply(path: Path) -> Contents:
    """Read the triangles (and vertex normals) of a PLY file.

    `path`: the file, ASCII or binary. Result: one mesh of the default material. Raises `InputError` if the file is
    damaged, cut short or holds no triangles.
    """
    content = read_bytes(path)
    elements, encoding, start = _header(content, path)
    _expect_complete(elements, encoding, content, start, path)
    parsed = _parsed(content, path)
    vertices, faces = np.asarray(parsed.get("vertices", ())), parsed.get("faces", ())
    _warn_of_colours(elements, path)
    expect(len(vertices) == elements["vertex"].length, f"{path}: element vertex",
           f"{elements['vertex'].length} entries", len(vertices))
    expect(len(faces) > 0, f"{path}: face", "at least one", 0)
    expect(len(faces) >= elements["face"].length, f"{path}: element face",
           f"{elements['face'].length} polygons of three or four corners", len(faces))
    normals = parsed.get("vertex_normals")
    mesh = Mesh(vertices, _triangles(faces, path), None if normals is None else np.asarray(normals),
                name=path.stem)
    mesh.expect_sound(f"{path}")
    return Contents((mesh,))


def _warn_of_colours(elements: dict[str, _Element], path: Path) -> None:
    """Say what a renderer of constant reflectances does not read."""
    for name, what in (("vertex", "vertices"), ("face", "faces")):
        found = [key for key in elements[name].properties if key.removeprefix("diffuse_") in COLOURS]
        if found:
            text = f"{path}: colours of {elements[name].length:,} {what} ({', '.join(found[:8])}) passed over"
            warnings.warn(RefgiWarning(text), stacklevel=4)


def _header(content: bytes, path: Path) -> tuple[dict[str, _Element], str, int]:
    """Return the elements by name, the encoding, and where the entries start."""
    expect(content[:3] == b"ply", f"{path}", "a PLY file (first line 'ply')", content[:8])
    end = content.find(b"end_header", 0, LONGEST_HEADER)
    line_end = content.find(b"\n", end)
    expect(end > 0 and line_end > 0, f"{path}", "a header that ends (the file is cut short)", f"{len(content)} bytes")
    lines = [line.split() for line in content[:end].decode("ascii", "replace").splitlines()[1:]]
    encoding = next((line[1] for line in lines if line[:1] == ["format"] and len(line) > 1), "")
    known = ("ascii", "binary_little_endian", "binary_big_endian")
    expect(encoding in known, f"{path}: format", f"one of {', '.join(known)}", encoding)
    elements: dict[str, _Element] = {}
    current: _Element | None = None
    for line in lines:
        if line[:1] == ["element"]:
            expect(len(line) == 3 and line[2].isdecimal() and len(line[2]) < 16, f"{path}: element",
                   "a name and a count of at most 15 digits", " ".join(line))
            current = _Element(line[1], int(line[2]), [], 0)
            elements[line[1]] = current
        elif line[:1] == ["property"]:
            expect(current is not None, f"{path}: property", "an element before it", " ".join(line))
            current = _with_property(current, line, path)  # type: ignore[arg-type]
            elements[current.name] = current
    return elements, encoding, line_end + 1


def _with_property(element: _Element, line: list[str], path: Path) -> _Element:
    is_list = line[1:2] == ["list"]
    types = line[2:4] if is_list else line[1:2]
    good = len(line) == (5 if is_list else 3) and all(name in SIZES for name in types)
    expect(good, f"{path}: property", "known types and a name", " ".join(line))
    least = SIZES[types[0]] + 3 * SIZES[types[1]] * (element.name == "face") if is_list else SIZES[types[0]]
    return element._replace(properties=[*element.properties, line[-1]], least_bytes=element.least_bytes + least)


def _expect_complete(elements: dict[str, _Element], encoding: str, content: bytes, start: int, path: Path) -> None:
    for name, needed in (("vertex", ("x", "y", "z")), ("face", ())):
        expect(name in elements and elements[name].length > 0, f"{path}: element {name}", "at least one", 0)
        lacking = [key for key in needed if key not in elements[name].properties]
        expect(not lacking, f"{path}: element {name}", "properties x, y and z", elements[name].properties)
    if encoding == "ascii":
        needed_lines, lines = sum(e.length for e in elements.values()), content.count(b"\n", start) + 1
        expect(lines >= needed_lines, f"{path}", f"{needed_lines} lines of entries (the file is cut short)", lines)
    else:
        least, left = sum(e.length * e.least_bytes for e in elements.values()), len(content) - start
        expect(left >= least, f"{path}", f"at least {least} bytes of entries (the file is cut short)", left)


def _parsed(content: bytes, path: Path) -> dict[str, Any]:
    """Let trimesh parse the file; whatever it raises or warns of becomes one error."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from trimesh.exchange.ply import load_ply

        warnings.simplefilter("error")
        try:
            return dict(load_ply(io.BytesIO(content), fix_texture=False, skip_materials=True))
        except Exception as error:  # trimesh documents no types; a damaged file raises nearly any
            raise InputError(f"{path}: damaged PLY entries: {error}") from error


def _triangles(faces: Any, path: Path) -> Array:
    corners = np.asarray(faces)
    good = corners.ndim == 2 and corners.shape[1] in (3, 4) and corners.dtype.kind in "iu"
    expect(good, f"{path}: face", "lists of three or four indices", f"{corners.dtype} {corners.shape}")
    if corners.shape[1] == 4:
        corners = corners[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return corners.astype(np.int64)
