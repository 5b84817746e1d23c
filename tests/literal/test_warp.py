"""The literal warp against densities, Eq. 4 to 6 by hand, and the paper's claims about methods A and B."""

import numpy as np
import pytest

from refgi.literal.warp import halve, mip, warp

ROUNDING = 1e-12
STANDARD_ERRORS = 4.0  # one in 16,000 means of unbiased estimates is farther off


def uneven(height, width, dark=0.2):
    rng = np.random.default_rng(3)
    field = rng.exponential(1.0, (height, width)) ** 2
    field[rng.random(field.shape) < dark] = 0
    return field


def values(points, plane):
    row, column = ((points[:, k] * size).astype(int) for k, size in ((1, plane.shape[0]), (0, plane.shape[1])))
    return plane[row, column]


def test_halves_by_hand():
    x = np.array([0.1, 0.25, 0.7])
    half, place, factor = halve(x, np.ones(3), np.full(3, 3.0), np.full(3, 0.5))  # r = 1/4
    np.testing.assert_array_equal(half, [0, 1, 1])
    np.testing.assert_allclose(place, [0.4, 0, 0.6])
    np.testing.assert_allclose(factor, [2, 2 / 3, 2 / 3])
    half, place, factor = halve(np.array([0.3, 0.8]), np.zeros(2), np.zeros(2), np.full(2, 0.5))
    np.testing.assert_allclose([half, place, factor], [[0, 1], [0.6, 0.6], [1, 1]])  # E-SII-07: nothing moves


@pytest.mark.parametrize(("height", "width"), [(8, 8), (5, 7), (1, 3)])
def test_cells_hold_the_sums_of_their_texels(height, width):
    field = uneven(height, width)
    for level, sums in enumerate(mip(field)):
        rows, columns = ([k * size >> level for k in range((1 << level) + 1)] for size in (height, width))
        expected = [[field[rows[i] : rows[i + 1], columns[j] : columns[j + 1]].sum() for j in range(1 << level)]
                    for i in range(1 << level)]
        np.testing.assert_allclose(sums, expected)


@pytest.mark.parametrize(("height", "width", "maps"), [(16, 16, 1), (7, 5, 1), (12, 6, 2)])
def test_down_to_the_texels_method_a_has_no_variance(height, width, maps):
    """E-SII-06: every weight times the importance that it finds is the mean."""
    field = uneven(height, width)
    points, weights = warp(np.random.default_rng(1).random((200, 2)), field, maps, 9, "A")
    np.testing.assert_allclose(weights * values(points, field), field.mean(), rtol=ROUNDING)


@pytest.mark.parametrize("levels", [1, 2, 4])
def test_weights_of_method_a_are_one_over_the_share_of_a_cell(levels):
    field = uneven(16, 16)
    points, weights = warp(np.random.default_rng(2).random((200, 2)), field, 1, levels, "A")
    cell = 16 >> levels
    means = field.reshape(1 << levels, cell, 1 << levels, cell).mean(axis=(1, 3))
    np.testing.assert_allclose(weights, field.mean() / values(points, means), rtol=ROUNDING)


@pytest.mark.parametrize("method", ["A", "B"])
@pytest.mark.parametrize("maps", [1, 2])
def test_the_estimate_is_unbiased(method, maps):
    field, wanted = uneven(14, 7, dark=0.0), np.random.default_rng(4).random((14, 7))
    points, weights = warp(np.random.default_rng(5).random((20_000, 2)), field, maps, 2, method)
    found = weights * values(points, wanted)
    assert abs(found.mean() - wanted.mean()) < STANDARD_ERRORS * found.std() / np.sqrt(len(found))


def test_method_b_cannot_see_a_diagonal():
    """E-SII-08: marginals of a diagonal are even; half of the points fall on nothing."""
    field, points = np.eye(2), np.random.default_rng(6).random((1000, 2))
    a, weights_a = warp(points, field, 1, 1, "A")
    b, weights_b = warp(points, field, 1, 1, "B")
    np.testing.assert_array_equal(values(a, field), 1)
    np.testing.assert_array_equal(weights_a, 0.5)
    assert 0.4 < values(b, field).mean() < 0.6
    np.testing.assert_array_equal(weights_b, 1)


def test_top_is_where_v_is_small():
    """E-SII-05: with all flux in the upper rows all points go there, and into the right one of two columns."""
    points, _ = warp(np.random.default_rng(7).random((100, 2)), np.array([[0.0, 1.0], [0.0, 0.0]]), 1, 1, "A")
    assert (points[:, 1] < 0.5).all()
    assert (points[:, 0] >= 0.5).all()
