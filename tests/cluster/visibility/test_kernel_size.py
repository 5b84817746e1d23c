"""Cones on a stereographic map, exact and as published (VAL-15)."""

import math

import numpy as np
import pytest

from refgi.cluster.visibility.kernel_size import (
    STEEPEST,
    cone_tangent,
    disc,
    published_square,
    published_tangent,
    solid_angle_tangent,
)
from tests.naive import soft_shadow as naive

EXACT = 2e-15
CENTS = 0.005  # half of the last digit of the known ratios


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


@pytest.mark.feature("VAL-15")
def test_penumbra_angle_as_printed_starts_at_the_axis():
    d, z, delta = 2.0, 1.0, 2.0  # p cos(beta) = 2 = d
    assert 2 * math.degrees(math.atan(published_tangent(delta, d, z))) == pytest.approx(45, abs=1e-9)
    assert 2 * math.degrees(math.atan(cone_tangent(delta, d, z))) == pytest.approx(53.13, abs=5e-3)
    assert published_tangent(1e-4, d, z) == pytest.approx(cone_tangent(1e-4, d, z), rel=1e-6)


@pytest.mark.feature("VAL-14")
def test_search_by_the_solid_angle_assumes_blockers_half_way():
    assert solid_angle_tangent(0.7, 5.0) == pytest.approx(cone_tangent(0.7, 5.0, 2.5))


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_cones_end_at_80_degrees(real):
    near, huge = real(1e-6), real(1e6)
    assert cone_tangent(huge, real(1.0), near) == real(STEEPEST)
    assert solid_angle_tangent(huge, real(1.0)) == real(STEEPEST)
    for z in (real(1.0), real(2.0), real(np.inf)):
        assert cone_tangent(huge, real(1.0), z) == 0
