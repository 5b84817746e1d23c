"""PLY: what trimesh would take on trust is checked; polygons, strips, any types and byte orders, textures."""

import struct
from pathlib import Path
from typing import Any

import imageio.v3
import numpy as np
import pytest

from refgi.errors import InputError, RefgiWarning
from refgi.scene import load_scene
from refgi.scene.files import reading_as
from refgi.scene.model import Mesh
from refgi.scene.ply import read_ply
from tests.scene.samples import FACES, TRIANGLES, ply_bytes


def written(folder: Path, content: bytes) -> Path:
    path = folder / "square.ply"
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("text", [False, True])
def test_vertices_and_faces_arrive(tmp_path: Path, text: bool) -> None:
    mesh = read_ply(written(tmp_path, ply_bytes(text=text))).meshes[0]
    assert np.array_equal(mesh.vertices, TRIANGLES)
    assert np.array_equal(mesh.faces, FACES)
    assert mesh.normals is None


def test_quadrilaterals_are_split(tmp_path: Path) -> None:
    mesh = read_ply(written(tmp_path, ply_bytes(faces=np.array([[0, 1, 2, 3]])))).meshes[0]
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize("text", [False, True])
def test_every_truncation_is_refused(tmp_path: Path, text: bool) -> None:
    whole = ply_bytes(text=text)
    for length in range(len(whole) - 2 * text):  # the last digit and line end of a text may be cut unnoticed
        with pytest.raises(InputError, match=r"square\.ply"):
            read_ply(written(tmp_path, whole[:length]))


@pytest.mark.parametrize(("old", "new", "said"), [
    (b"ply\n", b"plx\n", "first line"),
    (b"binary_little_endian", b"binary_middle_endian", "format"),
    (b"element vertex 4", b"element vertex 999999999", "cut short"),
    (b"element vertex 4", b"element vertex 99999999999999999999", "element"),
    (b"element vertex 4", b"element vertex -4", "element"),
    (b"element vertex 4", b"element vertex 0", "element vertex"),
    (b"element face 2", b"element face 0", "element face"),
    (b"element face 2", b"element face 3", "cut short"),
    (b"property float z\n", b"", "x, y and z"),
    (b"property float z", b"property quad z", "property"),
    (b"property list uchar", b"property list float", "ply"),
    (b"end_header", b"end_heeder", "header"),
])
def test_damaged_headers(tmp_path: Path, old: bytes, new: bytes, said: str) -> None:
    with pytest.raises(InputError) as error:
        read_ply(written(tmp_path, ply_bytes().replace(old, new)))
    assert "square.ply" in str(error.value)
    assert said in str(error.value)


@pytest.mark.parametrize("text", [False, True])
def test_indices_and_coordinates_are_checked(tmp_path: Path, text: bool) -> None:
    with pytest.raises(InputError, match=r"face 1: expected vertex indices from 0 to 3, got \[0, 2, 9\]"):
        read_ply(written(tmp_path, ply_bytes(faces=np.array([[0, 1, 2], [0, 2, 9]]), text=text)))
    vertices = TRIANGLES.copy()
    vertices[3, 0] = np.nan
    with pytest.raises(InputError, match="vertex 3: expected finite coordinates"):
        read_ply(written(tmp_path, ply_bytes(vertices, text=text)))


def test_a_mesh_of_flat_faces_alone_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="1 of zero area"):
        load_scene(written(tmp_path, ply_bytes(faces=np.array([[0, 1, 1]]))))


def test_a_bare_mesh_is_framed_and_lit(tmp_path: Path) -> None:
    with pytest.warns(RefgiWarning, match="no camera and no light"):
        scene = load_scene(written(tmp_path, ply_bytes()))
    eye, target = np.array(scene.camera.eye), np.array(scene.camera.target)
    forward = (target - eye) / np.linalg.norm(target - eye)
    for vertex in scene.geometry.vertices:
        towards = (vertex - eye) / np.linalg.norm(vertex - eye)
        assert np.arccos(towards @ forward) < scene.camera.vfov / 2
    light = scene.lights[0]
    axis = np.array(light.direction) / np.linalg.norm(light.direction)
    for vertex in scene.geometry.vertices:
        towards = vertex - np.array(light.position)
        assert np.arccos(towards @ axis / np.linalg.norm(towards)) < light.inner_half_angle


VERTICES = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 1.5, 0)]
CODES = {"char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d"}
FORMS = ("ascii", "binary_little_endian", "binary_big_endian")
Rows = list[tuple[Any, ...]]


def ply(form: str, *elements: tuple[str, str, Rows], comments: str = "", end: str = "\n") -> bytes:
    """Return a PLY file; `elements`: name, properties such as "float x, list uchar int vertex_indices", and rows."""
    head, body = f"ply\nformat {form} 1.0\n{comments}", b""
    for name, properties, rows in elements:
        head += f"element {name} {len(rows)}\n"
        kinds = [one.split() for one in properties.split(", ")]
        head += "".join(f"property {' '.join(kind)}\n" for kind in kinds)
        for row in rows:
            body += as_text(row) if form == "ascii" else as_bytes(row, kinds, "<" if "little" in form else ">")
    body = body.replace(b"\n", end.encode()) if form == "ascii" else body
    return (head + "end_header\n").replace("\n", end).encode() + body


def as_text(row: tuple[Any, ...]) -> bytes:
    words = [f"{len(one)} {' '.join(map(str, one))}" if isinstance(one, list) else str(one) for one in row]
    return (" ".join(words) + "\n").encode()


def as_bytes(row: tuple[Any, ...], kinds: list[list[str]], order: str) -> bytes:
    content = b""
    for kind, one in zip(kinds, row, strict=True):
        if kind[0] == "list":
            content += struct.pack(order + CODES[kind[1]] + f"{len(one)}" + CODES[kind[2]], len(one), *one)
        else:
            content += struct.pack(order + CODES[kind[0]], one)
    return content


def vertices(kind: str = "float") -> tuple[str, str, Rows]:
    return "vertex", f"{kind} x, {kind} y, {kind} z", list(VERTICES)


def faces(*rows: list[int], properties: str = "list uchar int vertex_indices") -> tuple[str, str, Rows]:
    return "face", properties, [(row,) for row in rows]


def read(folder: Path, content: bytes) -> Mesh:
    path = folder / "mesh.ply"
    path.write_bytes(content)
    mesh, = read_ply(path).meshes
    return mesh


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("rows", "expected"), [
    ([[0, 1, 2, 3], [3, 2, 4]], [[0, 1, 2], [0, 2, 3], [3, 2, 4]]),
    ([[3, 2, 4], [0, 1, 2, 3], [3, 2, 4]], [[3, 2, 4], [0, 1, 2], [0, 2, 3], [3, 2, 4]]),
    ([[0, 1, 2, 4, 3]], [[0, 1, 2], [0, 2, 4], [0, 4, 3]]),
    ([[0, 1, 2, 4, 3], [0, 1, 2], [0, 1, 2, 3]], [[0, 1, 2], [0, 2, 4], [0, 4, 3], [0, 1, 2], [0, 1, 2], [0, 2, 3]])])
def test_polygons_of_any_sizes(tmp_path: Path, form: str, rows: list[list[int]], expected: list[list[int]]) -> None:
    mesh = read(tmp_path, ply(form, vertices(), faces(*rows)))
    assert mesh.faces.tolist() == expected
    assert mesh.vertices.tolist() == [list(map(float, one)) for one in VERTICES]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("place", ["double", "float", "short"])
@pytest.mark.parametrize(("counter", "item", "key"), [
    ("uchar", "uint", "vertex_index"), ("int", "short", "vertex_indices"), ("ushort", "uchar", "vertex_indices"),
    ("uint", "ushort", "vertex_index"), ("char", "char", "vertex_indices")])
def test_any_type_and_properties_between(tmp_path: Path, form: str, place: str, counter: str, item: str,
                                         key: str) -> None:
    points: Rows = [(7, x, 3, y, z) for x, y, z in VERTICES]
    if place == "short":
        points = [tuple(int(value) for value in row) for row in points]
    for rows in ([[0, 1, 2], [0, 2, 3]], [[0, 1, 2, 3], [3, 2, 4]]):
        content = ply(form, ("vertex", f"uchar flag, {place} x, int id, {place} y, {place} z", points),
                      ("edge", "int vertex1, int vertex2", [(0, 1)]),
                      ("face", f"float quality, list {counter} {item} {key}, uchar flags, list uchar float more",
                       [(0.5, row, 9, [1.0] * (len(row) - 3)) for row in rows]))
        mesh = read(tmp_path, content)
        assert mesh.vertices.tolist() == [[row[1], row[3], row[4]] for row in points]
        assert [face for face in mesh.faces.tolist() if 4 not in face][:2] == [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("rows", "item"), [
    ([[0, 1, 3, 2, 4]], "int"), ([[0, 1, 3, 2, -1, 3, 2, 4]], "int"), ([[0, 1, 3, 2], [3, 2, 4]], "short"),
    ([[0, 1, 3, 2, 4294967295, 3, 2, 4]], "uint")])
def test_strips_start_anew_and_turn_every_other_triangle(tmp_path: Path, form: str, rows: list[list[int]],
                                                         item: str) -> None:
    properties = f"list int {item} vertex_indices"
    mesh = read(tmp_path, ply(form, vertices(), ("tristrips", properties, [(row,) for row in rows])))
    assert mesh.faces.tolist() == [[0, 1, 3], [3, 1, 2], [3, 2, 4]]
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_each_row_is_a_strip_of_its_own(tmp_path: Path) -> None:
    strips = ("tristrips", "list int int vertex_indices", [([0, 1, 3],), ([1, 2, 3],), ([2, 4, 3],)])
    assert read(tmp_path, ply("ascii", vertices(), strips)).faces.tolist() == [[0, 1, 3], [1, 2, 3], [2, 4, 3]]


def test_strips_beside_faces_and_joined_by_empty_triangles(tmp_path: Path) -> None:
    strips = ("tristrips", "list int int vertex_indices", [([0, 1, 2, 2, 3, 2, 4],)])
    mesh = read(tmp_path, ply("binary_little_endian", vertices(), faces([0, 1, 2]), strips))
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 1, 2], [3, 2, 4]]


@pytest.mark.parametrize("form", FORMS)
def test_faces_of_fewer_corners_are_passed_over_and_refused_when_strict(tmp_path: Path, form: str) -> None:
    content = ply(form, vertices(), faces([0, 1], [0, 1, 2, 3], [], [3], [3, 2, 4]))
    with pytest.warns(RefgiWarning, match=r"mesh\.ply: 3 faces of fewer than three corners passed over"):
        assert read(tmp_path, content).faces.tolist() == [[0, 1, 2], [0, 2, 3], [3, 2, 4]]
    with pytest.raises(InputError, match="3 faces of fewer"), reading_as(strict=True):
        read(tmp_path, content)


def test_a_polygon_that_bends_inwards_keeps_its_area(tmp_path: Path) -> None:
    mesh = read(tmp_path, ply("ascii", ("vertex", "float x, float y, float z", [
        (0, 0, 0), (0, 2, 1), (0, 0, 0.25), (0, -2, 1)]), faces([0, 1, 2, 3])))
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)[:, 0] / 2
    assert np.allclose(across, 0.25)  # 2 triangles; the fan from vertex 1 would hold 1.0 and leave the polygon


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("form", FORMS)
def test_ends_of_line(tmp_path: Path, form: str, end: str) -> None:
    assert read(tmp_path, ply(form, vertices(), faces([0, 1, 2, 3], [3, 2, 4]), end=end)).faces.shape == (3, 3)


def test_the_first_line_may_be_in_capitals(tmp_path: Path) -> None:
    content = ply("ascii", vertices(), faces([0, 1, 2])).replace(b"ply", b"PLY", 1)
    assert read(tmp_path, content).faces.tolist() == [[0, 1, 2]]


def test_a_byte_order_mark_and_blank_lines(tmp_path: Path) -> None:
    content = ply("ascii", vertices(), faces([0, 1, 2]))
    content = content.replace(b"end_header\n", b"end_header\n\n").replace(b"3 0", b"\n3 0")
    assert read(tmp_path, b"\xef\xbb\xbf" + content).faces.tolist() == [[0, 1, 2]]
    with pytest.raises(InputError, match="expected text in UTF-8, got UTF-16"):
        read(tmp_path, content.decode().encode("utf-16"))


@pytest.mark.parametrize("form", FORMS)
def test_normals_of_vertices(tmp_path: Path, form: str) -> None:
    normal = (0.0, 0.6, 0.8)
    mesh = read(tmp_path, ply(form, ("vertex", "float x, float y, float z, double nx, double ny, double nz",
                                     [(*one, *normal) for one in VERTICES]), faces([0, 1, 2], [0, 1, 2, 3])))
    assert mesh.normals is not None
    assert mesh.normals.tolist() == [list(normal)] * 5


@pytest.mark.parametrize(("old", "new", "said"), [
    (b"1 1 0\n", b"1 1\n", "element vertex 2: expected 3 numbers, got '2: 1 1'"),
    (b"1 1 0\n", b"1 1 0 0\n", "element vertex 2: expected 3 numbers, got '4: 1 1 0 0'"),
    (b"1 1 0\n", b"1 x 0\n", "could not convert"), (b"3 0 1 2", b"3 0 1", "element face 0: expected 4 numbers"),
    (b"3 0 1 2", b"3 0 1 2 3", "element face 0: expected 4 numbers"), (b"3 0 1 2", b"x 0 1 2", "the length of a list"),
    (b"3 0 1 2", b"-3 0 1 2", "the length of a list"), (b"3 0 1 2", b"3 0 1.5 2", "whole numbers of int32, got 1.5"),
    (b"3 0 1 2", b"3 0 1 7", "face 0: expected vertex indices from 0 to 4"),
    (b"4 0 1 2 3", b"4 0 1 2 7", r"face 1: expected vertex indices from 0 to 4, got [0, 1, 2, 7]"),
    (b"element vertex 5", b"element vertex 6", "cut short"), (b"element face 2", b"element vertex 2", "each once"),
    (b"list uchar int", b"list float int", "known types"),
    (b"list uchar int", b"list uchar float", "a list of integers"),
    (b"property float x", b"property list uchar float x", "element vertex 1: expected 4 numbers"),
    (b"vertex_indices", b"corners", "a list vertex_indices")])
def test_each_fault_is_one_line(tmp_path: Path, old: bytes, new: bytes, said: str) -> None:
    content = ply("ascii", vertices(), faces([0, 1, 2], [0, 1, 2, 3]))
    assert old in content
    with pytest.raises(InputError) as error:
        read(tmp_path, content.replace(old, new))
    assert "mesh.ply" in str(error.value)
    assert "\n" not in str(error.value)
    assert said in str(error.value).replace('"', "'")


FACE_PROPERTIES = "list uchar int vertex_indices, list uchar float texcoord, int texnumber"
PICTURES = {"a.png": (255, 0, 0), "b.png": (0, 0, 255)}


def pictures(folder: Path) -> None:
    for name, colour in PICTURES.items():
        imageio.v3.imwrite(folder / name, np.full((2, 2, 3), colour, np.uint8))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("pair", [("s", "t"), ("u", "v"), ("texture_u", "texture_v")])
def test_a_texture_lies_by_coordinates_of_vertices(tmp_path: Path, form: str, pair: tuple[str, str]) -> None:
    pictures(tmp_path)
    content = ply(form, ("vertex", f"float x, float y, float z, float {pair[0]}, float {pair[1]}",
                         [(*one, one[0] / 2, one[1] / 2) for one in VERTICES]), faces([0, 1, 2, 3], [3, 2, 4]),
                  comments="comment made by hand\ncomment TextureFile a.png\n")
    mesh = read(tmp_path, content)
    assert mesh.material.diffuse == (1, 1, 1)
    assert mesh.material.texture is not None
    assert mesh.material.texture.image.pixels[0, 0].tolist() == [255, 0, 0]
    assert mesh.uv is not None
    place = mesh.vertices[mesh.faces]
    assert np.allclose(mesh.uv[..., 0], place[..., 0] / 2)
    assert np.allclose(mesh.uv[..., 1], 1 - place[..., 1] / 2)  # row 0 is the top, t = 1


@pytest.mark.parametrize("form", FORMS)
def test_textures_of_faces_and_coordinates_of_their_corners(tmp_path: Path, form: str) -> None:
    pictures(tmp_path)
    places = [[0, 0, 1, 0, 1, 1], [0, 0, 1, 0, 1, 1, 0, 1], [0.5, 0, 0.5, 0.25, 0, 0]]
    rows: Rows = list(zip([[0, 1, 2], [0, 1, 2, 3], [3, 2, 4]], places, [0, 1, 0], strict=True))
    content = ply(form, vertices(), ("face", FACE_PROPERTIES, rows),
                  comments="comment TextureFile a.png\ncomment TextureFile b.png\n")
    path = tmp_path / "mesh.ply"
    path.write_bytes(content)
    meshes = read_ply(path).meshes
    shown = [mesh.material.texture.image.pixels[0, 0].tolist() for mesh in meshes if mesh.material.texture]
    assert shown == [[255, 0, 0], [0, 0, 255], [255, 0, 0]]
    assert [len(mesh.faces) for mesh in meshes] == [1, 2, 1]
    low = [[0, 1], [1, 1], [1, 0]]
    assert [mesh.uv.tolist() for mesh in meshes if mesh.uv is not None] == [
        [low], [low, [[0, 1], [1, 0], [0, 0]]], [[[0.5, 1], [0.5, 0.75], [0, 1]]]]
    assert [mesh.vertices[mesh.faces][:, 0].tolist() for mesh in meshes] == [[[0, 0, 0]], [[0, 0, 0]] * 2, [[0, 1, 0]]]


@pytest.mark.parametrize(("comment", "coordinates", "said"), [
    ("comment TextureFile gone.png\n", True, "TextureFile: gone.png: no such file, its faces are grey"),
    ("comment TextureFile a.png\n", False, "1 TextureFile(s) passed over for lack of texture coordinates")])
def test_what_a_texture_lacks_is_said(tmp_path: Path, comment: str, coordinates: bool, said: str) -> None:
    pictures(tmp_path)
    keys = "float x, float y, float z, " + ("float s, float t" if coordinates else "float p, float q")
    content = ply("ascii", ("vertex", keys, [(*one, 0, 1) for one in VERTICES]), faces([0, 1, 2]), comments=comment)
    with pytest.warns(RefgiWarning) as warned:
        assert read(tmp_path, content).material.diffuse == (0.5, 0.5, 0.5)
    assert [str(one.message) for one in warned] == [f"{tmp_path / 'mesh.ply'}: {said}"]
    with pytest.raises(InputError), reading_as(strict=True):
        read(tmp_path, content)
