"""Lobes of receivers: reciprocity, furnace, one light by hand, and every method of pixel lights against its twin."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.pairs.settings import PairSettings
from refgi.radiometry import mirrored, receiver_lobe, receiver_norm
from refgi.scene import PointLight, SpotLight
from tests.glossy import glossy_box
from tests.naive import receiver_lobes as naive
from tests.truth.scenes import floor, scene

EXPONENTS = [0.0, 1.0, 10.0, 1e3, 1e6]
QUADRATURE = 1e-8  # of both rules, converged
ROUNDING = 1e-12  # of dot products near 1, by an exponent of at most 1e3
SINGLE = 2.0**-24


def directions(count, seed=4):
    w = np.random.default_rng(seed).normal(size=(count, 3))
    w[:, 2] = np.abs(w[:, 2])
    return w / np.linalg.norm(w, axis=1, keepdims=True)


@pytest.mark.feature("REF-25")
@pytest.mark.parametrize("exponent", EXPONENTS)
def test_the_lobe_is_the_twins_and_reciprocal(exponent, evidence):
    normal, w_i = np.array([0.0, 0.0, 1.0]), directions(200)
    spread = np.random.default_rng(5).normal(size=(200, 3)) * 0.5 / math.sqrt(exponent + 1)
    w_o = naive.unit(naive.mirrored(normal, w_i) + spread)
    w_o[:, 2] = np.abs(w_o[:, 2])
    there, back = (naive.brdf(exponent, normal, *pair) for pair in ((w_i, w_o), (w_o, w_i)))
    ours = np.array([[receiver_lobe(*mirrored(*a, *normal), *b, exponent) for a, b in ((o, i), (i, o))]
                     for i, o in zip(w_i, w_o, strict=True)])
    peak = receiver_norm(exponent)
    assert peak == pytest.approx((exponent + 2) / (2 * math.pi), rel=1e-15)
    bound = 1e-13 * (1 + math.sqrt(exponent) * 10)  # h of a few 1 / P is rounded by some 1e-16 / sqrt(P)
    evidence(f"P = {exponent:g}: both ways differ by {np.abs(there - back).max() / peak:.1e} of the peak, "
             f"from the twin by {np.abs(ours[:, 0] - there).max() / peak:.1e}")
    assert there.max() > 0.3 * peak
    assert np.abs(there - back).max() < bound * peak
    assert np.abs(ours[:, 0] - there).max() < bound * peak
    assert np.abs(ours[:, 1] - back).max() < bound * peak


@pytest.mark.feature("REF-25")
@pytest.mark.parametrize("exponent", EXPONENTS)
def test_the_furnace_never_gives_more_than_it_gets(exponent, evidence):
    """A white lobe in a uniform field, by quadrature around the mirrored direction; by random directions besides."""
    angles = np.radians([0, 10, 30, 45, 60, 75, 85, 89, 90])
    albedo = np.array([naive.tilted_albedo(exponent, angle) for angle in angles])
    evidence(f"P = {exponent:g}: " + ", ".join(f"{math.degrees(t):.0f} deg {a:.4f}"
                                               for t, a in zip(angles, albedo, strict=True)))
    assert albedo[0] == pytest.approx(1, abs=QUADRATURE)  # (P + 2) / (2 pi) int cos^(P + 1) = 1
    assert (albedo <= 1 + QUADRATURE).all()
    if exponent == 0:  # half the hemisphere around m lies below at 90 degrees: int over a lune of <n.w> / pi
        np.testing.assert_allclose(albedo, (1 + np.cos(angles)) / 2, atol=1e-6)
    # the integrand of the kernel, at directions drawn from the lobe
    random = np.random.default_rng(7)
    for angle, expected in zip(angles[1:8:2], albedo[1:8:2], strict=True):
        normal, w_o = np.array([0.0, 0.0, 1.0]), np.array([math.sin(angle), 0, math.cos(angle)])
        m = np.array(mirrored(*w_o, *normal))
        gap = -np.expm1(np.log(1 - random.random(20000)) / (exponent + 1))
        turn, flat = 2 * math.pi * random.random(20000), np.sqrt(gap * (2 - gap))
        across = np.array([0.0, 1.0, 0.0])
        w = ((1 - gap)[:, None] * m + (flat * np.cos(turn))[:, None] * across
             + (flat * np.sin(turn))[:, None] * np.cross(m, across))
        f = np.array([receiver_lobe(*m, *one, exponent) for one in w])
        value = np.where(w[:, 2] > 0, f * w[:, 2], 0) / ((exponent + 1) / (2 * math.pi) * (1 - gap) ** exponent)
        assert abs(value.mean() - expected) < 4 * value.std() / math.sqrt(len(value)) + 1e-9


@pytest.mark.feature("REF-25")
def test_the_share_above_the_surface_would_break_the_furnace_and_reciprocity(evidence):
    """A receiver's norm over the senders' K reflects more than it gets, and depends on which way light goes."""
    normal, most = np.array([0.0, 0.0, 1.0]), (0.0, 0.0, 0.0)
    nodes, weights = np.polynomial.legendre.leggauss(100)
    theta, phi = (nodes + 1) * math.pi / 4, (nodes + 1) * math.pi / 2  # half a turn, twice
    t, p = (a.reshape(-1) for a in np.meshgrid(theta, phi, indexing="ij"))
    w_i = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=1)
    measure = 2 * np.outer(weights * math.pi / 4, weights * math.pi / 2).reshape(-1) * np.sin(t) * np.cos(t)
    for exponent in (0.0, 1.0, 3.0, 10.0, 30.0):
        shares = np.repeat([naive.lobe_fraction(angle, exponent) for angle in theta], len(phi))
        for degrees in (0, 20, 40, 60, 80):
            w_o = np.array([math.sin(math.radians(degrees)), 0, math.cos(math.radians(degrees))])
            f = naive.brdf(exponent, normal, w_i, w_o)
            most = max(most, (float((f / shares * measure).sum()), exponent, degrees))
            assert (f * measure).sum() == pytest.approx(naive.tilted_albedo(exponent, math.radians(degrees)), abs=2e-3)
    # P = 0 seen along the normal: 2 int sin cos / (1 - theta / pi), K by hand
    by_hand = 2 * (np.sin(theta) * np.cos(theta) / (1 - theta / math.pi)) @ weights * math.pi / 4
    there, back = (naive.sender_brdf(1.0, normal, np.array(a), np.array(b)) for a, b in (
        ([[0.0, 0.0, 1.0]], [[0.6, 0.0, 0.8]]), ([[0.6, 0.0, 0.8]], [[0.0, 0.0, 1.0]])))
    evidence(f"most: {most[0]:.3f} of a uniform field at P = {most[1]:g} seen at {most[2]} degrees; a sender's lobe "
             f"as a BRDF of P = 1, both ways: {there[0]:.4f}, {back[0]:.4f}")
    assert most == pytest.approx((by_hand, 0, 0), rel=1e-6)
    assert by_hand == pytest.approx(1.3628, abs=1e-3)
    assert abs(there[0] / back[0] - 1) > 0.05


LIGHTS = {"point": PointLight((0.3, 0.8, 0.2), (2.0, 1.0, 0.5)),
          "spot": SpotLight((0.3, 0.8, 0.2), (-0.2, -1.0, -0.1), 0.5, 0.9, (2.0, 1.0, 0.5))}


@pytest.mark.feature("REF-25")
@pytest.mark.parametrize("kind", ["point", "spot"])
@pytest.mark.parametrize("exponent", EXPONENTS)
def test_one_light_over_a_phong_floor(kind, exponent, evidence):
    """Direct light of one small light: f_s I <n.l> / d^2 at every pixel, from angles by the law of cosines."""
    from refgi.literal.light_flux import spot_share
    from refgi.scene import Material

    shiny, light = Material("shiny", (0.1,) * 3, (0.5, 0.6, 0.7), exponent), LIGHTS[kind]
    found = dataclasses.replace(scene([floor(1.0, shiny)], light))
    camera = dataclasses.replace(found.camera, eye=(-0.4, 0.9, 0.1), target=(0.0, 0.0, 0.15))
    frame = Frame(dataclasses.replace(found, camera=camera), width=32, height=32, dtype=np.float64, shadows="exact")
    covered = np.argwhere(frame.gbuffer.covered)
    worst, most = 0.0, 0.0
    expected = np.zeros_like(frame.direct_lobes)
    for row, column in covered:
        x = frame.gbuffer.position[:, row, column]
        intensity = np.asarray(light.intensity)
        if kind == "spot":
            axis, away = np.asarray(light.direction) / np.linalg.norm(light.direction), x - light.position
            share = spot_share(axis @ away / np.linalg.norm(away), light.inner_half_angle, light.outer_half_angle)
            intensity = share * intensity
        expected[:, row, column] = naive.of_point_light(intensity, light.position, exponent, shiny.specular, x,
                                                        np.array([0.0, 1.0, 0.0]), camera.eye)
    most = expected.max()
    worst = np.abs(frame.direct_lobes - expected).max() / most
    evidence(f"{kind}, P = {exponent:g}: within {worst:.1e} of the largest, {most:.3g} W/m^2/sr")
    assert most > 0
    assert worst < 1e-12 * (1 + exponent)  # the twin's cosine is rounded by 1e-16, which counts P-fold
    picture = frame.radiance(np.zeros_like(frame.direct))
    rest = frame.direct * np.array(shiny.diffuse)[:, None, None] / math.pi
    np.testing.assert_allclose(picture, rest + expected, rtol=1e-9, atol=1e-9 * most)


@pytest.mark.feature("REF-25")
@pytest.mark.parametrize("method", ["sii", "vpl"])
@pytest.mark.parametrize("senders", [0.0, 12.0])
@pytest.mark.parametrize("exponent", [0.0, 60.0, 1e4])
def test_pixel_lights_at_glossy_receivers_against_every_pair(method, senders, exponent, evidence):
    from refgi.lights import choose_pixel_lights
    from refgi.methods import find_method
    from refgi.settings import of, replaced

    found = glossy_box(exponent, blocks=max(senders, 1.0))
    if not senders:  # no sender is glossy beside what is seen: blocks diffuse
        found = dataclasses.replace(found, materials=tuple(
            dataclasses.replace(m, specular=(0.0,) * 3) if m.name == "metal" else m for m in found.materials))
    frame = Frame(found, width=20, height=20, rsm_resolution=24, dtype=np.float64)
    known = find_method(method)
    settings = of(known.settings, pattern="all") if method == "vpl" else of(known.settings, pattern="all", clamp="none")
    got = known.compute_lobes(frame, settings)[0]
    lights = choose_pixel_lights(frame.rsms, count=None, pattern="all")
    plain = replaced(PairSettings(), {"clamp": "none"})
    expected = naive.of_lights(frame, lights, plain, visibility=method == "vpl")
    error = np.abs(got - expected).max() / expected.max()
    differ = (np.abs(got - expected) > 1e-5 * expected.max()).any(axis=0).mean()
    evidence(f"{method}, P = {exponent:g}, senders {senders:g}: within {error:.1e} of the largest")
    assert expected.max() > 0
    assert differ < (0.01 if method == "vpl" else 1e-9)  # rays at edges: Embree is float32
