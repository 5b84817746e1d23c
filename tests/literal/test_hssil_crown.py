"""Crown samples as the paper states them: closed forms of discs, areas of crowns, sets by brute force."""

import math

import numpy as np
import pytest

from refgi.literal import hssil_crown as literal


def test_steps_are_powers_of_the_plastic_number():
    g = 1 / literal.FIRST_STEP
    assert g**3 == pytest.approx(g + 1, rel=1e-15)
    assert abs(literal.SECOND_STEP * g**2 - 1) < 1e-15


@pytest.mark.feature("HSS-04")
@pytest.mark.parametrize("radius", [0.01, 0.5, 3.0])
def test_a_disc_that_faces_the_receiver_has_its_closed_form(radius):
    """Analytic: E = pi L sin^2 of the angle that a disc on the axis is seen under; Eq. 3 is its limit afar."""
    x, n, y = np.zeros((3, 1)), np.array([[0.0], [0], [1]]), np.array([[0.0], [0], [2.0]])
    ds = np.array([math.pi * radius**2])
    exact = math.pi * math.sin(math.atan2(radius, 2.0)) ** 2
    assert literal.disc_form_factor(x, n, y, -n, ds)[0] == pytest.approx(exact, rel=1e-14)
    point = literal.point_form_factor(x, n, y, -n, ds)[0]
    assert point == pytest.approx(ds[0] / 4, rel=1e-14)
    assert point == pytest.approx(exact, rel=1.01 * radius**2 / 4)


def test_slanted_samples_have_both_cosines_by_hand():
    """45 degrees at the receiver, 60 at the sender, sqrt 2 m apart."""
    x, n = np.zeros((3, 1)), np.array([[0.0], [0], [1]])
    y = np.array([[1.0], [0], [1]])
    away = -y / math.sqrt(2)
    m = 0.5 * away + math.sqrt(0.75) * np.array([[0.0], [1], [0]])
    ds = np.array([1e-9])
    for form in (literal.disc_form_factor, literal.point_form_factor):
        assert form(x, n, y, m, ds)[0] == pytest.approx(1e-9 * math.sqrt(0.5) * 0.5 / 2, rel=1e-8)


def test_discs_of_a_share_lie_between_disc_and_points():
    """Analytic: with k discs of 1/k of the surface each the closed form of the small disc, k times."""
    x, n, y = np.zeros((3, 1)), np.array([[0.0], [0], [1]]), np.array([[0.0], [0], [1.0]])
    area, texels = np.array([0.3]), np.array([8.0])
    found = literal.shared_disc_form_factor(x, n, y, -n, area, texels, 0.25)[0]
    square = 2 * 0.3 / math.pi  # R^2 of two texels
    assert found == pytest.approx(4 * math.pi * square / (1 + square))
    assert literal.shared_disc_form_factor(x, n, y, -n, area, np.array([0.5]), 0.25)[0] == pytest.approx(
        literal.disc_form_factor(x, n, y, -n, 0.5 * area)[0])


@pytest.mark.feature("HSS-05")
@pytest.mark.parametrize("density", ["uniform", "inverse_distance"])
def test_weights_are_the_areas_of_disc_and_crown(density):
    """Analytic, of a disc's pi r^2 and a crown's 3 pi r^2: exact, or as the mean of many points."""
    radius, inner, crown = 40.0, 4000, 8000
    points = literal.sample_points(inner, crown)
    offsets, weight = literal.crown_samples(points, np.array([[[0.3, 0.6]]]), inner, radius, density)
    far, weight = np.hypot(*offsets[0, 0].T), weight[0, 0]
    assert weight[:inner].sum() == pytest.approx(math.pi * radius**2, rel=2e-3)
    assert weight[inner:].sum() == pytest.approx(3 * math.pi * radius**2, rel=2e-3)
    assert far[:inner].max() < radius + 1
    assert far[inner:].min() > radius - 1
    assert far[inner:].max() < 2 * radius + 1
    inside = {"uniform": 0.5, "inverse_distance": math.sqrt(0.5)}[density]  # of the disc's points, by r / sqrt(2)
    assert (far[:inner] < radius * math.sqrt(0.5)).mean() == pytest.approx(inside, abs=0.02)
    # a quarter of the turn has a quarter of the crown
    right, down = offsets[0, 0, inner:].T
    assert weight[inner:][(right > 0) & (down > 0)].sum() == pytest.approx(0.75 * math.pi * radius**2, rel=0.03)


def test_texels_of_a_tile_share_out_one_sequence():
    """Property: the shifted points of all texels of a tile are consecutive points of the sequence, each once."""
    crown, start = 5, (0.1, 0.2)
    points, shifts = literal.points_and_shifts(start, 0, crown, 3, 3)
    u = np.sort(((points[:, 0] + shifts[..., :1]) % 1).reshape(-1))
    np.testing.assert_allclose(u, np.sort((0.6 + np.arange(9 * crown) / 1.324717957244746) % 1), atol=1e-12)


def test_all_texels_by_brute_force():
    offsets, weight = literal.every_texel(3.0, 6.0)
    square = [(x, y) for x in range(-9, 10) for y in range(-9, 10) if 9 <= x * x + y * y < 36]
    assert sorted(map(tuple, offsets[0, 0].tolist())) == sorted(square)
    assert (weight == 1).all()
    assert len(literal.every_texel(0.0, 5.0)[0][0, 0]) == 68  # 69 points of the lattice at less than 5, one the middle


@pytest.mark.feature("HSS-10")
@pytest.mark.parametrize(("inner", "crown"), [(4, 6), (3, 7), (0, 1)])
def test_fixed_sets_are_their_own_mirror_image(inner, crown):
    offsets, weight = literal.mirrored_samples((0.4, 0.7), inner, crown, 5.0, "uniform")
    here = sorted((x, y, w) for (x, y), w in zip(offsets[0, 0].tolist(), weight[0, 0].tolist(), strict=True))
    assert here == sorted((-x, y, w) for x, y, w in here)
    assert weight.sum() == pytest.approx(math.pi * 25 * ((inner > 0) + 3))


@pytest.mark.feature("HSS-03")
def test_two_texels_light_each_other_by_hand():
    """Two walls 2 m apart that face each other; what is outside or the texel itself gives nothing."""
    position = np.array([[[-1.0, 1.0]], [[0, 0]], [[0, 0]]])
    normal, radiance = -position, np.array([[[3.0, 5.0]], [[1, 2]], [[4, 7]]])
    offsets = np.array([[1, 0], [-1, 0], [0, 0], [0, 1], [-2, 0], [2, 0]]).reshape(1, 1, 6, 2)
    weight, area = np.array([2.0, 3, 4, 5, 6, 7]).reshape(1, 1, 6), np.array([[0.25, 0.5]])
    found = literal.gather(position, normal, radiance, area, offsets, weight)
    disc = np.array([2 * 0.5, 3 * 0.25]) / math.pi
    np.testing.assert_allclose(found[:, 0], radiance[:, 0, ::-1] * math.pi * disc / (4 + disc))


def test_what_faces_away_gives_nothing():
    x, n, y = np.zeros((3, 1)), np.array([[0.0], [0], [1]]), np.array([[0.0], [0], [2.0]])
    for up, other in ((n, n), (-n, -n), (-n, n)):
        for form in (literal.disc_form_factor, literal.point_form_factor):
            assert form(x, up, y, other, np.ones(1))[0] == 0


def test_a_sample_by_hand():
    """u = 1/4 + 1/2, a turn of 1/4 + 1/12: 120 degrees from the right, downwards; E-HSS-06: 3 pi r^2 texels or less."""
    points, shifts = np.array([[0.25, 0.0, 1.0]]), np.array([[[0.5, 1 / 12]]])
    far = 4 * math.sqrt(1 + 3 * 0.75)
    expected = [math.floor(far * math.cos(2 * math.pi / 3) + 0.5), math.floor(far * math.sin(2 * math.pi / 3) + 0.5)]
    offsets, weight = literal.crown_samples(points, shifts, 0, 4.0, "uniform")
    assert offsets[0, 0, 0].tolist() == expected == [-4, 6]
    assert weight[0, 0, 0] == pytest.approx(48 * math.pi)
    offsets, weight = literal.crown_samples(points, shifts, 0, 4.0, "inverse_distance")
    assert offsets[0, 0, 0].tolist() == [-3, 6]  # 7 texels away
    assert weight[0, 0, 0] == pytest.approx(56 * math.pi)
    offsets, weight = literal.crown_samples(points, shifts, 1, 4.0, "inverse_distance")
    assert offsets[0, 0, 0].tolist() == [-1, 3]  # 3 texels away
    assert weight[0, 0, 0] == pytest.approx(24 * math.pi)


def test_points_and_shifts_by_hand():
    """Texel (1, 2) of 2 x 3 is the sixth: 5 crowns of 4 points further on."""
    points, shifts = literal.points_and_shifts((0.1, 0.2), 2, 4, 2, 3)
    g = 1.324717957244746
    turn = 2 * math.pi * (0.5 + 3 / g**2)
    np.testing.assert_allclose(points[5], [(0.5 + 3 / g) % 1, math.cos(turn), math.sin(turn)])
    np.testing.assert_allclose(shifts[1, 2], [(0.1 + 20 / g) % 1, (0.2 + 20 / g**2) % 1])
    np.testing.assert_allclose(shifts[0, 0], [0.1, 0.2])
    np.testing.assert_allclose(shifts[1, 0], [(0.1 + 12 / g) % 1, (0.2 + 12 / g**2) % 1])


def test_sets_in_their_order_by_hand():
    pairs = [(1, -1), (-1, -1), (1, 0), (-1, 0), (1, 1), (-1, 1)]
    assert list(map(tuple, literal.every_texel(0.0, 2.0)[0][0, 0].tolist())) == [*pairs, (0, -1), (0, 1)]
    # u = 0.6, v = 0.7: 8.37 texels away at 36 degrees; then u = 0.355, v = 0.27, straight above
    offsets, weight = literal.mirrored_samples((0.1, 0.2), 0, 3, 5.0, "uniform")
    assert offsets[0, 0].tolist() == [[7, 5], [-7, 5], [0, -7]]
    np.testing.assert_allclose(weight, 25 * math.pi)
    weight = literal.mirrored_samples((0.1, 0.2), 0, 3, 5.0, "inverse_distance")[1]
    np.testing.assert_allclose(weight[0, 0, :2], 2 * math.pi * 5 * 8 / 3)  # 5 (1 + 0.6) texels away


def test_receivers_read_the_samples_of_their_place_in_the_tile():
    """A tile of 2 x 2 texels that look right, left, down and up on 3 x 3: nothing wraps round."""
    offsets = np.array([[[[1, 0]], [[-1, 0]]], [[[0, 1]], [[0, -1]]]])
    i, j, texels = literal.samples_at((3, 3), offsets, np.arange(1.0, 5).reshape(2, 2, 1))
    assert texels[..., 0].tolist() == [[1, 2, 0], [3, 4, 3], [1, 2, 0]]
    assert (i[0, 0, 0], j[0, 0, 0], i[1, 0, 0], j[1, 0, 0]) == (0, 1, 2, 0)


def test_a_sender_that_leans_shrinks_its_disc_on_both_sides_of_the_fraction():
    """60 degrees at the sender: R^2 = ds / (2 pi) above and below."""
    x, n, y = np.zeros((3, 1)), np.array([[0.0], [0], [1]]), np.array([[0.0], [0], [1.0]])
    m = np.array([[math.sqrt(0.75)], [0], [-0.5]])
    square = 3.0 * 0.5 / math.pi
    found = literal.disc_form_factor(x, n, y, m, np.array([3.0]))[0]
    assert found == pytest.approx(math.pi * square / (1 + square))
