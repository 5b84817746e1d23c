"""glTF: morph targets, skins, instances and sparse accessors; where vertices must lie is computed by hand."""

import math
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from refgi.errors import InputError, RefgiWarning
from refgi.scene import load_scene
from refgi.scene.gltf import read_gltf
from tests.scene.samples import FACES, TRIANGLES, glb_bytes

CODES = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
UP = np.tile(np.array([0, 0, 1], np.float32), (4, 1))
IDENTITY = np.eye(4)
HALF = math.sqrt(0.5)


class File:
    """A glTF square, to which arrays and nodes are added."""

    def __init__(self) -> None:
        self.content = b""
        self.tree: dict[str, Any] = {"asset": {"version": "2.0"}, "accessors": [], "bufferViews": []}
        position, indices = self.add(TRIANGLES), self.add(FACES.ravel())
        self.primitive: dict[str, Any] = {"attributes": {"POSITION": position}, "indices": indices}
        self.tree["meshes"] = [{"primitives": [self.primitive]}]
        self.tree["nodes"] = [{"mesh": 0}]

    def view(self, values: np.ndarray) -> int:
        self.content += b"\0" * (-len(self.content) % 4)
        self.tree["bufferViews"].append({"buffer": 0, "byteOffset": len(self.content), "byteLength": values.nbytes})
        self.content += values.tobytes()
        return len(self.tree["bufferViews"]) - 1

    def add(self, values: np.ndarray, **changes: Any) -> int:
        kind = KINDS[values.shape[1] if values.ndim > 1 else 1]
        self.tree["accessors"].append({"bufferView": self.view(values), "componentType": CODES[values.dtype.name],
                                       "count": len(values), "type": kind} | changes)
        return len(self.tree["accessors"]) - 1

    def sparse(self, index: np.ndarray, values: np.ndarray, **changes: Any) -> int:
        """Add an accessor of four elements with some replaced; zeros unless `changes` says more."""
        entry = {"componentType": CODES[values.dtype.name], "count": 4, "type": KINDS[values.shape[1]], "sparse": {
            "count": len(index), "indices": {"bufferView": self.view(index), "componentType": CODES[index.dtype.name]},
            "values": {"bufferView": self.view(values)}}}
        self.tree["accessors"].append(entry | changes)
        return len(self.tree["accessors"]) - 1

    def skin(self, joints: np.ndarray, weights: np.ndarray, nodes: list[dict[str, Any]], *,
             inverse: np.ndarray | None = None, part: int = 0, **changes: Any) -> None:
        """Let the square follow joints, which are put behind the nodes there are."""
        self.primitive["attributes"] |= {f"JOINTS_{part}": self.add(joints),
                                         f"WEIGHTS_{part}": self.add(weights, **changes)}
        if nodes:
            first = len(self.tree["nodes"])
            self.tree["nodes"] += nodes
            self.tree["nodes"][0]["skin"] = 0
            self.tree["skins"] = [{"joints": list(range(first, first + len(nodes)))}]
        if inverse is not None:
            columns = np.swapaxes(inverse, 1, 2).reshape(-1, 16).astype(np.float32)
            self.tree["skins"][0]["inverseBindMatrices"] = self.add(columns)

    def instanced(self, **changes: Any) -> None:
        """Draw the square once for each row of the given attributes."""
        attributes = {key: self.add(*value) if isinstance(value, tuple) else value for key, value in changes.items()}
        self.tree["nodes"][0].setdefault("extensions", {})["EXT_mesh_gpu_instancing"] = {"attributes": attributes}
        self.tree["extensionsUsed"] = self.tree["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]

    def written(self, folder: Path) -> Path:
        self.tree["buffers"] = [{"byteLength": len(self.content)}]
        path = folder / "pose.glb"
        path.write_bytes(glb_bytes(self.tree, self.content))
        return path

    def vertices(self, folder: Path) -> np.ndarray:
        return np.concatenate([mesh.vertices for mesh in read_gltf(self.written(folder)).meshes])


def shifted(x: float, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def target(*shift: float) -> np.ndarray:
    return np.tile(np.array(shift, np.float32), (4, 1))


@pytest.mark.parametrize(("of_mesh", "of_node", "shift"), [
    ([1.0], None, 2.0), ([1.0], [0.25], 0.5), (None, [0.5], 1.0), (None, None, 0.0), ([1.0], [0.0], 0.0),
    ([-1.0, 0.5], None, -1.0)])
def test_morph_weights_count_without_animation(tmp_path: Path, of_mesh: Any, of_node: Any, shift: float) -> None:
    file = File()
    file.primitive["targets"] = [{"POSITION": file.add(target(2, 0, 0))}, {"POSITION": file.add(target(2, 0, 0))}]
    file.tree["meshes"][0] |= {} if of_mesh is None else {"weights": of_mesh}
    file.tree["nodes"][0] |= {} if of_node is None else {"weights": of_node}
    assert np.allclose(file.vertices(tmp_path), TRIANGLES + np.array([shift, 0, 0]), atol=1e-7)


def test_nodes_with_other_weights_show_other_shapes(tmp_path: Path) -> None:
    file = File()
    file.primitive["targets"] = [{"POSITION": file.add(target(2, 0, 0))}]
    file.tree["nodes"] = [{"mesh": 0, "weights": [1]}, {"mesh": 0, "weights": [2], "translation": [0, 0, 5]},
                          {"mesh": 0}]
    assert file.vertices(tmp_path)[:, [0, 2]].tolist() == [
        *([x + 2, 0] for x in (0, 1, 1, 0)), *([x + 4, 5] for x in (0, 1, 1, 0)), *([x, 0] for x in (0, 1, 1, 0))]


def test_morphed_normals_and_sparse_targets_without_a_view(tmp_path: Path) -> None:
    file = File()
    file.primitive["attributes"]["NORMAL"] = file.add(UP)
    file.primitive["targets"] = [{"NORMAL": file.sparse(np.array([2], np.uint8), np.array([[1, 0, 0]], np.float32)),
                                  "POSITION": file.sparse(np.array([1, 3], np.uint16), target(0, 0, 3)[:2])}]
    file.tree["meshes"][0]["weights"] = [1]
    mesh, = read_gltf(file.written(tmp_path)).meshes
    assert mesh.vertices[:, 2].tolist() == [0, 3, 0, 3]
    assert mesh.normals.tolist() == [[0, 0, 1], [0, 0, 1], [1, 0, 1], [0, 0, 1]]


def test_morphed_coordinates_are_passed_over_with_a_count(tmp_path: Path) -> None:
    file = File()
    file.primitive["targets"] = [{"TEXCOORD_0": 0}]
    file.tree["meshes"][0]["weights"] = [1]
    with pytest.warns(RefgiWarning, match="1 primitive\\(s\\)' morphed texture coordinates or colours passed over"):
        read_gltf(file.written(tmp_path))


def test_a_skin_stands_in_its_joints_pose_wherever_its_node_is(tmp_path: Path) -> None:
    file = File()
    file.tree["nodes"][0] |= {"translation": [0, 9, 0], "scale": [3, 3, 3]}
    file.skin(np.zeros((4, 4), np.uint8), np.tile(np.array([1, 0, 0, 0], np.float32), (4, 1)),
              [{"translation": [2, 0, 0]}], inverse=IDENTITY[None])
    assert file.vertices(tmp_path).tolist() == (TRIANGLES + np.array([2, 0, 0])).tolist()


@pytest.mark.parametrize("kind", ["float32", "uint8", "uint16"])
def test_influences_are_weighed_and_weights_of_any_sum_and_type(tmp_path: Path, kind: str) -> None:
    most = 1.0 if kind == "float32" else float(np.iinfo(kind).max)
    weights = (np.array([[0.2, 0.8, 0, 0], [0, 0.4, 0, 0], [0.6, 0, 0.4, 0], [0, 0, 0, 0]]) * most).astype(kind)
    file = File()
    file.skin(np.tile(np.array([0, 1, 2, 200], np.uint16), (4, 1)), weights, [
        {"translation": [10, 0, 0]}, {"translation": [0, 20, 0]}, {"translation": [0, 0, 30]}],
        normalized=kind != "float32")
    share = weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-9)
    share[3, 0] = 1.0  # without weights: the first joint
    expected = TRIANGLES + share @ np.array([[10, 0, 0], [0, 20, 0], [0, 0, 30], [0, 0, 0]])
    assert np.allclose(file.vertices(tmp_path), expected, atol=1e-6)


def test_inverse_bind_matrices_and_joints_below_others(tmp_path: Path) -> None:
    file = File()
    # an arm of two joints: the upper turns by 90 degrees about z, the lower sits 1 m along it
    inverse = np.stack([IDENTITY, shifted(-1), IDENTITY])  # the third is one too many
    file.skin(np.array([[0] * 4, [1] * 4, [1] * 4, [0] * 4], np.uint8), np.full((4, 4), 0.25, np.float32),
              [{"rotation": [0, 0, HALF, HALF], "children": [2]},
               {"translation": [1, 0, 0], "rotation": [0, 0, HALF, HALF]}],
              inverse=inverse)
    # upper: (x, y) to (-y, x); lower: at (0, 1), turned by 180 degrees: (x, y) to (0, 1) - (x - 1, y)
    expected = [[0, 0, 0], [0, 1, 0], [0, 0, 0], [-1, 0, 0]]
    assert np.allclose(file.vertices(tmp_path), expected, atol=1e-6)


def test_a_second_set_of_influences(tmp_path: Path) -> None:
    file = File()
    quarter = np.full((4, 4), 0.125, np.float32)
    file.skin(np.zeros((4, 4), np.uint8), quarter, [{}, {"translation": [8, 0, 0]}])
    file.skin(np.ones((4, 4), np.uint8), quarter, [], part=1)
    assert np.allclose(file.vertices(tmp_path), TRIANGLES + np.array([4, 0, 0]), atol=1e-6)


@pytest.mark.parametrize("scale", [[2, 1, 4], [-1, 1, 1], [1, 1, -1]])
def test_skinned_normals_stay_across_their_surface(tmp_path: Path, scale: list[float]) -> None:
    file = File()
    file.content, file.tree["bufferViews"] = b"", []
    slope = np.array([[0, 0, 0], [1, 0, 1], [1, 1, 1], [0, 1, 0]], np.float32)
    file.tree["accessors"] = []
    file.primitive |= {"attributes": {"POSITION": file.add(slope)}, "indices": file.add(FACES.ravel())}
    file.primitive["attributes"]["NORMAL"] = file.add(np.tile(np.array([-HALF, 0, HALF], np.float32), (4, 1)))
    file.skin(np.zeros((4, 4), np.uint8), np.tile(np.array([1, 0, 0, 0], np.float32), (4, 1)), [{"scale": scale}])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RefgiWarning)  # no camera, no light
        geometry = load_scene(file.written(tmp_path)).geometry
    a, b, c = (geometry.vertices[geometry.faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    assert np.allclose(np.einsum("nj,nkj->nk", normal, geometry.vertex_normals[geometry.faces]), 1, atol=1e-6)


def test_a_skin_moves_what_was_morphed_and_joints_may_lie_outside_the_scene(tmp_path: Path) -> None:
    file = File()
    file.skin(np.zeros((4, 4), np.uint8), np.full((4, 4), 0.25, np.float32), [{"scale": [2, 2, 2]}])
    file.primitive["targets"] = [{"POSITION": file.add(target(1, 0, 0))}]
    file.tree["meshes"][0]["weights"] = [3]
    file.tree |= {"scenes": [{"nodes": [0]}], "scene": 0}
    assert np.allclose(file.vertices(tmp_path), 2 * (TRIANGLES + np.array([3, 0, 0])), atol=1e-6)


def test_a_skinned_node_keeps_its_children_and_a_mesh_without_joints_its_node(tmp_path: Path) -> None:
    file = File()
    file.skin(np.zeros((4, 4), np.uint8), np.full((4, 4), 0.25, np.float32), [{"translation": [0, 0, 7]}])
    file.tree["meshes"].append({"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]})
    file.tree["nodes"][0] |= {"translation": [5, 0, 0], "children": [2]}
    file.tree["nodes"].append({"mesh": 1, "skin": 0, "translation": [0, 5, 0]})
    with pytest.warns(RefgiWarning, match=r"1 skin\(s\) of meshes without joints passed over"):
        vertices = file.vertices(tmp_path)
    assert np.allclose(vertices, np.concatenate([TRIANGLES + np.array([0, 0, 7]), TRIANGLES + np.array([5, 5, 0])]))


def test_instances_by_translation_alone(tmp_path: Path) -> None:
    file = File()
    file.instanced(TRANSLATION=(np.array([[0, 0, 0], [2, 0, 0], [4, 0, 0]], np.float32),))
    meshes = read_gltf(file.written(tmp_path)).meshes
    assert [mesh.vertices[:, 0].min() for mesh in meshes] == [0, 2, 4]
    assert sum(len(mesh.faces) for mesh in meshes) == 6


@pytest.mark.parametrize("kind", ["float32", "int8", "int16"])
def test_instances_are_scaled_turned_and_moved_and_then_placed_by_their_node(tmp_path: Path, kind: str) -> None:
    most = 1.0 if kind == "float32" else float(np.iinfo(kind).max)
    file = File()
    file.tree["nodes"][0] |= {"translation": [0, 0, 1], "scale": [1, 1, 2]}
    turn = (np.array([[0, 0, 0, 1], [0, 0, HALF, HALF]]) * most).astype(kind)
    rotation = file.add(turn, normalized=kind != "float32")
    file.instanced(TRANSLATION=(np.array([[0, 0, 0], [10, 0, 5]], np.float32),), ROTATION=rotation,
                   SCALE=(np.array([[1, 1, 1], [3, 1, 1]], np.float32),))
    x, y, _ = TRIANGLES.T
    expected = np.concatenate([TRIANGLES + np.array([0, 0, 1]), np.stack([10 - y, 3 * x, np.full(4, 11)], axis=1)])
    assert np.allclose(file.vertices(tmp_path), expected, atol=1e-5)


def test_instances_without_size_are_left_out_with_a_count(tmp_path: Path) -> None:
    file = File()
    file.instanced(SCALE=(np.array([[1, 1, 1], [0, 0, 0], [2, 2, 0]], np.float32),))
    with pytest.warns(RefgiWarning, match=r"2 instance\(s\) without size passed over"):
        assert len(read_gltf(file.written(tmp_path)).meshes) == 1


def test_instances_of_a_skin_are_one_with_a_warning(tmp_path: Path) -> None:
    file = File()
    file.skin(np.zeros((4, 4), np.uint8), np.full((4, 4), 0.25, np.float32), [{"translation": [0, 0, 7]}])
    file.instanced(TRANSLATION=(np.array([[0, 0, 0], [2, 0, 0]], np.float32),))
    with pytest.warns(RefgiWarning, match="skinned mesh\\(es\\)' instances passed over"):
        assert np.allclose(file.vertices(tmp_path), TRIANGLES + np.array([0, 0, 7]))


def test_a_dense_accessor_with_replaced_elements(tmp_path: Path) -> None:
    file = File()
    base = file.tree["accessors"][0]["bufferView"]
    position = file.sparse(np.array([1, 2], np.uint32), np.array([[5, 0, 0], [5, 1, 0]], np.float32), bufferView=base)
    normal = file.sparse(np.array([3], np.uint16), np.array([[0, 0, 127]], np.int8), normalized=True)
    file.primitive["attributes"] = {"POSITION": position, "NORMAL": normal}
    mesh, = read_gltf(file.written(tmp_path)).meshes
    assert mesh.vertices.tolist() == [[0, 0, 0], [5, 0, 0], [5, 1, 0], [0, 1, 0]]
    assert mesh.normals.tolist() == [[0, 0, 0]] * 3 + [[0, 0, 1]]


def test_a_scale_of_zero_hides_a_node_and_what_is_below_it(tmp_path: Path) -> None:
    file = File()
    file.tree["nodes"] = [{"mesh": 0, "scale": [0, 0, 0], "children": [1]}, {"mesh": 0, "translation": [1, 0, 0]},
                          {"mesh": 0, "translation": [0, 0, 5]}]
    file.tree |= {"scene": 0, "scenes": [{"nodes": [0, 2]}]}
    assert file.vertices(tmp_path)[:, 2].tolist() == [5] * 4
    file.tree["nodes"][1]["camera"] = 0
    file.tree["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}]
    with pytest.warns(RefgiWarning, match=r"1 camera\(s\) or light\(s\) of zero scale passed over"):
        file.vertices(tmp_path)


def test_a_joint_of_scale_zero_draws_its_vertices_together(tmp_path: Path) -> None:
    file = File()
    joints = np.array([[0] * 4, [0] * 4, [0] * 4, [1] * 4], np.uint8)
    file.skin(joints, np.full((4, 4), 0.25, np.float32), [{}, {"scale": [0, 0, 0], "translation": [7, 7, 7]}])
    assert file.vertices(tmp_path).tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [7, 7, 7]]


def broken(change: Any) -> File:
    """Return a file with a skin, a morph target, instances and a sparse accessor, changed."""
    file = File()
    file.skin(np.zeros((4, 4), np.uint8), np.full((4, 4), 0.25, np.float32), [{"translation": [0, 0, 7]}],
              inverse=IDENTITY[None])
    file.primitive["targets"] = [{"POSITION": file.sparse(np.array([1], np.uint8), target(0, 0, 1)[:1])}]
    file.tree["meshes"][0]["weights"] = [1]
    file.tree["nodes"].append({"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {
        "TRANSLATION": file.add(target(1, 0, 0)), "ROTATION": file.add(np.eye(4, dtype=np.float32))}}}})
    change(file.tree)
    return file


@pytest.mark.parametrize(("change", "said"), [
    (lambda t: t["meshes"][0].update(weights=["x"]), "meshes[0].weights"),
    (lambda t: t["nodes"][0].update(skin=4), "nodes[0].skin"),
    (lambda t: t["skins"][0].update(joints=[]), "skins[0].joints"),
    (lambda t: t["skins"][0].update(joints=[9]), "skins[0].joints"),
    (lambda t: t["skins"][0].update(joints=[1, 1]), "skins[0].inverseBindMatrices: expected 2 as joints"),
    (lambda t: t["meshes"][0]["primitives"][0]["attributes"].pop("WEIGHTS_0"), "expected 'WEIGHTS_0'"),
    (lambda t: t["accessors"][2].update(count=2), "JOINTS_0: expected 4 elements"),
    (lambda t: t["accessors"][5].update(count=3), "targets[0].POSITION: expected 4 elements"),
    (lambda t: t["accessors"][5]["sparse"].pop("values"), "sparse.values.bufferView"),
    (lambda t: t["accessors"][5]["sparse"].update(count=9), "sparse.indices"),
    (lambda t: t["accessors"][5].update(count=1), "sparse.indices: expected indices below 1"),
    (lambda t: t["accessors"][5].update(count=10**14), "accessors[5].count"),
    (lambda t: t["accessors"][5]["sparse"]["indices"].update(componentType=5126), "unsigned integers"),
    (lambda t: t["accessors"][6].update(count=2), "attributes.ROTATION: expected 2 elements"),
])
def test_each_fault_names_file_and_key(tmp_path: Path, change: Any, said: str) -> None:
    with pytest.raises(InputError) as error:
        read_gltf(broken(change).written(tmp_path))
    assert "pose.glb" in str(error.value)
    assert said.replace("expected 'WEIGHTS_0'", "expected WEIGHTS_0") in str(error.value)


def test_a_joint_that_the_skin_lacks(tmp_path: Path) -> None:
    file = File()
    file.skin(np.ones((4, 4), np.uint8), np.full((4, 4), 0.25, np.float32), [{}])
    with pytest.raises(InputError, match=r"JOINTS_0: expected indices into the skin's 1 joints, got 1"):
        file.vertices(tmp_path)
