"""Literal filters: linear functions and edges in closed form, subsets of lights counted."""

import numpy as np
import pytest

from refgi.literal.val_filters import (
    blur,
    box_means,
    disc_means,
    halved,
    mip_levels,
    mip_means,
    overlap,
    places_of_subset,
)

CLOSE = 1e-12


def sheet(n, *functions):
    """Return channels (1, C, n, n) that are functions of s and t at texel centres."""
    at = (np.arange(n) + 0.5) * 2 / n - 1
    s, t = np.meshgrid(at, at)
    return np.stack([f(s, t) + 0 * s for f in functions])[None]


def plane(s, t):
    return 0.3 + 0.2 * s - 0.4 * t


def discs(count=40, wide=0.4, seed=2):
    """Return discs within the map, (1, 3, 1, count)."""
    random = np.random.default_rng(seed)
    return np.stack([*random.uniform(-0.5, 0.5, (2, count)), random.uniform(0, wide, count)])[None, :, None]


def by_levels(basis, region):
    return mip_means(np.ones((1, *region.shape[2:]), bool), region, 1, True, [basis, *mip_levels(basis)])


def test_a_level_is_half_of_the_one_before():
    """By hand: of 3 x 3 texels the last row and column count twice."""
    level = np.arange(9.0).reshape(1, 1, 3, 3)
    np.testing.assert_allclose(halved(level)[0, 0], [[2, 3.5], [6.5, 8]])
    assert [one.shape[2] for one in mip_levels(level)] == [2, 1]
    even = np.random.default_rng(1).random((2, 5, 16, 16))
    np.testing.assert_allclose(mip_levels(even)[-1][..., 0, 0], even.mean(axis=(2, 3)))


def right(s, t):
    return (s > 0) + 0.0 * t


def test_levels_read_a_plane_at_the_middle_of_a_disc():
    region = discs()
    found = by_levels(sheet(64, *[plane] * 5), region)
    np.testing.assert_allclose(found[0, :, 0], np.tile(plane(*region[0, :2, 0]), (5, 1)), atol=CLOSE)


@pytest.mark.parametrize("radius", [1 / 16, 1 / 8, 1 / 4])
def test_an_edge_between_texels_is_a_ramp(radius):
    """As wide as a square, and as a texel of the level read, which is half of the disc's diameter."""
    at = np.linspace(-0.6, 0.6, 101)
    basis, region = sheet(64, *[right] * 5), np.stack([at, 0 * at, 0 * at + radius])[None, :, None]
    found = by_levels(basis, region)[0, 0, 0]
    np.testing.assert_allclose(found, np.clip(0.5 + at / radius, 0, 1), atol=CLOSE)
    found = box_means(np.ones((1, 1, 101), bool), region, 1, False, basis)[0, 1, 0]
    np.testing.assert_allclose(found, np.clip(0.5 + at / (2 * radius), 0, 1), atol=CLOSE)


def test_an_interval_holds_parts_of_texels():
    np.testing.assert_allclose(overlap(np.array([2.25]), np.array([1.0]), 4), [[0, 0.75, 1, 0.25]])
    np.testing.assert_allclose(overlap(np.array([-3.0]), np.array([1.5]), 4), [[1, 0.5, 0, 0]])


def test_discs_take_texels_by_their_centres():
    basis = sheet(8, *[right] * 5)
    region = np.array([[0, 0, 0.3], [0.3, 0.1, 0.01], [-1, 0, 0.6]]).T[None, :, None]
    found = disc_means(np.array([[[True, True, False]]]), region, 1, False, basis)
    assert found[0, :, 0].tolist() == [[0.5, 1, 0], [0.5, 1, 0]]


def picture(h=13, w=17, step=0):
    """Return position and normal of a floor, lower by `step` from column 9 on, and triangle ids."""
    y, x = np.mgrid[:h, :w].astype(float)
    return np.stack([x, y, -step * (x >= 9)]), np.stack([0 * x, 0 * x, 1 + 0 * x]), np.zeros((h, w), int)


def subsets(h, w, n):
    return np.tile(((np.arange(h) % n)[:, None] * n + np.arange(w) % n).astype(float), (3, 1, 1))


@pytest.mark.parametrize("n", [2, 3, 4])
@pytest.mark.parametrize("every_subset", [False, True])
def test_each_subset_counts_once(n, every_subset):
    """E-VAL-13: also at the rim of the picture; beside a straight edge where missing ones are looked for."""
    position, normal, ids = picture()
    box = np.array([[0.0, 0, 0], [17, 13, 0]])
    found = blur(subsets(13, 17, n), position, normal, ids, box, n, 1.0, 0.8, every_subset)
    np.testing.assert_allclose(found, (n * n - 1) / 2)
    position, normal, ids = picture(step=100)
    found = blur(subsets(13, 17, n), position, normal, ids, box, n, 1.0, 0.8, every_subset)
    assert (np.abs(found - (n * n - 1) / 2).max() < CLOSE) == every_subset


def test_other_surfaces_do_not_count():
    """Irradiance 1 left of an edge and 3 right of it stays, whether the places or the normals differ."""
    position, normal, ids = picture(step=100)
    values = np.where(position[0] < 9, 1.0, 3.0) + np.zeros((3, 1, 1))
    box = np.array([[0.0, 0, 0], [17, 13, 0]])
    assert np.array_equal(blur(values, position, normal, ids, box, 4, 1.0, 0.8), values)
    flat, turned = picture()[0], np.where(position[0] < 9, normal, normal[[2, 0, 1]])
    assert np.array_equal(blur(values, flat, turned, ids, box, 4, 1.0, 0.8), values)
    assert not np.array_equal(blur(values, flat, normal, ids, box, 4, 1.0, 0.8), values)
    ids[2, 3] = -1
    assert not blur(values, flat, normal, ids, box, 4)[:, 2, 3].any()


def test_pixels_of_a_subset_lie_n_apart():
    places = places_of_subset(-1, 1, 3)
    assert places[0] == (-1, 1)
    assert len(set(places)) == 9
    assert {(v % 3, u % 3) for v, u in places} == {(2, 1)}
    assert places[1:3] == [(-1, -2), (2, 1)]
