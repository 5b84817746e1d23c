"""The real scenes: faces and materials of the tables that came with them, colours to the bit."""

import json
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest

from refgi.errors import RefgiWarning
from refgi.scene import Scene, load_scene
from refgi.scene.scenefile import read_mesh_file

# Name, faces, materials used. Faces of zero area count in the table and are skipped with a warning.
SCENES = [("cornell_box", 30, 3), ("cornell_horse", 16990, 4), ("dragon_bunny", 405458, 6), ("buddha", 100008, 5),
          ("teapot", 6328, 5), ("flying_bunnies", 416716, 6), ("metaballs", 4896, 5), ("caustic_ring", 20482, 2),
          ("glass_sphere", 20488, 5), ("sponza", 261839, 25), ("kitchen", 188839, 80), ("quake_e1m1", 15085, 66)]
# File, vertices, faces, materials.
MESHES = [("buddha.ply", 49950, 100000, 1), ("bunny.ply", 35947, 69451, 1), ("cornell_box.glb", 60, 30, 3),
          ("cornell_shell.glb", 20, 10, 3), ("dragon.ply", 168953, 335999, 1), ("horse.ply", 8492, 16980, 1),
          ("kitchen.glb", 98789, 188839, 80), ("metaballs.ply", 2446, 4888, 1), ("plate.ply", 4, 2, 1),
          ("quake_e1m1.glb", 12356, 15085, 66), ("ring.ply", 10240, 20480, 1), ("sphere.ply", 10242, 20480, 1),
          ("sponza.glb", 175793, 261839, 25), ("stage.glb", 16, 8, 4), ("teapot.ply", 3644, 6320, 1)]


def loaded(path: Path) -> tuple[Scene, int]:
    """Return a scene and how many faces it was said to skip."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        scene = load_scene(path)
    assert all(isinstance(w.message, RefgiWarning) for w in said)
    return scene, sum(int(str(w.message).rpartition(": ")[2].split()[0]) for w in said)


@pytest.mark.parametrize(("name", "faces", "materials"), SCENES)
def test_faces_and_materials_equal_the_table(data_dir: Path, name: str, faces: int, materials: int) -> None:
    scene, skipped = loaded(data_dir / f"{name}.json")
    assert scene.face_count + skipped == faces
    assert len(scene.materials) == materials
    assert scene.name == name
    assert skipped == (116 if name == "dragon_bunny" else 0)  # faces of exactly zero area in dragon.ply


@pytest.mark.parametrize(("name", "vertices", "faces", "materials"), MESHES)
def test_meshes_equal_the_table(data_dir: Path, name: str, vertices: int, faces: int, materials: int) -> None:
    meshes = read_mesh_file(data_dir / name).meshes
    assert sum(len(mesh.faces) for mesh in meshes) == faces
    assert sum(len(mesh.vertices) for mesh in meshes) == vertices
    assert len({mesh.material for mesh in meshes}) == materials


@pytest.mark.parametrize("name", ["sponza", "kitchen", "quake_e1m1", "stage"])
def test_base_colours_equal_the_files_floats(data_dir: Path, name: str) -> None:
    content = (data_dir / f"{name}.glb").read_bytes()
    length = struct.unpack_from("<I", content, 12)[0]
    listed = json.loads(content[20 : 20 + length])["materials"]
    colours = {m["name"]: tuple(m["pbrMetallicRoughness"]["baseColorFactor"][:3]) for m in listed}
    for mesh in read_mesh_file(data_dir / f"{name}.glb").meshes:
        assert mesh.material.diffuse == colours[mesh.material.name]


@pytest.mark.parametrize("name", ["sponza.glb", "kitchen.glb", "quake_e1m1.glb"])
def test_geometry_equals_trimesh(data_dir: Path, name: str) -> None:
    import trimesh

    oracle = list(trimesh.load_scene(data_dir / name, process=False).geometry.values())
    ours = read_mesh_file(data_dir / name).meshes
    assert len(oracle) == len(ours)
    for mesh, other in zip(ours, oracle, strict=True):
        assert np.array_equal(mesh.vertices, other.vertices)
        assert np.array_equal(mesh.faces, other.faces)


def test_transforms_place_the_bunnies(data_dir: Path) -> None:
    scene = load_scene(data_dir / "flying_bunnies.json")
    bunny = read_mesh_file(data_dir / "bunny.ply").meshes[0]
    tree = json.loads((data_dir / "flying_bunnies.json").read_text())
    start = 20
    for entry in tree["objects"][1:]:
        rows = np.reshape(entry["transform"], (4, 4))
        expected = np.array([[sum(row[k] * v[k] for k in range(3)) + row[3] for row in rows[:3]]
                             for v in bunny.vertices[:50].astype(float)])
        assert np.allclose(scene.geometry.vertices[start : start + 50], expected, rtol=0, atol=1e-14)
        start += len(bunny.vertices)


def test_smooth_normals_arrive_where_asked_for(data_dir: Path, tmp_path: Path) -> None:
    tree = json.loads((data_dir / "metaballs.json").read_text())
    tree["objects"] = [{"mesh": str(data_dir / "metaballs.ply"), "material": "metaballs", "smooth_normals": True,
                        "transform": [2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]},
                       {"mesh": str(data_dir / "plate.ply")}]
    path = tmp_path / "smooth.json"
    path.write_text(json.dumps(tree))
    geometry = load_scene(path).geometry
    source = read_mesh_file(data_dir / "metaballs.ply").meshes[0]
    expected = np.asarray(source.normals, float) * (0.5, 1, 1)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert np.allclose(geometry.vertex_normals[: len(expected)], expected, atol=1e-7)
    assert np.allclose(np.abs(geometry.vertex_normals[len(expected) :]), [0, 1, 0], atol=1e-12)
