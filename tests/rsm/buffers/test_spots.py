"""Maps of narrow spots, where float32 has few digits of the cone, and of spots that light a half space and more."""

import dataclasses
import json
import math

import mpmath
import numpy as np
import pytest

from refgi.errors import InputError
from refgi.methods import find_method, render
from refgi.radiometry import FOR_FLOAT32, incident_light, radiant_intensity, spot_falloff
from refgi.rays import Tracer
from refgi.rsm import direct_irradiance, gbuffer, reflective_shadow_map
from refgi.rsm.buffers.direct import NO_SHADOW, _spot_irradiance
from refgi.rsm.buffers.light_projection import incident_flux, light_projection
from refgi.rsm.buffers.solid_angle import spot_power
from refgi.rsm.raster.projection import paraboloid_projection, spot_projection
from refgi.scene import Camera, Material, SpotLight, light_table, load_scene, material_table
from refgi.scene.gltf import read_gltf
from refgi.scene.light import Falloff, cone_row
from refgi.settings import of
from refgi.splat import walk_lights
from refgi.truth.light_grid import light_rays
from tests.rsm.shapes import geometry
from tests.scene.samples import SCENE, glb_bytes, gltf_tree, write_scene

PLAIN = {np.float32: FOR_FLOAT32, np.float64: math.inf}
ULP = 8  # as promised in the docstring of `spot_falloff`
DEGREES = (1e-5, 3e-5, 1e-4, 1e-3, 0.02, 0.1, 0.3, 1.0, 10.0, 35.0, 60.0, 89.0, 89.99, 89.9999)
FLOOR = geometry([[-9, 0, -9], [9, 0, -9], [9, 0, 9], [-9, 0, 9]], [[0, 1, 2], [0, 2, 3]])
SHARES = (0.0, 0.3, 0.8, 0.99, 0.9999, 1.0)  # of the outer half-angle that the inner one is


def exact_falloff(d, axis, inner, outer, falloff="smoothstep"):
    """t t (3 - 2 t), t t or t, t = clamp((cos a - cos outer) / (cos inner - cos outer), 0, 1), to 60 digits."""
    with mpmath.workdps(60):
        d, axis = (mpmath.matrix([mpmath.mpf(float(c)) for c in vector]) for vector in (d, axis))
        dot = sum(d[i] * axis[i] for i in range(3))
        cosine = dot / mpmath.sqrt(sum(c * c for c in d) * sum(c * c for c in axis))
        low, high = mpmath.cos(mpmath.mpf(outer)), mpmath.cos(mpmath.mpf(inner))
        if cosine >= high or cosine <= low:
            return mpmath.mpf(int(cosine >= high))
        t = (cosine - low) / (high - low)
        return {"smoothstep": t * t * (3 - 2 * t), "squared_ramp": t * t, "ramp": t}[falloff]


def directions_about(axis, outer, inner, count, rng):
    """Return vectors of any length, at angles in and about the cone, some next to its edges."""
    angle = outer * rng.uniform(0, 1.05, count)
    angle[: count // 4] = outer * (1 - 10 ** rng.uniform(-8, 0, count // 4))
    angle[count // 4 : count // 2] = inner + (outer - inner) * 10 ** rng.uniform(-8, 0, count // 4)
    side = np.cross(axis, rng.normal(size=(count, 3)))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    unit = np.cos(angle)[:, None] * axis + np.sin(angle)[:, None] * side
    return unit * 10 ** rng.uniform(-3, 3, (count, 1))


@pytest.mark.parametrize("falloff", ["smoothstep", "squared_ramp", "ramp"])
@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.parametrize("degrees", DEGREES)
def test_the_falloff_is_exact_to_a_few_units_in_the_last_place(real, degrees, falloff):
    rng, outer, worst = np.random.default_rng(1), math.radians(degrees), 0.0
    for share in SHARES:
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        cone = cone_row(share * outer, outer, falloff)
        for d in directions_about(axis, outer, share * outer, 60, rng).astype(real):
            got = real(spot_falloff(tuple(float(c) for c in d), tuple(axis), cone, PLAIN[real]))
            exact = exact_falloff(d, axis, share * outer, outer, falloff)
            assert (got == 0) == (exact < np.finfo(real).tiny)
            worst = max(worst, abs(float((mpmath.mpf(float(got)) - exact) / float(np.spacing(real(float(exact)))))))
    assert worst < ULP


def power(light):
    """2 pi I (1 - (cos inner + cos outer) / 2), by 1 - cos a = 2 sin^2(a / 2); the smoothstep's mean is 1/2."""
    squares = (math.sin(angle / 2) ** 2 for angle in (light.inner_half_angle, light.outer_half_angle))
    return 2 * math.pi * light.intensity[0] * sum(squares)


def narrow(degrees, share=0.5, axis=(0.0, -1.0, 0.0)):
    outer = math.radians(degrees)
    return SpotLight((0.3, 1.0, -0.2), axis, share * outer, outer, (3.0, 2.0, 1.0))


@pytest.mark.parametrize(("real", "limit"), [(np.float64, 1e-12), (np.float32, 1e-6)])
@pytest.mark.parametrize("degrees", [0.02, 0.3, 20.0])
def test_irradiance_of_points_as_they_are_given(real, limit, degrees):
    rng, light = np.random.default_rng(2), narrow(degrees, axis=(0.2, -1.0, 0.4))
    table = light_table([light])
    for d in directions_about(table.direction[0], light.outer_half_angle, light.inner_half_angle, 100, rng):
        point = (np.array(light.position) + d / np.linalg.norm(d)).astype(real)
        away = point.astype(float) - light.position
        share = exact_falloff(away, table.direction[0], light.inner_half_angle, light.outer_half_angle)
        got = real(incident_light(table, 0, *point)[4])
        assert got == pytest.approx(3.0 * float(share) / (away @ away), rel=limit, abs=1e-30)


@pytest.mark.parametrize(("real", "limit"), [(np.float64, 1e-12), (np.float32, 1e-6)])
@pytest.mark.parametrize("degrees", [0.02, 0.3, 20.0])
def test_direct_light_is_exact_up_to_the_edge_of_the_cone(real, limit, degrees):
    """Receivers in a row, whose falloff float64 alone leaves in doubt near the edge."""
    rng, light = np.random.default_rng(4), narrow(degrees, axis=(0.2, -1.0, 0.4))
    table = light_table([light])
    directions = directions_about(table.direction[0], light.outer_half_angle, light.inner_half_angle, 100, rng)
    points = np.stack([np.array(light.position) + d / np.linalg.norm(d) for d in directions]).astype(real)
    normal = np.broadcast_to(np.array([0, 1, 0], real)[:, None, None], (3, 1, len(points))).copy()
    out = np.empty((3, 1, len(points)), real)
    _spot_irradiance(table, np.ascontiguousarray(points.T[:, None]), normal, np.ones((1, len(points)), bool),
                     NO_SHADOW, out)
    for point, got in zip(points, out[0, 0], strict=True):
        away = point.astype(float) - light.position
        share = float(exact_falloff(away, table.direction[0], light.inner_half_angle, light.outer_half_angle))
        r2 = away @ away
        assert got == pytest.approx(3.0 * share * -away[1] / (r2 * math.sqrt(r2)), rel=limit, abs=1e-30)


def seen_from_the_light(degrees, dtype, size=96):
    """Irradiance on a floor 1 m below a spot and the area of its pixels, from a camera at the light."""
    light = narrow(degrees)
    camera = Camera(light.position, (0.3, 0.0, -0.2), (0, 0, 1), vfov=2.5 * light.outer_half_angle, width=size,
                    height=size)
    seen = gbuffer(FLOOR, material_table([Material()], dtype), camera, dtype=dtype)
    return light, direct_irradiance(seen, light), (2 * math.tan(camera.vfov / 2) / size) ** 2


# 96 x 96 midpoints of the smoothstep; positions in float32 are 1.5e-8 m off, the spot is 3.5e-4 m wide, and each of
# some 5000 pixels is off on its own
POWER = {np.float64: 2e-5, np.float32: 2e-5}


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("degrees", [0.02, 0.1, 0.3, 5.0])
def test_the_power_of_a_narrow_spot_arrives_on_a_floor(degrees, dtype):
    light, irradiance, area = seen_from_the_light(degrees, dtype)
    assert irradiance[0].sum(dtype=float) * area / power(light) == pytest.approx(1, abs=POWER[dtype])


@pytest.mark.parametrize("share", [0.0, 0.5, 0.99, 1.0])
@pytest.mark.parametrize("degrees", [1e-5, 0.02, 1.0, 40.0, 89.9999])
def test_the_map_holds_the_power_of_a_spot(degrees, share):
    light = narrow(degrees, share)
    half, angles = math.tan(light.outer_half_angle / 2), (light.inner_half_angle, light.outer_half_angle)
    maps = [paraboloid_projection([light.position], [light.direction], 64, half)]
    maps += [spot_projection(light, 64)] if degrees < 75 else []
    for projection in maps:
        assert 3.0 * spot_power(projection, *angles).sum() / power(light) == pytest.approx(1, abs=1e-13)
    if degrees < 75:  # all of the cone meets the floor
        rsm = reflective_shadow_map(FLOOR, material_table([Material(diffuse=(0.5, 0.5, 0.5))]), light, 64, np.float32)
        assert rsm.flux[0].sum(dtype=float) / power(light) == pytest.approx(0.5, abs=1e-7)  # rounding to float32


@pytest.mark.parametrize("degrees", [1e-5, 0.02, 1.0, 40.0, 89.9999])
def test_texels_of_a_narrow_map_hold_the_falloff(degrees):
    """A texel's power is the mean of the exact falloff over it, which 64 x 64 texels change little within."""
    light, n = narrow(degrees, 0.3), 64
    angles, half = (light.inner_half_angle, light.outer_half_angle), math.tan(light.outer_half_angle / 2)
    taken = spot_power(paraboloid_projection([(0, 0, 0)], [(0, 0, 1)], n, half), *angles)
    whole = spot_power(paraboloid_projection([(0, 0, 0)], [(0, 0, 1)], n, half), angles[1], angles[1])
    for row, column in ((32, 32), (32, 50), (12, 40), (20, 60)):
        u, v = ((2 * place + 1) / n - 1 for place in (column, row))
        d = (2 * half * u, 2 * half * v, 1 - (u * u + v * v) * half * half)
        expected = float(exact_falloff(d, (0, 0, 1), *angles))
        assert taken[row, column] / whole[row, column] == pytest.approx(expected, abs=2e-3)  # curvature in a texel


@pytest.mark.parametrize("degrees", [1e-5, 0.02, 0.3, 40.0, 89.9999])
def test_rays_and_paths_carry_the_power_of_a_spot(degrees):
    light = narrow(degrees, 0.3, (0.1, -1.0, 0.3))
    table, n = light_table([light]), 256
    rays = light_rays(light, FLOOR, np.full((n * n, 2), 0.5))
    assert rays.measure * n * n == pytest.approx(4 * math.pi * math.sin(light.outer_half_angle / 2) ** 2, rel=1e-14)
    carried = sum(radiant_intensity(table, 0, *d)[0] for d in rays.directions) * rays.measure
    assert carried / power(light) == pytest.approx(1, abs=1e-4)  # midpoints of 256 x 256 cells
    cosine = rays.directions @ table.direction[0]
    assert np.arccos(np.minimum(cosine, 1)).max() < light.outer_half_angle + 2e-8  # what a cosine in float64 can tell
    if degrees < 75:
        left = walk_lights(Tracer(FLOOR), FLOOR, material_table([Material(diffuse=(0.5, 0.5, 0.5))], np.float64),
                           table, paths=20_000)
        assert left.flux[0].sum() / power(light) == pytest.approx(0.5, abs=1e-3)  # quasi-random falloff


@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("degrees", DEGREES)
def test_what_kernels_need_of_a_cone(degrees, share):
    outer = math.radians(degrees)
    row = cone_row(share * outer, outer)
    with mpmath.workdps(60):
        sine, cosine = mpmath.sin(outer), mpmath.cos(outer)
        pairs = ((row[0] + mpmath.mpf(row[1]), sine), (row[2] + mpmath.mpf(row[3]), cosine))
        assert all(abs(found - exact) <= 2.0**-104 * exact for found, exact in pairs)
        assert row[4] == float(mpmath.cos(share * outer) - cosine)
        assert row[5] == float(1 - cosine)


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
