"""Wavefront OBJ meshes and the diffuse, specular and emissive colours of their MTL files.

Read line by line here, because trimesh counts a negative index from the end of the whole file and not from the line
it stands on, takes index 0 for 1, hands groups back in reverse order and rounds colours to eight bits.
"""

import warnings
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from refgi.errors import InputError, RefgiWarning, expect, first_faults, shortened
from refgi.scene.files import Contents, is_there, read_bytes
from refgi.scene.material import reflects_too_much
from refgi.scene.model import Array, Material, Mesh, Rgb

Corner = tuple[int, int]  # position and normal (-1: none), counted from 0
TEXTURES = ("bump", "disp", "decal", "norm", "refl")  # and all that starts with map_


def read_obj(path: Path) -> Contents:
    """Read the polygons of an OBJ file, one mesh per material in order of first use.

    `path`: the file; `mtllib` files are looked for beside it. Result: meshes with vertex normals where every corner
    names one. Raises `InputError` if a line cannot be read, an index is out of range, or there are no polygons.
    """
    reader = _Reader(path)
    for number, words in _lines(path):
        reader.take(words, f"{path}: line {number}")
    return reader.contents()


class _Reader:
    """Positions, normals and polygons by material, as the lines come."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.positions: list[tuple[float, ...]] = []
        self.normals: list[tuple[float, ...]] = []
        self.materials: dict[str, Material] = {}
        self.libraries: set[str] = set()
        self.coloured = 0  # vertices with a colour
        self.triangles: dict[str, list[Corner]] = {}
        self.current = "default"

    def take(self, words: list[str], where: str) -> None:
        key, values = words[0], words[1:]
        if key == "v":
            self.positions.append(_numbers(values[:3], where))
            self.coloured += len(values) >= 6
        elif key == "vn":
            self.normals.append(_numbers(values[:3], where))
        elif key == "f":
            self._polygon(values, where)
        elif key == "usemtl" and values:
            self.current = " ".join(values)
        elif key == "mtllib" and values:
            self._read_library(" ".join(values), where)

    def contents(self) -> Contents:
        expect(bool(self.triangles), f"{self.path}: f", "at least one polygon", 0)
        if self.coloured:
            warnings.warn(RefgiWarning(f"{self.path}: colours of {self.coloured:,} vertices passed over"), stacklevel=4)
        positions, normals = np.array(self.positions), np.array(self.normals)
        return Contents(tuple(self._mesh(name, positions, normals) for name in self.triangles))

    def _read_library(self, name: str, where: str) -> None:
        if name in self.libraries:
            return
        self.libraries.add(name)
        try:
            self.materials |= read_mtl(self.path.parent / name)
        except InputError as error:
            raise InputError(f"{where}: mtllib: {shortened(str(error), 1000)}") from error

    def _polygon(self, values: list[str], where: str) -> None:
        expect(len(values) >= 3, where, "three or more corners", len(values))
        corners = [self._corner(value, where) for value in values]
        fan = self.triangles.setdefault(self.current, [])
        for second, third in pairwise(corners[1:]):
            fan += (corners[0], second, third)

    def _corner(self, text: str, where: str) -> Corner:
        parts = text.split("/")
        position = _index(parts[0], len(self.positions), where)
        return position, _index(parts[2], len(self.normals), where) if len(parts) > 2 and parts[2] else -1

    def _mesh(self, name: str, positions: Array, all_normals: Array) -> Mesh:
        corners = np.array(self.triangles[name], np.int64)
        material = self.materials.get(name, Material(name))
        if (corners[:, 1] < 0).any():
            used, faces = np.unique(corners[:, 0], return_inverse=True)
            normals = None
        else:
            pairs, faces = np.unique(corners, axis=0, return_inverse=True)
            used, normals = pairs[:, 0], all_normals[pairs[:, 1]]
        mesh = Mesh(positions[used], faces.reshape(-1, 3), normals, material, name)
        mesh.expect_sound(f"{self.path}: material {name!r}")
        return mesh


def read_mtl(path: Path) -> dict[str, Material]:
    """Read the materials of an MTL file: Kd as albedo, Ks and Ns as Phong lobe, Ke as emission.

    Result: by name. A lobe that would reflect more than arrives together with Kd is left out. Raises `InputError` if
    the file is missing or a value is out of range.

    Warns `RefgiWarning` if lobes are left out, or textures are named.
    """
    textures: list[tuple[str, ...]] = []
    values: dict[str, dict[str, tuple[float, ...]]] = {}
    current: dict[str, tuple[float, ...]] = {}
    for number, words in _lines(path):
        if words[0] == "newmtl":
            current = values.setdefault(" ".join(words[1:]), {})
        elif words[0] in ("Kd", "Ks", "Ke"):
            current[words[0]] = _numbers(words[1:4], f"{path}: line {number}")
        elif words[0] == "Ns":
            current["Ns"] = _numbers(words[1:2], f"{path}: line {number}", 1)
        elif words[0].lower().startswith("map_") or words[0].lower() in TEXTURES:
            textures.append(tuple(words))
    _warn_of_textures(textures, path)
    too_bright = sum(_is_lobed(found) and reflects_too_much(*_reflectances(found)) for found in values.values())
    if too_bright:
        warnings.warn(RefgiWarning(f"{path}: {too_bright:,} of {len(values):,} materials with diffuse + specular "
                                   f"(Kd + Ks) over 1 in a channel: specular left out"), stacklevel=5)
    return {name: _material(name, found, path) for name, found in values.items()}


def _warn_of_textures(textures: Sequence[tuple[str, ...]], path: Path) -> None:
    """Say how many textures a file names, and which of them are not there."""
    if not textures:
        return
    kinds = ", ".join(sorted({shortened(words[0], 40) for words in textures})[:10])
    # options come before the name, which may hold spaces
    found = {words: any(is_there(path.parent / " ".join(words[k:])) for k in range(1, min(len(words), 20)))
             for words in set(textures)}
    missing = [" ".join(words[1:]) for words in textures if not found[words]]
    absent = f"; {len(missing):,} of them name no file: {first_faults([shortened(m, 80) for m in missing], ', ')}"
    text = f"{path}: {len(textures):,} texture(s) ({kinds}) passed over{absent if missing else ''}"
    warnings.warn(RefgiWarning(text), stacklevel=6)


def _is_lobed(found: dict[str, tuple[float, ...]]) -> bool:
    return found.get("Ns", (0.0,))[0] > 0


def _reflectances(found: dict[str, tuple[float, ...]]) -> tuple[Rgb, Rgb]:
    return _rgb(found.get("Kd", (0.5, 0.5, 0.5))), _rgb(found.get("Ks", (0.0, 0.0, 0.0)))


def _material(name: str, found: dict[str, tuple[float, ...]], path: Path) -> Material:
    diffuse, specular = _reflectances(found)
    exponent = found.get("Ns", (0.0,))[0]
    if not _is_lobed(found) or reflects_too_much(diffuse, specular):
        specular, exponent = (0.0, 0.0, 0.0), 0.0
    try:
        return Material(name, diffuse, specular, exponent, emission=_rgb(found.get("Ke", (0.0, 0.0, 0.0))))
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield the number and the words of each line that says something, continued lines joined."""
    text = read_bytes(path).decode("utf-8", "replace").replace("\\\r\n", " ").replace("\\\n", " ")
    for number, line in enumerate(text.splitlines(), 1):
        words = line.partition("#")[0].split()
        if words:
            yield number, words


def _numbers(words: list[str], where: str, count: int = 3) -> tuple[float, ...]:
    try:
        values = tuple(float(word) for word in words)
    except ValueError:
        values = ()
    expect(len(values) == count, where, f"{count} number(s)", " ".join(words))
    return values


def _index(text: str, count: int, where: str) -> int:
    try:
        index = int(text)
    except ValueError:
        index = 0
    expect(1 <= abs(index) <= count, where, f"an index from 1 to {count} (or negative)", text)
    return index - 1 if index > 0 else count + index


def _rgb(values: tuple[float, ...]) -> Rgb:
    return values[0], values[1], values[2]
