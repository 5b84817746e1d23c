"""Direct light against closed forms, and the map's shadows against rays."""

import dataclasses
import math

import numpy as np
import pytest

from refgi import Frame
from refgi.errors import InputError
from refgi.rsm import direct_irradiance, gbuffer, reflective_shadow_map, shadow_map_visibility
from refgi.rsm.raster.projection import PARABOLOID
from refgi.scene import Camera, DirectionalLight, Material, PointLight, SpotLight, load_scene, material_table
from tests.rsm.shapes import geometry, sphere

FLOAT32 = 4e-7  # a few roundings
FLOOR = geometry([[-9, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]], [[0, 1, 2], [0, 2, 3]])
CAMERA = Camera((0, 3, 4), (0, 0, 0), width=60, height=50)
SPOT = SpotLight((0.5, 2.0, -0.3), (0.1, -1, 0.2), 0.3, 0.8, (3.0, 2.0, 1.0))
LIGHTS = {
    "spot": SPOT,
    "wide spot": SpotLight((0.5, 2.0, -0.3), (0.1, -1, 0.2), 0.3, 1.5, (3.0, 2.0, 1.0)),
    "point": PointLight((0.5, 2.0, -0.3), (3.0, 2.0, 1.0)),
    "directional": DirectionalLight((0.3, -1.0, 0.4), (3.0, 2.0, 1.0)),
}


def view(shape, dtype=np.float64, camera=CAMERA):
    return gbuffer(shape, material_table([Material()], dtype), camera, dtype=dtype)


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("name", LIGHTS)
def test_irradiance_equals_its_definition(name, dtype):
    light, seen = LIGHTS[name], view(FLOOR, dtype)
    out = direct_irradiance(seen, light)
    for row, column in np.argwhere(seen.covered)[::50]:
        x, n = (plane[:, row, column].astype(float) for plane in (seen.position, seen.normal))
        if name == "directional":
            to_light = -np.array(light.direction) / np.linalg.norm(light.direction)
            expected = np.array(light.irradiance) * (n @ to_light)
        else:
            away = x - light.position
            square = away @ away
            away /= math.sqrt(square)
            share = 1.0
            if name != "point":
                axis = np.array(light.direction) / np.linalg.norm(light.direction)
                cosines = math.cos(light.inner_half_angle), math.cos(light.outer_half_angle)
                t = min(max((axis @ away - cosines[1]) / (cosines[0] - cosines[1]), 0.0), 1.0)
                share = t * t * (3 - 2 * t)
            expected = np.array(light.intensity) * share * (-n @ away) / square
        rounding = 1e-12 if dtype == np.float64 else FLOAT32
        np.testing.assert_allclose(out[:, row, column], expected, rtol=rounding, atol=rounding * 1e-2)
    assert (out[:, ~seen.covered] == 0).all()
    assert out.dtype == dtype


def test_lamps_of_a_frame_add_up():
    box = load_scene("cornell_box")
    lamps = (DirectionalLight((0.3, -0.2, 1.0), (0.3, 0.2, 0.1)), PointLight((0.1, 0.3, 0.4), (0.3, 0.2, 0.1)),
             *box.lights)

    def direct(*lit):
        return Frame(dataclasses.replace(box, lights=lit), width=12, height=9, dtype=np.float64, shadows="exact").direct

    parts = [direct(lamp) for lamp in lamps]
    assert all(part.any() for part in parts)
    np.testing.assert_allclose(direct(*lamps), np.sum(parts, axis=0), rtol=1e-12)


def test_what_is_not_visible_gets_nothing():
    seen = view(FLOOR)
    half = np.zeros((50, 60), bool)
    half[:, :30] = True
    whole, cut = direct_irradiance(seen, SPOT), direct_irradiance(seen, SPOT, half)
    np.testing.assert_array_equal(cut, whole * half)


def test_what_faces_away_gets_nothing():
    below = PointLight((0.5, -2.0, -0.3), (3.0, 2.0, 1.0))
    assert (direct_irradiance(view(FLOOR), below) == 0).all()


@pytest.mark.parametrize("name", LIGHTS)
@pytest.mark.parametrize("resolution", [16, 512])
def test_a_lone_plane_has_no_shadow_on_itself(name, resolution):
    light, seen = LIGHTS[name], view(FLOOR)
    rsm = reflective_shadow_map(FLOOR, material_table([Material()], np.float64), light, resolution, np.float64)
    visible = shadow_map_visibility(seen.position, seen.normal, seen.covered, rsm)
    np.testing.assert_array_equal(direct_irradiance(seen, light, visible), direct_irradiance(seen, light))
    assert not visible[~seen.covered].any()


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.parametrize("resolution", [32, 128])
def test_a_convex_room_has_no_shadow(smooth, resolution):
    room = sphere(16, 4.0)
    room = room if smooth else geometry(room.vertices, room.faces)
    light = PointLight((1.5, 1.0, -0.4), (1, 1, 1))
    seen = view(room, camera=Camera((0.4, 0.2, 3.0), (0, 0, 0), vfov=1.8, width=150, height=150))
    rsm = reflective_shadow_map(room, material_table([Material()], np.float64), light, resolution, np.float64)
    visible = shadow_map_visibility(seen.position, seen.normal, seen.covered, rsm)
    assert visible.mean() > 0.9998  # along a crease of 11 degrees a neighbour's texel may stand a tenth above


@pytest.mark.parametrize("name", LIGHTS)
def test_map_shadows_are_those_of_rays_away_from_their_edges(name, evidence):
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    box = load_scene("cornell_box")
    position = box.lights[0].position
    light = {
        "spot": box.lights[0],
        "wide spot": SpotLight(position, (0.1, -1, 0.2), 0.3, 1.5, (1, 1, 1)),
        "point": PointLight(position, (1, 1, 1)),
        "directional": DirectionalLight((0.2, -0.5, -1.0), (1, 1, 1)),
    }[name]
    materials = material_table(box.materials, np.float64)
    seen = gbuffer(box.geometry, materials, box.camera, 160, 160, np.float64)
    rsm = reflective_shadow_map(box.geometry, materials, light, 1024, np.float64)
    visible = shadow_map_visibility(seen.position, seen.normal, seen.covered, rsm)
    lit = direct_irradiance(seen, light).any(axis=0)
    origin = (seen.position + 1e-5 * seen.normal)[:, lit].T
    if name == "directional":
        to_light = np.broadcast_to(-np.array(light.direction) / np.linalg.norm(light.direction), origin.shape)
        reach = np.full(len(origin), 1e6)
    else:
        to_light = np.array(position) - origin
        reach = np.linalg.norm(to_light, axis=1)
        to_light = to_light / reach[:, None]
    scene = EmbreeScene()
    TriangleMesh(scene, box.geometry.vertices.astype(np.float32), box.geometry.faces)
    blocked = scene.run(origin.astype(np.float32), np.ascontiguousarray(to_light, np.float32),
                        (reach * 0.9999).astype(np.float32), query="OCCLUDED") >= 0  # fmt: skip
    wrong = (visible[lit] == blocked).mean()
    assert wrong < 0.01  # texels and pixels that straddle a shadow's edge
    evidence(f"{name}: {wrong:.2%} of the unshadowed pixels differ from rays, all along edges")


def reached(point, normal, rsm):
    """The published rule with the receiver's plane, literally: (lit, how far the closest decision was, m)."""
    row, column, far = (float(number) for number in rsm.project(point))
    if math.isnan(far):
        return False, math.inf
    row, column = int(row), int(column)
    stored, depth = rsm.position[:, row, column], rsm.depth[row, column]
    above = normal @ (stored - point) - 1e-6 * far if np.isfinite(depth) else -math.inf
    maps = rsm.projection
    along, texel = maps.frame[row // maps.height, 2], 2 * maps.half[0] / maps.width
    if not isinstance(rsm.light, DirectionalLight):
        along = (point - rsm.light.position) / np.linalg.norm(point - rsm.light.position)
        texel *= np.linalg.norm(point - rsm.light.position) * (2 if maps.kind == PARABOLOID else 1)
    cosine = abs(along @ normal)
    margin = 0.1 * texel * (1 + min(math.sqrt(1 - min(cosine, 1) ** 2) / max(cosine, 1e-6), 10))
    doubt = min(abs(far - depth), abs(above - margin))
    return far <= depth or above <= margin, doubt


@pytest.mark.parametrize("name", LIGHTS)
def test_the_look_up_is_its_literal_twin(name):
    ball = sphere(10, 0.5, (0.4, 0.8, 0.1))
    shape = geometry(np.concatenate([FLOOR.vertices, ball.vertices]), [*FLOOR.faces, *(ball.faces + 4)])
    seen = view(shape, camera=Camera((0, 3, 4), (0, 0.3, 0), width=45, height=40))
    rsm = reflective_shadow_map(shape, material_table([Material()], np.float64), LIGHTS[name], 24, np.float64)
    visible = shadow_map_visibility(seen.position, seen.normal, seen.covered, rsm)
    shadowed = 0
    for row, column in np.argwhere(seen.covered):
        lit, doubt = reached(seen.position[:, row, column], seen.normal[:, row, column], rsm)
        if doubt > 1e-9:  # m; closer decisions are rounding of float64
            assert visible[row, column] == lit
            shadowed += not lit
    assert shadowed > 20


def test_a_given_bias_is_used_as_it_is():
    shape = geometry(
        np.concatenate([FLOOR.vertices, FLOOR.vertices * 0.05 + (0.5, 0.2, 0.0)]), [*FLOOR.faces, *(FLOOR.faces + 4)]
    )
    seen = view(shape)
    rsm = reflective_shadow_map(shape, material_table([Material()]), DirectionalLight((0, -1, 0), (1, 1, 1)), 512)
    under = (seen.triangle_id < 2) & (np.abs(seen.position[0] - 0.5) < 0.4) & (np.abs(seen.position[2]) < 0.4)
    assert under.any()
    for bias, expected in ((0.0, False), (0.19, False), (0.21, True)):
        visible = shadow_map_visibility(seen.position, seen.normal, seen.covered, rsm, bias)
        assert (visible[under] == expected).all()
    with pytest.raises(InputError, match="bias: expected a finite number >= 0, m, got -1"):
        shadow_map_visibility(seen.position, seen.normal, seen.covered, rsm, -1)
