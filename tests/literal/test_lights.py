"""Literal pixel lights against numbers by hand, published sequences and closed forms."""

import math

import numpy as np
import pytest

from refgi.literal.lights import (
    BELOW_1,
    footprints,
    grid_points,
    halton_points,
    importance,
    pixel_lights,
    radical_inverse,
    texels,
)


def test_importance_by_hand():
    flux, lobe = np.reshape([1.0, 2.0, 4.0], (3, 1, 1)), np.reshape([0.0, 3.0, 0.0], (3, 1, 1))
    exponent = np.array([[9.0]])
    assert importance(flux) == 4
    assert importance(flux, lobe, exponent) == 5  # 2 + 3 of green
    assert importance(flux, lobe, exponent, peaked=True) == 17  # 2 + (9 + 1) / 2 * 3
    assert importance(flux, openness=np.array([[0.75]])) == 1
    assert importance(flux, openness=np.array([[1.0]])) == pytest.approx(0.2)  # the floor of 0.05


def test_points_are_the_published_sequence():
    points = halton_points([9, 5], np.zeros((2, 2)), 1)
    np.testing.assert_allclose(points, [(0, 0), (1 / 2, 1 / 3), (1 / 4, 2 / 3), (3 / 4, 1 / 9), (1 / 8, 4 / 9)])
    assert radical_inverse(np.array([6, 11, 24]), 5).tolist() == pytest.approx([6 / 25, 7 / 25, 24 / 25])
    shifted = halton_points([4], np.array([[0.5, 0.25]]), 0)
    np.testing.assert_allclose(shifted[1], (0, 7 / 12))
    assert halton_points([2], np.array([[0.5 - 1e-12, 0.0]]), 0)[1, 0] == BELOW_1


def test_centres_of_cells_fall_on_each_texel_once():
    points = grid_points(5)
    np.testing.assert_allclose(points[:6, 0], [0.1, 0.3, 0.5, 0.7, 0.9, 0.1])
    chosen, weight = texels(points, [25], 0, 1, 5, 5)
    np.testing.assert_array_equal(chosen, np.arange(25))
    np.testing.assert_array_equal(weight, 1)


def test_texels_and_weights_by_hand():
    points = np.array([(0.0, 0.0), (0.49, 0.5), (BELOW_1, BELOW_1)])
    chosen, weight = texels(points, [7, 3], 1, 2, 3, 4, np.array([1.0, 2.0, 0.5]))  # 2 maps of 3 rows and 4 columns
    np.testing.assert_array_equal(chosen, [0, 3 * 4 + 1, 5 * 4 + 3])
    np.testing.assert_allclose(weight, [8, 16, 4])  # T / N = 24 / 3


def test_lights_of_two_maps_by_hand():
    first, second = np.arange(12.0).reshape(3, 2, 2), 100 + np.arange(18.0).reshape(3, 2, 3)
    dark = first.copy()
    dark[:, 0, 1] = 0
    p, m, phi, texel, number = pixel_lights(
        [np.array([3, 1, 0]), np.array([5, 5])], [np.full(3, 2.0), np.array([1.0, 3.0])], [first, second],
        [-first, -second], [dark, second])
    np.testing.assert_array_equal(texel, [3, 0, 5, 5])  # texel 1 of the first map is dark
    np.testing.assert_array_equal(number, [0, 0, 1, 1])
    np.testing.assert_array_equal(p, np.transpose([(3, 7, 11), (0, 4, 8), (105, 111, 117), (105, 111, 117)]))
    np.testing.assert_array_equal(m, -p)
    np.testing.assert_array_equal(phi, p * [2, 2, 1, 3])


def test_lights_of_pure_lobes_are_kept():
    plane, none = np.ones((3, 1, 2)), np.zeros((3, 1, 2))
    lobe = none.copy()
    lobe[1, 0, 1] = 5
    made = pixel_lights([np.array([0, 1])], [np.array([4.0, 4.0])], [plane], [plane], [none], [lobe], [plane],
                        [np.array([[7.0, 9.0]])])
    assert made[2].tolist() == [[0], [0], [0]]
    assert made[3].tolist() == [[0], [20], [0]]
    assert made[5].tolist() == [9]
    assert made[6].tolist() == [1]


def seen_floor(side, tilt=0.0):
    """Return texels, places and solid angles of a map of 90 degrees that looks down on a floor 2 m below."""
    edges = np.linspace(-1, 1, side + 1)
    x0, y0 = np.meshgrid(edges[:-1], edges[:-1])
    x1, y1 = np.meshgrid(edges[1:], edges[1:])

    def corner(x, y):
        return np.arctan2(x * y, np.sqrt(1 + x**2 + y**2))

    angle = corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0)
    x, y = (x0 + x1).ravel(), (y0 + y1).ravel()  # of the centres, 2 m below
    return angle, np.stack([x, y, -2 - math.tan(tilt) * x])


def test_footprints_of_a_map_add_up_to_the_floor_that_it_sees():
    angle, place = seen_floor(64)
    texel, up = np.arange(64 * 64), np.tile([[0.0], [0.0], [1.0]], 64 * 64)
    area = footprints(place, up, texel, 0 * texel, [angle], [texel], [np.full(64 * 64, 1.0)], [np.zeros(3)], [True])
    assert area.sum() == pytest.approx(16, rel=2e-4)  # 4 m by 4 m
    half = footprints(place[:, ::2], up[:, ::2], texel[::2], 0 * texel[::2], [angle], [texel[::2]],
                      [np.full(64 * 32, 2.0)], [np.zeros(3)], [True])
    assert half.sum() == pytest.approx(16, rel=1e-3)


def test_footprints_of_a_directional_lamp_are_larger_by_the_slant():
    place, normal = np.zeros((3, 2)), np.array([[0.0, 0.6], [0.0, 0.0], [1.0, 0.8]])
    area = footprints(place, normal, np.array([1, 1]), np.array([0, 0]), [np.array([[0.5, 0.25]])], [np.array([1])],
                      [np.array([3.0])], [np.array([0.0, 0.0, -5.0])], [False])
    np.testing.assert_allclose(area, [0.75, 0.75 / 0.8])
