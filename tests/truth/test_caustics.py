"""Light through mirrors and glass, against an image of the light and the laws of Snell and Fresnel."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.errors import RefgiWarning
from refgi.frame import Frame
from refgi.scene import Camera, Material, SpotLight
from refgi.truth import TruthSettings, trace_truth
from refgi.truth.caustics import _through_glass, film
from tests.truth.scenes import floor, rectangle, scene

FOOTPRINT = 2e-3  # E varies by that within a pixel of this picture, where it is smooth
MIRROR = Material("mirror", (0, 0, 0), (0.9, 0.8, 0.5), 1e8)


def mirror_over_floor(light):
    wall = rectangle((1, 0, 2), (0, 0, -4), (0, 3, 0), MIRROR)
    found = scene([floor(3.0), wall], light)
    camera = Camera((0.2, 2.5, 0.0), (0.2, 0.0, 0.0), (0, 0, -1), math.radians(20), 28, 20)
    return dataclasses.replace(found, camera=camera)


def test_a_mirror_acts_as_an_image_of_the_light(evidence):
    light = SpotLight((0.0, 1.0, 0.0), (1.0, -0.35, 0.0), math.radians(25), math.radians(25), (3.0, 2.0, 1.0))
    frame = Frame(mirror_over_floor(light))
    result = trace_truth(frame, TruthSettings(samples=24 * 12, caustics=True, photons=1 << 17))
    away = frame.gbuffer.position - np.array([2.0, 1.0, 0.0])[:, None, None]  # from the image of the light
    distance = np.linalg.norm(away, axis=0)
    axis = np.array([-1.0, -0.35, 0.0]) / math.hypot(1, 0.35)
    inside = np.tensordot(axis, away / distance, 1) > math.cos(math.radians(24))  # a pixel away from the edge
    expected = (np.array(MIRROR.specular) * light.intensity)[:, None, None] * -away[1] / distance**3
    ratio = (result.mean / expected)[:, inside].mean()
    error = (np.sqrt(result.variance_of_mean) / expected)[:, inside].mean() / math.sqrt(inside.sum())
    evidence(f"plane mirror: {ratio:.5f} of the closed form (standard error {error:.5f}) over {inside.sum()} pixels")
    assert inside.sum() > 50
    assert abs(ratio - 1) < FOOTPRINT + 4 * error
    outside = np.tensordot(axis, away / distance, 1) < math.cos(math.radians(26))
    assert (result.mean[:, outside] == 0).all()


@pytest.mark.slow
def test_without_the_option_the_lobe_is_an_emitter_like_any_other():
    light = SpotLight((0.0, 1.0, 0.0), (1.0, -0.35, 0.0), math.radians(25), math.radians(25), (3.0, 2.0, 1.0))
    blunt = dataclasses.replace(MIRROR, exponent=150.0)
    found = mirror_over_floor(light)
    found = dataclasses.replace(found, materials=tuple(blunt if m == MIRROR else m for m in found.materials))
    frame = Frame(found, width=12, height=12)
    emitter = trace_truth(frame, TruthSettings(samples=24 * 60))
    photons = trace_truth(frame, TruthSettings(samples=24 * 20, caustics=True, photons=1 << 17))
    middle = np.s_[:, 4:8, 4:8]
    assert photons.mean[middle].mean() == pytest.approx(emitter.mean[middle].mean(), rel=0.02)


def test_glass_follows_snell_and_fresnel(evidence):
    n, ior = (0.0, 0.0, 1.0), 1.5
    words = np.arange(20_000, dtype=np.uint32)
    for degrees, entering in ((0, True), (50, True), (30, False), (60, False)):
        angle = math.radians(degrees)
        d = (math.sin(angle), 0.0, -math.cos(angle))
        out = np.array([_through_glass(n, d, entering, ior, word) for word in words])
        sine = math.sin(angle) / ior if entering else math.sin(angle) * ior
        reflected = out[:, 2] > 0
        assert np.linalg.norm(out, axis=1) == pytest.approx(1, abs=1e-12)
        assert out[reflected, 0] == pytest.approx(math.sin(angle), abs=1e-12)
        assert out[~reflected, 0] == pytest.approx(sine, abs=1e-12)
        if sine >= 1:
            assert reflected.all()
            continue
        a, b = math.cos(angle), math.sqrt(1 - sine**2)
        first, second = (1, ior) if entering else (ior, 1)
        across, along = (first * a - second * b) / (first * a + second * b), (first * b - second * a) / (
            first * b + second * a)
        share = (across**2 + along**2) / 2
        assert reflected.mean() == pytest.approx(share, abs=4 * math.sqrt(share * (1 - share) / len(words)))
    evidence("Snell to 1e-12, Fresnel's share within 4 standard errors of 20,000 choices")


def test_a_scene_without_mirror_or_glass_sends_no_photons():
    light = SpotLight((0.0, 1.0, 0.0), (1.0, -0.35, 0.0), 0.3, 0.4, (3.0, 2.0, 1.0))
    assert film(scene([floor()], light), (4, 4)) is None
    assert film(mirror_over_floor(light), (4, 4)) is not None


def test_glass_without_the_option_is_announced():
    light = SpotLight((0.0, 1.0, 0.0), (1.0, -0.35, 0.0), 0.3, 0.4, (3.0, 2.0, 1.0))
    glass = rectangle((1, 0, 2), (0, 0, -4), (0, 3, 0), Material("pane", ior=1.5))
    frame = Frame(scene([floor(3.0), glass], light), width=4, height=4)
    with pytest.warns(RefgiWarning, match="glass is opaque and black"):
        trace_truth(frame, TruthSettings(samples=24))
    trace_truth(frame, TruthSettings(samples=24, caustics=True, photons=1024))  # says nothing


def test_a_pane_of_glass_lets_light_through_on_its_far_side(evidence):
    """Rays start on the side they leave to: a pane shifts and dims a lamp as Snell and Fresnel say."""
    ior, height, top, thickness = 1.5, 2.0, 1.0, 0.4
    pane = Material("pane", ior=ior)
    faces = [rectangle((-1, top, 1), (2, 0, 0), (0, 0, -2), pane),
             rectangle((-1, top - thickness, -1), (2, 0, 0), (0, 0, 2), pane)]
    lamp = SpotLight((0.0, height, 0.0), (0.0, -1.0, 0.0), 0.35, 0.35, (3.0, 2.0, 1.0))
    camera = Camera((0.0, 0.5, 0.0), (0.0, 0.0, 0.0), (0, 0, -1), 0.6, 16, 16)
    frame = Frame(dataclasses.replace(scene([floor(3.0), *faces], lamp), camera=camera))
    result = trace_truth(frame, TruthSettings(samples=24 * 4, caustics=True, photons=1 << 16))
    angle = np.linspace(1e-4, 0.34, 4000)
    inside = np.arcsin(np.sin(angle) / ior)
    along = (height - thickness) * np.tan(angle) + thickness * np.tan(inside)
    across = (np.cos(angle) - ior * np.cos(inside)) / (np.cos(angle) + ior * np.cos(inside))
    beside = (ior * np.cos(angle) - np.cos(inside)) / (ior * np.cos(angle) + np.cos(inside))
    share = (across**2 + beside**2) / 2
    through = (1 - share) / (1 + share)  # with all reflections between the faces
    expected = through * np.sin(angle) / (along * np.gradient(along, angle))
    distance = np.hypot(frame.gbuffer.position[0], frame.gbuffer.position[2])
    ratio = result.mean / (np.reshape(lamp.intensity, (3, 1, 1)) * np.interp(distance, along, expected))
    error = np.sqrt(result.picture_variance / result.picture_mean**2).mean()
    evidence(f"pane: {ratio.mean():.5f} of Snell and Fresnel (standard error {error:.5f})")
    assert distance.max() < 0.3
    assert abs(ratio.mean() - 1) < FOOTPRINT + 4 * error
