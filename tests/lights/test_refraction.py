"""Light through glass: exits, directions and fluxes of single rays, what ends them, and what costs nothing."""

import dataclasses
import math
from functools import cache

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.lights.refraction import refract, refracted
from refgi.rays import Tracer
from refgi.rsm import reflective_shadow_map
from refgi.scene import DirectionalLight, Geometry, Material, Mesh, PointLight, SpotLight, material_table, merge
from refgi.scene.builtin.surfaces import rectangle, sphere
from refgi.stages import observe
from tests.naive.refraction import bend, mean_transmittance, through_ball

INDEX = 1.5
GLASS = Material("glass", (0, 0, 0), ior=INDEX)
WHITE = Material("white", (0.5, 0.5, 0.5))
CENTRE, RADIUS = (0.1, -0.2, 0.3), 0.5
DOWN = DirectionalLight((0.0, -1.0, 0.0), (3.0, 2.0, 1.0))
SPOT = SpotLight((0.4, 1.5, 0.1), (-0.3, -1.7, 0.2), 0.5, 0.5, (3.0, 2.0, 1.0))
MODES = ("back_face", "two_interface")
# A triangle of the ball below has edges of 0.03 rad: chords lie up to R 0.03^2 / 8 inside (1e-4 R), and interpolated
# normals are right to 1e-4; a grazing ray moves along the surface by sagitta / cosine.
FACETS, SAGITTA = 20_000, 1.5e-4
FLUX = 2e-3  # of the disc that a faceted ball shows, and of Fresnel's curve on it


@cache
def glass_ball(*others, smooth=True):
    return merge([sphere(CENTRE, RADIUS, FACETS, GLASS, "ball"), *others], smooth=smooth)


def through(scene, light, mode, resolution=128, **options):
    geometry, materials = scene
    table = material_table(materials)
    rsm = reflective_shadow_map(geometry, table, light, resolution, np.float64, options.pop("projection", "auto"))
    tracer = Tracer(geometry) if mode == "two_interface" else None
    return rsm, refracted(rsm, geometry, table, mode, 1000.0, tracer=tracer, **options)


def sent(rsm):
    return rsm.lobe_flux.any(axis=0)


@pytest.mark.feature("SII-09")
def test_refraction_equals_the_laws_by_angles(evidence):
    random = np.random.default_rng(5)
    direction, normal = (v / np.linalg.norm(v, axis=0) for v in random.normal(size=(2, 3, 500)))
    eta = random.uniform(0.4, 2.5, 500)
    normal[:, 0] = direction[:, 0]  # straight on
    got, share = refract(direction, normal, eta)
    twin = [bend(direction[:, i], normal[:, i], eta[i], 1.0) for i in range(500)]
    expected, kept = np.array([t[0] for t in twin]).T, np.array([t[1] for t in twin])
    assert (share > 0).sum() > 100
    assert ((share == 0) == (kept == 0)).all()
    assert np.abs(share - kept).max() < 1e-12
    assert np.abs(got - expected).max() < 1e-12
    evidence(f"direction to {np.abs(got - expected).max():.0e}, transmittance to {np.abs(share - kept).max():.0e}")


@pytest.mark.feature("SII-09")
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("light", [SPOT, DOWN], ids=["spot", "directional"])
def test_exits_of_a_ball_equal_the_rays_of_the_twin(mode, light, evidence):
    rsm, glass = through(glass_ball(), light, mode)
    incident = through(glass_ball(), light, mode, fresnel=False)[1].lobe_flux
    places, worst = np.argwhere(sent(glass))[::23], np.zeros(3)
    for row, column in places:
        front = rsm.position[:, row, column]
        ahead = np.array([0.0, -1.0, 0.0]) if light is DOWN else front - SPOT.position
        ahead = ahead / np.linalg.norm(ahead)
        leave, outward, out, share = through_ball(front - 2 * ahead, ahead, np.array(CENTRE), RADIUS, INDEX,
                                                  front=mode == "two_interface")
        steep = -float(rsm.normal[:, row, column] @ ahead)  # a front off by the sagitta moves the rest by that over it
        errors = [np.linalg.norm(glass.position[:, row, column] - leave) / RADIUS,
                  np.linalg.norm(glass.normal[:, row, column] - outward),
                  np.linalg.norm(glass.lobe_axis[:, row, column] - out)]
        if share > 0.5:  # beyond, the curves of Snell and Fresnel are too steep for facets
            worst = np.maximum(worst, np.array(errors) * steep)
            ratio = glass.lobe_flux[0, row, column] / incident[0, row, column]
            assert ratio == pytest.approx(share, abs=30 * SAGITTA / steep)
    assert len(places) > 50
    assert (worst < np.array([10, 10, 20]) * SAGITTA).all(), worst
    evidence(f"{mode}: exit {worst[0]:.1e} R, normal {worst[1]:.1e}, direction {worst[2]:.1e} of the smooth ball's")


@pytest.mark.feature("SII-09")
@pytest.mark.parametrize("mode", MODES)
def test_energy_through_a_ball_follows_fresnel(mode, evidence):
    _, glass = through(glass_ball(), DOWN, mode, 256)
    _, clear = through(glass_ball(), DOWN, mode, 256, fresnel=False)
    area = math.pi * RADIUS**2
    share = glass.lobe_flux.sum(axis=(1, 2)) / DOWN.irradiance / area
    expected = mean_transmittance(INDEX, front=mode == "two_interface")
    passed = clear.lobe_flux.sum(axis=(1, 2)) / DOWN.irradiance / area
    whole = 1 / INDEX**2 if mode == "back_face" else 1.0  # h > R / n is totally reflected by the back alone
    assert share == pytest.approx(expected, abs=FLUX)
    assert passed == pytest.approx(whole, abs=FLUX)
    evidence(f"{mode}: {share[0]:.4f} of the light passes (Fresnel: {expected:.4f}), without Fresnel {passed[0]:.4f} "
             f"({whole:.4f})")


@pytest.mark.feature("SII-02", "SII-09")
@pytest.mark.parametrize("projection", ["perspective", "cube", "paraboloid"])
def test_every_projection_sends_the_same_flux(projection):
    expected = through(glass_ball(), SPOT, "back_face", 256)[1].lobe_flux.sum(axis=(1, 2))
    got = through(glass_ball(), SPOT, "back_face", 256, projection=projection)[1].lobe_flux.sum(axis=(1, 2))
    assert got == pytest.approx(expected, rel=5 * FLUX)


@pytest.mark.feature("SII-09")
@pytest.mark.parametrize("mode", MODES)
def test_lobes_point_out_of_the_surface(mode):
    _, glass = through(glass_ball(), SPOT, mode)
    cosine = (glass.normal * glass.lobe_axis).sum(axis=0)[sent(glass)]
    assert (cosine > 0).all()
    assert (glass.lobe_exponent[sent(glass)] == 1000).all()
    assert np.linalg.norm(glass.lobe_axis[:, sent(glass)], axis=0) == pytest.approx(1, abs=1e-12)
    assert (glass.flux[:, sent(glass)] == 0).all()
    outward = glass.position - np.reshape(CENTRE, (3, 1, 1))
    assert ((outward * glass.normal).sum(axis=0)[sent(glass)] > 0.99 * RADIUS).all()


def test_what_is_not_glass_stays():
    scene = glass_ball(rectangle((-2, -1, 2), (4, 0, 0), (0, 0, -4), WHITE, "floor"),
                       sphere((1.2, -0.2, 0.3), 0.3, 500, Material("metal", (0, 0, 0), (1, 1, 1), 50.0), "metal"))
    rsm, glass = through(scene, DOWN, "back_face")
    kept = scene[1].index(GLASS) != scene[0].material_of_face[rsm.triangle_id]
    for name in ("depth", "triangle_id", "solid_angle", "covered", "flux"):
        assert np.array_equal(getattr(glass, name), getattr(rsm, name))
    for name in ("position", "normal", "lobe_flux", "lobe_axis", "lobe_exponent"):
        assert np.array_equal(getattr(glass, name)[..., kept], getattr(rsm, name)[..., kept])
    assert rsm.lobe_flux[:, kept].any()
    assert glass.lobe_flux[:, ~kept].any()


@pytest.mark.feature("SII-09")
@pytest.mark.parametrize("mode", MODES)
def test_opaque_things_end_the_light(mode):
    roof = rectangle((0.1, 0.5, 1.3), (2, 0, 0), (0, 0, -2), WHITE, "roof")  # over the half x > 0.1
    core = sphere(CENTRE, 0.1, 500, WHITE, "core")
    _, free = through(glass_ball(), DOWN, mode, 256)
    _, half = through(glass_ball(roof), DOWN, mode, 256)
    _, cored = through(glass_ball(core), DOWN, mode, 256)
    whole = free.lobe_flux[0].sum()
    assert half.lobe_flux[0].sum() == pytest.approx(whole / 2, rel=0.02)
    straight = (0.1 / RADIUS) ** 2  # the core's share of the disc; bent rays come from a wider part
    hidden = through_core() if mode == "two_interface" else straight
    assert whole - cored.lobe_flux[0].sum() == pytest.approx(0.96**2 * 3 * math.pi * RADIUS**2 * hidden, rel=0.06)


def through_core():
    """Share of the disc whose rays, bent at the front, pass the centre nearer than a fifth of the radius: h = 0.2 n."""
    return (0.2 * INDEX) ** 2


@pytest.mark.feature("SII-09")
@pytest.mark.parametrize("mode", MODES)
def test_glass_without_a_back_lets_nothing_through(mode):
    scene = merge([rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2), GLASS, "pane"),
                   rectangle((-1, -1, 1), (2, 0, 0), (0, 0, -2), WHITE, "floor")])
    assert not sent(through(scene, DOWN, mode)[1]).any()


@pytest.mark.parametrize("mode", MODES)
def test_a_light_inside_glass_refracts_once(mode):
    light = PointLight((0.1, 0.1, 0.3), (1.0, 1.0, 1.0))
    _, glass = through(glass_ball(), light, mode, 32)
    inside = np.array(light.position)
    row, column = np.argwhere(sent(glass))[len(np.argwhere(sent(glass))) // 3]
    ahead = glass.position[:, row, column] - inside
    ahead /= np.linalg.norm(ahead)
    out, share = bend(ahead, glass.normal[:, row, column], INDEX, 1.0)
    incident = through(glass_ball(), light, mode, 32, fresnel=False)[1].lobe_flux[:, row, column]
    assert glass.lobe_axis[:, row, column] == pytest.approx(out, abs=1e-6)
    assert glass.lobe_flux[:, row, column] == pytest.approx(share * incident, rel=1e-6)  # no front has reflected any
    assert glass.lobe_flux[0].sum() < 4 * math.pi
    assert glass.lobe_flux[0].sum() > 0.5 * 4 * math.pi


@pytest.mark.feature("SII-09")
def test_of_two_balls_in_a_row_the_first_bends():
    second = sphere((CENTRE[0], CENTRE[1] - 1.5, CENTRE[2]), RADIUS, FACETS, GLASS, "second")
    _, one = through(glass_ball(), DOWN, "back_face")
    _, two = through(glass_ball(second), DOWN, "back_face")
    assert two.position[1][sent(two)].min() > CENTRE[1] - 1.001 * RADIUS
    assert two.lobe_flux.sum() == pytest.approx(one.lobe_flux.sum(), rel=5 * FLUX)


def test_without_glass_the_map_comes_back_itself():
    geometry, materials = merge([rectangle((-1, 0, 1), (2, 0, 0), (0, 0, -2), WHITE, "floor")])
    table = material_table(materials)
    rsm = reflective_shadow_map(geometry, table, DOWN, 8)
    with observe() as log:
        assert refracted(rsm, geometry, table) is rsm
        assert refracted(rsm, geometry, table, "two_interface") is rsm  # asks for no tracer
    assert [(run.name, run.status) for run in log.runs] == 2 * [("lights.refraction", "skipped")]
    roofed = glass_ball(rectangle((-2, 1, 2), (4, 0, 0), (0, 0, -4), WHITE, "roof"))
    rsm, glass = through(roofed, DOWN, "back_face")
    assert glass is rsm  # the light sees no glass


def test_types_follow_the_map_and_the_map_stays():
    geometry, materials = glass_ball()
    table = material_table(materials, np.float32)
    rsm = reflective_shadow_map(geometry, table, SPOT, 32)
    before = rsm.position.copy()
    glass = refracted(rsm, geometry, table)
    for name in ("position", "normal", "lobe_flux", "lobe_axis", "lobe_exponent"):
        assert getattr(glass, name).dtype == np.float32
    assert np.array_equal(rsm.position, before)
    assert rsm.lobe_flux is None


@pytest.mark.parametrize(("options", "words"), [
    ({"mode": "front"}, "mode: expected 'back_face' or 'two_interface', got 'front'"),
    ({"exponent": -1.0}, "exponent: expected a Phong exponent"),
    ({"exponent": math.nan}, "exponent: expected"),
    ({"mode": "two_interface"}, "tracer: expected one for the mode 'two_interface'"),
])
def test_unusable_options_are_named(options, words):
    geometry, materials = glass_ball()
    table = material_table(materials)
    rsm = reflective_shadow_map(geometry, table, SPOT, 8)
    with pytest.raises(InputError, match=words):
        refracted(rsm, geometry, table, **options)


def test_turned_vertex_order_turns_inside_and_outside():
    geometry, materials = glass_ball(smooth=False)
    table = material_table(materials)
    turned = Geometry(geometry.vertices, geometry.faces[:, ::-1], geometry.material_of_face)
    rsm = reflective_shadow_map(turned, table, DOWN, 64, np.float64)
    glass = refracted(rsm, turned, table)
    assert (glass.position[1][sent(glass)] > CENTRE[1]).all()  # leaves "glass" at the first face it meets


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("power", [1e-30, 1e20])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("back", [True, False])
def test_a_light_on_the_glass_and_glass_without_a_back_give_finite_lobes(mode, power, scale, back):
    ball = sphere((0.0, 0.0, 0.0), scale, 200, GLASS, "ball")
    if not back:
        ball = dataclasses.replace(ball, faces=ball.faces[ball.vertices[ball.faces].mean(axis=1)[:, 1] > 0])
    flat = Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]]), None, WHITE)  # the triangle that rays which miss ask about
    for light in (PointLight(tuple(ball.vertices[ball.faces[0, 0]]), (power,) * 3), PointLight((0, 0, 0), (power,) * 3),
                  PointLight((0, 3 * scale, 0), (power,) * 3), DirectionalLight((0, -1e90, 0), (power,) * 3)):
        for pieces in ([ball], [flat, ball]):
            rsm, glass = through(merge(pieces, smooth=True), light, mode, resolution=8)
            for part in (glass.position, glass.normal, glass.lobe_flux, glass.lobe_axis):
                assert part is None or np.isfinite(part).all()
            if glass.lobe_flux is not None:
                assert glass.lobe_flux.sum() <= rsm.solid_angle.sum() * power * 3 * (1 + 1e-9)
