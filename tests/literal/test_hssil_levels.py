"""Levels as the papers state them: areas of planes, choices by hand, what means and draws keep."""

import math

import numpy as np
import pytest

from refgi.literal import hssil_levels as literal

FRAME = np.array([[[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]])  # right, down, ahead
MIDPOINT = 2e-4  # of the area: a pixel's surface by the middle of it, 80 x 60 pixels of a slanted plane


def slanted(size, half, n, distance):
    """Return depths of the plane n . x = -distance (m, the eye at 0) at pixel centres."""
    rays = literal.pixel_ray(*(np.indices(size) + 0.5), FRAME, half, size)
    return -distance / np.tensordot(n, rays, 1)


def planes(depth, radiance=1.0):
    """Return a picture of such depths whose surfaces face the camera: depth, normal, albedo, irradiance."""
    ones = np.ones((3, *depth.shape))
    return depth, np.array([0.0, 0, 1])[:, None, None] * ones, ones, math.pi * radiance * ones


@pytest.mark.feature("HSS-02")
def test_areas_add_up_to_that_of_the_plane(evidence):
    """Analytic: the polygon that the four corners of the picture cut out of a plane, by its cross products."""
    size, half, n = (60, 80), np.array([0.6, 0.45]), np.array([0.3, 0.5, 0.8])
    n /= np.linalg.norm(n)
    depth, normal, albedo, light = planes(slanted(size, half, n, 2.0))
    normal[:] = n[:, None, None]
    area = literal.first_level(depth, normal, albedo, light, FRAME, half, 0)[4]
    v, u = np.array([[0.0, 0, 60, 60]]), np.array([[0.0, 80, 80, 0]])
    rays = literal.pixel_ray(v, u, FRAME, half, size)[:, 0]
    corners = (rays * -2.0 / (n @ rays)).T
    exact = sum(np.linalg.norm(np.cross(corners[k] - corners[0], corners[k + 1] - corners[0])) / 2 for k in (1, 2))
    assert area.sum() == pytest.approx(exact, rel=MIDPOINT)
    evidence(f"areas of a slanted plane add up to it within {abs(area.sum() / exact - 1):.0e}")


def test_a_wall_seen_head_on_by_hand():
    """4 x 2 pixels of a 90 degree view 3 m away: 6 x 6 m, of which a pixel shows 1.5 x 3 m."""
    depth, normal, albedo, light = planes(np.full((2, 4), 3.0))
    level = literal.first_level(depth, normal, albedo, light, FRAME, np.ones(2), 1)
    np.testing.assert_allclose(level[4], [[18.0, 18.0]])  # four pixels each
    np.testing.assert_allclose(level[3], 1.0)
    np.testing.assert_array_equal(level[5], [[1, 2]])  # equally near: those beside the centre line, in the upper row
    np.testing.assert_allclose(level[0][:, 0, 0], [-0.75, 1.5, -3.0])
    coarser = literal.coarser_level(*level, 2, (2, 4))
    np.testing.assert_allclose(coarser[4], [[36.0]])


def test_the_closest_of_four_has_its_own_place_and_light():
    depth, normal, albedo, light = planes(np.array([[5.0, 4.0, np.inf], [2.0, 3.0, np.inf]]))
    albedo *= np.arange(6).reshape(2, 3) * np.array([1.0, 2, 0.5])[:, None, None]
    level = literal.first_level(depth, normal, albedo, light, FRAME, np.ones(2), 1)
    assert level[5].tolist() == [[3, -1]]
    assert level[1].tolist() == [[2.0, np.inf]]
    np.testing.assert_allclose(level[3][:, 0, 0], [3.0, 6, 1.5])
    assert not level[0][:, 0, 1].any()


def test_what_is_seen_from_behind_has_no_area():
    depth, normal, albedo, light = planes(np.full((2, 2), 2.0))
    normal *= -1
    assert not literal.first_level(depth, normal, albedo, light, FRAME, np.ones(2), 0)[4].any()


@pytest.mark.feature("HSS-09")
def test_means_keep_flux_and_unit_normals():
    """Property: areas and what they send add up over odd sizes and holes."""
    rng = np.random.default_rng(1)
    depth = np.where(rng.random((7, 9)) < 0.2, np.inf, rng.uniform(1, 3, (7, 9)))
    picture = (depth, *planes(depth)[1:3], rng.random((3, 7, 9)))
    pixels = literal.first_level(*picture, FRAME, np.ones(2), 0)
    level = literal.first_mean(*picture, FRAME, np.ones(2), 1)
    for _ in range(2):
        np.testing.assert_allclose((level[3] * level[4]).sum(axis=(1, 2)), (pixels[3] * pixels[4]).sum(axis=(1, 2)))
        np.testing.assert_allclose((level[2] ** 2).sum(axis=0), np.isfinite(level[1]))
        level = literal.level_of_means(*level)


def test_mean_radiance_is_that_of_all_pixels_whatever_the_levels_between():
    rng = np.random.default_rng(2)
    depth = np.where(rng.random((8, 8)) < 0.3, np.inf, 2.0)
    picture = (depth, *planes(depth)[1:3], rng.random((3, 8, 8)))
    level = literal.first_mean_radiance(*picture, FRAME, np.ones(2), 1)
    for number in (2, 3):
        level = literal.coarser_mean_radiance(*level, number, (8, 8))
    assert level[6].tolist() == [[np.isfinite(depth).sum()]]
    np.testing.assert_allclose(level[3][:, 0, 0], picture[3][:, np.isfinite(depth)].mean(axis=1) / math.pi)


@pytest.mark.feature("HSS-09")
def test_drawn_senders_keep_flux_and_stand_in_its_middle_on_average():
    """Quadrature over u: the mean place of what is sent is the flux's, and radiance times area is kept by each draw."""
    rng = np.random.default_rng(3)
    depth = rng.uniform(1, 3, (2, 2))
    picture = (depth, *planes(depth)[1:3], rng.random((3, 2, 2)))
    pixels = literal.first_level(*picture, FRAME, np.ones(2), 0)
    closest = literal.first_level(*picture, FRAME, np.ones(2), 1)
    flux = pixels[4] * pixels[3].sum(axis=0)
    mean = np.zeros(3)
    for u in (np.arange(4000) + 0.5) / 4000:
        drawn = literal.resampled_level(closest, pixels, np.array([[u]]), 2)
        np.testing.assert_allclose(drawn[4] * drawn[3][:, 0, 0].sum(), flux.sum())
        mean += drawn[0][:, 0, 0] / 4000
    np.testing.assert_allclose(mean, (flux * pixels[0]).sum(axis=(1, 2)) / flux.sum(), rtol=2e-3)


def test_the_closest_of_the_closest_is_the_closest_of_all():
    """Property: with all it has, and the area of all pixels below it, over odd sizes and ties."""
    rng = np.random.default_rng(4)
    depth = np.where(rng.random((11, 13)) < 0.3, np.inf, np.round(rng.uniform(1, 3, (11, 13)) * 4) / 4)
    normal = rng.normal(size=(3, 11, 13)) * 0.2 + np.array([0.0, 0, 1])[:, None, None]
    picture = depth, normal / np.sqrt((normal**2).sum(axis=0)), *rng.random((2, 3, 11, 13))
    level = literal.first_level(*picture, FRAME, np.ones(2), 1)
    for number in (2, 3, 4):
        level = literal.coarser_level(*level, number, (11, 13))
        for one, other in zip(level, literal.first_level(*picture, FRAME, np.ones(2), number), strict=True):
            np.testing.assert_allclose(one, other)


def test_a_mean_by_hand():
    """Areas 1 and 3; normals 60 degrees apart, whose mean is made a unit vector again; a hole beside them."""
    s = math.sqrt(0.75)
    planes_ = (np.array([[[0.0, 4, 0]]] * 3), np.array([[2.0, 6, np.inf]]), np.array([[[0, s, 0]], [[0.0, 0, 0]],
               [[1, 0.5, 0]]]), np.array([[[8.0, 4, 0]]] * 3), np.array([[1.0, 3, 0]]))
    place, depth, normal, radiance, area = literal.level_of_means(*planes_, 2)
    assert area.tolist() == [[4.0, 0.0]]
    assert depth.tolist() == [[5.0, np.inf]]
    np.testing.assert_allclose(place[0], [[3.0, 0.0]])
    np.testing.assert_allclose(radiance[0], [[5.0, 0.0]])
    mean = np.array([3 * s, 0, 2.5])
    np.testing.assert_allclose(normal[:, 0, 0], mean / np.linalg.norm(mean))
