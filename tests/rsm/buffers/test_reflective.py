"""Reflective shadow maps: flux sums of closed forms, equal light through every projection, lobes, glass."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from refgi.errors import InputError
from refgi.jit import threads
from refgi.lights import choose_pixel_lights
from refgi.rsm import reflective_shadow_map
from refgi.scene import DirectionalLight, Material, PointLight, SpotLight, load_scene, material_table
from refgi.stages import observe
from tests.naive import pixel_lights as naive
from tests.rsm.shapes import geometry, sphere

ROUNDING = 1e-12  # sums of up to 1e5 float64 fluxes
SIZES = tuple(range(200, 264, 4))  # of maps
# 600 of 31,000 texels lie on the outline and are in or out by chance, those along each of its 32 straight edges mostly
# alike: sqrt(32) * 600 / 32 * 0.29 / 31,000 is 1e-3
TEXELS_ASTRAY = 1e-3
RHO = (0.2, 0.5, 0.8)
DIFFUSE = Material(diffuse=RHO)
GLOSSY = Material(name="gloss", diffuse=(0.1, 0.1, 0.1), specular=(0.3, 0.4, 0.5), exponent=20.0)
GLASS = Material(name="glass", diffuse=(0.9, 0.9, 0.9), specular=(0.5, 0.5, 0.5), exponent=5.0, ior=1.5)


def in_a_ball(light, resolution=32, materials=(DIFFUSE,), dtype=np.float64, **options):
    ball = sphere(16, 2.0)
    if len(materials) > 1:
        ball = dataclasses.replace(ball, material_of_face=np.arange(len(ball.faces), dtype=np.int32) % len(materials))
    return reflective_shadow_map(ball, material_table(materials, dtype), light, resolution, dtype, **options)


@pytest.mark.feature("SII-01")
@pytest.mark.parametrize("resolution", [17, 33, 128])
@pytest.mark.parametrize(("falloff", "mean"), [("smoothstep", 1 / 2), ("squared_ramp", 1 / 3), ("ramp", 1 / 2)])
@pytest.mark.parametrize(("inner", "outer"), [(30, 50), (40, 40), (0, 70), (60, 80), (85, 85)])
def test_spot_flux_sums_to_albedo_times_its_power(resolution, inner, outer, falloff, mean, evidence):
    light = SpotLight((0.3, 0.2, -0.4), (1, -2, 0.5), math.radians(inner), math.radians(outer), (3, 2, 1), falloff)
    rsm = in_a_ball(light, resolution)
    cosine, cos_outer = math.cos(light.inner_half_angle), math.cos(light.outer_half_angle)
    power = 2 * math.pi * (1 - cosine + mean * (cosine - cos_outer))
    expected = np.array(RHO) * light.intensity * power
    error = np.abs(rsm.flux.sum(axis=(1, 2)) / expected - 1).max()
    assert error < 1e-6
    some = np.arange(0, rsm.texels, 3)  # which alone have the bits of the whole map
    np.testing.assert_array_equal(in_a_ball(light, resolution).at(some, "flux")[0], rsm.flux.reshape(3, -1)[:, some])
    evidence(f"spot {inner}/{outer} deg {falloff}, {resolution}^2: {error:.0e}")


@pytest.mark.feature("SII-01", "SII-02")
@pytest.mark.parametrize("shape", ["cube", "paraboloid"])
@pytest.mark.parametrize("resolution", [7, 64])
def test_point_flux_sums_to_albedo_times_4_pi_i(shape, resolution, evidence):
    light = PointLight((0.3, 0.2, -0.4), (3.0, 2.0, 1.0))
    rsm = in_a_ball(light, resolution, projection=shape)
    expected = np.array(RHO) * light.intensity * 4 * math.pi
    error = np.abs(rsm.flux.sum(axis=(1, 2)) / expected - 1).max()
    assert error < (ROUNDING if shape == "cube" or resolution > 32 else 1e-6)  # 1e-6: quadrature of few rim texels
    assert rsm.covered[rsm.solid_angle > 0].all()
    evidence(f"{shape} {resolution}^2: {error:.0e}")


SUN = DirectionalLight((0.3, -1.0, 0.2), (3.0, 2.0, 1.0))
BLACK = Material(name="black", diffuse=(0.0, 0.0, 0.0))


def along_texels(rows, columns, resolution, tilt):
    """Return a rectangle whose outline, as the sun sees it, runs along the edges of some rows and columns of texels.

    Two black triangles without area span a map that is wider than the rectangle. `tilt`: its slopes along the map's
    axes. Also return its two sides.
    """
    ends = np.repeat([[-1.0, -1, -1], [1.0, 1, 1]], 3, axis=0)
    empty = geometry(ends, np.arange(6))
    view = reflective_shadow_map(empty, material_table([BLACK], np.float64), SUN, resolution, np.float64).projection
    frame, origin = view.frame[0], view.origin[0]
    (left, right), (top, bottom) = ((2 * np.array(edges) / resolution - 1) * half
                                    for edges, half in zip((columns, rows), view.half, strict=True))
    depth = -origin @ frame[2]  # of the middle of the scene
    corners = np.array([origin + (u, v, depth + tilt[0] * u + tilt[1] * v) @ frame
                        for u, v in ((left, top), (right, top), (right, bottom), (left, bottom))])
    shape = geometry(np.concatenate([ends, corners]), [[0, 1, 2], [3, 4, 5], [6, 7, 8], [6, 8, 9]],
                     materials=[1, 1, 0, 0])
    return shape, corners[1] - corners[0], corners[3] - corners[0]


@pytest.mark.feature("SII-01")
@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.8, -1.1)])
@pytest.mark.parametrize("resolution", [24, 97])
def test_directional_flux_of_a_rectangle_along_texels_is_exact(resolution, tilt, evidence):
    """Closed form: albedo * E_perp * |a x b . d|, the rectangle's area as the sun sees it, however it is tilted."""
    rows, columns = (resolution // 3, resolution // 2), (resolution // 4, 2 * resolution // 3)
    shape, along, across = along_texels(rows, columns, resolution, tilt)
    rsm = reflective_shadow_map(shape, material_table([DIFFUSE, BLACK], np.float64), SUN, resolution, np.float64)
    toward = np.array(SUN.direction) / np.linalg.norm(SUN.direction)
    expected = np.array(RHO) * SUN.irradiance * abs(np.cross(along, across) @ toward)
    error = np.abs(rsm.flux.sum(axis=(1, 2)) / expected - 1).max()
    assert error < ROUNDING
    lit = np.zeros(rsm.covered.shape, bool)
    lit[slice(*rows), slice(*columns)] = True
    np.testing.assert_array_equal(rsm.flux.any(axis=0), lit)
    evidence(f"orthographic, {resolution}^2, slopes {tilt}: {error:.0e} of albedo * E_perp * area")


@pytest.mark.feature("SII-01")
def test_directional_flux_of_a_ball_is_that_of_its_outline(evidence):
    """Closed form: the area of the convex hull of the ball's vertices as the sun sees them."""
    ball = sphere(16, 2.0)
    toward = np.array(SUN.direction) / np.linalg.norm(SUN.direction)
    across = np.linalg.svd(toward[None])[2][1:]  # any two axes perpendicular to the sun
    outline = ConvexHull(ball.vertices @ across.T).volume  # of a plane figure: its area
    errors = [(in_a_ball(SUN, resolution).flux.sum(axis=(1, 2)) / (np.array(RHO) * SUN.irradiance * outline) - 1)[0]
              for resolution in SIZES]
    assert abs(np.mean(errors)) < 2 * TEXELS_ASTRAY / math.sqrt(len(SIZES))
    assert np.abs(errors).max() < 3 * TEXELS_ASTRAY
    evidence(f"ball, {SIZES[0]} to {SIZES[-1]} texels: flux {np.mean(errors):+.0e} in the mean, "
             f"{np.abs(errors).max():.0e} at most, off that of its outline")


def eq2(lights, position, normal):
    """Eq. 2 summed literally at a few points: E = sum Phi/pi <n_i.w> <n.-w> / r^2."""
    out = []
    for x, n in zip(position, normal, strict=True):
        away = x[:, None] - lights.position
        square = (away**2).sum(axis=0)
        cosines = np.maximum((lights.normal * away).sum(axis=0), 0) * np.maximum(-(n @ away), 0) / square**2
        out.append((lights.flux * cosines).sum(axis=1) / math.pi)
    return np.array(out)


def irradiance(box, light, resolution, **options):
    """Irradiance at points on the Cornell box's walls from all texels."""
    materials = material_table(box.materials, np.float64)
    rsm = reflective_shadow_map(box.geometry, materials, light, resolution, np.float64, **options)
    lights = choose_pixel_lights([rsm], count=None, pattern="all")
    points = np.array([[0.28, 0.3, 0.05], [0.5, 0.53, 0.4], [0.1, 0.45, 0.5]])
    normals = np.array([[0.0, 0, 1], [0, -1, 0], [0, 0, -1.0]])
    return eq2(lights, points, normals)


@pytest.mark.feature("SII-02")
def test_every_projection_of_a_light_gives_the_same_irradiance(evidence):
    box = load_scene("cornell_box")
    spot = box.lights[0]
    point = PointLight(spot.position, spot.intensity)
    pairs = {
        "spot: cube": (spot, spot, {"projection": "cube"}, 0.01),
        "spot: paraboloid": (spot, spot, {"projection": "paraboloid"}, 0.01),
        "point: dual paraboloid": (point, point, {"projection": "paraboloid"}, 0.01),
    }
    for name, (first, second, options, tolerance) in pairs.items():
        reference = irradiance(box, first, 256)
        error = np.abs(irradiance(box, second, 256, **options) / reference - 1).max()
        assert error < tolerance, name
        evidence(f"{name} {error:.1e}")


@pytest.mark.feature("SII-02")
def test_a_directional_light_is_a_far_spot(evidence):
    floor = geometry([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], [[0, 1, 2], [0, 2, 3]])
    materials = material_table([DIFFUSE], np.float64)
    direction, distance = np.array([0.3, -1.0, 0.2]) / math.sqrt(1.13), 2000.0
    sun = DirectionalLight(tuple(direction), (3.0, 2.0, 1.0))
    intensity = tuple(distance**2 * x for x in sun.irradiance)
    far = SpotLight(tuple(-distance * direction), tuple(direction), 1e-3, 1e-3, intensity)
    both = [reflective_shadow_map(floor, materials, light, 200, np.float64) for light in (sun, far)]
    sums = [rsm.flux.sum(axis=(1, 2)) for rsm in both]
    np.testing.assert_allclose(sums[0], np.array(RHO) * sun.irradiance * 4 * -direction[1], rtol=5e-3)
    points, normals = np.array([[0.2, 0.4, 0.1], [0, 1, 0]]), np.array([[0.0, -1, 0], [0, -1, 0]])
    values = [eq2(choose_pixel_lights([rsm], count=None, pattern="all"), points, normals) for rsm in both]
    error = np.abs(values[0] / values[1] - 1).max()
    assert error < 5e-3
    evidence(f"directional against a spot 2 km away: {error:.1e}")


def test_lobes_only_where_a_material_has_one():
    light = SpotLight((0.3, 0.2, -0.4), (1, -2, 0.5), 0.6, 0.9, (3.0, 2.0, 1.0))
    assert in_a_ball(light).lobe_flux is None
    rsm = in_a_ball(light, materials=(DIFFUSE, GLOSSY))
    of_face = np.arange(4000) % 2
    glossy = of_face[rsm.triangle_id] == 1
    bright = rsm.flux.any(axis=0)
    assert (rsm.lobe_flux[:, ~glossy] == 0).all()
    assert (rsm.lobe_exponent[glossy & bright] == 20).all()
    assert (glossy & ~bright).any()
    assert (rsm.lobe_exponent[~(glossy & bright)] == 0).all()
    ratio = rsm.lobe_flux[:, glossy & bright] / rsm.flux[:, glossy & bright]
    np.testing.assert_allclose(ratio, np.broadcast_to([[3.0], [4.0], [5.0]], ratio.shape))
    for row, column in np.argwhere(glossy & bright)[::40]:
        incoming = rsm.position[:, row, column] - light.position
        incoming /= np.linalg.norm(incoming)
        expected = naive.mirror(incoming, rsm.normal[:, row, column])
        np.testing.assert_allclose(rsm.lobe_axis[:, row, column], expected, atol=1e-12)


@pytest.mark.feature("SII-08")
def test_lobe_axis_of_a_directional_light_mirrors_its_direction():
    light = DirectionalLight((0.3, -1.0, 0.2), (1, 1, 1))
    rsm = in_a_ball(light, materials=(GLOSSY,))
    row, column = np.argwhere(rsm.covered)[70]
    expected = naive.mirror(np.array(light.direction) / math.sqrt(1.13), rsm.normal[:, row, column])
    np.testing.assert_allclose(rsm.lobe_axis[:, row, column], expected, atol=1e-12)


@pytest.mark.feature("SII-01")
def test_glass_reflects_nothing():
    light = PointLight((0.3, 0.2, -0.4), (3.0, 2.0, 1.0))
    rsm = in_a_ball(light, materials=(DIFFUSE, GLASS))
    glass = (np.arange(4000) % 2)[rsm.triangle_id] == 1
    assert glass.any()
    assert (rsm.flux[:, glass] == 0).all()
    assert (rsm.flux[:, ~glass] > 0).all()
    assert rsm.lobe_flux is None  # glass is no mirror here


def test_normals_face_the_light_and_rows_project_back():
    for light, shape in (
        (PointLight((0.3, 0.2, -0.4), (1, 1, 1)), "cube"),
        (PointLight((0.3, 0.2, -0.4), (1, 1, 1)), "paraboloid"),
        (SpotLight((0.3, 0.2, -0.4), (1, -2, 0.5), 0.6, 1.4, (1, 1, 1)), "auto"),
        (DirectionalLight((0.3, -1.0, 0.2), (1, 1, 1)), "auto"),
    ):
        rsm = in_a_ball(light, 16, projection=shape)
        assert rsm.texels == rsm.depth.size
        row, column, depth = rsm.project(rsm.position[:, rsm.covered])
        expected = np.argwhere(rsm.covered) + 0.5
        np.testing.assert_allclose(np.stack([row, column], axis=1), expected, atol=1e-9)
        np.testing.assert_allclose(depth, rsm.depth[rsm.covered], rtol=1e-12)
        if not isinstance(light, DirectionalLight):
            towards = np.array(light.position)[:, None] - rsm.position[:, rsm.covered]
            assert ((rsm.normal[:, rsm.covered] * towards).sum(axis=0) > 0).mean() > 0.99


@pytest.mark.feature("REF-19")
def test_same_bits_for_any_threads_and_float32_is_the_rounded_float64(evidence):
    light = SpotLight((0.3, 0.2, -0.4), (1, -2, 0.5), 0.6, 0.9, (3.0, 2.0, 1.0))
    arrays = [field for field in ("depth", "position", "normal", "solid_angle", "flux", "lobe_flux", "lobe_axis")]
    with threads(1):
        first = in_a_ball(light, materials=(DIFFUSE, GLOSSY), dtype=np.float32)
    second = in_a_ball(light, materials=(DIFFUSE, GLOSSY), dtype=np.float32)
    double = in_a_ball(light, materials=(DIFFUSE, GLOSSY))
    for name in arrays:
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
        exact = getattr(double, name)
        np.testing.assert_allclose(getattr(first, name), exact, rtol=4e-7, atol=2e-7 * np.abs(exact[exact < 1e9]).max())
    evidence("RSM: equal bits for 1 and 2 threads; float32 within 4e-7 of float64")


@pytest.mark.parametrize(
    ("light", "options", "message"),
    [
        (PointLight((0, 0, 0), (1, 1, 1)), {"projection": "perspective"}, "suits a PointLight: cube, paraboloid"),
        (DirectionalLight((0, -1, 0), (1, 1, 1)), {"projection": "cube"}, "suits a DirectionalLight: orthographic"),
        (PointLight((0, 0, 0), (1, 1, 1)), {"projection": "fisheye"}, "expected auto or perspective or"),
        (PointLight((0, 0, 0), (1, 1, 1)), {"resolution": 0}, "expected 1 to 16384 texels, got 0"),
        (PointLight((0, 0, 0), (1, 1, 1)), {"dtype": np.int32}, "expected float32 or float64, got 'int32'"),
    ],
)
def test_errors_name_what_is_wrong(light, options, message):
    with pytest.raises(InputError, match=message):
        in_a_ball(light, **options)


CHANNELS = ("depth", "position", "normal", "solid_angle", "flux", "lobe_flux", "lobe_axis", "lobe_exponent")


@pytest.mark.feature("SII-01")
@pytest.mark.parametrize("materials", [(DIFFUSE,), (DIFFUSE, GLOSSY, GLASS)])
@pytest.mark.parametrize("light", [
    SpotLight((0.3, 0.2, -0.4), (1, -2, 0.5), 0.4, 0.8, (3.0, 2.0, 1.0)),
    SpotLight((0.3, 0.2, -0.4), (1, -2, 0.5), 0.4, 1.5, (3.0, 2.0, 1.0)),
    PointLight((0.3, 0.2, -0.4), (3.0, 2.0, 1.0)),
    DirectionalLight((0.3, -1.0, 0.2), (3.0, 2.0, 1.0)),
])  # fmt: skip
def test_channels_at_some_texels_are_those_of_the_whole_map(light, materials):
    whole, some = in_a_ball(light, 33, materials), in_a_ball(light, 33, materials)
    texel = np.random.default_rng(3).integers(0, whole.texels, whole.texels // 10)
    for given, channel in zip(some.at(texel, *CHANNELS), CHANNELS, strict=True):
        full = getattr(whole, channel)
        assert (given is None) == (full is None) == (len(materials) == 1 and channel.startswith("lobe"))
        if full is not None:
            np.testing.assert_array_equal(given, full.reshape(*full.shape[:-2], -1)[..., texel])
            np.testing.assert_array_equal(some.at(np.arange(some.texels), channel)[0].reshape(full.shape), full)
    other = whole._replace(flux=2 * whole.flux)
    np.testing.assert_array_equal(other.at(texel, "flux")[0], 2 * whole.at(texel, "flux")[0])
    assert other.depth is whole.depth


@pytest.mark.parametrize("materials", [(DIFFUSE,), (DIFFUSE, GLOSSY)])
def test_few_lights_need_no_whole_map(materials):
    with observe() as log:
        rsm = in_a_ball(SpotLight((0.3, 0.2, -0.4), (1, -2, 0.5), 0.4, 0.8, (3.0, 2.0, 1.0)), 64, materials)
        lights = choose_pixel_lights([rsm], count=64, pattern="grid")
    assert lights.flux.any()
    assert lights.lobe_flux is None if len(materials) == 1 else lights.lobe_flux.any()
    assert not {"rsm.resolve", "rsm.solid_angles"} & {run.name for run in log.runs}


def test_a_light_that_shines_on_nothing():
    empty = geometry(np.zeros((0, 3)), np.zeros((0, 3)))
    for light in (PointLight((0, 0, 0), (1, 1, 1)), DirectionalLight((0, -1, 0), (1, 1, 1))):
        rsm = reflective_shadow_map(empty, material_table([DIFFUSE]), light, 4)
        assert not rsm.covered.any()
        assert (rsm.flux == 0).all()
        assert choose_pixel_lights([rsm], count=rsm.texels, pattern="random").flux.shape == (3, 0)


LAMP = SpotLight((0.278, 0.5488, 0.28), (0.0, -1.0, 0.0), 0.5, 0.9, (1.0, 1.0, 1.0))


@pytest.mark.parametrize("direction", [(0.0, -1.0, 0.0), (0.3, -1.0, 0.1)])
def test_a_lamp_in_the_ceiling_shines_down(direction):
    """Exactly in the ceiling's plane or 10 um below it: the map differs by what 10 um can move."""
    box = load_scene("cornell_box")
    materials = material_table(box.materials, np.float64)
    in_it = dataclasses.replace(LAMP, direction=direction)
    below = dataclasses.replace(in_it, position=(0.278, 0.54879, 0.28))
    maps = [reflective_shadow_map(box.geometry, materials, light, 64, np.float64) for light in (in_it, below)]
    assert maps[0].flux.sum() == pytest.approx(maps[1].flux.sum(), rel=1e-3)
    both = maps[0].covered & maps[1].covered
    assert np.quantile(np.abs(maps[0].depth[both] - maps[1].depth[both]), 0.9) < 2e-5


def test_a_bulb_in_the_ceiling_lights_half_its_map():
    box = load_scene("cornell_box")
    materials = material_table(box.materials, np.float64)
    rsm = reflective_shadow_map(box.geometry, materials, PointLight(LAMP.position, LAMP.intensity), 32, np.float64)
    assert rsm.covered.any()
    assert rsm.depth[rsm.covered].min() > 1e-3  # nothing at no distance: the ceiling is seen edge-on
