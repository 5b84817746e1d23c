"""Scene files: what they say arrives to the bit, and what is wrong in them is said at once, by file, key and value."""

import copy
import json
import math
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from refgi import stages
from refgi.errors import InputError, RefgiWarning
from refgi.scene import Camera, DirectionalLight, PointLight, SpotLight, load_scene
from tests.scene.samples import SCENE, TRIANGLES, glb_bytes, ply_bytes, write_scene


def changed(*path: str | int, value: Any) -> dict[str, Any]:
    """Return the sample scene's top-level change that sets one nested key."""
    tree = copy.deepcopy(SCENE)
    owner: Any = tree
    for key in path[:-1]:
        owner = owner[key]
    owner[path[-1]] = value
    return {str(path[0]): tree[str(path[0])]}


def test_every_value_arrives(tmp_path: Path) -> None:
    scene = load_scene(write_scene(tmp_path))
    assert scene.name == "sample"
    assert scene.description == "A square."
    assert scene.exposure == 1.2
    assert scene.camera == Camera((0, 0, 3), (0, 0, 0), (0, 1, 0), math.radians(40), 64, 48)
    assert scene.lights == (SpotLight((0, 0, 2), (0, 0, -1), math.radians(20), math.radians(30), (1, 2, 3)),)
    assert scene.materials[0].diffuse == (0.1, 0.2, 0.3)
    assert scene.face_count == 2
    assert scene.geometry.vertices.tolist() == [[0.5, 0, 0], [1.5, 0, 0], [1.5, 1, 0], [0.5, 1, 0]]


def test_several_lights_of_each_kind(tmp_path: Path) -> None:
    lights = [*SCENE["lights"], SCENE["lights"][0] | {"falloff": "squared_ramp"},
              {"type": "point", "position": [1, 2, 3], "intensity_w_per_sr": [4, 5, 6]},
              {"type": "directional", "direction": [0, -2, 0], "irradiance_w_per_m2": [7, 8, 9]}]
    scene = load_scene(write_scene(tmp_path, lights=lights))
    assert [light.falloff for light in scene.lights[:2]] == ["smoothstep", "squared_ramp"]
    assert scene.lights[2:] == (PointLight((1, 2, 3), (4, 5, 6)), DirectionalLight((0, -2, 0), (7, 8, 9)))


def test_material_by_name_inline_or_from_the_mesh(tmp_path: Path) -> None:
    (tmp_path / "square.glb").write_bytes(glb_bytes())
    inline = {"type": "phong", "diffuse": [0.2, 0.2, 0.2], "specular": [0.5, 0.5, 0.5], "exponent": 20}
    glass = {"type": "dielectric", "ior": 1.5, "note": "clear"}
    scene = load_scene(write_scene(
        tmp_path, objects=[{"mesh": "square.glb"}, {"mesh": "square.ply", "material": inline},
                           {"mesh": "square.ply", "material": "glass"}, {"mesh": "square.ply"}],
        materials={"paint": {"type": "diffuse", "diffuse": [0.9, 0.8, 0.7]}, "glass": glass}))
    paint, phong, clear, default = scene.materials
    assert paint.diffuse == (0.9, 0.8, 0.7)  # `materials` is asked before the mesh's own colour
    assert (phong.specular, phong.exponent) == ((0.5, 0.5, 0.5), 20)
    assert (clear.ior, clear.diffuse) == (1.5, (0, 0, 0))
    assert default.diffuse == (0.5, 0.5, 0.5)
    own = load_scene(write_scene(tmp_path, objects=[{"mesh": "square.glb"}], materials={}))
    assert own.materials[0].diffuse == (0.1, 0.2, 0.3)


def test_camera_and_lights_can_be_replaced(tmp_path: Path) -> None:
    path = write_scene(tmp_path, camera=None, lights=None)
    camera, light = Camera((0, 0, 1), (0, 0, 0)), PointLight((0, 0, 1), (1, 1, 1))
    scene = load_scene(path, camera=camera, lights=[light])
    assert scene.camera is camera
    assert scene.lights == (light,)


def test_normals_only_where_asked_for(tmp_path: Path) -> None:
    for key, value, expected in (("smooth_normals", None, False), ("smooth_normals", True, False)):
        scene = load_scene(write_scene(tmp_path, **{key: value}))
        assert (scene.geometry.vertex_normals is not None) is expected  # the mesh has none to give


@pytest.mark.parametrize(("said", "noted"), [({}, True), ({"smooth_normals": False}, False),
                                             ({"smooth_normals": True}, False)])
def test_normals_that_nobody_asks_for_are_noted(said: dict[str, bool], noted: bool, data_dir: Path,
                                                tmp_path: Path) -> None:
    """A mesh file on its own is shaded with its normals; a scene file that says nothing leaves them out."""
    tree = json.loads((data_dir / "metaballs.json").read_text()) | said
    for item in tree["objects"]:
        item["mesh"] = str(data_dir / item["mesh"])
    (tmp_path / "scene.json").write_text(json.dumps(tree))
    with stages.observe() as log:
        scene = load_scene(tmp_path / "scene.json")
    notes = [run.reason for run in log.runs if run.name == "scene.vertex_normals"]
    assert ["metaballs.ply: the scene file says nothing of smooth_normals" in note for note in notes] == [True] * noted
    assert (scene.geometry.vertex_normals is not None) == said.get("smooth_normals", False)


@pytest.mark.parametrize(("change", "key", "value"), [
    (changed("objects", 0, "colour", value=1), "objects[0].colour", "1"),
    (changed("camera", "vfov_deg", value="40"), "camera.vfov_deg", "'40'"),
    (changed("camera", "vfov_deg", value=180), "vfov_deg", "180"),
    (changed("camera", "width", value=0), "width", "0"),
    (changed("camera", "width", value=10.5), "camera.width", "10.5"),
    (changed("camera", "width", value=10**9), "width", "1000000000"),
    (changed("camera", "target", value=[0, 0, 3]), "target", "(0.0, 0.0, 3.0)"),
    (changed("camera", "up", value=[0, 0, 1]), "up", "(0.0, 0.0, 1.0)"),
    (changed("lights", 0, "outer_half_angle_deg", value=0), "outer_half_angle_deg", "0"),
    (changed("lights", 0, "outer_half_angle_deg", value=90.001), "lights[0]: outer_half_angle_deg", "90.001"),
    (changed("lights", 0, "falloff", value="linear"), "lights[0].falloff", "'linear'"),
    (changed("lights", 0, "inner_half_angle_deg", value=31), "inner_half_angle_deg", "31"),
    (changed("lights", 0, "direction", value=[0, 0, 0]), "direction", "(0.0, 0.0, 0.0)"),
    (changed("lights", 0, "intensity_w_per_sr", value=[1, -1, 1]), "intensity_w_per_sr", "-1"),
    (changed("lights", 0, "type", value="lamp"), "lights[0]", "lamp"),
    (changed("materials", "paint", "diffuse", value=[0.1, 1.2, 0.3]), "materials.paint: diffuse", "1.2"),
    (changed("materials", "paint", value={"type": "phong", "diffuse": [0.1, 0.5, 0.3], "specular": [0.9, 0.500002, 0.7],
                                          "exponent": 9}), "materials.paint: diffuse + specular", "1.000002"),
    (changed("objects", 0, "material", value={"type": "phong", "diffuse": [0, 0, 0.3], "specular": [0, 0, 0.8],
                                              "exponent": 9}), "objects[0].material: diffuse + specular", "1.1"),
    (changed("materials", "paint", "diffuse", value=[0.1, 0.3]), "materials.paint.diffuse", "0.3"),
    (changed("materials", "paint", "type", value="velvet"), "materials.paint", "velvet"),
    (changed("materials", "paint", value={"type": "dielectric", "ior": 0.5}), "ior", "0.5"),
    (changed("objects", 0, "material", value="pain"), "objects[0].material", "did you mean 'paint'"),
    (changed("objects", 0, "transform", value=[0.0] * 15 + [1.0]), "objects[0].transform", "invertible"),
    (changed("objects", 0, "transform", value=[1.0] * 15), "objects[0].transform", "16"),
    (changed("objects", 0, "mesh", value="sqare.ply"), "objects[0].mesh", "did you mean 'square.ply'"),
    (changed("objects", 0, "mesh", value="square.stl"), "objects[0].mesh", ".stl"),
    (changed("objects", 0, "mesh", value="."), "objects[0].mesh", "."),
    (changed("objects", 0, "mesh", value="a\nb.ply"), "objects[0].mesh", "one line, got 'a\\nb.ply'"),
    (changed("objects", 0, "mesh", value="nul\0.ply"), "objects[0].mesh", "ply"),
    ({"objects": []}, "objects", "[]"),
    ({"schema": 2}, "schema", "2"),
    ({"units": "cm"}, "units", "cm"),
    ({"preview_exposure": 0}, "preview_exposure", "0"),
    ({"camera": None}, "camera", "nothing given"),
    ({"lights": None}, "lights", "nothing given"),
    ({"lights": []}, "lights", "nothing given"),
])
def test_each_fault_names_file_key_and_value(tmp_path: Path, change: dict[str, Any], key: str, value: str) -> None:
    path = write_scene(tmp_path, **change)
    with pytest.raises(InputError) as error:
        load_scene(path)
    text = str(error.value)
    assert str(path) in text
    assert key in text
    assert value in text
    assert "Traceback" not in text


def test_all_faults_of_a_file_come_at_once(tmp_path: Path) -> None:
    path = write_scene(tmp_path, units="cm", colour=1, camera=None,
                       lights=[SCENE["lights"][0] | {"outer_half_angle_deg": 120}],
                       objects=[{"mesh": "a.ply", "material": "unknown"}, {"mesh": "b.ply", "transform": [0] * 16}])
    with pytest.raises(InputError) as error:
        load_scene(path)
    lines = str(error.value).splitlines()
    assert len(lines) == 6
    assert all(line.startswith(str(path)) for line in lines)


def test_all_missing_meshes_come_at_once(tmp_path: Path) -> None:
    path = write_scene(tmp_path, objects=[{"mesh": "a.ply"}, {"mesh": "b.obj"}])
    with pytest.raises(InputError, match=r"objects\[0\].*\n.*objects\[1\]"):
        load_scene(path)


def test_of_very_many_faults_the_first_are_shown_and_the_others_counted(tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(SCENE | {f"unknown{number}": 0 for number in range(50_000)}))
    with pytest.raises(InputError) as error:
        load_scene(path)
    lines = str(error.value).splitlines()
    shown = len(lines) - 1
    assert min(20, 1800 // len(f"{lines[0]}\n")) <= shown <= 20  # as many as 2 KB hold
    assert len(str(error.value).encode()) <= 2048
    assert all(line == f"{path}: unknown{number}: unknown key, got 0" for number, line in enumerate(lines[:shown]))
    assert lines[shown] == f"... and {50_000 - shown:,} more"


def test_very_long_keys_and_values_are_shortened(tmp_path: Path) -> None:
    path = write_scene(tmp_path, **{"x" * 100_000: ["y" * 100_000] * 3})
    with pytest.raises(InputError, match=r"xxx.*unknown key, got .*yyy") as error:
        load_scene(path)
    assert len(str(error.value)) < 2000


def test_of_repeated_keys_the_first_are_shown_and_the_others_counted(tmp_path: Path) -> None:
    path = tmp_path / "scene.json"
    keys = ", ".join(f'"key{number:05}": 0' for number in range(60_000))
    path.write_text(f"{{{keys}, {keys}}}")
    with pytest.raises(InputError, match=r"key00019, \.\.\. and 59,980 more: expected each key once") as error:
        load_scene(path)
    assert "key00020" not in str(error.value)


def test_many_missing_meshes_and_materials_are_counted(tmp_path: Path) -> None:
    for objects in ([{"mesh": f"{number}.ply"} for number in range(200)],
                    [{"mesh": "square.ply", "material": f"paint{number}"} for number in range(200)]):
        with pytest.raises(InputError) as error:
            load_scene(write_scene(tmp_path, objects=objects))
        lines = str(error.value).splitlines()
        assert 5 <= len(lines) <= 21  # as many as 2 KB hold
        assert lines[-1] == f"... and {200 - (len(lines) - 1)} more"
        assert len(str(error.value).encode()) <= 2048


def test_no_more_suggestions_are_looked_for_than_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr("refgi.scene.files.did_you_mean", lambda word, _: asked.append(word) or "")
    monkeypatch.setattr("refgi.scene.schema.did_you_mean", lambda word, _: asked.append(word) or "")
    for key, other in (("mesh", {}), ("material", {"mesh": "square.ply"})):
        asked.clear()
        with pytest.raises(InputError, match=r"and 1[89]\d more"):
            load_scene(write_scene(tmp_path, objects=[other | {key: f"{number}.ply"} for number in range(200)]))
        assert len(asked) == 20


def test_a_flat_and_a_missing_object_come_at_once(tmp_path: Path) -> None:
    (tmp_path / "flat.ply").write_bytes(ply_bytes(faces=np.array([[0, 1, 1]])))
    objects = [{"mesh": "flat.ply"}, {"mesh": "square.ply"}, {"mesh": "absent.ply"}, {"mesh": "flat.ply"}]
    with pytest.raises(InputError) as error:
        load_scene(write_scene(tmp_path, objects=objects))
    text = str(error.value)
    assert len(text.splitlines()) == 3
    for number, words in ((0, "of zero area"), (2, "no such file"), (3, "of zero area")):
        assert any(f"objects[{number}].mesh" in line and words in line for line in text.splitlines())


@pytest.mark.parametrize(("text", "said"), [
    ("{", "damaged JSON"), ("[]", "expected a JSON object"), ('{"schema": 1, "schema": 1}', "each key once"),
    ("", "empty"), ("\xff", "damaged JSON"), ("[" * 100_000, "damaged JSON"), ("null", "expected a JSON object"),
    ('{"schema": 1e999}', "schema"), ('{"camera": {"eye": [NaN, 0, 0]}}', "NaN"),
])
def test_damaged_json(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "scene.json"
    path.write_bytes(text.encode("latin-1"))
    with pytest.raises(InputError) as error:
        load_scene(path)
    assert str(path) in str(error.value)
    assert said.lower() in str(error.value).lower()


def test_not_a_number_is_named(tmp_path: Path) -> None:
    path = write_scene(tmp_path)
    path.write_text(path.read_text().replace('"eye": [0,', '"eye": [NaN,'))
    with pytest.raises(InputError, match=r"camera\.eye"):
        load_scene(path)


@pytest.mark.parametrize(("scale", "said"), [
    (1e308, r"objects\[1\].mesh: square.ply: after its transform: vertex"),
    (1e-300, "after its transform: faces: expected at least one with an area"),
])
def test_a_transform_that_leaves_no_mesh_names_its_object(tmp_path: Path, scale: float, said: str) -> None:
    matrix = [scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, 1]
    with pytest.raises(InputError, match=said):
        load_scene(write_scene(tmp_path, objects=[*SCENE["objects"], {"mesh": "square.ply", "transform": matrix}]))


def test_a_byte_order_mark_is_no_fault(tmp_path: Path) -> None:
    path = write_scene(tmp_path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert load_scene(path).name == "sample"


def test_a_light_without_power_is_left_out_and_counted(tmp_path: Path) -> None:
    dark = SCENE["lights"][0] | {"intensity_w_per_sr": [0, 0, 0]}
    with pytest.warns(RefgiWarning, match="1 light of zero power"):
        scene = load_scene(write_scene(tmp_path, lights=[dark, SCENE["lights"][0]]))
    assert len(scene.lights) == 1
    with pytest.raises(InputError, match="at least one light of power"):
        load_scene(write_scene(tmp_path, lights=[dark]))


def test_flat_faces_are_skipped_and_counted(tmp_path: Path) -> None:
    path = write_scene(tmp_path)
    (tmp_path / "square.ply").write_bytes(ply_bytes(faces=np.array([[0, 1, 2], [0, 1, 1], [3, 3, 3]])))
    with pytest.warns(RefgiWarning, match="2 faces of zero area skipped"):
        scene = load_scene(path)
    assert scene.face_count == 1


def test_more_instances_than_memory_holds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("refgi.scene.mesh.physical_memory", lambda: 4 * 48.0 * 10)
    with pytest.raises(InputError, match=r"objects\[7\].*fits in .* GiB of memory, got '32 vertices and 16 faces"):
        load_scene(write_scene(tmp_path, objects=[{"mesh": "square.ply"}] * 8))


@settings(deadline=None)  # files are written and read
@given(angle=st.floats(allow_nan=False, width=32))
def test_any_cone_is_taken_or_refused(tmp_path_factory: pytest.TempPathFactory, angle: float) -> None:
    folder = tmp_path_factory.mktemp("cone", numbered=True)
    path = write_scene(folder, **changed("lights", 0, "outer_half_angle_deg", value=angle))
    if 20 <= angle <= 90:
        assert load_scene(path).lights[0].outer_half_angle == math.radians(angle)
    else:
        with pytest.raises(InputError, match="half_angle_deg"):
            load_scene(path)


@settings(deadline=None)
@given(tree=st.recursive(st.none() | st.booleans() | st.floats() | st.text(max_size=5),
                         lambda inner: st.lists(inner, max_size=3) | st.dictionaries(
                             st.sampled_from(["schema", "camera", "lights", "objects", "mesh", "type"]), inner),
                         max_leaves=12),
       key=st.sampled_from(sorted(SCENE)))
def test_any_value_under_any_key_is_taken_or_refused(
    tmp_path_factory: pytest.TempPathFactory, key: str, tree: Any
) -> None:
    path = write_scene(tmp_path_factory.mktemp("any", numbered=True))
    path.write_text(json.dumps(copy.deepcopy(SCENE) | {key: tree}))
    refusal = ""
    try:
        load_scene(path)
    except InputError as error:
        refusal = str(error)
    assert not refusal or str(path) in refusal


def test_reflectances_that_add_up_to_one_are_taken(tmp_path: Path) -> None:
    for diffuse in np.linspace(0, 1, 101).round(2).tolist():
        specular = round(1 - diffuse, 2)
        paint = {"type": "phong", "diffuse": [diffuse] * 3, "specular": [specular] * 3, "exponent": 9}
        assert load_scene(write_scene(tmp_path, materials={"paint": paint})).materials[0].specular[0] == specular
    exact = {"type": "phong", "diffuse": [float(np.float32(0.7))] * 3, "specular": [float(np.float32(0.3))] * 3,
             "exponent": 9}
    assert load_scene(write_scene(tmp_path, materials={"paint": exact})).face_count == 2


@pytest.mark.parametrize(("scale", "said"), [
    (0.005, "0.00707 m across"), (800, "1.13e\\+03 m across"), (0.0072, ""), (700, "")])
@pytest.mark.parametrize("form", ["json", "ply"])
def test_a_size_of_another_unit_is_hinted_at(tmp_path: Path, scale: float, said: str, form: str) -> None:
    path = write_scene(tmp_path, objects=[{"mesh": "square.ply"}])
    (tmp_path / "square.ply").write_bytes(ply_bytes(TRIANGLES * scale))
    path = path if form == "json" else tmp_path / "square.ply"
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        load_scene(path)
    hints = [str(warning.message) for warning in caught if "across" in str(warning.message)]
    assert len(hints) == bool(said)
    for hint in hints:
        assert re.search(f"{path.name}: {said}; lengths are taken as metres.*\"transform\"", hint)


def test_loading_writes_nothing(tmp_path: Path) -> None:
    write_scene(tmp_path)
    (tmp_path / "bad.json").write_text(json.dumps(SCENE | {"colour": 1}))
    before = sorted(tmp_path.rglob("*"))
    load_scene(tmp_path / "sample.json")
    with pytest.raises(InputError):
        load_scene(tmp_path / "bad.json")
    assert sorted(tmp_path.rglob("*")) == before


def test_extras_hold_what_other_programs_need_and_unknown_keys_are_refused(tmp_path: Path) -> None:
    extras = {"editor": {"zoom": [1, None, "x"]}, "version": 2.5}
    objects = [SCENE["objects"][0] | {"extras": "any"}]
    materials = {"paint": SCENE["materials"]["paint"] | {"extras": extras}}
    lights = [SCENE["lights"][0] | {"extras": []}]
    scene = load_scene(write_scene(tmp_path, extras=extras, objects=objects, materials=materials, lights=lights,
                                   camera=SCENE["camera"] | {"extras": 1}))
    plain = load_scene(write_scene(tmp_path))
    assert (scene.materials, scene.lights, scene.camera) == (plain.materials, plain.lights, plain.camera)
    with pytest.raises(InputError, match="editor: unknown key"):
        load_scene(write_scene(tmp_path, editor=1))


def test_utf_16_is_named(tmp_path: Path) -> None:
    path = write_scene(tmp_path)
    path.write_text(path.read_text(), encoding="utf-16")
    with pytest.raises(InputError, match=r"sample\.json: expected text in UTF-8, got UTF-16"):
        load_scene(path)
