"""Wavefront OBJ meshes; their materials come from `mtl`.

Read line by line here, because trimesh counts a negative index from the end of the whole file and not from the line
it stands on, takes index 0 for 1, hands groups back in reverse order and rounds colours to eight bits. Texture
coordinates of OBJ have v = 0 at the bottom of the picture; they are turned when they are read.
"""

import warnings
from itertools import pairwise
from pathlib import Path

import numpy as np

from refgi.errors import InputError, RefgiWarning, expect, shortened
from refgi.scene.files import Contents
from refgi.scene.model import Array, Material, Mesh
from refgi.scene.mtl import Maps, lines_of, numbers_of, read_library

Corner = tuple[int, int, int]  # position, normal and texture coordinates (-1: none), counted from 0


def read_obj(path: Path) -> Contents:
    """Read the polygons of an OBJ file, one mesh per material in order of first use.

    `path`: the file; `mtllib` files are looked for beside it. Result: meshes with vertex normals where every corner
    names one. Raises `InputError` if a line cannot be read, an index is out of range, or there are no polygons.
    """
    reader = _Reader(path)
    for number, words in lines_of(path):
        reader.take(words, f"{path}: line {number}")
    return reader.contents()


class _Reader:
    """Positions, normals and polygons by material, as the lines come."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.positions: list[tuple[float, ...]] = []
        self.normals: list[tuple[float, ...]] = []
        self.coordinates: list[tuple[float, ...]] = []
        self.materials: dict[str, Material] = {}
        self.maps: dict[str, Maps] = {}
        self.without = 0  # faces whose texture has no coordinates
        self.libraries: set[str] = set()
        self.coloured = 0  # vertices with a colour
        self.triangles: dict[str, list[Corner]] = {}
        self.current = "default"

    def take(self, words: list[str], where: str) -> None:
        key, values = words[0], words[1:]
        if key == "v":
            self.positions.append(numbers_of(values[:3], where))
            self.coloured += len(values) >= 6
        elif key == "vn":
            self.normals.append(numbers_of(values[:3], where))
        elif key == "vt":
            self.coordinates.append(numbers_of([*values, "0"][:2], where, 2))
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
        coordinates = np.array([*self.coordinates, (0.0, 0.0)])
        coordinates[:, 1] = 1 - coordinates[:, 1]
        meshes = [mesh for name in self.triangles for mesh in self._meshes(name, positions, normals, coordinates)]
        if self.without:
            warnings.warn(RefgiWarning(f"{self.path}: textures of {self.without:,} triangles passed over for lack of "
                                       "texture coordinates (vt)"), stacklevel=4)
        return Contents(tuple(meshes))

    def _read_library(self, name: str, where: str) -> None:
        if name in self.libraries:
            return
        self.libraries.add(name)
        try:
            materials, maps = read_library(self.path.parent / name)
            self.materials |= materials
            self.maps = {key: found for key, found in self.maps.items() if key not in materials} | maps
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
        normal = _index(parts[2], len(self.normals), where) if len(parts) > 2 and parts[2] else -1
        has_vt = len(parts) > 1 and parts[1] and self.coordinates
        return position, normal, _index(parts[1], len(self.coordinates), where) if has_vt else -1

    def _meshes(self, name: str, positions: Array, normals: Array, coordinates: Array) -> list[Mesh]:
        """Return the mesh of a material; what lacks the coordinates for its texture becomes another, without it."""
        corners = np.array(self.triangles[name], np.int64)
        material = self.materials.get(name, Material(name))
        placed = np.repeat((corners[:, 2].reshape(-1, 3) >= 0).all(axis=1), 3)
        if name not in self.maps:
            return [self._mesh(name, corners, positions, normals, material, coordinates if placed.all() else None)]
        self.without += int(np.count_nonzero(~placed)) // 3
        meshes = []
        if placed.any():
            found, painted = self.maps[name].place, self.maps[name].painted(material)
            # u' = s u + o as the file has them, v upwards
            scale, offset, bottom = np.array(found.scale), np.array(found.offset), np.array((0.0, 1.0))
            turned = (coordinates - bottom) * scale + bottom + offset * (1.0, -1.0)
            meshes.append(self._mesh(name, corners[placed], positions, normals, painted, turned))
        if not placed.all():
            meshes.append(self._mesh(name, corners[~placed], positions, normals, material, None))
        return meshes

    def _mesh(self, name: str, corners: Array, positions: Array, all_normals: Array, material: Material,
              coordinates: Array | None) -> Mesh:
        uv = None if coordinates is None else coordinates[corners[:, 2]].reshape(-1, 3, 2)
        corners = corners[:, :2]
        if (corners[:, 1] < 0).any():
            used, faces = np.unique(corners[:, 0], return_inverse=True)
            normals = None
        else:
            pairs, faces = np.unique(corners, axis=0, return_inverse=True)
            used, normals = pairs[:, 0], all_normals[pairs[:, 1]]
        mesh = Mesh(positions[used], faces.reshape(-1, 3), normals, material, name, uv)
        mesh.expect_sound(f"{self.path}: material {name!r}")
        return mesh


def _index(text: str, count: int, where: str) -> int:
    try:
        index = int(text)
    except ValueError:
        index = 0
    expect(1 <= abs(index) <= count, where, f"an index from 1 to {count} (or negative)", text)
    return index - 1 if index > 0 else count + index
