"""Paths: interpolation between keys, scenes along them, and files that describe them."""

import itertools
import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.scene import DirectionalLight, PointLight, load_scene
from refgi.scene.path import Motion, Path, Track, scenes_along, value_at
from refgi.scene.pathfile import read_path

FILE = """
frames = 5
curve = "linear"

[[camera]]
at = 0.25
eye = [0.0, 0.0, -1.0]
vfov_deg = 40

[[camera]]
at = 1
vfov_deg = 60.0

[[lights]]
light = 0
keys = [{at = 0.0, intensity_w_per_sr = [1.0, 1.0, 1.0]}, {at = 1.0, intensity_w_per_sr = [3.0, 1.0, 0.0]}]

[[objects]]
material = "red"
axis = [0.0, 2.0, 0.0]
center = [0.5, 0.0, 0.0]
keys = [{at = 0.0}, {at = 1.0, turn_deg = 180.0, move = [0.0, 1.0, 0.0]}]

[[objects]]
faces = [0, 2]
keys = [{at = 0.5, move = [1.0, 0.0, 0.0]}]
"""


@pytest.fixture(scope="module")
def room():
    return load_scene("cornell_box").with_camera(width=16, height=12)


@pytest.fixture
def written(tmp_path):
    def write(text):
        path = tmp_path / "way.toml"
        path.write_text(text)
        return path

    return write


def track(at, *values):
    return Track(np.array(at, np.float64), np.array(values, np.float64).reshape(len(at), -1))


@pytest.mark.parametrize("curve", ["linear", "catmull_rom"])
def test_keys_are_met_to_the_bit_and_hold_at_both_ends(curve):
    keys = track([0.1, 0.3, 0.4, 0.9], 1.1, -2.3, 5.7, 0.1)
    for at, value in zip(keys.at, keys.values, strict=True):
        assert value_at(keys, float(at), curve) == value
    assert value_at(keys, 0.0, curve) == 1.1
    assert value_at(keys, 1.0, curve) == 0.1
    assert value_at(track([0.5], 7), 0.2, curve) == 7


def test_linear_goes_straight_from_key_to_key():
    assert np.allclose(value_at(track([0, 0.5, 1], (0, 1), (2, 3), (2, 9)), 0.75, "linear"), [2, 6])


@pytest.mark.parametrize("time", [0.05, 0.3, 0.55, 0.8])
def test_catmull_rom_is_the_textbook_cubic(time):
    # of even keys: half of (1, s, s^2, s^3) times the matrix of Catmull and Rom; lines stay lines for uneven ones
    assert value_at(track([0, 0.1, 0.5, 1], 0, 0.2, 1, 2), time, "catmull_rom") == pytest.approx(2 * time)
    p = [3.0, -1.0, 4.0, 2.0]
    s = time * 0.999
    expected = 0.5 * np.array([1, s, s * s, s**3]) @ [[0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]] @ p
    assert value_at(track([0, 1 / 3, 2 / 3, 1], *p), 1 / 3 + s / 3, "catmull_rom") == pytest.approx(expected)


def test_a_file_becomes_scenes(room, written):
    path, frames = read_path(written(FILE), room)
    assert frames == 5
    scenes = list(scenes_along(room, path, frames))
    assert [math.degrees(s.camera.vfov) for s in scenes] == pytest.approx([40, 40, 40 + 20 / 3, 40 + 40 / 3, 60])
    assert all(s.camera.eye == (0, 0, -1) and s.camera.target == room.camera.target for s in scenes)
    assert scenes[2].lights[0].intensity == (2, 1, 0.5)
    assert scenes[2].lights[0].position == room.lights[0].position
    red = room.geometry.material_of_face == 2
    start, end = (s.geometry.vertices[s.geometry.faces[red]] for s in (scenes[0], scenes[4]))
    rest = room.geometry.vertices[room.geometry.faces[red]]
    assert np.array_equal(start, rest)
    assert np.allclose(end, rest * (-1, 1, -1) + (1, 1, 0))
    assert np.allclose(scenes[2].geometry.vertices[scenes[2].geometry.faces[:2]],
                       room.geometry.vertices[room.geometry.faces[:2]] + np.array([1, 0, 0]))
    assert all(s.geometry.faces is scenes[0].geometry.faces for s in scenes)


def test_while_objects_rest_frames_share_one_geometry(room):
    move = track([0.0, 0.5, 0.75, 1.0], (0, 0, 0), (1, 0, 0), (1, 0, 0), (2, 0, 0))
    way = Path("linear", objects=(Motion(np.ones(30, np.bool_), (0, 1, 0), (0, 0, 0), None, move),))
    scenes = list(scenes_along(room, way, 9))
    shared = [a.geometry is b.geometry for a, b in itertools.pairwise(scenes)]
    assert shared == [False] * 4 + [True] * 2 + [False] * 2
    still = list(scenes_along(room, Path(), 3))
    assert all(s.geometry is room.geometry and s.camera is room.camera for s in still)
    assert all(s.lights[0] is room.lights[0] for s in still)


def test_a_whole_turn_is_none(room):
    turn = track([0.0, 1.0], 0.0, 2 * math.pi)
    way = Path("linear", objects=(Motion(np.ones(30, np.bool_), (1, 1, 0), (0.3, 0.1, 0.2), turn, None),))
    last = list(scenes_along(room, way, 3))[-1]
    assert np.array_equal(last.geometry.vertices, room.geometry.vertices)


def test_all_faults_of_a_file_come_at_once(room, written):
    text = """
frames = 0
curve = "bezier"
camera = [{at = 2.0, eye = [1.0, 2.0]}, {at = 0.5}]
lights = [{light = 0, keys = [{at = 0.0, colour = 3}]}]
objects = [{keys = [{at = 0.0}]}, {material = "red", axis = [0.0, 0.0, 0.0], keys = [{at = 0.0}]},
           {keys = [{at = nan}]}]
"""
    with pytest.raises(InputError) as caught:
        read_path(written(text), room)
    lines = str(caught.value).splitlines()
    for words in ("frames: ", "curve: ", "camera[0].at: ", "camera[0].eye", "camera[1]: expected a value at 0.5",
                  "lights[0].keys[0].colour: unknown key", "objects[0]: expected either material or faces",
                  "objects[1]: axis: expected a finite vector", "objects[2].keys[0].at"):
        assert any(words in line for line in lines), (words, lines)
    assert all("way.toml" in line for line in lines)


def test_all_that_the_scene_does_not_have_comes_at_once(room, written):
    text = """
camera = [{at = 0.5, eye = [0.0, 0.0, 1.0]}, {at = 0.5, eye = [0.0, 0.0, 1.0]}]
lights = [{light = 1, keys = [{at = 0.0, position = [0.0, 0.0, 0.0]}]},
          {light = 0, keys = [{at = 0.0, irradiance_w_per_m2 = [1.0, 0.0, 0.0]}]}]
objects = [{material = "rde", keys = [{at = 0.0}]}, {faces = [3, 31], keys = [{at = 0.0}]}]
"""
    with pytest.raises(InputError) as caught:
        read_path(written(text), room)
    lines = str(caught.value).splitlines()
    for line, words in zip(lines, ("camera: expected keys with ascending times", "lights[0].light: expected 0 to 0",
                                   "lights[1].keys: irradiance_w_per_m2", "objects[0].material",
                                   "objects[1].faces: expected first and end within 0 to 30"), strict=True):
        assert words in line


@pytest.mark.parametrize(("content", "words"), [
    ("frames = ", "no TOML"), ("frames = 1\nframes = 2", "no TOML"), ("colour = 1", "colour: unknown key"),
    ("camera = 3", "camera: "),
])
def test_damaged_files_are_refused(room, written, content, words):
    with pytest.raises(InputError, match=words):
        read_path(written(content), room)


def test_a_frame_whose_camera_is_not_usable_is_named(room, written):
    # each key is good, but halfway between them the eye passes through the target
    (x, y, z), (ex, ey, ez) = room.camera.target, room.camera.eye
    beyond = [2 * x - ex, 2 * y - ey, 2 * z - ez]
    text = f'curve = "linear"\ncamera = [{{at = 0.0, eye = {[ex, ey, ez]}}}, {{at = 1.0, eye = {beyond}}}]'
    path, _ = read_path(written(text), room)
    with pytest.raises(InputError, match=r"way\.toml: frame 1 of 3 \(at = 0\.5\): camera: target"):
        list(scenes_along(room, path, 3))


def test_a_frame_whose_light_is_not_usable_is_named(room, written):
    # the cubic undershoots: keys 0, 0, 1 dip below 0 between the first two
    keys = ", ".join(f"{{at = {at}, intensity_w_per_sr = [{v}, {v}, {v}]}}" for at, v in ((0.0, 0), (0.5, 0), (1.0, 1)))
    path, _ = read_path(written(f"lights = [{{light = 0, keys = [{keys}]}}]"), room)
    with pytest.raises(InputError, match=r"way\.toml: frame 1 of 5 .*: lights\[0\] of the scene: light: intensity"):
        list(scenes_along(room, path, 5))


def test_a_frame_whose_object_is_not_usable_is_named(room, written):
    text = "objects = [{faces = [0, 1], keys = [{at = 0.0}, {at = 1.0, move = [1e9, 0.0, 0.0]}]}]"
    path, _ = read_path(written(text), room)
    with pytest.raises(InputError, match=r"way\.toml: frame 1 of 2 .*: geometry: vertex"):
        list(scenes_along(room, path, 2))


def test_keys_whose_values_no_frame_could_use_are_named_with_the_file(room, written):
    text = f"""
camera = [{{at = 0.0, vfov_deg = 40.0, eye = {list(room.camera.eye)}}}, {{at = 0.3, vfov_deg = 200.0}},
          {{at = 0.7, eye = {list(room.camera.target)}}}]
lights = [{{light = 0, keys = [
    {{at = 0.0, intensity_w_per_sr = [-1.0, 0.0, 0.0], direction = [0.0, 1.0, 0.0]}},
    {{at = 0.5, intensity_w_per_sr = [1.0, 0.0, 0.0], direction = [0.0, 0.0, 0.0]}}]}}]
[[objects]]
material = "red"
center = [0.0, 1e10, 0.0]
keys = [{{at = 0.0}}, {{at = 1.0, move = [1e30, 0.0, 0.0]}}]
"""
    with pytest.raises(InputError) as caught:
        read_path(written(text), room)
    lines = str(caught.value).splitlines()
    for words in ("way.toml: camera[1]: vfov_deg: expected", "way.toml: camera[2]: target: expected a point away",
                  "way.toml: lights[0].keys[0]: intensity_w_per_sr: expected",
                  "way.toml: lights[0].keys[1]: direction: expected",
                  "way.toml: objects[0].center: expected", "way.toml: objects[0].keys[1].move: expected"):
        assert any(words in line for line in lines), (words, lines)


def test_many_faults_of_a_path_are_counted(room, written):
    with pytest.raises(InputError) as caught:
        read_path(written("\n".join(f"key{number} = 1" for number in range(500))), room)
    lines = str(caught.value).splitlines()
    assert 2 <= len(lines) <= 21  # as many as 2,000 bytes hold, which the length of the file's name decides
    assert lines[-1] == f"... and {501 - len(lines)} more"


def test_each_kind_of_light_has_its_own_keys(room, written):
    lights = PointLight((0, 1, 0), (1, 1, 1)), DirectionalLight((0, -1, 0), (1, 1, 1))
    text = """
lights = [{light = 1, keys = [{at = 0.0, direction = [1.0, -1.0, 0.0], irradiance_w_per_m2 = [2.0, 2.0, 2.0]}]},
          {light = 0, keys = [{at = 0.0, position = [0.0, 2.0, 0.0]}]}]
"""
    scene = room.with_lights(*lights)
    path, frames = read_path(written(text), scene)
    assert frames is None
    point, sun = next(iter(scenes_along(scene, path, 1))).lights
    assert point.position == (0, 2, 0)
    assert (sun.direction, sun.irradiance) == ((1, -1, 0), (2, 2, 2))
