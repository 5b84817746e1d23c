"""Spots that light a whole half space: no plane meets all of their cone, other maps do."""

import dataclasses
import json
import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.methods import find_method, render
from refgi.rsm.buffers.light_projection import incident_flux, light_projection
from refgi.scene import SpotLight, load_scene
from refgi.scene.gltf import read_gltf
from refgi.scene.light import Falloff
from refgi.settings import of
from tests.scene.samples import SCENE, glb_bytes, gltf_tree, write_scene

RIGHT = math.pi / 2
SAMPLED = 2e-3  # of the power: 16 samples a texel along the rim of the cone on a cube map of 6 x 32 x 32 texels
INTEGRATED = 1e-9  # of the power: quadrature of smooth functions, whose rest a paraboloid map has at its rim
ALMOST = RIGHT - math.radians(0.001)
SAME = 2e-3  # of the mean: lights are drawn anew from a map whose texels all change by 2e-5


def spot(inner: float, outer: float = RIGHT, falloff: Falloff = "smoothstep") -> SpotLight:
    return SpotLight((0.3, 0.4, 0.3), (0.1, -1, 0.2), inner, outer, (3, 2, 1), falloff)


@pytest.fixture(scope="module")
def room():
    return load_scene("cornell_box").with_camera(width=24, height=24)


@pytest.mark.parametrize(("falloff", "mean"), [("smoothstep", 1 / 2), ("squared_ramp", 1 / 3), ("ramp", 1 / 2)])
@pytest.mark.parametrize("inner", [0.0, 0.4, ALMOST, RIGHT])
@pytest.mark.parametrize(("shape", "tolerance"), [("auto", INTEGRATED), ("paraboloid", INTEGRATED), ("cube", SAMPLED)])
def test_all_of_the_power_falls_into_the_map(room, inner, shape, tolerance, falloff, mean):
    light = spot(inner, falloff=falloff)
    maps = light_projection(light, room.geometry, 32, shape)
    flux = incident_flux(light, maps, None, np.float64)
    # between the cones the falloff, even in the cosine, is its mean: 2 pi I ((1 - cos inner) + mean (cos inner - 0))
    power = 2 * math.pi * (1 - math.cos(inner) + mean * math.cos(inner)) * np.array([3, 2, 1])
    assert flux.reshape(3, -1).sum(axis=1) == pytest.approx(power, rel=tolerance)


def test_a_perspective_map_of_a_half_space_is_refused_with_the_maps_that_suit(room):
    with pytest.raises(InputError, match="suits a SpotLight of 90 degrees: cube, paraboloid, got 'perspective'"):
        light_projection(spot(0.4), room.geometry, 32, "perspective")
    assert light_projection(spot(0.4, ALMOST), room.geometry, 32, "perspective").maps == 1


@pytest.mark.filterwarnings("ignore:.* of the indirect light")  # of clamps: tests/pairs/test_loss
@pytest.mark.parametrize("method", ["sii", "val", "vpl", "hssil", "truth"])
def test_ninety_degrees_light_as_the_angles_just_below(room, method):
    settings_class = find_method(method).settings
    settings = of(settings_class, lights=256) if method in ("sii", "val", "vpl") else settings_class()
    below, wide = (render(room.with_lights(dataclasses.replace(room.lights[0], inner_half_angle=0.5,
                                                               outer_half_angle=angle)), method, settings)
                   for angle in (ALMOST, RIGHT))
    assert np.isfinite(wide.radiance).all()
    assert wide.irradiance.mean() > 0
    assert wide.irradiance.mean() == pytest.approx(below.irradiance.mean(), rel=SAME)


@pytest.mark.parametrize("angle", [RIGHT, 1.5707964, float(np.float32(RIGHT))])
def test_gltf_spots_of_ninety_degrees_are_taken(tmp_path, angle):
    tree = gltf_tree()
    tree["extensions"]["KHR_lights_punctual"]["lights"][0]["spot"] = {"innerConeAngle": angle, "outerConeAngle": angle}
    path = tmp_path / "wide.glb"
    path.write_bytes(glb_bytes(tree))
    light = read_gltf(path).lights[0]
    assert (light.inner_half_angle, light.outer_half_angle) == (RIGHT, RIGHT)


@pytest.mark.parametrize("angle", [RIGHT + 2e-6, 2.0])
def test_gltf_spots_of_more_are_refused(tmp_path, angle):
    tree = gltf_tree()
    tree["extensions"]["KHR_lights_punctual"]["lights"][0]["spot"] = {"outerConeAngle": angle}
    path = tmp_path / "wide.glb"
    path.write_bytes(glb_bytes(tree))
    with pytest.raises(InputError, match=r"outer_half_angle_deg: expected 1e-05 to 90, got"):
        read_gltf(path)


def test_spots_of_ninety_degrees_in_a_scene_file(tmp_path):
    light = json.loads(json.dumps(SCENE["lights"][0])) | {"outer_half_angle_deg": 90, "inner_half_angle_deg": 90}
    scene = load_scene(write_scene(tmp_path, lights=[light]))
    assert scene.lights[0].outer_half_angle == scene.lights[0].inner_half_angle == RIGHT
