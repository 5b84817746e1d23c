"""Cones on a stereographic map, exact and as published (VAL-15)."""

import math

import numpy as np
import pytest

from refgi.cluster.settings import ValSettings
from refgi.cluster.visibility.evaluate import visibility
from refgi.cluster.visibility.kernel_size import (
    STEEPEST,
    cone_tangent,
    conservative_tangent,
    disc,
    published_square,
    published_tangent,
    solid_angle_tangent,
)
from refgi.settings import of
from tests.cluster.visibility.plates import directions, lit_by, map_of_plates, square_share
from tests.naive import soft_shadow as naive

EXACT = 2e-15
CENTS = 0.005  # half of the last digit of the known ratios
NEAR, FAR, DELTA = 1.0, 3.0, 0.6  # of the blocker, of receivers and all else, and of the light, m
TEXELS = 1024
STEP = 0.002  # of V: texels at the rim of a disc of 100; the edge itself lies between texels
NARROW = 0.015  # tan, sin and a itself for a = 11 degrees
WIDTH = 0.002


@pytest.mark.parametrize("theta", [0.0, 0.3, 1.0, 1.5, math.pi / 2])
@pytest.mark.parametrize("a", [1e-3, 0.2, 0.9, math.radians(80)])
def test_cone_is_a_disc(theta, a):
    x, y, z = 3 * math.sin(theta) * 0.6, 3 * math.sin(theta) * 0.8, 3 * math.cos(theta)
    found = disc(x, y, z, 3.0, math.tan(a))
    assert found == pytest.approx(naive.cone_disc(x, y, z, a), abs=EXACT * 10)
    axis, phi = np.array([x, y, z]) / 3, np.linspace(0, 6, 7)
    right = np.cross(axis, [0.8, -0.6, 0.0])
    rim = math.cos(a) * axis[:, None] + math.sin(a) * (
        np.outer([0.8, -0.6, 0.0], np.cos(phi)) + np.outer(right, np.sin(phi)))
    s, t = rim[0] / (1 + rim[2]), rim[1] / (1 + rim[2])
    assert np.abs(np.hypot(s - found[0], t - found[1]) - found[2]).max() < 1e-13 * max(1, found[2])


@pytest.mark.feature("VAL-15")
def test_published_filter_is_too_wide_in_the_middle_and_too_narrow_at_the_rim(evidence):
    ratios = {}
    for degrees, known in ((0, 1.27), (30, 1.19), (60, 0.95), (80, 0.75), (90, 0.635)):
        theta, tangent = math.radians(degrees), 1e-4
        x, z = math.sin(theta), max(math.cos(theta), 0.0)
        ratios[degrees] = published_square(x, 0.0, z, 1.0, tangent)[2] / disc(x, 0.0, z, 1.0, tangent)[2]
        assert ratios[degrees] == pytest.approx(known, abs=CENTS)
        assert ratios[degrees] == pytest.approx(2 / math.pi * (1 + math.cos(theta)), rel=1e-6)
    evidence("alpha / pi over the exact width: " + ", ".join(f"{r:.3f} at {k} deg" for k, r in ratios.items()))


def across(theta, turn):
    """Directions at `turn` from the plane of the edge, in which the one at `theta` from the axis lies, (3, n)."""
    return np.stack([np.cos(turn) * math.sin(theta), np.sin(turn), np.cos(turn) * math.cos(theta)])


def penumbra(theta, *published):
    """Return V across an edge, and the angles to the receivers.

    A half sphere at NEAR hides the other half, FAR: turned about the edge's normal, the scene is the same, so a
    penumbra must be as wide at any angle from the light's axis.
    """
    w, within = directions(TEXELS)
    depth = np.where(within, np.where(w[1] < 0, NEAR, FAR), np.inf)
    turn = np.linspace(-0.4, 0.4, 201)
    points = FAR * across(theta, turn)
    settings = of(ValSettings, prefilter="brute", as_published=frozenset(published))
    return visibility(*reversed(lit_by(depth, DELTA, FAR)), 0, points, -points / FAR, settings), turn


def of_the_series(share):
    """Return V of four terms where a share of the filter is free, all at FAR, and NEAR hides the rest."""
    bias = naive.first_one(4)
    to, _ = naive.scales([[NEAR, FAR]], "log_map", FAR, bias, bias)
    left = naive.step_series(to(FAR) - bias, to(NEAR), 4)
    return np.where((1 - share) * (1 - left) < naive.NOTHING, 1, np.clip(left + (1 - left) * share, 0, 1))


def width_of(v, turn):
    """Return the angle between where V is 0.1 and 0.9."""
    return np.subtract(*np.interp([0.9, 0.1], np.maximum.accumulate(v), turn))


@pytest.mark.feature("VAL-15")
@pytest.mark.parametrize("degrees", [0, 30, 60, 75])  # the disc ends at 90
def test_penumbrae_through_the_chain_are_as_wide_as_their_filters(degrees, evidence):
    """Analytic: a cone of half-angle a is cut by the edge's plane; of a square of side alpha / pi the map is cut."""
    theta, a = math.radians(degrees), math.atan(DELTA * (FAR - NEAR) / (2 * FAR * NEAR))
    v, turn = penumbra(theta)
    u = np.clip(np.sin(turn) / math.sin(a), -1, 1)
    disc_ramp = of_the_series(0.5 + (np.arcsin(u) + u * np.sqrt(1 - u * u)) / math.pi)
    printed, _ = penumbra(theta, "val_alpha_over_pi")
    t = np.sin(turn) / (1 + np.cos(turn) * math.cos(theta))
    square_ramp = of_the_series(np.clip(0.5 + t / (4 * a / math.pi), 0, 1))
    widths = [width_of(one, turn) for one in (v, disc_ramp, printed, square_ramp)]
    square = width_of(of_the_series(np.clip(0.5 + np.tan(turn) / (2 * math.tan(a)), 0, 1)), turn)
    evidence(f"{degrees} deg off the axis: the penumbra is {widths[0]:.4f} rad wide ({widths[1]:.4f} in closed form), "
             f"as published {widths[2]:.4f} ({widths[3]:.4f}), {widths[2] / square:.3f} of a square light's")
    for one, ramp, got, right in ((v, disc_ramp, *widths[:2]), (printed, square_ramp, *widths[2:])):
        assert np.abs(one - ramp).max() < STEP
        assert got == pytest.approx(right, rel=WIDTH)
    # the table's ratio, for narrow cones; this one is 11 degrees
    assert widths[2] / square == pytest.approx(2 / math.pi * (1 + math.cos(theta)), rel=NARROW)


@pytest.mark.feature("VAL-15")
def test_penumbra_angle_as_printed_starts_at_the_axis():
    d, z, delta = 2.0, 1.0, 2.0  # p cos(beta) = 2 = d
    assert 2 * math.degrees(math.atan(published_tangent(delta, d, z))) == pytest.approx(45, abs=1e-9)
    assert 2 * math.degrees(math.atan(cone_tangent(delta, d, z))) == pytest.approx(53.13, abs=5e-3)
    assert published_tangent(1e-4, d, z) == pytest.approx(cone_tangent(1e-4, d, z), rel=1e-6)


@pytest.mark.feature("VAL-14")
def test_search_by_the_solid_angle_assumes_blockers_half_way():
    assert solid_angle_tangent(0.7, 5.0) == pytest.approx(cone_tangent(0.7, 5.0, 2.5))


@pytest.mark.feature("VAL-14")
def test_a_conservative_search_holds_every_blocker_of_the_light_s_cone(evidence):
    """Property: of points in the cone from a receiver to the light, none lies outside, and the widest is at its rim."""
    rng, worst, missed = np.random.default_rng(5), 0.0, 0
    for _ in range(200):
        d, delta = 1.0 + rng.random() * 5, 10 ** rng.uniform(-1, 0.7)
        along, turn = rng.random(4000) * d, rng.random(4000)
        aside = delta / 2 * (1 - along / d) * np.sqrt(turn)
        r, theta = np.hypot(along, aside), np.arctan2(aside, along)
        near = d * rng.uniform(0.02, 0.9)
        beyond = theta[(r >= near)].max()
        searched, plain = (math.atan(tangent(delta, d, near)) for tangent in (conservative_tangent, cone_tangent))
        assert beyond < searched + EXACT or searched == pytest.approx(math.radians(80))
        missed += beyond > plain
        if searched < math.radians(79):
            z, half = near, delta / 2
            on_rim = z * math.sin(searched) - half * (1 - z * math.cos(searched) / d)
            worst = max(worst, abs(on_rim) / z)
    evidence(f"points of the cone outside of the search: none of 200 cones, of {missed} for the depth on the axis; "
             f"the end lies {worst:.0e} off the cone's rim")
    assert worst < 1e-12
    assert missed > 50


@pytest.mark.feature("VAL-14")
def test_a_blocker_beside_the_light_is_found_by_the_conservative_search_alone(evidence):
    """A half plane 0.2 m before a light of 1 m, from 0.3 m off its axis on: nearest at 0.36 m and 56 degrees."""
    plate, point = [(0.3, 50.0, -50.0, 50.0, 0.2)], np.array([[0.0], [0.0], [4.0]])
    areas, maps = lit_by(map_of_plates(512, plate), 1.0, 10.0)
    hidden = 1 - square_share(point, 1.0, plate, 400)[0]
    found = {how: 1 - visibility(maps, areas, 0, point, -point / 4, of(ValSettings, visibility="pcss", search=how))[0]
             for how in ("nearest", "conservative")}
    evidence(f"{hidden:.3f} of the light is hidden; found {found}")
    assert hidden == pytest.approx(0.184, abs=1 / 400)  # columns of points on the light
    assert found["nearest"] == 0
    assert found["conservative"] > hidden / 2


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_cones_end_at_80_degrees(real):
    near, huge = real(1e-6), real(1e6)
    assert cone_tangent(huge, real(1.0), near) == real(STEEPEST)
    assert solid_angle_tangent(huge, real(1.0)) == real(STEEPEST)
    for z in (real(1.0), real(2.0), real(np.inf)):
        assert cone_tangent(huge, real(1.0), z) == conservative_tangent(huge, real(1.0), z) == 0
    assert conservative_tangent(huge, real(1.0), near) == real(STEEPEST)
