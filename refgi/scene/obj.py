"""Wavefront OBJ meshes; their materials come from `mtl`.

Read line by line here, because trimesh counts a negative index from the end of the whole file and not from the line
it stands on, takes index 0 for 1, hands groups back in reverse order and rounds colours to eight bits. Texture
coordinates of OBJ have v = 0 at the bottom of the picture; they are turned when they are read.
"""

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from refgi.errors import InputError, RefgiWarning, expect, first_faults, shortened
from refgi.scene.files import is_strict, is_there
from refgi.scene.material import UNPAINTED, WHITE, factors
from refgi.scene.mesh import expect_all_sound, expect_coordinates
from refgi.scene.model import Contents, Material, Mesh
from refgi.scene.mtl import Maps, lines_of, numbers_of, read_library
from refgi.scene.repair import triangles_of
from refgi.scene.texture.image import expect_all_fit
from refgi.types import Array

NOT_POLYGONS = {"l": "lines", "p": "points", "curv": "curves", "curv2": "curves", "surf": "free-form surfaces"}


def read_obj(path: Path) -> Contents:
    """Read the polygons of an OBJ file in its order, one mesh for each run of faces of one material.

    `path`: the file; `mtllib` files are looked for beside it. Result: meshes with vertex normals where any corner names
    one; corners that name none have the normal of their face. Raises `InputError` if a line cannot be read, an index of
    a vertex is out of range, or there are no polygons.
    """
    reader = _Reader(path)
    for number, words in lines_of(path):
        reader.take(words, f"{path}: line {number}")
    return reader.contents()


class _Corners(NamedTuple):
    """The corners of all triangles in the file's order."""

    position: Array  # (m, 3)
    normal: Array  # (m, 3); -1: none
    coordinates: Array  # (m, 3); -1: none
    material: Array  # (m,) in the order of first use


class _Reader:
    """Positions, normals and polygons, as the lines come."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.positions: list[tuple[float, ...]] = []
        self.normals: list[tuple[float, ...]] = []
        self.coordinates: list[tuple[float, ...]] = []
        self.materials: dict[str, Material] = {}
        self.maps: dict[str, Maps] = {}
        self.painted: dict[str, Material] = {}  # with their textures decoded
        self.libraries: set[str] = set()
        self.absent: list[str] = []  # of them
        self.absent_textures: list[str] = []
        self.colours: dict[int, tuple[float, ...]] = {}  # of vertices that have one
        self.passed_over: dict[str, int] = {}
        self.corners: list[tuple[int, int, int]] = []  # position, normal and texture coordinates (-1: none), from 0
        self.counts: list[int] = []  # corners of each polygon
        self.material_of: list[int] = []  # of each polygon
        self.names: dict[str, int] = {}  # of materials, in order of first use
        self.current = ""

    def take(self, words: list[str], where: str) -> None:
        key, values = words[0], words[1:]
        if key == "v":
            if len(values) >= 6:
                self.colours[len(self.positions)] = numbers_of(values[3:6], where)
            self.positions.append(numbers_of(values[:3], where))
        elif key == "vn":
            self.normals.append(numbers_of(values[:3], where))
        elif key == "vt":
            self.coordinates.append(numbers_of([*values, "0"][:2], where, 2))
        elif key == "f":
            self._polygon(values, where)
        elif key == "usemtl" and values:
            self.current = " ".join(values)
        elif key == "mtllib" and values:
            self._read_libraries(values, where)
        elif key in NOT_POLYGONS:
            self._pass_over(NOT_POLYGONS[key])

    def contents(self) -> Contents:
        expect(bool(self.counts), f"{self.path}: f", "at least one polygon of three or more corners", 0)
        meshes = list(self._meshes(self._triangles()))
        self._warn()
        expect_all_sound(meshes, lambda number: f"{self.path}: material {meshes[number].name!r}")
        undefined = [name for name in self.names if name and name not in self.materials]
        return Contents(tuple(meshes), undefined=() if self.absent else tuple(undefined))

    def _warn(self) -> None:
        for what, count in self.passed_over.items():
            warnings.warn(RefgiWarning(f"{self.path}: {count:,} {what} passed over"), stacklevel=5)
        for what, names in (("material file(s) not there, their materials are grey", self.absent),
                            ("texture(s) of map_Kd and map_d not there, left out", self.absent_textures)):
            if names:
                text = f"{self.path}: {len(names):,} {what}: {first_faults(names, ', ')}"
                warnings.warn(RefgiWarning(text), stacklevel=5)

    def _pass_over(self, what: str) -> None:
        self.passed_over[what] = self.passed_over.get(what, 0) + 1

    def _read_libraries(self, words: list[str], where: str) -> None:
        """Read the libraries of an mtllib line: one name that may hold spaces, or several."""
        whole = " ".join(words)
        names = [whole] if len(words) == 1 or self._library(whole) is not None else words
        for name in names:
            if name not in self.libraries:
                self.libraries.add(name)
                self._read_library(name, where)

    def _library(self, name: str) -> Path | None:
        """Return the file of a library, None where there is none."""
        for way in (name, name.replace("\\", "/")):
            if is_there(self.path.parent / way):
                return self.path.parent / way
        return None

    def _read_library(self, name: str, where: str) -> None:
        found = self._library(name)
        if found is None and not is_strict():
            self.absent.append(shortened(name, 80))
            return
        try:
            materials, maps = read_library(found or self.path.parent / name)
        except InputError as error:
            raise InputError(f"{where}: mtllib: {shortened(str(error), 1000)}") from error
        # the first library that has a name counts
        self.maps |= {key: one for key, one in maps.items() if key not in self.materials}
        self.materials = materials | self.materials

    def _polygon(self, values: list[str], where: str) -> None:
        if len(values) < 3:
            expect(not is_strict(), where, "three or more corners", len(values))
            self._pass_over("faces of fewer than three corners")
            return
        self.corners += [self._corner(value, where) for value in values]
        self.counts.append(len(values))
        self.material_of.append(self.names.setdefault(self.current, len(self.names)))

    def _corner(self, text: str, where: str) -> tuple[int, int, int]:
        parts = text.split("/")
        position = _index(parts[0], len(self.positions), where)
        normal = self._spare_index(parts[2], len(self.normals), where, "vn") if len(parts) > 2 and parts[2] else -1
        coordinates = -1
        if len(parts) > 1 and parts[1]:
            coordinates = self._spare_index(parts[1], len(self.coordinates), where, "vt")
        return position, normal, coordinates

    def _spare_index(self, text: str, count: int, where: str, key: str) -> int:
        """Return the index of a normal or coordinates, -1 where there is none such: the position is enough."""
        index = _integer(text)
        if index is None or 1 <= abs(index) <= count or is_strict():
            return _index(text, count, where) if count or key == "vn" else -1
        if count or key == "vn":
            self._pass_over(f"indices of absent {'normals' if key == 'vn' else 'texture coordinates'} ({key})")
        return -1

    def _triangles(self) -> _Corners:
        corners = np.array(self.corners, np.int64)
        counts = np.array(self.counts, np.int64)
        triangles, crossed = triangles_of(np.array(self.positions), corners[:, 0], counts)
        if crossed:
            text = f"{crossed:,} polygon(s) that cross themselves or have very many corners are fans of their first"
            warnings.warn(RefgiWarning(f"{self.path}: {text}"), stacklevel=5)
        position, normal, coordinates = (corners[triangles, k] for k in range(3))
        return _Corners(position, normal, coordinates, np.repeat(np.array(self.material_of, np.int64), counts - 2))

    def _meshes(self, corners: _Corners) -> Iterator[Mesh]:
        """Yield a mesh for each run of triangles of one material, with or without its textures."""
        positions, coordinates = np.array(self.positions), np.array([*self.coordinates, (0.0, 0.0)])
        coordinates[:, 1] = 1 - coordinates[:, 1]
        names = list(self.names)
        textured = np.array([name in self.maps for name in names])[corners.material]
        placed = np.asarray((corners.coordinates >= 0).all(axis=1))
        if without := int(np.count_nonzero(textured & ~placed)):
            text = f"textures of {without:,} triangles passed over for lack of texture coordinates (vt)"
            warnings.warn(RefgiWarning(f"{self.path}: {text}"), stacklevel=5)
        # what lacks the coordinates for its texture is a mesh without it
        kind = 2 * corners.material + (textured & ~placed)
        starts = np.flatnonzero(np.diff(kind, prepend=-1))
        normal_of, normals = self._normals(corners, positions, starts)
        run = np.cumsum(np.diff(kind, prepend=-1) != 0) - 1
        key, number = np.unique(corners.position * (len(normals) + 1) + normal_of, return_inverse=True)
        vertex, index = np.unique(run[:, None] * len(key) + number.reshape(-1, 3), return_inverse=True)
        index = index.reshape(-1, 3)
        position, normal = np.divmod(key[vertex % len(key)], len(normals) + 1)
        first = np.searchsorted(vertex, np.arange(len(starts) + 1) * len(key)).tolist()
        ends = np.append(starts[1:], len(kind)).tolist()
        colours = self._colours()
        shown = {names[number] for number in corners.material[starts[textured[starts] & placed[starts]]]}
        expect_all_fit((found.path for name in shown for found in self.maps[name][:2] if found),
                       f"{self.path}: textures")
        for k, (start, end) in enumerate(zip(starts.tolist(), ends, strict=True)):
            part, faces = slice(first[k], first[k + 1]), slice(start, end)
            name = names[corners.material[start]]
            material, uv = self._painted(name, bool(textured[start] and placed[start])), None
            if placed[faces].all():
                uv = self._laid(coordinates[corners.coordinates[faces]], name)
            has_normals = normal[first[k]] > 0
            yield Mesh(positions[position[part]], index[faces] - first[k],
                       normals[normal[part] - 1] if has_normals else None, material, name or "default", uv,
                       None if colours is None else colours[corners.position[faces]])

    def _normals(self, corners: _Corners, positions: Array, starts: Array) -> tuple[Array, Array]:
        """Return (m, 3) one more than the number of each corner's normal, 0 where its run has none, and normals (k, 3).

        Behind the file's normals stand those of faces of which corners name none, in runs in which others do.
        """
        numbers = corners.normal + 1
        lacking = numbers == 0
        named = np.add.reduceat(np.count_nonzero(numbers, axis=1), starts)
        in_such_runs = np.repeat(named > 0, np.diff(starts, append=len(numbers)))
        mended = np.flatnonzero(in_such_runs & lacking.any(axis=1))
        a, b, c = (positions[corners.position[mended, k]] for k in range(3))
        with np.errstate(over="ignore", invalid="ignore"):  # coordinates are checked later
            across = np.cross(b - a, c - a)
        own = len(self.normals) + 1 + np.arange(len(mended))[:, None]
        numbers[mended] = np.where(lacking[mended], own, numbers[mended])
        return numbers, np.concatenate([np.array(self.normals, np.float64).reshape(-1, 3), across])

    def _colours(self) -> Array | None:
        """Return the colours (n, 3) of all vertices, white where a vertex has none; None where none has any."""
        if not self.colours:
            return None
        colours = np.ones((len(self.positions), 3))
        colours[list(self.colours)] = list(self.colours.values())
        return factors(colours, f"{self.path}")

    def _painted(self, name: str, textured: bool) -> Material:
        if textured and name not in self.painted:
            self.painted[name] = self.maps[name].painted(self.materials[name])
            self.absent_textures += [shortened(found.path.name, 80) for found in self.maps[name].absent]
        return self.painted[name] if textured else self.materials.get(name) or Material(
            name or "default", WHITE.diffuse if self.colours else UNPAINTED.diffuse)

    def _laid(self, coordinates: Array, name: str) -> Array:
        """Return texture coordinates, v downwards, as a material's maps lie: u' = s u + o as the file has them."""
        if name not in self.maps:
            return coordinates
        found, bottom = self.maps[name].place, np.array((0.0, 1.0))
        with np.errstate(over="ignore", invalid="ignore"):
            laid = np.asarray((coordinates - bottom) * found.scale + bottom + np.array(found.offset) * (1.0, -1.0))
        expect_coordinates(laid, len(laid), f"{self.path}: material {shortened(repr(name))}")
        return laid


def _index(text: str, count: int, where: str) -> int:
    """Return an index of the file, from 1 or negative, counted from 0."""
    index = _integer(text)
    if index is None or not 1 <= abs(index) <= count:
        expect(False, where, f"an index from 1 to {count} (or negative)", text)
        return -1
    return index - 1 if index > 0 else count + index


def _integer(text: str) -> int | None:
    try:
        return int(text)
    except ValueError:
        return None
