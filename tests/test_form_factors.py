"""Closed forms against quadrature of cos cos / (pi r^2)."""

import math

import numpy as np
import pytest

from tests.form_factors import (
    coaxial_discs_form_factor,
    disc_form_factor,
    parallel_rectangles_form_factor,
    polygon_form_factor,
    wedge_form_factor,
)

QUADRATURE = 1e-6  # the midpoint sums below


def test_disc_by_polar_sum():
    r = (np.arange(4000) + 0.5) / 4000 * 1.5
    expected = float((2 * r * 0.7**2 / (r**2 + 0.7**2) ** 2).sum() * 1.5 / 4000)
    assert disc_form_factor(0.7, 1.5) == pytest.approx(expected, abs=QUADRATURE)


def test_polygon_with_many_corners_is_a_disc():
    turn = np.linspace(0, 2 * math.pi, 4000, endpoint=False)
    corners = np.stack([np.cos(turn), np.sin(turn), np.full_like(turn, 0.7)], axis=1)
    for order in (1, -1):
        got = polygon_form_factor((0, 0, 0), (0, 0, 1), corners[::order])
        assert got == pytest.approx(disc_form_factor(0.7, 1.0), abs=QUADRATURE)


def test_parallel_rectangles_by_polygons():
    n = 60
    x = (np.arange(n) + 0.5) / n
    corners = [(0, 0, 0.8), (1.3, 0, 0.8), (1.3, 0.6, 0.8), (0, 0.6, 0.8)]
    mean = np.mean([polygon_form_factor((1.3 * u, 0.6 * v, 0), (0, 0, 1), corners) for u in x for v in x])
    assert parallel_rectangles_form_factor(1.3, 0.6, 0.8) == pytest.approx(mean, abs=2e-5)  # midpoint sum of n = 60


def test_wedge_by_crossed_strings():
    for angle in (0.3, 1.0, math.pi / 2, 2.5):
        far = math.dist((1, 0), (math.cos(angle), math.sin(angle)))
        assert wedge_form_factor(angle) == pytest.approx((1 + 1 - far) / 2, abs=1e-15)


def test_discs_are_reciprocal_and_tend_to_the_small_surface():
    a, b = coaxial_discs_form_factor(0.5, 2.0, 1.3), coaxial_discs_form_factor(2.0, 0.5, 1.3)
    assert a * 0.5**2 == pytest.approx(b * 2.0**2, rel=1e-14)
    assert coaxial_discs_form_factor(1e-6, 2.0, 1.3) == pytest.approx(disc_form_factor(1.3, 2.0), rel=1e-10)
