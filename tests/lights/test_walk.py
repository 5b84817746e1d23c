"""Light paths: the first bounce has the mean of the map's lights, all bounces add up to the geometric series."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.rays import Tracer
from refgi.scene import DirectionalLight, Material, PointLight, light_table, load_scene, material_table
from refgi.settings import of
from refgi.splat import SiiSettings, sii, walk_lights

pytestmark = pytest.mark.filterwarnings("ignore:.* of the indirect light")  # that is told: tests/pairs/test_loss


def lights_of(scene, **settings):
    return walk_lights(Tracer(scene.geometry), scene.geometry, material_table(scene.materials),
                       light_table(scene.lights), **settings)


@pytest.mark.feature("SII-17")
def test_first_bounce_has_the_mean_of_the_map(evidence):
    frame = Frame(load_scene("cornell_box"), width=32, height=32, rsm_resolution=512)
    clamp = {"clamp": "distance", "clamp_value": 0.05}
    reference = sii(frame, of(SiiSettings, pattern="all", **clamp)).astype(float).mean(axis=(1, 2))
    walks = (of(SiiSettings, source="walk", lights=1000, seed=s, **clamp) for s in range(1, 31))
    runs = np.array([sii(frame, walk).mean(axis=(1, 2), dtype=float) for walk in walks])
    error = runs.std(axis=0) / math.sqrt(30)
    # the map's texels on silhouettes count whole: 1e-3 of the light at 512^2
    assert (np.abs(runs.mean(axis=0) - reference) < 4 * error + 1e-3 * reference).all()
    worst = np.abs(runs.mean(axis=0) / reference - 1).max()
    evidence(f"mean E of 30 x 1000 paths against a 512^2 map: {worst:.2%} (its standard error "
             f"{(error / reference).max():.2%})")


@pytest.mark.parametrize("light", [PointLight((0.278, 0.4, -0.2), (1.0, 2.0, 3.0)),
                                   DirectionalLight((0.3, -1.0, 0.4), (1.0, 2.0, 3.0))])
@pytest.mark.feature("SII-17")
def test_flux_of_other_lights_is_that_of_their_maps(light, evidence):
    scene = load_scene("cornell_box").with_lights(light)
    frame = Frame(scene, width=4, height=4, rsm_resolution=256)
    expected = frame.rsms[0].flux.astype(float).sum(axis=(1, 2))
    got = lights_of(scene, paths=60_000).flux.sum(axis=1)
    np.testing.assert_allclose(got, expected, rtol=0.01)  # 60,000 quasi-random paths and texels of 1/256
    evidence(f"{type(light).__name__}: reflected flux {np.abs(got / expected - 1).max():.2%} off the map's")


@pytest.mark.feature("REF-16")
def test_bounces_in_a_sphere_are_the_geometric_series(evidence):
    rho = 0.7
    scene = load_scene(f"integrating_sphere:faces=5000,albedo={rho}")
    light = scene.lights[0]
    half = math.cos(light.inner_half_angle), math.cos(light.outer_half_angle)
    emitted = light.intensity[0] * 2 * math.pi * ((1 - half[0]) + 0.5 * (half[0] - half[1]))
    flux = np.array([lights_of(scene, paths=2000, bounces=b).flux[0].sum() for b in range(1, 8)])
    series = emitted * rho * (1 - rho ** np.arange(1, 8)) / (1 - rho)
    np.testing.assert_allclose(flux, series, rtol=2e-3)  # 2000 paths sample the spot's falloff
    # every bounce keeps exactly rho of the one before
    steps = np.diff(flux)
    np.testing.assert_allclose(steps[1:] / steps[:-1], rho, rtol=1e-12)
    error = (flux[-1] + steps[-1] * rho / (1 - rho)) / (emitted * rho / (1 - rho)) - 1
    assert abs(error) < 2e-3
    evidence(f"rho / (1 - rho) Phi0 to {error:+.1e}; each bounce rho of the last to 1e-12")


@pytest.mark.feature("REF-16")
def test_irradiance_of_all_bounces_in_a_sphere(evidence):
    rho, bounces = 0.5, 6
    scene = load_scene(f"integrating_sphere:faces=20000,albedo={rho}")
    frame = Frame(scene, width=16, height=16)
    got = sii(frame, of(SiiSettings, source="walk", lights=3000, bounces=bounces))
    light = scene.lights[0]
    half = math.cos(light.inner_half_angle), math.cos(light.outer_half_angle)
    emitted = light.intensity[0] * 2 * math.pi * ((1 - half[0]) + 0.5 * (half[0] - half[1]))
    expected = emitted * rho * (1 - rho**bounces) / (1 - rho) / (4 * math.pi)
    assert np.median(got) == pytest.approx(expected, rel=3e-3)  # facets and the spot's sampling
    evidence(f"median E of six bounces: {np.median(got) / expected - 1:+.1e} off the series")


def test_same_paths_for_the_same_seed():
    scene = load_scene("cornell_box")
    first, again, other = (lights_of(scene, paths=200, bounces=3, seed=s) for s in (5, 5, 6))
    for a, b in zip(first[:3], again[:3], strict=True):
        np.testing.assert_array_equal(a, b)
    assert first.flux.shape != other.flux.shape or (first.flux != other.flux).any()


@pytest.mark.feature("SII-17")
def test_lights_lie_on_surfaces_and_face_the_path():
    scene = load_scene("cornell_box")
    lights = lights_of(scene, paths=500)
    towards = np.asarray(scene.lights[0].position)[:, None] - lights.position
    assert ((towards * lights.normal).sum(axis=0) > 0).all()
    np.testing.assert_allclose((lights.normal**2).sum(axis=0), 1, rtol=1e-12)
    assert lights.drawn >= lights.flux.shape[1]


@pytest.mark.feature("REF-16", "SII-17")
def test_glossy_surfaces_leave_lobes_around_the_mirror_direction():
    scene = load_scene("parallel_plates")
    shiny = tuple(dataclasses.replace(m, diffuse=(0.0, 0.0, 0.0), specular=(0.4, 0.4, 0.4), exponent=30.0)
                  for m in scene.materials)
    lights = lights_of(dataclasses.replace(scene, materials=shiny), paths=300)
    assert not lights.flux.any()
    assert (lights.lobe_exponent == 30).all()
    away = lights.position - np.asarray(scene.lights[0].position)[:, None]
    mirror = away - 2 * (away * lights.normal).sum(axis=0) * lights.normal
    np.testing.assert_allclose(lights.lobe_axis, mirror / np.linalg.norm(mirror, axis=0), atol=1e-9)


def test_glass_and_black_leave_nothing():
    scene = load_scene("cornell_box")
    glass = dataclasses.replace(scene, materials=tuple(Material(m.name, ior=1.5) for m in scene.materials))
    assert lights_of(glass, paths=100).flux.shape == (3, 0)


def test_bad_numbers_are_refused():
    scene = load_scene("cornell_box")
    for change in ({"paths": 0}, {"paths": 9, "bounces": 0}, {"paths": 9, "bounces": 99}):
        with pytest.raises(InputError, match=r"lights|bounces"):
            lights_of(scene, **change)


@pytest.mark.feature("REF-16", "SII-17")
def test_paths_are_shared_out_among_lights():
    scene = load_scene("cornell_box")
    lamps = (PointLight((0.278, 0.4, -0.2), (2.0, 2.0, 2.0)), PointLight((0.2, 0.3, -0.2), (1.0, 1.0, 1.0)))
    both = lights_of(scene.with_lights(*lamps), paths=7)
    assert both.drawn == 7
    first, second = (lights_of(scene.with_lights(lamp), paths=n) for lamp, n in zip(lamps, (5, 2), strict=True))
    np.testing.assert_array_equal(both.position, np.hstack([first.position, second.position]))


@pytest.mark.feature("REF-16", "SII-17")
def test_fewer_paths_than_lamps_carry_the_flux_of_all():
    """Closed form: inside a sphere a lamp's path reflects rho 4 pi I; one path of three lamps stands for all."""
    lamps = (PointLight((0.1 * i, 0.0, 0.0), (i, 2 * i, 0.0)) for i in (1.0, 2.0, 5.0))
    scene = load_scene("integrating_sphere:faces=320,albedo=0.5").with_lights(*lamps)
    for seed in range(1, 4):
        flux = lights_of(scene, paths=1, seed=seed).flux[:, 0]
        np.testing.assert_allclose(flux, 2 * math.pi * 8 * np.array([1, 2, 0]), rtol=1e-9)
