"""Emissive surfaces: a warning with their number, or one lamp on each connected part with its power."""

import dataclasses
import math
import warnings
from pathlib import Path

import numpy as np
import pytest

from refgi.errors import InputError, RefgiWarning
from refgi.provenance.record import scene_record
from refgi.rsm import direct_irradiance, gbuffer, reflective_shadow_map
from refgi.scene import Camera, Image, Material, PointLight, SpotLight, Texture, load_scene, material_table, merge
from refgi.scene.builtin.surfaces import rectangle, sphere
from refgi.scene.placed import emissive_lamps, emissive_parts
from tests.rsm.shapes import sphere as ball
from tests.scene.samples import glb_bytes, gltf_tree, write_scene

ROUNDING = 1e-12
ROOM = """mtllib room.mtl
v -1 0 -1
v -1 0 1
v 1 0 1
v 1 0 -1
v -0.3 1.99 -0.3
v 0.3 1.99 -0.3
v 0.3 1.99 0.3
v -0.3 1.99 0.3
usemtl white
f 1 2 3 4
usemtl lamp
f 5 6 7 8
"""
LAMP = "newmtl white\nKd 0.7 0.7 0.7\nnewmtl lamp\nKd 0 0 0\nKe 15 10 5\n"


def room(folder: Path, more: str = "") -> Path:
    (folder / "room.mtl").write_text(LAMP)
    (folder / "room.obj").write_text(ROOM + more)
    return folder / "room.obj"


def said(run):
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        result = run()
    assert all(one.category is RefgiWarning for one in found)
    return result, [str(one.message).partition(": ")[2] for one in found]


def test_emissive_surfaces_are_counted(tmp_path):
    scene, texts = said(lambda: load_scene(room(tmp_path)))
    assert texts == ["1 emissive surface lights nothing here, the camera alone sees it; --emissive lamps puts a lamp "
                     "on each", "the file has no camera and no light; one was placed to fit the mesh"]
    assert scene.emissive_lamps == 0
    far = "v 5 0 0\nv 6 0 0\nv 6 1 0\nf 9 10 11\n"
    _, texts = said(lambda: load_scene(room(tmp_path, far)))
    assert texts[0].startswith("2 emissive surfaces light nothing here, the camera alone sees them;")


def test_a_lamp_has_the_parts_power_normal_and_a_cosine_cone(tmp_path):
    """L A = 0.36 m^2 of (15, 10, 5): the power of a diffuse emitter is pi L A."""
    scene, texts = said(lambda: load_scene(room(tmp_path), emissive="lamps"))
    light, = scene.lights
    assert isinstance(light, SpotLight)
    assert light.direction == pytest.approx((0, -1, 0))
    assert light.position[::2] == pytest.approx((0, 0))
    assert 1.98 < light.position[1] < 1.99
    assert light.intensity == pytest.approx((5.4, 3.6, 1.8))
    assert (light.inner_half_angle, light.outer_half_angle, light.falloff) == (0, math.pi / 2, "ramp")
    assert texts == ["1 lamp(s), each in place of an emissive part: all of its power comes from one point with a "
                     "cosine falloff (an approximation)", "the file has no camera; one was placed to fit the mesh"]
    white = material_table([Material(diffuse=(1, 1, 1))], np.float64)
    rsm = reflective_shadow_map(ball(32, 3.0), white, light, 64, np.float64)
    assert rsm.flux.sum(axis=(1, 2)) == pytest.approx(math.pi * 0.36 * np.array([15, 10, 5]), rel=1e-6)


def test_a_lamp_lights_a_floor_as_a_small_diffuse_emitter_does(tmp_path):
    """E = L A cos cos / d^2 = L A h^2 / (h^2 + r^2)^2 over a parallel floor."""
    scene, _ = said(lambda: load_scene(room(tmp_path), emissive="lamps"))
    light, = scene.lights
    view = Camera((0, 1.5, 0), (0, 0, 0), (0, 0, -1), math.radians(60), 17, 17)
    buffer = gbuffer(scene.geometry, material_table(scene.materials), view, dtype=np.float64)
    x, y, z = buffer.position
    h = light.position[1] - y
    expected = 5.4 * h**2 / (h**2 + x**2 + z**2) ** 2
    np.testing.assert_allclose(direct_irradiance(buffer, light)[0], expected, rtol=ROUNDING)


def test_the_record_says_so_and_a_change_of_lights_ends_it(tmp_path):
    scene, _ = said(lambda: load_scene(room(tmp_path), emissive="lamps"))
    record = scene_record(scene, {})["scene"]
    assert record["emissive_lamps"]["count"] == 1
    assert "one point" in record["emissive_lamps"]["approximation"]
    assert "emissive_lamps" not in scene_record(scene.with_lights(PointLight((0, 1, 0), (1, 1, 1))), {})["scene"]


def test_own_lights_stay_beside_the_lamps(tmp_path):
    own = PointLight((0, 1, 0), (1, 1, 1))
    scene, _ = said(lambda: load_scene(room(tmp_path), lights=[own], emissive="lamps"))
    assert scene.lights[0] == own
    assert (len(scene.lights), scene.emissive_lamps) == (2, 1)


def test_scene_files_and_gltf(tmp_path):
    glow = {"type": "diffuse", "diffuse": [0, 0, 0], "emission": [2, 2, 2]}
    path = write_scene(tmp_path, materials={"paint": glow}, lights=None)
    with pytest.raises(InputError, match="at least one light"):
        load_scene(path)
    scene, texts = said(lambda: load_scene(path, emissive="lamps"))
    assert scene.lights[0].intensity == pytest.approx((2, 2, 2))  # a square of 1 m^2
    assert len(texts) == 1
    tree = gltf_tree()
    tree["materials"][0]["emissiveFactor"] = [1, 0, 0]
    (tmp_path / "a.glb").write_bytes(glb_bytes(tree))
    scene, _ = said(lambda: load_scene(tmp_path / "a.glb", emissive="lamps"))
    assert [type(light) for light in scene.lights] == [SpotLight, SpotLight]
    assert scene.lights[1].intensity == pytest.approx((1, 0, 0))
    assert scene.emissive_lamps == 1
    with pytest.raises(InputError, match="emissive: expected seen or lamps, got 'area'"):
        load_scene(tmp_path / "a.glb", emissive="area")


def test_parts_hang_together_by_position_and_textures_count_by_their_mean():
    image = np.zeros((2, 2, 3), np.float32)
    image[0, 0], image[1, 1] = 1, 0.5
    glow = Material("glow", emission=(8, 8, 8), emission_texture=Texture(Image(image)))
    first = rectangle((0, 0, 0), (1, 0, 0), (0, 0, 1), glow, "a", (3, 3))
    beside = rectangle((1, 0, 0), (1, 0, 0), (0, 0, 1), Material("b", emission=(1, 1, 1)), "b")
    apart = rectangle((0, 5, 0), (1, 0, 0), (0, 0, 1), Material("b", emission=(1, 1, 1)), "c")
    plain = rectangle((0, 7, 0), (1, 0, 0), (0, 0, 1), Material(), "d")
    meshes = [one if one.uv is not None else _laid(one) for one in (first, plain, apart, beside)]
    geometry, materials = merge(meshes)
    assert [len(part) for part in emissive_parts(geometry, materials)] == [20, 2]
    lamps = emissive_lamps(geometry, materials)
    assert lamps[0].intensity == pytest.approx((8 * 0.375 + 1,) * 3)
    assert lamps[1].intensity == pytest.approx((1, 1, 1))
    assert lamps[0].direction == pytest.approx((0, -1, 0))  # x cross z


def _laid(mesh):
    return dataclasses.replace(mesh, uv=np.zeros((len(mesh.faces), 3, 2)))


def test_a_bulb_shines_from_before_it_towards_the_middle_of_the_scene():
    floor = rectangle((-5, 0, 5), (10, 0, 0), (0, 0, -10), Material(), "floor")
    bulb = sphere((0, 4, 0), 0.1, 800, Material("bulb", emission=(1, 1, 1)), "bulb")
    geometry, materials = merge([floor, bulb])
    lamp, = emissive_lamps(geometry, materials)
    assert lamp.direction == pytest.approx((0, -1, 0))
    assert lamp.position[1] < 3.9
    assert lamp.intensity[0] == pytest.approx(4 * math.pi * 0.01, rel=0.05)  # its area, of flat faces


def test_scenes_without_emission_say_nothing(tmp_path):
    scene = load_scene(write_scene(tmp_path), emissive="lamps")
    assert scene.emissive_lamps == 0
    assert len(scene.lights) == 1
