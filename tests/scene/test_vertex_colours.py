"""Vertex colours of every format become factors of the diffuse reflectance at each face's corners."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from refgi.errors import InputError, RefgiWarning
from refgi.frame import Frame
from refgi.scene import Camera, Scene, load_scene
from refgi.scene.obj import read_obj
from refgi.scene.ply import read_ply
from tests.scene.samples import BUFFER, FACES, TRIANGLES, glb_bytes, gltf_tree, ply_bytes, write_scene

# of the sample's square: red and green to the left, at (0, 0) and (0, 1); yellow-ish and half blue to the right
COLOURS = np.array([[1, 0, 0, 1], [1, 1, 0, 1], [0, 0, 0.5, 1], [0, 1, 0, 1]])
TYPES = {5126: ("<f4", 1), 5121: ("<u1", 255), 5123: ("<u2", 65535)}


def coloured(folder: Path, code: int, kind: str, *, normalised: bool = True, material: bool = False,
             values: np.ndarray = COLOURS, edit: Any = None) -> Path:
    """Write the sample square with COLOR_0 of a component type."""
    dtype, most = TYPES[code]
    width = 4 if kind == "VEC4" else 3
    stride = -(-width * np.dtype(dtype).itemsize // 4) * 4
    stored = np.zeros((4, stride // np.dtype(dtype).itemsize), dtype)
    stored[:, :width] = np.round(values[:, :width] * most) if most > 1 else values[:, :width]
    tree = gltf_tree()
    tree["bufferViews"].append({"buffer": 0, "byteOffset": 60, "byteLength": stored.nbytes, "byteStride": stride})
    tree["accessors"].append({"bufferView": 2, "componentType": code, "count": 4, "type": kind} | (
        {"normalized": True} if normalised and most > 1 else {}))
    tree["buffers"][0]["byteLength"] = 60 + stored.nbytes
    primitive, = tree["meshes"][0]["primitives"]
    primitive["attributes"]["COLOR_0"] = 2
    if not material:
        del primitive["material"]
    if edit is not None:
        edit(tree)
    path = folder / "square.glb"
    path.write_bytes(glb_bytes(tree, BUFFER + stored.tobytes()))
    return path


@pytest.mark.parametrize("normalised", [True, False])
@pytest.mark.parametrize("kind", ["VEC3", "VEC4"])
@pytest.mark.parametrize("code", TYPES)
def test_gltf_in_all_component_types(tmp_path: Path, code: int, kind: str, normalised: bool) -> None:
    scene = load_scene(coloured(tmp_path, code, kind, normalised=normalised))
    assert scene.materials[0].diffuse == (1, 1, 1)
    assert scene.geometry.colours is not None
    np.testing.assert_allclose(scene.geometry.colours, COLOURS[FACES][..., :3], atol=1 / 255 if code == 5121 else 1e-4)


def seen(scene: Scene, x: float, y: float) -> np.ndarray:
    """Return the albedo of a point of the sample's square, at z = 3 and moved by (1, 2)."""
    camera = Camera((1 + x, 2 + y, 5), (1 + x, 2 + y, 3), vfov=0.01, width=1, height=1)
    pixel: np.ndarray = Frame(Scene("one", scene.geometry, scene.materials, camera, scene.lights),
                              dtype=np.float64).gbuffer.albedo[:, 0, 0]
    return pixel


def test_gltf_multiplies_the_base_colour_between_the_corners(tmp_path: Path) -> None:
    scene = load_scene(coloured(tmp_path, 5126, "VEC4", material=True))
    base = np.array([0.1, 0.2, 0.3])
    for x, y in ((0.25, 0.75), (0.6, 0.3), (0.01, 0.99), (0.5, 0.25)):
        if x > y:  # corners 0, 1, 2: at (0, 0), (1, 0), (1, 1)
            expected = (1 - x) * COLOURS[0] + (x - y) * COLOURS[1] + y * COLOURS[2]
        else:  # corners 0, 2, 3
            expected = (1 - y) * COLOURS[0] + x * COLOURS[2] + (y - x) * COLOURS[3]
        np.testing.assert_allclose(seen(scene, x, y), base * expected[:3], atol=1e-9)


def test_white_colours_are_none(tmp_path: Path) -> None:
    assert load_scene(coloured(tmp_path, 5121, "VEC4", values=np.ones((4, 4)))).geometry.colours is None


def test_gltf_colours_beyond_1_are_cut_and_said(tmp_path: Path) -> None:
    with pytest.warns(RefgiWarning, match=r"COLOR_0: 1 vertex colour\(s\) beyond 0 to 1 cut"):
        scene = load_scene(coloured(tmp_path, 5126, "VEC3", values=COLOURS * ((2,), (1,), (1,), (1,))))
    assert scene.geometry.colours is not None
    assert scene.geometry.colours.max() == 1


def test_gltf_alpha_of_cut_outs_and_further_colours_are_said(tmp_path: Path) -> None:
    def edit(tree: dict[str, Any]) -> None:
        tree["materials"][0]["alphaMode"] = "MASK"
        tree["meshes"][0]["primitives"][0]["attributes"]["COLOR_1"] = 2

    values = COLOURS * (1, 1, 1, 0.5)
    with pytest.warns(RefgiWarning) as said:
        load_scene(coloured(tmp_path, 5121, "VEC4", material=True, values=values, edit=edit))
    assert sorted(str(one.message).partition(": ")[2] for one in said) == [
        "1 primitive(s)' alpha of vertex colours passed over",
        "1 primitive(s)' further vertex colours (COLOR_1 ...) passed over"]


def test_gltf_faults_name_the_attribute(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="COLOR_0: expected 4 elements as POSITION, got 3"):
        load_scene(coloured(tmp_path, 5121, "VEC4", edit=lambda tree: tree["accessors"][2].update(count=3)))


SQUARE = "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0.25 0.5 0.75\nv 0 1 0\n"


def obj(folder: Path, text: str) -> Path:
    path = folder / "square.obj"
    path.write_text(text)
    return path


def test_obj_colours_are_linear_and_white_where_absent(tmp_path: Path) -> None:
    mesh, = read_obj(obj(tmp_path, SQUARE + "f 1 2 3\nf 1 3 4\n")).meshes
    assert mesh.material.diffuse == (1, 1, 1)
    rgb = {(0, 0, 0): (1, 0, 0), (1, 0, 0): (0, 1, 0), (1, 1, 0): (0.25, 0.5, 0.75), (0, 1, 0): (1, 1, 1)}
    assert mesh.colours is not None
    for face, colours in zip(mesh.faces, mesh.colours, strict=True):
        assert [rgb[tuple(one)] for one in mesh.vertices[face]] == [tuple(one) for one in colours]


def test_obj_colours_multiply_the_material(tmp_path: Path) -> None:
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 0.5 0.4 0.3\n")
    mesh, = read_obj(obj(tmp_path, "mtllib m.mtl\n" + SQUARE + "usemtl a\nf 1 2 3\n")).meshes
    assert mesh.material.diffuse == (0.5, 0.4, 0.3)
    assert mesh.colours is not None


def test_obj_without_colours_has_none(tmp_path: Path) -> None:
    mesh, = read_obj(obj(tmp_path, "v 0 0 0 1\nv 1 0 0 1\nv 1 1 0 1\nf 1 2 3\n")).meshes
    assert mesh.colours is None
    assert mesh.material.diffuse == (0.5, 0.5, 0.5)


def ply(folder: Path, properties: str, rows: list[str], faces: tuple[str, ...] = ("", "")) -> Path:
    """Write the sample square as ASCII with further columns of vertices and of faces."""
    of_face = faces[0]
    text = ("ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
            f"{properties}element face 2\nproperty list uchar int vertex_indices\n{of_face}end_header\n")
    for place, row in zip(TRIANGLES.tolist(), rows, strict=True):
        text += f"{' '.join(map(str, place))} {row}\n"
    path = folder / "square.ply"
    path.write_text(text + f"3 0 1 2 {faces[1]}\n3 0 2 3 {faces[-1]}\n")
    return path


CODES = "property uchar red\nproperty uchar green\nproperty uchar blue\n"


def linear(code: int, most: int = 255) -> float:
    """IEC 61966-2-1."""
    share = code / most
    return share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4


def test_ply_codes_of_8_bits_are_srgb(tmp_path: Path) -> None:
    mesh, = read_ply(ply(tmp_path, CODES, ["255 0 0", "0 255 0", "188 10 64", "255 255 255"])).meshes
    assert mesh.material.diffuse == (1, 1, 1)
    assert mesh.colours is not None
    np.testing.assert_allclose(mesh.colours[0], [[1, 0, 0], [0, 1, 0], [linear(188), linear(10), linear(64)]])
    np.testing.assert_allclose(mesh.colours[1, 2], 1)


def test_ply_codes_of_16_bits_and_floats(tmp_path: Path) -> None:
    rows = ["65535 0 0", "0 65535 0", "30000 1000 64", "65535 65535 65535"]
    mesh, = read_ply(ply(tmp_path, CODES.replace("uchar", "ushort"), rows)).meshes
    assert mesh.colours is not None
    np.testing.assert_allclose(mesh.colours[0, 2], [linear(code, 65535) for code in (30000, 1000, 64)])
    mesh, = read_ply(ply(tmp_path, CODES.replace("uchar", "float"), ["0.5 0.25 1"] * 4)).meshes
    assert mesh.colours is not None
    assert (mesh.colours == (0.5, 0.25, 1)).all()


def test_ply_colours_of_faces(tmp_path: Path) -> None:
    mesh, = read_ply(ply(tmp_path, "", [""] * 4, (CODES, "255 0 0", "0 0 255"))).meshes
    assert mesh.colours is not None
    assert mesh.colours.tolist() == [[[1, 0, 0]] * 3, [[0, 0, 1]] * 3]
    with pytest.warns(RefgiWarning, match="colours of 2 faces passed over for those of the vertices"):
        mesh, = read_ply(ply(tmp_path, CODES, ["0 255 0"] * 4, (CODES, "255 0 0", "0 0 255"))).meshes
    assert mesh.colours is not None
    assert (mesh.colours == (0, 1, 0)).all()


def test_scene_files_multiply_their_material_by_the_colours_of_the_mesh(tmp_path: Path) -> None:
    path = write_scene(tmp_path)
    ply(tmp_path, CODES, ["255 0 0", "0 255 0", "0 0 255", "255 255 255"])
    scene = load_scene(path)
    assert scene.materials[0].diffuse == (0.1, 0.2, 0.3)
    assert scene.geometry.colours is not None
    assert scene.geometry.colours[0].tolist() == np.eye(3).tolist()


def test_a_mesh_without_colours_beside_one_that_has_some_is_white(tmp_path: Path) -> None:
    path = write_scene(tmp_path, objects=[{"mesh": "square.ply"}, {"mesh": "plain.ply"}])
    (tmp_path / "plain.ply").write_bytes(ply_bytes())
    ply(tmp_path, CODES, ["0 0 0"] * 4)
    colours = load_scene(path).geometry.colours
    assert colours is not None
    assert colours.tolist() == [[[0, 0, 0]] * 3] * 2 + [[[1, 1, 1]] * 3] * 2
    assert json.loads(path.read_text())["schema"] == 1
