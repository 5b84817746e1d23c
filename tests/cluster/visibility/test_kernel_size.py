"""Cones on a stereographic map, exact and as published (VAL-15)."""

import math

import numpy as np
import pytest

from refgi.cluster.settings import ValSettings
from refgi.cluster.visibility.pcf import (
    STEEPEST,
    cone_tangent,
    disc,
    farthest_tangent,
    published_square,
    published_tangent,
    solid_angle_tangent,
)
from refgi.cluster.visibility.shadow import visibility
from refgi.literal import val_series, val_visibility
from refgi.settings import of
from tests.cluster.visibility.plates import directions, lit_by

EXACT = 2e-15
CENTS = 0.005  # half of the last digit of the known ratios
NEAR, FAR, DELTA = 1.0, 3.0, 0.6  # of the blocker, of receivers and all else, and of the light, m
TEXELS = 1024
STEP = 0.002  # of V: texels at the rim of a disc of 100; the edge itself lies between texels
NARROW = 0.015  # tan, sin and a itself for a = 11 degrees
WIDTH = 0.002


@pytest.mark.feature("VAL-15")
@pytest.mark.parametrize("theta", [0.0, 0.3, 1.0, 1.5, math.pi / 2])
@pytest.mark.parametrize("a", [1e-3, 0.2, 0.9, math.radians(80)])
def test_cone_is_a_disc(theta, a):
    x, y, z = 3 * math.sin(theta) * 0.6, 3 * math.sin(theta) * 0.8, 3 * math.cos(theta)
    found = disc(x, y, z, 3.0, math.tan(a))
    one = np.ones((1, 1, 1))
    literal = val_visibility.disc(np.array([x, y, z]).reshape(3, 1, 1, 1), 3 * one, a * one)
    assert found == pytest.approx(literal[0, :, 0, 0], abs=EXACT * 10)
    axis, phi = np.array([x, y, z]) / 3, np.linspace(0, 6, 7)
    right = np.cross(axis, [0.8, -0.6, 0.0])
    rim = math.cos(a) * axis[:, None] + math.sin(a) * (
        np.outer([0.8, -0.6, 0.0], np.cos(phi)) + np.outer(right, np.sin(phi)))
    s, t = rim[0] / (1 + rim[2]), rim[1] / (1 + rim[2])
    assert np.abs(np.hypot(s - found[0], t - found[1]) - found[2]).max() < 1e-13 * max(1, found[2])


@pytest.mark.feature("VAL-14")
@pytest.mark.parametrize(("delta", "d", "r"), [(1.0, 4.0, 0.6), (1.0, 4.0, 2.0), (3.0, 2.0, 1.7), (0.1, 5.0, 4.9)])
def test_the_farthest_blocker_lies_on_the_line_to_the_lights_edge(delta, d, r):
    """The light ends at (delta / 2, 0), the receiver is at (0, d), the blocker at (r sin, r cos)."""
    theta = math.atan(farthest_tangent(delta, d, r))
    x, z = r * math.sin(theta), r * math.cos(theta)
    assert x == pytest.approx(delta / 2 * (1 - z / d), rel=1e-12)
    assert theta > math.atan(cone_tangent(delta, d, r))


@pytest.mark.feature("VAL-14")
def test_blockers_nearer_than_half_the_light_lie_anywhere():
    assert farthest_tangent(1.0, 4.0, 0.36) == STEEPEST
    assert farthest_tangent(1.0, 4.0, 0.49) == STEEPEST
    assert farthest_tangent(1.0, 4.0, 4.0) == 0.0
    assert farthest_tangent(1.0, 4.0, 5.0) == 0.0


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
    weight, bias, end = val_series.series(4)
    apart = max(2 * end[0] - 1, end[0] / 2)  # of the farthest from the nearest
    left = 0.5 + val_series.above_half(bias[1] - apart, weight)
    return np.where((1 - share) * (1 - left) < val_series.LEAST_BLOCKED, 1, np.clip(left + (1 - left) * share, 0, 1))


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
@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_cones_end_at_80_degrees(real):
    near, huge = real(1e-6), real(1e6)
    assert cone_tangent(huge, real(1.0), near) == real(STEEPEST)
    assert solid_angle_tangent(huge, real(1.0)) == real(STEEPEST)
    for z in (real(1.0), real(2.0), real(np.inf)):
        assert cone_tangent(huge, real(1.0), z) == 0
