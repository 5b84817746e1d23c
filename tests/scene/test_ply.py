"""PLY: what trimesh would take on trust is checked before and after it."""

from pathlib import Path

import numpy as np
import pytest

from refgi.errors import InputError, RefgiWarning
from refgi.scene import load_scene
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
