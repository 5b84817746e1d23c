"""Literal gathering against areas of discs, places by hand, and linear pictures."""

import math

import numpy as np
import pytest

from refgi.literal.gather import all_maps, centers, disc_sum, disc_texels, interpolate, pattern
from refgi.literal.lights import halton_points
from refgi.literal.pairs import pairs

XI = halton_points([4000], np.zeros((1, 2)), 0)
UP = np.array([[0.0], [0.0], [1.0]])


@pytest.mark.parametrize("squared", [False, True])
def test_weights_have_the_area_of_the_disc_as_mean(squared):
    offset, weight = pattern(XI, squared)
    assert weight.mean() == pytest.approx(math.pi, rel=2e-3)
    np.testing.assert_allclose((offset**2).sum(axis=1), XI[:, 0] ** 2)


def test_weights_make_the_samples_even():
    """The second moment of a disc of radius 1 is pi / 4 along either axis."""
    offset, weight = pattern(XI)
    np.testing.assert_allclose((weight[:, None] * offset**2).mean(axis=0), math.pi / 4, rtol=5e-3)
    np.testing.assert_allclose((weight[:, None] * offset).mean(axis=0), 0, atol=2e-3)


def place(x, y, z, **view):
    view = {"origin": np.zeros((1, 3)), "frame": np.eye(3)[None], "half": np.array([1.0, 0.5]), "rows": 8,
            "columns": 12, "kind": "perspective"} | view
    center, depth = centers(np.reshape([x, y, z], (3, 1, 1)), np.zeros((1, 1), int), **view)
    return (*center.ravel().tolist(), float(depth.item()))


def test_places_on_a_map_by_hand():
    assert place(1.0, -0.5, 2.0) == pytest.approx((2.0, 9.0, 2.0))  # down -1/4 of 1/2, right 1/2 of 1
    assert place(6.0, 1.5, 2.0) == pytest.approx((6.0, 12.0, math.inf))  # (3, 1.5) in halves: on the way at (1, 0.5)
    assert place(0.5, 0.125, -1.0) == pytest.approx((6.0, 12.0, math.inf))  # behind: as far out as can be
    assert place(0.5, -0.25, 9.0, kind="orthographic") == pytest.approx((2.0, 9.0, 9.0))
    side = {"kind": "paraboloid", "half": np.ones(2)}
    assert place(3.0, 0.0, 4.0, **side) == pytest.approx((4.0, 8.0, 5.0))  # 3 / (5 + 4)
    assert place(1.0, -1.0, -1.0, **side) == pytest.approx((0.0, 12.0, math.inf))  # behind


def test_of_stacked_maps_the_one_that_sees_a_point_counts():
    turned = np.stack([np.eye(3), np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])])
    two = {"origin": np.zeros((2, 3)), "frame": turned, "half": np.ones(2)}
    assert place(-2.0, 0.5, 1.0, **two) == pytest.approx((8 + 5.0, 9.0, 2.0))  # z = 2: right 1/2, down 1/4


def test_without_surface_there_is_neither_place_nor_texel():
    center, depth = centers(np.ones((3, 1, 1)), np.full((1, 1), -1), np.zeros((1, 3)), np.eye(3)[None], np.ones(2), 8,
                            8, "perspective")
    assert center.tolist() == [[[0]], [[0]]]
    assert depth == math.inf
    assert disc_texels(center, np.zeros((1, 2)), np.full((1, 1), -1), 0.5, 1, 8, 8) == -1


def test_texels_of_a_disc_by_hand():
    offset = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)])
    texel = disc_texels(np.array([[[2.5]], [[3.9]]]), offset, np.zeros((1, 1), int), 0.25, 2, 8, 8)
    np.testing.assert_array_equal(texel[:, 0, 0], [2 * 8 + 3, 4 * 8 + 3, 2 * 8 + 1, 0 * 8 + 3])
    assert disc_texels(np.array([[[0.5]], [[7.5]]]), offset[1:2, ::-1], np.zeros((1, 1), int), 0.25, 2, 8, 8) == -1


def test_a_disc_of_equal_texels_gives_its_area_in_texels():
    """All texels lie at one place: E = pi R^2 T times the light of one."""
    offset, weight = pattern(XI)
    x, n = np.array([0.3, 0.0, 2.0]).reshape(3, 1, 1), -UP[:, :, None]
    flux, ones = np.ones((3, 64, 64)), np.ones((1, 64, 64))
    texel = disc_texels(np.array([[[32.5]], [[30.0]]]), offset, np.zeros((1, 1), int), 0.4, 1, 64, 64)
    total = disc_sum(x, n, np.zeros((1, 1), int), texel, weight, 0 * flux, UP[:, :, None] * ones, flux, 0.4, 64 * 64)
    one = pairs(x[:, :, 0, None], n[:, :, 0, None], np.zeros((3, 1)), UP, np.ones((3, 1)))
    np.testing.assert_allclose(total.ravel(), math.pi * 0.16 * 64**2 * one.ravel(), rtol=2e-3)
    outside = disc_sum(x, n, np.zeros((1, 1), int), 0 * texel - 1, weight, 0 * flux, UP[:, :, None] * ones, flux, 0.4,
                       64 * 64)
    assert not outside.any()
    np.testing.assert_allclose(all_maps([total, total]), 2 * total)


def test_a_linear_picture_is_interpolated_on_a_plane_and_kept_across_an_edge():
    row, column = np.mgrid[:12, :16].astype(float)
    position, ids = np.stack([column, row, 0 * row]), np.zeros((12, 16), int)
    normal = np.where(column < 8, 1.0, 0.0) * UP[:, :, None] + np.where(column < 8, 0.0, 1.0) * UP[::-1, :, None]
    light, box = np.stack([row + 2 * column, row, column]), (np.zeros(3), np.array([15.0, 11.0, 0.0]))
    chosen, made = interpolate(position, np.ones((1, 12, 16)) * UP[:, :, None], ids, light, box, 4, 0.9, 1.0)
    inside = np.s_[:, 1:10, 2:14]  # between the outermost coarse pixels
    np.testing.assert_allclose(made[inside], light[inside])
    assert chosen.all()
    halves = np.where(column < 8, 1.0, 2.0) * np.ones((3, 1, 1))
    chosen, made = interpolate(position, normal, ids, halves, box, 4, 0.9, 1.0)
    np.testing.assert_allclose(made, halves)
    assert not chosen[5, [7, 8]].any()
    chosen, _ = interpolate(position, normal, ids, light, box, 4, -1.0, 1e-6)
    assert chosen.sum() == 16  # the coarse pixels alone
