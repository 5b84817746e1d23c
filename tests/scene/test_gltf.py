"""glTF: floats arrive to the bit, nodes are placed, and no reference is followed out of bounds."""

import base64
import json
import math
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from refgi.errors import InputError, RefgiWarning
from refgi.frame import Frame
from refgi.rsm import direct_irradiance
from refgi.scene import Camera, DirectionalLight, PointLight, SpotLight, load_scene
from refgi.scene.files import LightUnit
from refgi.scene.gltf import read_gltf
from tests.scene.samples import BUFFER, FACES, TRIANGLES, glb_bytes, gltf_tree

Edit = Callable[[dict[str, Any]], Any]


def written(folder: Path, edit: Edit | None = None, buffer: bytes = BUFFER) -> Path:
    tree = gltf_tree()
    if edit is not None:
        edit(tree)
    path = folder / "square.glb"
    path.write_bytes(glb_bytes(tree, buffer))
    return path


def test_mesh_material_camera_and_light(tmp_path: Path) -> None:
    scene = load_scene(written(tmp_path))
    assert np.array_equal(scene.geometry.vertices, TRIANGLES.astype(np.float64) + np.array([1, 2, 3]))
    assert np.array_equal(scene.geometry.faces, FACES)
    assert scene.materials[0].diffuse == (0.1, 0.2, 0.3)  # as decimal digits in the JSON, not rounded to 8 bits
    assert (scene.camera.eye, scene.camera.target, scene.camera.vfov) == ((0, 0, 5), (0, 0, 4), 0.7)
    assert (scene.camera.width, scene.camera.height) == (768, 512)
    light = scene.lights[0]
    assert isinstance(light, SpotLight)
    assert (light.position, light.direction) == ((0, 0, 4), (0, 0, -1))
    assert (light.inner_half_angle, light.outer_half_angle) == (0.2, 0.5)
    assert light.intensity == (1.0, 0.5, 0.25)  # 683 cd are 1 W/sr


def test_a_spot_falls_off_as_the_extension_says(tmp_path: Path) -> None:
    """KHR_lights_punctual: saturate((cos a - cos o) / (cos i - cos o)) squared, here 2 m above a floor and 683 cd."""
    path, out = tmp_path / "spot.gltf", math.pi / 4
    corners = np.array([[-3, 0, -3], [-3, 0, 3], [3, 0, 3], [3, 0, -3]], "<f4")
    uri = "data:;base64," + base64.b64encode(corners.tobytes() + FACES.tobytes()).decode()
    lamp = {"type": "spot", "intensity": 683.0, "spot": {}}
    tree = gltf_tree() | {"materials": [{"pbrMetallicRoughness": {"metallicFactor": 0}}],
                          "buffers": [{"byteLength": 60, "uri": uri}],
                          "nodes": [{"mesh": 0}, {"camera": 0, "translation": [0, 0, 5]}, {
                              "translation": [0, 2, 0], "rotation": [-math.sqrt(0.5), 0, 0, math.sqrt(0.5)],
                              "extensions": {"KHR_lights_punctual": {"light": 0}}}],
                          "extensions": {"KHR_lights_punctual": {"lights": [lamp]}}}
    path.write_text(json.dumps(tree))
    light, = load_scene(path).lights
    assert isinstance(light, SpotLight)
    assert (light.inner_half_angle, light.outer_half_angle, light.intensity) == (0, out, (1, 1, 1))
    camera = Camera((0, 1.9, 0), (0, 0, 0), (0, 0, -1), math.radians(90), 33, 33)
    buffer = Frame(load_scene(path, camera=camera), dtype=np.float64).gbuffer
    got = direct_irradiance(buffer, light)[0][buffer.covered]
    r = np.hypot(buffer.position[0], buffer.position[2])[buffer.covered]
    cosine = 2 / np.hypot(r, 2)
    falloff = np.clip((cosine - math.cos(out)) / (1 - math.cos(out)), 0, 1) ** 2
    assert r.min() < 1 < 2 < r.max()
    np.testing.assert_allclose(got, falloff * cosine / (r * r + 4), atol=1e-15)


@pytest.mark.parametrize(("unit", "per_watt", "lux"), [
    ("cd", 683.0, 683.0), ("lm", 683.0 * 4 * math.pi, 683.0), ("W/sr", 1.0, 1.0)])
def test_the_unit_of_lights_may_be_another(tmp_path: Path, unit: LightUnit, per_watt: float, lux: float) -> None:
    """1000 W of an isotropic source are 79.577 W/sr; a directional light is in lux or W/m^2."""
    def edit(tree: dict[str, Any]) -> None:
        tree["extensions"]["KHR_lights_punctual"]["lights"] = [
            {"type": "point", "intensity": 79.577}, {"type": "spot", "intensity": 5, "spot": {}},
            {"type": "directional", "intensity": 3}]
        tree["nodes"][2]["children"] = [3, 4]
        tree["nodes"] += [{"extensions": {"KHR_lights_punctual": {"light": k}}} for k in (1, 2)]

    point, spot, sun = load_scene(written(tmp_path, edit), light_unit=unit).lights
    assert isinstance(point, PointLight)
    assert isinstance(spot, SpotLight)
    assert isinstance(sun, DirectionalLight)
    assert point.intensity[0] == pytest.approx(79.577 / per_watt)
    assert spot.intensity[0] == pytest.approx(5 / per_watt)
    assert sun.irradiance[0] == pytest.approx(3 / lux)


def test_an_unknown_unit_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="light_unit: expected cd or lm or W/sr, got 'W'"):
        load_scene(written(tmp_path), light_unit="W")  # type: ignore[arg-type]


def test_geometry_equals_trimesh(tmp_path: Path) -> None:
    import trimesh

    def turn(tree: dict[str, Any]) -> None:
        tree["nodes"][0] = {"children": [3], "rotation": [0.5, 0.5, 0.5, 0.5], "scale": [1, 2, 3]}
        tree["nodes"].append({"mesh": 0, "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 4, 5, 6, 1]})

    path = written(tmp_path, turn)
    oracle = trimesh.load_scene(path, process=False).to_geometry()
    mesh = read_gltf(path).meshes[0]
    assert np.allclose(mesh.vertices, oracle.vertices, rtol=0, atol=1e-12)
    assert np.array_equal(mesh.faces, oracle.faces)


def test_rotation_and_scale_act_in_their_order(tmp_path: Path) -> None:
    import trimesh

    def turn(tree: dict[str, Any]) -> None:
        tree["nodes"][0] = {"mesh": 0, "rotation": [0.1, -0.5, 0.3, 0.806225774829855], "scale": [1, 2, 3],
                            "translation": [3, 4, 5]}

    path = written(tmp_path, turn)
    oracle = trimesh.load_scene(path, process=False).to_geometry()
    assert np.allclose(read_gltf(path).meshes[0].vertices, oracle.vertices, rtol=0, atol=1e-12)


def test_mirrored_node_keeps_normals_outward(tmp_path: Path) -> None:
    path = written(tmp_path, lambda tree: tree["nodes"][0].update(scale=[1, 1, -1]))
    mesh = read_gltf(path).meshes[0]
    a, b, c = mesh.vertices[mesh.faces[0]]
    assert np.cross(b - a, c - a)[2] < 0


@pytest.mark.parametrize("mode", [5, 6])
def test_strips_and_fans(tmp_path: Path, mode: int) -> None:
    def edit(tree: dict[str, Any]) -> None:
        tree["meshes"][0]["primitives"][0] |= {"mode": mode}
        tree["accessors"][1]["count"] = 5

    order = [0, 1, 3, 2, 2] if mode == 5 else [0, 1, 2, 3, 3]
    path = written(tmp_path, edit, TRIANGLES.tobytes() + np.array([*order, 0], np.uint16).tobytes())
    mesh = load_scene_quietly(path).geometry
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    assert len(mesh.faces) == 2
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def load_scene_quietly(path: Path) -> Any:
    with pytest.warns(RefgiWarning, match="1 face of zero area"):
        return load_scene(path)


def test_embedded_and_external_buffers(tmp_path: Path) -> None:
    tree = gltf_tree()
    tree["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(BUFFER).decode()
    (tmp_path / "a.gltf").write_text(json.dumps(tree))
    tree["buffers"][0]["uri"] = "the%20buffer.bin"
    (tmp_path / "b.gltf").write_text(json.dumps(tree))
    (tmp_path / "the buffer.bin").write_bytes(BUFFER)
    for name in ("a.gltf", "b.gltf"):
        assert load_scene(tmp_path / name).face_count == 2


def test_interleaved_and_normalised_attributes(tmp_path: Path) -> None:
    def edit(tree: dict[str, Any]) -> None:
        tree["bufferViews"] = [{"buffer": 0, "byteLength": 4 * 16, "byteStride": 16}, {"buffer": 0, "byteOffset": 64,
                                                                                      "byteLength": 12}]
        tree["accessors"].append({"bufferView": 0, "byteOffset": 12, "componentType": 5120, "normalized": True,
                                  "count": 4, "type": "VEC3"})
        tree["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = 2
        tree["buffers"][0]["byteLength"] = 76

    rows = b"".join(v.tobytes() + struct.pack("<4b", 0, 0, 127, 0) for v in TRIANGLES)
    scene = load_scene(written(tmp_path, edit, rows + FACES.tobytes()))
    assert np.array_equal(scene.geometry.vertices, TRIANGLES.astype(np.float64) + np.array([1, 2, 3]))
    assert scene.geometry.vertex_normals.tolist() == [[0, 0, 1]] * 4


def test_point_and_directional_lights(tmp_path: Path) -> None:
    def edit(tree: dict[str, Any]) -> None:
        tree["extensions"]["KHR_lights_punctual"]["lights"] = [{"type": "point", "intensity": 1366},
                                                               {"type": "directional", "intensity": 683}]
        half = math.sqrt(0.5)
        tree["nodes"].append({"extensions": {"KHR_lights_punctual": {"light": 1}}, "rotation": [-half, 0, 0, half]})
        tree["scenes"][0]["nodes"].append(3)

    lights = load_scene(written(tmp_path, edit)).lights
    assert lights[0] == PointLight((0, 0, 4), (2, 2, 2))
    assert isinstance(lights[1], DirectionalLight)
    assert lights[1].irradiance == (1, 1, 1)
    assert np.allclose(lights[1].direction, (0, -1, 0), atol=1e-15)


def test_cameras_beside_the_first_are_counted_where_the_file_s_own_is_taken(tmp_path: Path) -> None:
    tree = gltf_tree()
    tree["nodes"] += [{"camera": 0, "translation": [0, 0, k]} for k in (7, 9)]
    tree["scenes"][0]["nodes"] += [3, 4]
    path = tmp_path / "three.glb"
    path.write_bytes(glb_bytes(tree))
    with pytest.warns(RefgiWarning) as warned:
        assert load_scene(path).camera.eye == (0, 0, 5)
    assert [str(one.message) for one in warned] == [f"{path}: 2 camera(s) beside the first passed over"]
    other = Camera((0, 0, 4), (0, 0, 0))
    assert load_scene(path, camera=other).camera == other


def test_without_camera_and_light_both_are_placed(tmp_path: Path) -> None:
    path = written(tmp_path, lambda tree: tree["scenes"][0].update(nodes=[0]))
    with pytest.warns(RefgiWarning, match="no camera and no light"):
        scene = load_scene(path)
    low, high = scene.geometry.bounds
    assert scene.camera.target == tuple((low + high) / 2)


def test_what_has_no_triangles_is_passed_over_with_a_count(tmp_path: Path) -> None:
    def edit(tree: dict[str, Any]) -> None:
        tree["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}, "mode": 1})
        tree["materials"][0]["normalTexture"] = {"index": 0}

    with pytest.warns(RefgiWarning, match="passed over") as said:
        load_scene(written(tmp_path, edit))
    assert len(said) == 2


@pytest.mark.parametrize("key", ["normalTexture", "occlusionTexture"])
def test_any_other_texture_is_passed_over_with_a_count(tmp_path: Path, key: str) -> None:
    def edit(tree: dict[str, Any]) -> None:
        tree["materials"][0][key] = {"index": 0}

    with pytest.warns(RefgiWarning) as said:
        load_scene(written(tmp_path, edit))
    named = "normal maps (shading normals stay the mesh's)" if key == "normalTexture" else "occlusionTexture"
    assert {str(warning.message).partition(": ")[2] for warning in said} == {
        f"1 material(s)' {named} passed over"}


def chained(scale: list[float], depth: int = 3) -> Edit:
    def edit(tree: dict[str, Any]) -> None:
        tree["nodes"] += [{"scale": scale, "children": [4 + k]} for k in range(depth)]
        tree["nodes"].append({"mesh": 0})
        tree["scenes"][0]["nodes"] = [1, 2, 3]

    return edit


@pytest.mark.parametrize("scale", [1e-200, 1e200])
def test_a_product_of_matrices_that_is_no_placement_names_its_node(tmp_path: Path, scale: float) -> None:
    path = written(tmp_path, chained([scale] * 3))
    with pytest.raises(InputError, match=r"square\.glb: nodes\[4\]: expected a finite, invertible product"):
        load_scene(path)


def test_nested_nodes_multiply_and_zero_normals_are_mended(tmp_path: Path) -> None:
    def edit(tree: dict[str, Any]) -> None:
        chained([2, 3, 4], 2)(tree)
        tree["bufferViews"].append({"buffer": 0, "byteOffset": 60, "byteLength": 48})
        tree["accessors"].append({"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC3"})
        tree["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = 2
        tree["buffers"][0]["byteLength"] = 108

    normals = np.array([[0, 0, 0], [0, 0, 1], [np.inf, 0, 0], [0, 0, 3]], np.float32)
    scene = load_scene(written(tmp_path, edit, BUFFER + normals.tobytes()))
    assert np.array_equal(scene.geometry.vertices, TRIANGLES.astype(np.float64) * (4, 9, 16))
    assert scene.geometry.vertex_normals.tolist() == [[0, 0, 1]] * 4


def setter(*path: str | int, value: Any) -> Edit:
    def edit(tree: Any) -> None:
        for key in path[:-1]:
            tree = tree[key]
        tree[path[-1]] = value

    return edit


@pytest.mark.parametrize(("edit", "key"), [
    (setter("asset", "version", value="1.0"), "asset.version"),
    (setter("asset", value=None), "asset.version"),
    (setter("extensionsRequired", value=["VENDOR_new"]), "extensionsRequired"),
    (setter("scene", value=4), "scene"),
    (setter("scene", value=-1), "scene"),
    (setter("scenes", 0, "nodes", value=[7]), "node"),
    (setter("scenes", 0, "nodes", value="0"), "scenes[0].nodes"),
    (setter("scenes", 0, "nodes", value=[0, 0]), "nodes[0]"),
    (setter("scenes", 0, "nodes", value=[]), "at least one mesh"),
    (setter("nodes", 0, "children", value=[0]), "nodes[0]"),
    (setter("nodes", 0, "mesh", value=3), "nodes[0].mesh"),
    (setter("nodes", 0, "mesh", value=True), "nodes[0].mesh"),
    (setter("nodes", 0, "scale", value=[0, 1, 1]), "nodes[0]"),
    (setter("nodes", 0, "scale", value=[1e308, 1, 1]), "nodes[0].scale"),
    (setter("nodes", 0, "rotation", value=[0, 0, 0, 0]), "nodes[0].rotation"),
    (setter("nodes", 0, "translation", value=[1e200, 0, 0]), "vertex 0"),
    (setter("nodes", 0, "matrix", value=[1.0] * 16), "nodes[0].matrix"),
    (setter("nodes", 1, "camera", value=2), "nodes[1].camera"),
    (setter("nodes", 2, "extensions", "KHR_lights_punctual", "light", value=9), "light"),
    (setter("nodes", 2, "extensions", value=[]), "nodes[2].extensions"),
    (setter("cameras", 0, "perspective", "yfov", value=4), "cameras[0]"),
    (setter("cameras", 0, "perspective", "aspectRatio", value=0), "aspectRatio"),
    (setter("meshes", 0, "primitives", 0, "attributes", value={}), "POSITION"),
    (setter("meshes", 0, "primitives", 0, "indices", value=5), "indices"),
    (setter("meshes", 0, "primitives", 0, "material", value=1), "material"),
    (setter("materials", 0, "pbrMetallicRoughness", "baseColorFactor", value=[1.5, 0, 0, 1]), "materials[0]"),
    (setter("materials", 0, "pbrMetallicRoughness", "baseColorFactor", value=[1, 0]), "baseColorFactor"),
    (setter("materials", 0, "emissiveFactor", value=[-1, 0, 0]), "materials[0]"),
    (setter("accessors", 0, "count", value=5), "accessors[0]"),
    (setter("accessors", 0, "count", value=10**15), "accessors[0]"),
    (setter("accessors", 0, "count", value=0), "at least one"),
    (setter("accessors", 0, "count", value=-4), "accessors[0].count"),
    (setter("accessors", 0, "byteOffset", value=48), "accessors[0]"),
    (setter("accessors", 0, "type", value="VEC2"), "accessors[0].type"),
    (setter("accessors", 0, "componentType", value=5130), "accessors[0].componentType"),
    (setter("accessors", 0, "bufferView", value=9), "accessors[0].bufferView"),
    (setter("accessors", 0, "sparse", value={}), "sparse"),
    (setter("accessors", 1, "count", value=5), "three per triangle"),
    (setter("accessors", 1, value={"bufferView": 1, "componentType": 5126, "count": 3, "type": "SCALAR"}), "indices"),
    (setter("bufferViews", 0, "byteLength", value=4000), "bufferViews[0]"),
    (setter("bufferViews", 0, "byteOffset", value=40), "bufferViews[0]"),
    (setter("bufferViews", 0, "byteStride", value=4), "byteStride"),
    (setter("bufferViews", 0, "buffer", value=1), "buffers[1]"),
    (setter("buffers", 0, "byteLength", value=4000), "buffers[0]"),
    (setter("buffers", 0, "uri", value="../../secret.bin"), "buffers[0].uri"),
    (setter("buffers", 0, "uri", value="/etc/passwd"), "buffers[0].uri"),
    (setter("buffers", 0, "uri", value="missing.bin"), "missing.bin"),
    (setter("buffers", 0, "uri", value="data:;base64,****"), "base64"),
    (setter("extensions", "KHR_lights_punctual", "lights", 0, "type", value="area"), "lights[0].type"),
    (setter("extensions", "KHR_lights_punctual", "lights", 0, "spot", "outerConeAngle", value=1.6), "lights[0]"),
    (setter("extensions", "KHR_lights_punctual", "lights", 0, "intensity", value=0), "power"),
])
def test_each_fault_names_file_and_key(tmp_path: Path, edit: Edit, key: str) -> None:
    path = written(tmp_path, edit)
    with pytest.raises(InputError) as error:
        load_scene(path)
    assert str(tmp_path) in str(error.value)
    assert key in str(error.value)


def test_more_instances_than_memory_holds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def edit(tree: dict[str, Any]) -> None:
        tree["nodes"] += [{"mesh": 0}] * 9
        tree["scenes"][0]["nodes"] = [0, *range(3, 12)]

    monkeypatch.setattr("refgi.scene.mesh.physical_memory", lambda: 4 * 48.0 * 10)
    with pytest.raises(InputError, match=r"nodes\[9\]\.mesh: expected a scene that fits"):
        load_scene(written(tmp_path, edit))


def test_index_out_of_range(tmp_path: Path) -> None:
    path = written(tmp_path, None, TRIANGLES.tobytes() + np.array([0, 1, 2, 0, 2, 4], np.uint16).tobytes())
    with pytest.raises(InputError, match=r"face 1: expected vertex indices from 0 to 3, got \[0, 2, 4\]"):
        load_scene(path)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e20])
def test_coordinate_out_of_range(tmp_path: Path, value: float) -> None:
    vertices = TRIANGLES.copy()
    vertices[2, 1] = value
    with pytest.raises(InputError, match="vertex 2: expected finite coordinates"):
        load_scene(written(tmp_path, None, vertices.tobytes() + FACES.tobytes()))


def test_every_truncation_is_refused(tmp_path: Path) -> None:
    whole = glb_bytes()
    path = tmp_path / "short.glb"
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"short\.glb"):
            read_gltf(path)
