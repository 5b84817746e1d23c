"""Loading takes time in proportion to the file: four times as many parts take about four times as long."""

import gc
import json
import statistics
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from refgi.errors import InputError, RefgiWarning
from refgi.scene import Material, Mesh, load_scene
from refgi.scene.model import merge
from refgi.scene.motion import transformed_all
from refgi.scene.repair import repaired, repaired_all
from tests.scene.samples import SCENE, glb_bytes, gltf_tree, ply_bytes

FEW, MANY = 700, 2800
MOST_RATIO = 8.0  # of times: 4 is linear, 16 quadratic; the machine may be busy
ROUNDS = 3


def flat_nodes(folder: Path, count: int) -> Path:
    tree = gltf_tree()
    tree["nodes"] = [{"mesh": 0, "translation": [k, 0, 0]} for k in range(count)]
    tree["scenes"] = [{"nodes": list(range(count))}]
    return written(folder / f"flat{count}.glb", glb_bytes(tree))


def chained_nodes(folder: Path, count: int) -> Path:
    tree = gltf_tree()
    tree["nodes"] = [{"mesh": 0, "translation": [0.001, 0, 0], "children": [k + 1]} for k in range(count)]
    del tree["nodes"][-1]["children"]
    tree["scenes"] = [{"nodes": [0]}]
    return written(folder / f"chain{count}.glb", glb_bytes(tree))


def rootless_nodes(folder: Path, count: int) -> Path:
    path = chained_nodes(folder, count)
    tree = gltf_tree() | {"scenes": []}
    tree["nodes"] = [{"children": list(range(1, count))}, *({"mesh": 0, "translation": [k, 0, 0]}
                                                            for k in range(count - 1))]
    return written(path.with_name(f"roots{count}.glb"), glb_bytes(tree))


def own_meshes(folder: Path, count: int) -> Path:
    tree = gltf_tree()
    primitive = tree["meshes"][0]["primitives"][0]
    tree["nodes"] = [{"mesh": k} for k in range(count)]
    tree["scenes"] = [{"nodes": list(range(count))}]
    tree["meshes"] = [{"primitives": [primitive | {"material": k}]} for k in range(count)]
    tree["materials"] = [{"name": str(k), "emissiveFactor": [k, 0, 0]} for k in range(count)]
    return written(folder / f"meshes{count}.glb", glb_bytes(tree))


def many_lights(folder: Path, count: int) -> Path:
    tree = gltf_tree()
    light: dict[str, Any] = {"type": "point", "intensity": 1.0}
    tree["extensions"]["KHR_lights_punctual"]["lights"] = [light] * count
    tree["nodes"] = [{"mesh": 0}] + [{"extensions": {"KHR_lights_punctual": {"light": k}}} for k in range(count)]
    tree["scenes"] = [{"nodes": list(range(count + 1))}]
    return written(folder / f"lights{count}.glb", glb_bytes(tree))


def many_objects(folder: Path, count: int) -> Path:
    (folder / "square.ply").write_bytes(ply_bytes())
    objects = [{"mesh": "square.ply", "material": str(k),
                "transform": [1, 0, 0, k, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]} for k in range(count)]
    materials = {str(k): {"type": "diffuse", "diffuse": [0.1, 0.2, k / count]} for k in range(count)}
    return written(folder / f"objects{count}.json",
                   json.dumps(SCENE | {"objects": objects, "materials": materials}).encode())


def many_groups(folder: Path, count: int) -> Path:
    materials = "".join(f"newmtl m{k}\nKd 0.5 0.5 {k / count}\n" for k in range(count))
    (folder / f"m{count}.mtl").write_text(materials)
    groups = "".join(f"mtllib m{count}.mtl\n" * (k % 350 == 0) + f"g {k}\nusemtl m{k}\nv {k} 0 0\nv {k} 1 0\n"
                     f"v {k} 1 1\nf -3 -2 -1\n" for k in range(count))
    return written(folder / f"groups{count}.obj", groups.encode())


def repeated_keys(folder: Path, count: int) -> Path:
    keys = ", ".join(f'"{k}": 0' for k in range(count * 20))
    return written(folder / f"repeated{count}.json", f"{{{keys}, {keys}}}".encode())


def unknown_materials(folder: Path, count: int) -> Path:
    objects = [{"mesh": "square.ply", "material": f"unknown {k}"} for k in range(count)]
    materials = {f"known {k}": {"type": "diffuse", "diffuse": [0.1, 0.2, 0.3]} for k in range(count)}
    return written(folder / f"unknown{count}.json",
                   json.dumps(SCENE | {"objects": objects, "materials": materials}).encode())


def missing_meshes(folder: Path, count: int) -> Path:
    objects = [{"mesh": f"missing{k}.ply"} for k in range(count)]
    return written(folder / f"missing{count}.json", json.dumps(SCENE | {"objects": objects}).encode())


def written(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


MAKERS = (own_meshes,)
MORE = (many_objects, chained_nodes, unknown_materials, flat_nodes, rootless_nodes, many_lights, many_groups,
        repeated_keys, missing_meshes)


@pytest.mark.slow("own_meshes")
@pytest.mark.parametrize("make", [*MAKERS, *(pytest.param(make, marks=pytest.mark.slow) for make in MORE)],
                         ids=lambda make: make.__name__)
def test_time_grows_with_the_file(tmp_path: Path, make: Callable[[Path, int], Path]) -> None:
    few, many = make(tmp_path, FEW), make(tmp_path, MANY)
    seconds_of(few)  # imports
    ratios = [seconds_of(many) / seconds_of(few) for _ in range(ROUNDS)]
    assert statistics.median(ratios) < MOST_RATIO


def seconds_of(path: Path) -> float:
    """Return the processor time of loading a file, or of refusing it."""
    gc.collect()
    gc.disable()  # its rounds go over all that the test run holds
    try:
        start = time.process_time()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RefgiWarning)
            try:
                load_scene(path)
            except InputError:
                assert path.name.startswith(("repeated", "unknown", "missing"))
        return time.process_time() - start
    finally:
        gc.enable()


def test_a_chain_of_nodes_deeper_than_any_stack(tmp_path: Path) -> None:
    depth = 20_000
    path = chained_nodes(tmp_path, depth)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RefgiWarning)
        scene = load_scene(path)
    assert scene.face_count == 2 * depth
    # the last square lies at the sum of all translations; its rounding grows with their number
    assert scene.geometry.vertices[-1] == pytest.approx([0.001 * depth, 1, 0], rel=depth * 2.3e-16)


def shapes(random: np.random.Generator) -> list[Mesh]:
    """Return small meshes of all sorts: with flat faces, with and without normals, some of them missing."""
    made = []
    for number in range(60):
        count = int(random.integers(3, 9))
        faces = random.integers(0, count, (int(random.integers(1, 7)), 3))
        faces[0] = 0, 1, 2
        normals = random.normal(size=(count, 3)) if number % 2 else None
        if normals is not None and number % 3 == 0:
            normals[0] = (0, 0, 0) if number % 4 == 1 else (np.nan, 1e200, 0)
        vertices = random.normal(size=(count, 3)).astype(np.float32 if number % 5 else np.float64)
        made.append(Mesh(vertices, faces.astype(np.int32), normals, Material(f"{number % 7}"), f"mesh {number}"))
    return made


def same(first: Mesh, second: Mesh) -> bool:
    arrays = ((first.vertices, second.vertices), (first.faces, second.faces), (first.normals, second.normals))
    return first.name == second.name and all((a is None and b is None) or np.array_equal(a, b) for a, b in arrays)


def test_meshes_mended_together_are_those_mended_alone() -> None:
    meshes = shapes(np.random.default_rng(3))
    faults: list[str] = []
    together, dropped = repaired_all(meshes, lambda number: f"{number}", faults)
    alone = [repaired(mesh, "") for mesh in meshes]
    assert not faults
    assert dropped == sum(count for _, count in alone) > 0
    assert all(same(one, other) for one, (other, _) in zip(together, alone, strict=True))
    assert any(not same(one, mesh) for one, mesh in zip(together, meshes, strict=True))


@pytest.mark.parametrize("spoil", ["index", "coordinate", "flat", "shape", "negative"])
def test_what_is_wrong_with_one_of_many_meshes_is_told_as_if_alone(spoil: str) -> None:
    meshes = shapes(np.random.default_rng(4))
    vertices, faces = meshes[7].vertices.copy(), meshes[7].faces.copy()
    if spoil == "index":
        faces[-1, 2] = len(vertices)  # the next mesh's first vertex, once they are joined
    elif spoil == "negative":
        faces[0, 0] = -1
    elif spoil == "coordinate":
        vertices[-1, 1] = np.inf
    elif spoil == "flat":
        faces[:] = 1
    else:
        faces = faces[:, :2]
    meshes[7] = Mesh(vertices, faces, meshes[7].normals)
    with pytest.raises(InputError) as alone:
        repaired(meshes[7], "number 7")
    faults: list[str] = []
    repaired_all(meshes, lambda number: f"number {number}", faults)
    assert faults == [str(alone.value)]
    if spoil != "flat":
        with pytest.raises(InputError, match=r"mesh 7 \(mesh\): "):
            merge(meshes)


def test_meshes_placed_together_are_those_placed_alone() -> None:
    random = np.random.default_rng(5)
    meshes = [repaired(mesh, "")[0] for mesh in shapes(random)]
    matrices = np.tile(np.eye(4), (len(meshes), 1, 1))
    matrices[1:, :3] = random.normal(size=(len(meshes) - 1, 3, 4))
    together = transformed_all(meshes, matrices)
    assert together[0] is meshes[0]
    mirrored = 0
    for mesh, matrix, found in zip(meshes[1:], matrices[1:], together[1:], strict=True):
        assert same(found, transformed_all([mesh], matrix[None])[0])
        for row, vertex in enumerate(mesh.vertices.astype(np.float64)):
            assert found.vertices[row] == pytest.approx(matrix[:3, :3] @ vertex + matrix[:3, 3], rel=1e-12, abs=1e-12)
        mirror = np.linalg.det(matrix[:3, :3]) < 0
        mirrored += mirror
        assert np.array_equal(found.faces, mesh.faces[:, ::-1] if mirror else mesh.faces)
    assert 0 < mirrored < len(meshes) - 1


def test_materials_are_numbered_in_order_of_first_use() -> None:
    meshes = shapes(np.random.default_rng(6))
    geometry, materials = merge(meshes)
    expected = list(dict.fromkeys(mesh.material for mesh in meshes))
    assert list(materials) == expected
    shown = [expected.index(mesh.material) for mesh in meshes for _ in mesh.faces]
    assert geometry.material_of_face.tolist() == shown
