"""OBJ and MTL: indices of either sign, materials as floats, and the line of every fault."""

from pathlib import Path

import numpy as np
import pytest

from refgi.errors import InputError, RefgiWarning
from refgi.scene.files import reading_as
from refgi.scene.obj import read_obj

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def written(folder: Path, text: str) -> Path:
    path = folder / "square.obj"
    path.write_text(text)
    return path


def test_triangles_quadrilaterals_and_relative_indices(tmp_path: Path) -> None:
    mesh = read_obj(written(tmp_path, SQUARE + "f 1 2 3 4\n# note\nf -4/1 -3/2 -1/3 # tail\n")).meshes[0]
    corners = mesh.vertices[mesh.faces]
    assert corners[0].tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
    assert corners[1].tolist() == [[0, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert corners[2].tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def test_negative_indices_count_from_their_line(tmp_path: Path) -> None:
    mesh = read_obj(written(tmp_path, SQUARE + "f -4 -3 -2\nv 9 9 9\nf -5 -4 -3\n")).meshes[0]
    assert np.array_equal(mesh.vertices[mesh.faces[0]], mesh.vertices[mesh.faces[1]])


def test_geometry_equals_trimesh(tmp_path: Path) -> None:
    import io

    import trimesh

    body = trimesh.creation.icosphere(subdivisions=2)
    text = trimesh.exchange.obj.export_obj(body, include_normals=True, digits=17)
    oracle = trimesh.load_mesh(io.StringIO(text), file_type="obj", process=False, maintain_order=True)
    mesh = read_obj(written(tmp_path, text)).meshes[0]
    assert np.array_equal(mesh.vertices[mesh.faces], oracle.vertices[oracle.faces])
    assert mesh.normals is not None
    assert np.allclose(mesh.normals[mesh.faces], body.vertex_normals[body.faces], atol=1e-12)


def test_materials_are_floats_in_order_of_use(tmp_path: Path) -> None:
    (tmp_path / "colours.mtl").write_text(
        "newmtl matt\nKd 0.1 0.2 0.0001\n\nnewmtl shiny\nKd 0.3 0.3 0.3\nKs 0.5 0.5 0.5\nNs 40\nKe 1 2 3\n"
        "newmtl too_bright\nKd 0.8 0.8 0.8\nKs 0.5 0.5 0.5\nNs 40\n")
    text = ("mtllib colours.mtl\n" + SQUARE + "usemtl shiny\nf 1 2 3\nusemtl matt\nf 1 3 4\n"
            "usemtl too_bright\nf 1 2 4\nusemtl unheard\nf 2 3 4\nusemtl shiny\nf 2 3 4\n")
    with pytest.warns(RefgiWarning, match=r"colours.mtl: 1 of 3 materials with diffuse \+ specular .* over 1"):
        meshes = read_obj(written(tmp_path, text)).meshes
    shiny, matt, bright, unheard, again = (mesh.material for mesh in meshes)
    assert matt.diffuse == (0.1, 0.2, 0.0001)
    assert (shiny.specular, shiny.exponent, shiny.emission) == ((0.5, 0.5, 0.5), 40, (1, 2, 3))
    assert not bright.is_glossy
    assert unheard.diffuse == (0.5, 0.5, 0.5)
    assert again == shiny
    assert [len(mesh.faces) for mesh in meshes] == [1, 1, 1, 1, 1]


@pytest.mark.parametrize(("tail", "said"), [
    ("f 1 2 9\n", "line 5: expected an index from 1 to 4 (or negative), got '9'"),
    ("f 0 1 2\n", "line 5"), ("f -5 1 2\n", "line 5"), ("f 1 2\n", "line 5: expected three or more corners"),
    ("f 1 2 x\n", "line 5"), ("f 1//7 2//1 3//1\n", "line 5"), ("v 1 2\nf 1 2 3\n", "line 5: expected 3 number(s)"),
    ("v 1 2 x\nf 1 2 3\n", "line 5"), ("v nan 2 3\nf 1 2 5\n", "finite coordinates"), ("", "at least one polygon"),
    ("mtllib absent.mtl\nf 1 2 3\n", "absent.mtl: no such file"),
])
def test_each_fault_names_file_and_line(tmp_path: Path, tail: str, said: str) -> None:
    with pytest.raises(InputError) as error, reading_as(strict=True):
        read_obj(written(tmp_path, SQUARE + tail))
    assert str(tmp_path) in str(error.value)
    assert said in str(error.value)


def test_albedo_over_one_in_a_material_file(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 1.5 0 0\n")
    with pytest.raises(InputError, match=r"m\.mtl: material 'a': diffuse"):
        read_obj(written(tmp_path, "mtllib m.mtl\n" + SQUARE + "usemtl a\nf 1 2 3\n"))


def test_textures_are_passed_over_with_a_count_and_those_that_are_missing_named(tmp_path: Path) -> None:
    (tmp_path / "the wood.png").write_bytes(b"")
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 0.5 0.5 0.5\nmap_Ka -s 1 1 1 the wood.png\nbump absent bump.png\n"
                                    "newmtl b\nmap_Ks gone.png\n")
    with pytest.warns(RefgiWarning) as said:
        read_obj(written(tmp_path, "mtllib m.mtl\n" + SQUARE + "usemtl a\nf 1 2 3\nmtllib m.mtl\n"))
    assert [str(warning.message) for warning in said] == [
        f"{tmp_path / 'm.mtl'}: 3 texture(s) (bump, map_Ka, map_Ks) passed over (shading normals stay the mesh's); "
        "2 of them name no file: absent bump.png, gone.png"]


def test_textures_that_are_there_are_passed_over_with_a_count(tmp_path: Path) -> None:
    (tmp_path / "wood.png").write_bytes(b"")
    (tmp_path / "m.mtl").write_text("newmtl a\nmap_Ka wood.png\n")
    with pytest.warns(RefgiWarning, match=r"m\.mtl: 1 texture\(s\) \(map_Ka\) passed over$"):
        read_obj(written(tmp_path, "mtllib m.mtl\n" + SQUARE + "usemtl a\nf 1 2 3\n"))


def test_normals_belong_to_their_corners_in_every_material(tmp_path: Path) -> None:
    text = SQUARE + ("vn 1 0 0\nvn 0 1 0\nvn 0 0 1\nusemtl a\nf 1//1 2//2 3//3\nusemtl b\nf 1//3 3//2 4//1\n"
                     "vn 0 0 -1\nusemtl a\nf 1//4 2//4 4//4\n")
    a, b, c = read_obj(written(tmp_path, text)).meshes
    assert a.normals is not None
    assert b.normals is not None
    assert c.normals is not None
    assert a.normals[a.faces].tolist() == [[[1, 0, 0], [0, 1, 0], [0, 0, 1]]]
    assert b.normals[b.faces].tolist() == [[[0, 0, 1], [0, 1, 0], [1, 0, 0]]]
    assert c.normals[c.faces].tolist() == [[[0, 0, -1]] * 3]
    assert b.vertices[b.faces].tolist() == [[[0, 0, 0], [1, 1, 0], [0, 1, 0]]]
