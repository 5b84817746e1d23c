"""PLY meshes: polygons of any sizes and triangle strips, vertex normals, textures that a comment names."""

import dataclasses
import warnings
from pathlib import Path

import numpy as np

from refgi.errors import RefgiWarning, expect
from refgi.scene.files import is_there, tolerate
from refgi.scene.material import UNPAINTED, WHITE, factors, from_codes
from refgi.scene.model import Contents, Material, Mesh
from refgi.scene.plydata import Column, Ply, read_entries
from refgi.scene.repair import triangles_of
from refgi.scene.texture.image import image_file
from refgi.scene.texture.table import Texture
from refgi.types import Array

COLOURS = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b"))
CORNERS = ("vertex_indices", "vertex_index")
COORDINATES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
TEXTURE = "TextureFile"  # of a comment


def read_ply(path: Path) -> Contents:
    """Read the triangles, vertex normals and textures of a PLY file.

    `path`: the file, ASCII or binary. Result: one mesh, or one for each run of faces of one texture where there are
    several. Raises `InputError` if the file is damaged, cut short or holds no triangles.
    """
    ply = read_entries(path)
    vertex = {key: one for key, one in ply.columns.get("vertex", {}).items() if one.counts is None}
    expect(bool(vertex) and ply.elements["vertex"].length > 0, f"{path}: element vertex", "at least one", 0)
    expect({"x", "y", "z"} <= vertex.keys(), f"{path}: element vertex", "properties x, y and z", list(vertex))
    vertices = np.column_stack([vertex[key].values for key in "xyz"])
    has_normals = {"nx", "ny", "nz"} <= vertex.keys()
    normals = np.column_stack([vertex[key].values for key in ("nx", "ny", "nz")]) if has_normals else None
    faces, uv, texture_of, face_of = _faces(ply, vertices, path)
    mesh = Mesh(vertices, faces, normals, UNPAINTED, path.stem)
    mesh.expect_sound(f"{path}")
    colours = _colours(ply, faces, face_of, path)
    mesh = mesh if colours is None else dataclasses.replace(mesh, material=WHITE, colours=colours)
    uv = _vertex_coordinates(vertex, faces) if uv is None else uv
    return Contents(tuple(_painted(mesh, uv, texture_of, ply.comments, path)))


def _colours(ply: Ply, faces: Array, face_of: Array, path: Path) -> Array | None:
    """Return the colours (m, 3, 3) of corners, by vertex or by face, None where there are none or all are white."""
    found = {name: _colours_of(ply.columns.get(name, {})) for name in ("vertex", "face")}
    of_vertex, of_face = found["vertex"], found["face"]
    if of_vertex is not None:
        if of_face is not None:
            text = f"{path}: colours of {len(of_face):,} faces passed over for those of the vertices"
            warnings.warn(RefgiWarning(text), stacklevel=4)
        values = factors(of_vertex, f"{path}")
        return None if values is None else np.asarray(values[faces])
    values = None if of_face is None else factors(np.append(of_face, [[1, 1, 1]], axis=0), f"{path}")
    return None if values is None else np.repeat(values[face_of][:, None], 3, axis=1)


def _colours_of(columns: dict[str, Column]) -> Array | None:
    for names in COLOURS:
        if set(names) <= columns.keys() and all(columns[name].counts is None for name in names):
            return np.column_stack([from_codes(columns[name].values) for name in names])
    return None


def _faces(ply: Ply, vertices: Array, path: Path) -> tuple[Array, Array | None, Array, Array]:
    """Return triangles (m, 3), texture coordinates of their corners that belong to faces, their textures and faces."""
    parts = [_corners(ply, name, path) for name in ("face", "tristrips")]
    some = any(part is not None and len(part.values) for part in parts)
    expect(some, f"{path}: element face", "at least one, with a list vertex_indices", 0)
    triangles, uv, texture_of = np.zeros((0, 3), np.int64), None, np.zeros(0, np.int64)
    face_of = np.zeros(0, np.int64)  # -1: of a strip
    if parts[0] is not None:
        corners, counts, chosen = _polygons(parts[0], len(vertices), path)
        within, crossed = triangles_of(vertices, corners, counts)
        if crossed:
            text = f"{crossed:,} polygon(s) that cross themselves or have very many corners are fans of their first"
            warnings.warn(RefgiWarning(f"{path}: {text}"), stacklevel=4)
        triangles = (corners if len(within) * 3 == len(corners) else corners[within]).reshape(-1, 3).astype(np.int64)
        texture_of, face_of = np.zeros(len(within), np.int64), np.repeat(np.flatnonzero(chosen), counts - 2)
        uv = _corner_coordinates(ply.columns["face"].get("texcoord"), parts[0], within, chosen, path)
        number = ply.columns["face"].get("texnumber")
        if number is not None and number.counts is None:
            texture_of = np.repeat(number.values[chosen].astype(np.int64), counts - 2)
    if parts[1] is not None:
        strips = _strips(parts[1])
        triangles, uv = np.concatenate([triangles, strips]), None if len(strips) else uv
        texture_of = np.append(texture_of, np.zeros(len(strips), np.int64))
        face_of = np.append(face_of, np.full(len(strips), -1))
    expect(len(triangles) > 0, f"{path}: element face", "a polygon of three or more corners", 0)
    return triangles, uv, texture_of, face_of


def _corners(ply: Ply, name: str, path: Path) -> Column | None:
    """Return the lists of vertex indices of an element, None where it has none."""
    columns = ply.columns.get(name, {})
    key = next((key for key in CORNERS if key in columns), None)
    if key is None or not ply.elements[name].length:
        return None
    good = columns[key].counts is not None and columns[key].values.dtype.kind in "iu"
    expect(good, f"{path}: element {name}: {key}", "a list of integers", columns[key].values.dtype.name)
    return columns[key]


def _polygons(lists: Column, vertices: int, path: Path) -> tuple[Array, Array, Array]:
    """Return the corners and their counts of all polygons of three or more, and (faces,) which faces these are."""
    assert lists.counts is not None
    corners, counts = lists.values, lists.counts
    if len(corners) and not (corners.min() >= 0 and corners.max() < vertices):
        outside = (corners < 0) | (corners >= vertices)
        face = int(np.searchsorted(np.cumsum(counts), np.argmax(outside), "right"))
        first = int(counts[:face].sum())
        expect(False, f"{path}: face {face}", f"vertex indices from 0 to {vertices - 1}",
               corners[first : first + counts[face]].tolist())
    chosen = np.asarray(counts >= 3)
    if few := int(np.count_nonzero(~chosen)):
        tolerate(f"{path}: {few:,} faces of fewer than three corners passed over")
        corners, counts = corners[np.repeat(chosen, counts)], counts[chosen]
    return corners, counts, chosen


def _strips(lists: Column) -> Array:
    """Return the triangles (m, 3) of strips, which -1 starts anew; every other one turned to the side of the first."""
    assert lists.counts is not None
    values = lists.values.astype(np.int64)
    if lists.values.dtype.kind == "u":
        values[values == np.iinfo(lists.values.dtype).max] = -1
    values = np.insert(values, np.cumsum(lists.counts), -1)
    number = np.arange(len(values))
    place = number - np.maximum.accumulate(np.where(values < 0, number, -1)) - 1  # in its strip
    triangles = np.stack([values[:-2], values[1:-1], values[2:]], axis=1)
    odd = place[:-2] % 2 == 1
    triangles[odd, :2] = triangles[odd, 1::-1]
    a, b, c = triangles.T
    return np.asarray(triangles[(triangles >= 0).all(axis=1) & (a != b) & (b != c) & (c != a)])


def _vertex_coordinates(vertex: dict[str, Column], faces: Array) -> Array | None:
    """Return (m, 3, 2) texture coordinates that belong to vertices, v downwards, None where there are none."""
    for pair in COORDINATES:
        if set(pair) <= vertex.keys():
            u, v = (vertex[key].values.astype(np.float64) for key in pair)
            return np.asarray(np.stack([u, 1 - v], axis=1)[faces])
    return None


def _corner_coordinates(found: Column | None, lists: Column, within: Array, chosen: Array, path: Path) -> Array | None:
    """Return (m, 3, 2) texture coordinates that belong to the corners of faces, v downwards, None where some lack."""
    if found is None or found.counts is None or lists.counts is None:
        return None
    if not np.array_equal(found.counts, 2 * lists.counts):
        tolerate(f"{path}: texture coordinates of faces (texcoord) passed over: not one pair for each corner")
        return None
    pairs = found.values.astype(np.float64).reshape(-1, 2)[np.repeat(chosen, lists.counts)]
    return np.asarray(np.stack([pairs[:, 0], 1 - pairs[:, 1]], axis=1)[within])


def _painted(mesh: Mesh, uv: Array | None, texture_of: Array, comments: list[str], path: Path) -> list[Mesh]:
    """Return the mesh with its textures, a mesh for each run of faces of one."""
    names = [text.split(None, 1)[1].strip() for text in comments if text.split()[0] == TEXTURE and " " in text.strip()]
    if uv is None or not names:
        if names:
            tolerate(f"{path}: {len(names)} {TEXTURE}(s) passed over for lack of texture coordinates")
        usable = uv is not None and bool(np.isfinite(uv).all())
        return [dataclasses.replace(mesh, uv=uv if usable else None)]
    materials = [_material(name, path) for name in names]
    outside = (texture_of < 0) | (texture_of >= len(materials))
    number = np.where(outside, len(materials), texture_of)
    materials.append(mesh.material)
    starts = np.flatnonzero(np.diff(number, prepend=-1)).tolist()
    meshes = []
    for start, end in zip(starts, [*starts[1:], len(number)], strict=True):
        used, faces = np.arange(len(mesh.vertices)), mesh.faces
        if len(starts) > 1:
            used, faces = np.unique(mesh.faces[start:end], return_inverse=True)
        meshes.append(Mesh(mesh.vertices[used], faces.reshape(-1, 3),
                           None if mesh.normals is None else mesh.normals[used], materials[number[start]], mesh.name,
                           uv[start:end], None if mesh.colours is None else mesh.colours[start:end]))
        meshes[-1].expect_sound(f"{path}")
    return meshes


def _material(name: str, path: Path) -> Material:
    """Return the material of a texture, grey where its file is absent."""
    file = path.parent / name.replace("\\", "/")
    if not is_there(file):
        tolerate(f"{path}: {TEXTURE}: {file.name}: no such file, its faces are grey")
        return UNPAINTED
    return Material(diffuse=(1.0, 1.0, 1.0), texture=Texture(image_file(file)))
