"""The caustic of a round mirror, drawn by pixel lights: a nephroid, against its closed form and against tracing."""

import dataclasses
import math
from functools import cache

import numpy as np
import pytest

from refgi.lights import choose_pixel_lights
from refgi.rsm import reflective_shadow_map
from refgi.scene import Camera, DirectionalLight, Material, Scene, material_table, merge
from refgi.scene.builtin.surfaces import patch, rectangle
from tests.naive import nephroid
from tests.splat.pictures import Picture, on_floor, published_lights

R, HEIGHT = 0.1, 0.14  # m; the wall is high enough for the ray that crosses the axis at the mirror's foot
EXPONENT = 2000.0  # polished metal, as in the built-in ring
FALL = DirectionalLight((1.0, -1.0, 0.0), (math.sqrt(2),) * 3)  # 1 W/m^2 on the floor
CUSP = 0.006  # R: where a line through 1 / E meets zero; blurred by 0.016 R, E bends away from it by that much
SEEDS = 0.02  # R: four seeds of 4096 lights; one alone finds the cusp to 0.014 R


@cache
def half_ring(exponent=EXPONENT, columns=256):
    turn = np.linspace(-math.pi / 2, math.pi / 2, columns + 1)
    hollow = np.stack([-np.cos(turn), 0 * turn, -np.sin(turn)], axis=-1)
    low = R * -hollow
    metal = Material("metal", (0, 0, 0), (1, 1, 1), exponent)
    wall = patch(np.stack([low, low + np.array([0, HEIGHT, 0])]), metal, "wall")
    wall = dataclasses.replace(wall, normals=np.concatenate([hollow, hollow]))
    floor = rectangle((-0.15, 0, 0.2), (0.35, 0, 0), (0, 0, -0.4), Material("floor", (0, 0, 0)), "floor")
    geometry, materials = merge([floor, wall], smooth=True)
    return Scene("half ring", geometry, materials, Camera((0, 1, 0.1), (0, 0, 0)), (FALL,))


@cache
def ring_lights(count=4096, exponent=EXPONENT, resolution=512, seed=0):
    scene = half_ring(exponent)
    rsm = reflective_shadow_map(scene.geometry, material_table(scene.materials), FALL, resolution)
    if count is None:
        return choose_pixel_lights([rsm], count=None, pattern="all")
    return published_lights([rsm], count, seed)


@pytest.mark.feature("SII-08")
def test_the_cusp_lies_where_the_nephroid_has_it(evidence):
    x = np.linspace(0.15, 0.4, 26) * R  # before the cusp a single ray arrives and 1 / E = 1 - 2 x / R
    found = []
    for lights in (ring_lights(None), *(ring_lights(seed=seed) for seed in range(4))):
        slope, start = np.polyfit(x, 1 / on_floor(lights, x, np.zeros(1)), 1)
        found.append(-start / slope / R)
    evidence(f"cusp at {found[0]:.4f} R from all texels, {np.mean(found[1:]):.4f} R (spread {np.std(found[1:]):.4f}) "
             "from 4096 lights, 3 levels of method B; nephroid: 0.5 R")
    assert found[0] == pytest.approx(0.5, abs=CUSP)
    assert np.mean(found[1:]) == pytest.approx(0.5, abs=SEEDS)


@pytest.mark.feature("SII-08")
def test_irradiance_behind_the_cusp_is_that_of_a_perfect_mirror(evidence):
    x = np.concatenate([np.linspace(0.2, 0.4, 9), np.linspace(0.65, 0.85, 9)]) * R
    expected = nephroid.irradiance_on_axis(x, R, 1.0)
    error = np.abs(on_floor(ring_lights(None, resolution=1024), x, np.zeros(1)) / expected - 1)
    evidence(f"on the axis, a tenth of R and more from the cusp: within {error.max():.1%} of the closed form")
    assert error.max() < 0.04  # what the lobe's blur adds: E'' s^2 / 2, s = 0.016 R


@pytest.mark.feature("SII-08")
def test_the_branches_of_the_cusp_are_as_far_apart_as_the_nephroids(evidence):
    azimuth = np.linspace(0, math.pi / 4, 4001)
    z = np.linspace(0, 0.3, 301) * R
    gaps = []
    for at in (0.6, 0.65):
        closed = np.interp(at * R, *nephroid.caustic(azimuth, R)) / R
        for exponent in (EXPONENT, 10 * EXPONENT):
            ridge = z[on_floor(ring_lights(None, exponent, 1024), at * R * np.ones(1), z).argmax()] / R
            # a fold that a lobe of width 1 / sqrt(P) blurs is brightest about that width inside
            assert closed - 1.5 / math.sqrt(exponent) < ridge < closed
            gaps.append(f"{ridge:.3f}")
        gaps.append(f"closed form {closed:.3f}")
    evidence(f"half width at 0.6 R and 0.65 R, R: exponents 2000 and 20,000: {', '.join(gaps)}")


@pytest.mark.feature("SII-08")
def test_the_published_lights_draw_the_traced_caustic(evidence):
    landed, flux = nephroid.trace(2_000_000, R, HEIGHT, EXPONENT, 1.0, seed=3)
    cell, figures = 0.02 * R, []
    for name, along, across, span in (("axis", 0, 1, (0.3, 0.7)), ("across", 1, 0, (-0.25, 0.25))):
        middle = 0.0 if name == "axis" else 0.6 * R
        edges = np.arange(span[0] * R, span[1] * R, cell)
        near = np.abs(landed[:, across] - middle) < cell / 2
        traced = np.histogram(landed[near, along], edges)[0] * flux / cell**2
        places = [(edges[:-1] + share * cell)[:, None] for share in (1 / 6, 1 / 2, 5 / 6)]
        sides = middle + np.array([-1, 0, 1]) * cell / 3
        means = [on_floor(ring_lights(), *((p, sides) if along == 0 else (sides, p))).mean(axis=1) for p in places]
        lit = np.mean(means, axis=0)
        error = math.sqrt(np.mean((lit - traced) ** 2) / np.mean(traced**2))
        widths = [np.count_nonzero(profile > profile.max() / 2) * cell / R for profile in (lit, traced)]
        places = [abs(edges[profile.argmax()] / R + 0.01) for profile in (lit, traced)]  # across, two are alike
        figures.append(f"{name}: RMSE {error:.1%}, peak at {places[0]:.2f} (traced {places[1]:.2f}) R, "
                       f"width {widths[0]:.2f} ({widths[1]:.2f}) R, flux {lit.sum() / traced.sum():.3f}")
        assert error < 0.06
        assert abs(places[0] - places[1]) < 0.021  # one cell
        assert abs(widths[0] - widths[1]) < 0.041
        assert lit.sum() == pytest.approx(traced.sum(), rel=0.02)
    evidence("; ".join(figures))


@pytest.mark.feature("SII-08")
def test_widening_calms_lights_near_the_floor_and_leaves_the_cusp(evidence):
    lights = ring_lights()
    spot = lights.position - lights.position[1] / lights.lobe_axis[1] * lights.lobe_axis  # where each axis ends
    low = lights.position[1] < 0.05 * R
    x = np.linspace(0.3, 0.7, 81) * R
    spots, cusp = ([on_floor(lights, *where, widening=a) for a in (0.0, 0.03)]
                   for where in ((spot[0, low], spot[2, low]), (x, np.zeros(1))))
    evidence(f"{low.sum()} of 4096 lights lie under R / 20; widened over 3 cm, the mean of their spots falls from "
             f"{spots[0].mean():.0f} to {spots[1].mean():.1f} times the light's irradiance, the largest from "
             f"{spots[0].max():.1e} to {spots[1].max():.0f}; at the cusp {cusp[1].max() / cusp[0].max():.4f} of before")
    assert low.sum() > 50
    assert spots[1].max() < spots[0].max() / 10
    assert spots[1].mean() < spots[0].mean() / 5
    assert np.abs(cusp[1] - cusp[0]).max() < 0.02 * cusp[0].max()


@pytest.mark.feature("SII-08")
def test_the_rings_caustic_lies_where_one_mirror_bounce_has_it(monkeypatch, evidence):
    monkeypatch.setattr("refgi.truth.caustics.LONGEST_CHAIN", 2)  # to the ring, and on to the plate
    picture = Picture("ring")
    place = picture.position
    mask = (place[1] < 1e-4) & (np.hypot(place[0], place[2]) < 0.085)
    traced, noise = picture.truth(1 << 18)
    noise = math.sqrt((noise[mask] ** 2).mean() / (traced[mask] ** 2).mean())
    error, flux, away = picture.compare(picture.lit_by(published_lights(picture.frame.rsms)), traced, mask)
    many = picture.compare(picture.lit_by(published_lights(picture.frame.rsms, 32768)), traced, mask)
    evidence(f"inside the ring, 4096 lights: RMSE {error:.1%}, flux {flux:.3f}, centre {1000 * away:.1f} mm off; "
             f"32,768: {many[0]:.1%}, {many[1]:.3f}, {1000 * many[2]:.1f} mm (noise of the truth {noise:.1%})")
    assert error < 0.4  # too few lights where it is not bright: 1600 of them lie on the ring
    assert many[0] < 0.1
    assert flux == pytest.approx(1, abs=0.05)
    assert many[1] == pytest.approx(1, abs=0.02)
    assert away < 2e-3
    assert many[2] < 1e-3
