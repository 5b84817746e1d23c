"""Glossy scenes of any exponent: no NaN, no made energy, and the limit of a mirror."""

import dataclasses
import math
import sys

import numpy as np
import pytest

from refgi import load_scene
from refgi.errors import RefgiWarning
from refgi.frame import Frame
from refgi.rays import Tracer
from refgi.scene import SpotLight
from refgi.truth import TruthSettings, trace_truth
from refgi.truth.caustics import SHARP_LOBE
from refgi.truth.light_grid import light_rays
from refgi.truth.light_vertices import closest_of, join, light_vertices
from refgi.truth.result import add_pass, no_passes, with_means
from refgi.truth.surfaces import lights_of, lobe_pattern, surfaces
from tests.naive.truth import mirror_mean
from tests.test_lobes import literal_power
from tests.truth.test_caustics import FOOTPRINT, MIRROR, mirror_over_floor

SIGMAS = 4


def glossy(name, exponent, specular=0.5):
    scene = load_scene(name)
    return dataclasses.replace(scene, materials=tuple(
        dataclasses.replace(m, diffuse=tuple(np.minimum(m.diffuse, 1 - specular)), specular=(specular,) * 3,
                            exponent=exponent) for m in scene.materials))


@pytest.mark.slow("True-80-900.0", "False-80-10000.0", "True-320-1000000.0", "False-80-1e+20")
@pytest.mark.parametrize(("faces", "exponent"), [(80, 900.0), (80, 1e4), (320, 1e6), (80, 1e20)])
@pytest.mark.parametrize("caustics", [False, True])
def test_no_value_is_lost_on_a_glossy_sphere(faces, exponent, caustics):
    frame = Frame(glossy(f"cornell_sphere:faces={faces}", exponent), width=48, height=48)
    result = trace_truth(frame, TruthSettings(samples=48, caustics=caustics, photons=1 << 12))
    assert np.isfinite(result.mean).all()
    assert result.lost == 0
    assert result.mean.max() < 100  # W/m^2; the lamp gives the floor 1


@pytest.mark.slow("1000000.0")
@pytest.mark.parametrize("exponent", [1e6, 1e12])
def test_the_sharpest_lobes_are_mirrors(exponent, evidence):
    """Mean of the picture against mirrors: a reflection of light in NumPy, and the diffuse part alone."""
    scene = glossy("cornell_sphere:faces=80", exponent)
    settings = TruthSettings(samples=24 * 6, photons=1 << 15)
    frame = Frame(scene, width=48, height=48)
    sharp = trace_truth(frame, settings)
    rough = dataclasses.replace(scene, materials=tuple(
        dataclasses.replace(m, specular=(0.0,) * 3) for m in scene.materials))
    diffuse = trace_truth(Frame(rough, width=48, height=48), dataclasses.replace(settings, seed=1))
    geometry = scene.geometry
    mirrored, error = mirror_mean(geometry.vertices, geometry.faces, geometry.vertex_normals, scene.lights[0],
                                  scene.camera, frame.gbuffer.covered, 0.5, 1 << 17)
    got, expected = sharp.picture_mean.mean(), diffuse.picture_mean.mean() + mirrored.mean()
    spread = math.sqrt(sharp.picture_variance.mean() + diffuse.picture_variance.mean() + (error**2).mean())
    evidence(f"P = {exponent:g}: mean {got:.5f}, mirrors {expected:.5f}, standard error {spread:.5f}")
    assert spread < 0.005 * expected
    assert abs(got - expected) < SIGMAS * spread


@pytest.mark.slow("1000000000000.0")
@pytest.mark.parametrize("exponent", [1e8, 1e12, 1e20])
def test_a_sharp_lobe_acts_as_an_image_of_the_light(exponent, evidence):
    light = SpotLight((0.0, 1.0, 0.0), (1.0, -0.35, 0.0), math.radians(25), math.radians(25), (3.0, 2.0, 1.0))
    scene = mirror_over_floor(light)
    scene = dataclasses.replace(scene, materials=tuple(
        dataclasses.replace(m, exponent=exponent) if m == MIRROR else m for m in scene.materials))
    frame = Frame(scene)
    result = trace_truth(frame, TruthSettings(samples=24 * 12, photons=1 << 16))
    plain = dataclasses.replace(scene, materials=tuple(dataclasses.replace(m, specular=(0.0,) * 3)
                                                       for m in scene.materials))
    rest = trace_truth(Frame(plain), TruthSettings(samples=24 * 12))
    away = frame.gbuffer.position - np.array([2.0, 1.0, 0.0])[:, None, None]  # from the image of the light
    distance = np.linalg.norm(away, axis=0)
    axis = np.array([-1.0, -0.35, 0.0]) / math.hypot(1, 0.35)
    inside = np.tensordot(axis, away / distance, 1) > math.cos(math.radians(24))  # a pixel away from the edge
    expected = (np.array(MIRROR.specular) * light.intensity)[:, None, None] * -away[1] / distance**3
    ratio = ((result.mean - rest.mean) / expected)[:, inside].mean()
    error = (np.sqrt(result.variance_of_mean + rest.variance_of_mean) / expected)[:, inside].mean()
    error /= math.sqrt(inside.sum())
    evidence(f"P = {exponent:g}: {ratio:.5f} of the closed form (standard error {error:.5f})")
    assert abs(ratio - 1) < FOOTPRINT + SIGMAS * error


def test_below_the_shading_horizon_a_lobe_sends_nothing():
    scene = glossy("cornell_sphere:faces=80", 1e4)
    tables = surfaces(scene)
    n, light = (0.0, 0.0, 1.0), (math.sqrt(0.75), 0.0, -0.5)
    for w in ((0.6, 0.0, 0.8), (-math.sqrt(0.75), 0.0, 1e-9), (1.0, 0.0, 0.0)):
        assert lobe_pattern(tables, 0, n, light, w) == 0
    rays = light_rays(scene.lights[0], scene.geometry, np.full((64 * 64, 2), 0.5))
    found = light_vertices(tables, lights_of(scene), 0, rays, closest_of(Tracer(scene.geometry), rays), 0.1, lobes=True)
    points = join([found], 1, 64 * 64).points
    assert np.isfinite(points.peak).all()
    below = (points.peak == 0) & (points.power > 0)
    assert below.any()  # the scene holds such points
    away = (points.axis * points.normal).sum(axis=0)
    assert (away[below] < 0).all()


def test_the_pattern_of_a_lobe_against_sixty_digits():
    scene = glossy("cornell_sphere:faces=80", 3e7)
    tables = surfaces(scene)
    random = np.random.default_rng(3)
    for _ in range(50):
        light = random.normal(size=3) * (1, 1, 0.3) + (0, 0, 1)
        light *= math.copysign(1, light[2]) / np.linalg.norm(light)
        mirror = np.array([-light[0], -light[1], light[2]])
        w = (mirror + random.normal(size=3) * 1e-4).astype(np.float32)  # as rays have it, of a rounded length
        w = tuple(float(c) for c in w / np.linalg.norm(w).astype(np.float32))
        got = lobe_pattern(tables, 0, (0.0, 0.0, 1.0), tuple(light), w)
        expected = (3e7 + 1) / 2 * literal_power(mirror, w, 3e7)
        assert got == pytest.approx(expected, rel=1e-6, abs=1e-20)  # h: 1e-16 times the angle and the exponent


def test_values_that_are_no_numbers_are_counted_and_left_out():
    moments, block = no_passes(6), np.array([0, 0, 1])
    values = [np.full((3, 3), float(k)) for k in range(4)]
    values[1][1, 2] = np.nan
    values[2][0, 2] = np.inf
    for value in values:
        add_pass(moments, with_means(value, block, 2))
    assert moments.lost.tolist() == [0, 0, 2, 0, 2, 0]
    np.testing.assert_allclose(moments.mean, [[1.5] * 6] * 3)
    variance, of_two = np.var([0, 1, 2, 3], ddof=1) / 4, np.var([0, 3], ddof=1) / 2
    np.testing.assert_allclose(moments.variance_of_mean, [[variance, variance, of_two, variance, of_two, variance]] * 3)


def test_a_picture_tells_how_many_values_it_lost(monkeypatch):
    def one_pass(task, number):
        values = np.full((3, len(task.receivers.pixel)), 2.0)
        values[0, :5] = np.nan if number == 0 else 2.0
        return values

    monkeypatch.setattr(sys.modules["refgi.truth.truth"], "one_pass", one_pass)
    frame = Frame(load_scene("cornell_box"), width=8, height=8)
    with pytest.warns(RefgiWarning, match=r"5 of 128 values of a pixel in a pass are not finite"):
        result = trace_truth(frame, TruthSettings(samples=48))
    assert result.lost == 5
    assert np.isfinite(result.mean).all()
    assert (result.samples[frame.gbuffer.covered] < 48).sum() == 5
    np.testing.assert_allclose(result.mean[:, frame.gbuffer.covered], 2)


def test_sharp_lobes_that_photons_cannot_serve_are_announced():
    frame = Frame(glossy("cornell_box", 1e6), width=6, height=6)
    for settings in (TruthSettings(samples=24, visibility=False), TruthSettings(samples=24, emitters="visible")):
        with pytest.warns(RefgiWarning, match=r"sharp \(exponent 30000 or more\) and sampled by chance"):
            trace_truth(frame, settings)
    with pytest.warns(RefgiWarning, match="left out beyond the first bounce"):
        result = trace_truth(frame, TruthSettings(samples=24, bounces=2, photons=1 << 12))
    assert np.isfinite(result.mean).all()


@pytest.mark.filterwarnings("ignore:.*sampled by chance")  # that it is told: the test above
def test_sharp_lobes_stay_with_the_samples_where_nothing_blocks(evidence):
    """Without visibility lobes just above and below the limit send nearly the same light: none is left out there."""
    settings = TruthSettings(samples=24 * 16, visibility=False)
    results = [trace_truth(Frame(glossy("cornell_box", exponent), width=24, height=24), settings)
               for exponent in (SHARP_LOBE, SHARP_LOBE - 1)]
    means = [result.picture_mean.mean() for result in results]
    evidence(f"exponent {SHARP_LOBE:g}: {means[0]:.4f}, below: {means[1]:.4f} W/m^2")
    assert means[0] == pytest.approx(means[1], rel=0.05)  # equal seeds, exponents apart by 0.1 %; the lobes are a third
