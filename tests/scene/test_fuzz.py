"""Spoiled files: whatever bytes change, a file is read or refused with an `InputError`; nothing else escapes."""

import json
import warnings
from pathlib import Path

import numpy as np
import pytest

from refgi.errors import InputError, RefgiWarning
from refgi.scene import load_scene
from tests.scene.samples import SCENE, glb_bytes, ply_bytes, write_scene

MUTATIONS = 400  # per format
OBJ = b"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nusemtl a\nf 1//1 2//1 3//1 4//1\nf -4 -3 -2\n"
MTL = b"newmtl a\nKd 0.1 0.2 0.3\nKs 0.1 0.1 0.1\nNs 10\nKe 0 0 1\n"
SEEDS = {"scene.json": json.dumps(SCENE).encode(), "square.glb": glb_bytes(), "square.ply": ply_bytes(),
         "text.ply": ply_bytes(text=True), "square.obj": OBJ, "m.mtl": MTL}
TOKENS = [b"0", b"-1", b"1e999", b"NaN", b"4294967295", b"99999999999", b"null", b"[", b"}", b'"', b"\0", b"\xff", b""]


def spoiled(content: bytes, random: np.random.Generator) -> bytes:
    """Return the bytes with one to four flips, cuts, repeats or insertions."""
    for _ in range(int(random.integers(1, 5))):
        if not content:
            break
        place, length = int(random.integers(len(content))), int(random.integers(1, 24))
        choice = int(random.integers(5))
        if choice == 0:
            content = content[:place] + bytes([content[place] ^ (1 << int(random.integers(8)))]) + content[place + 1 :]
        elif choice == 1:
            content = content[:place] + content[place + length :]
        elif choice == 2:
            content = content[: place + length] + content[place:]
        elif choice == 3:
            content = content[:place] + TOKENS[int(random.integers(len(TOKENS)))] + content[place + length % 4 :]
        else:
            content = content[:place] + random.bytes(min(length, 4)) + content[place + min(length, 4) :]
    return content


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


def _outcome(path: Path) -> str:
    """Return what became of a file; a refusal must name the folder it lies in, a scene must be sound."""
    try:
        scene = load_scene(path)
    except InputError as error:
        said = str(error)
    else:
        assert np.isfinite(scene.geometry.vertices).all()
        assert scene.geometry.faces.max() < len(scene.geometry.vertices)
        return "read"
    assert str(path.parent) in said
    return "refused"
