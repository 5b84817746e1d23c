"""Spoiled files: whatever bytes change, a file is read or refused with an `InputError`; nothing else escapes."""

import json
import warnings
from pathlib import Path

import numpy as np
import pytest

from benchmarks.stability.file_formats import ODD, places, spoiled, with_value
from refgi.errors import InputError, RefgiWarning
from refgi.scene import load_scene
from tests.scene.samples import FACES, SCENE, glb_bytes, gltf_tree, ply_bytes, write_scene

MUTATIONS = 800  # per format; few of a scene file are still sound
OBJ = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nusemtl a\nf 1//1 2//1 3//1 4//1\nf -4 -3 -2\n"
MTL = b"newmtl a\nKd 0.1 0.2 0.3\nKs 0.1 0.1 0.1\nNs 10\nKe 0 0 1\n"
SEEDS = {"scene.json": json.dumps(SCENE).encode(), "square.glb": glb_bytes(), "square.ply": ply_bytes(),
         "text.ply": ply_bytes(text=True), "square.obj": OBJ, "m.mtl": MTL}


@pytest.mark.parametrize("name", SEEDS)
def test_spoiled_files_are_read_or_refused(tmp_path: Path, name: str) -> None:
    random = np.random.default_rng(list(name.encode()))
    write_scene(tmp_path)
    (tmp_path / "m.mtl").write_bytes(MTL)
    (tmp_path / "square.obj").write_bytes(OBJ)
    path = tmp_path / name
    entry = tmp_path / "square.obj" if name == "m.mtl" else path
    outcomes = {"read": 0, "refused": 0}
    for _ in range(MUTATIONS):
        path.write_bytes(spoiled(SEEDS[name], random))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", RefgiWarning)
            outcomes[_outcome(entry)] += 1
    assert min(outcomes.values()) > 0


def test_spoiled_real_headers(data_dir: Path, tmp_path: Path) -> None:
    random = np.random.default_rng(5)
    for name in ("stage.glb", "plate.ply", "cornell_box.glb"):
        whole = (data_dir / name).read_bytes()
        for _ in range(60):
            (tmp_path / name).write_bytes(spoiled(whole[:2000], random) + whole[2000:])
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", RefgiWarning)
                _outcome(tmp_path / name)


@pytest.mark.parametrize("form", ["json", "glb"])
def test_odd_values_under_every_key_are_read_or_refused(tmp_path: Path, form: str) -> None:
    random = np.random.default_rng(11)
    write_scene(tmp_path)
    tree = SCENE if form == "json" else gltf_tree()
    if form == "glb":
        tree["nodes"][0] |= {"rotation": [0, 0, 0, 1], "scale": [1, 1, 1]}
        tree["nodes"][1] = {"camera": 0, "matrix": np.eye(4).ravel().tolist()}
        tree["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = 0
    path = tmp_path / f"odd.{form}"
    outcomes = {"read": 0, "refused": 0}
    for place in places(tree):
        for value in (ODD[k] for k in random.permutation(len(ODD))[:6]):
            spoilt = with_value(tree, place, value)
            path.write_bytes(json.dumps(spoilt).encode() if form == "json" else glb_bytes(spoilt))
            outcomes[_quiet_outcome(path)] += 1
    assert min(outcomes.values()) > 20


def test_odd_numbers_in_a_buffer_are_read_or_refused(tmp_path: Path) -> None:
    random = np.random.default_rng(12)
    tree = gltf_tree()
    tree["bufferViews"].append({"buffer": 0, "byteOffset": 60, "byteLength": 48})
    tree["accessors"].append({"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC3"})
    tree["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = 2
    tree["buffers"][0]["byteLength"] = 108
    sizes = np.array([1, -1, 3, 1e-300, 1e-100, 1e-5, 1e5, 1e100, 1e300])
    numbers = np.array([0, 0, 0, 1, -1, 1e8, 1e-40, 3e38, np.nan, np.inf, -np.inf], np.float32)
    outcomes = {"read": 0, "refused": 0}
    for _ in range(300):
        tree["nodes"][0] |= {"scale": random.choice(sizes, 3).tolist(),
                             "rotation": random.choice([0, 1, -1, 1e-200, 1e200], 4).tolist()}
        vertices = np.where(random.random(12) < 0.05, random.choice(numbers, 12), random.random(12)).astype(np.float32)
        content = vertices.tobytes() + FACES.tobytes() + random.choice(numbers, 12).tobytes()
        (tmp_path / "odd.glb").write_bytes(glb_bytes(tree, content))
        outcomes[_quiet_outcome(tmp_path / "odd.glb")] += 1
    assert min(outcomes.values()) > 20


def _quiet_outcome(path: Path) -> str:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", RefgiWarning)
        return _outcome(path)


def _outcome(path: Path) -> str:
    """Return what became of a file; a refusal must name the folder it lies in, a scene must be sound."""
    try:
        scene = load_scene(path)
    except InputError as error:
        said = str(error)
    else:
        assert np.isfinite(scene.geometry.vertices).all()
        assert scene.geometry.vertex_normals is None or np.isfinite(scene.geometry.vertex_normals).all()
        assert scene.geometry.faces.max() < len(scene.geometry.vertices)
        return "read"
    assert str(path.parent) in said
    return "refused"
