"""Light at subsplats and lists of each light as literal text: integrating sphere, cells by hand, the printed list."""

import math

import numpy as np
import pytest

from refgi.literal import multires, multires_lights
from tests.naive import per_light

RADIUS = 2.0


def sphere(count, seed):
    """Points (3, n) on a sphere and the normals inside it."""
    away = np.random.default_rng(seed).normal(size=(3, count))
    away /= np.linalg.norm(away, axis=0)
    return RADIUS * away, -away


def test_inside_a_sphere_every_subsplat_gets_the_same():
    """Cos cos / r^2 is 1 / (4 R^2) for all pairs: E = sum of fluxes / (4 pi R^2)."""
    flux = np.random.default_rng(1).random((3, 5))
    light = multires_lights.subsplat_irradiance(*sphere(7, 2), *sphere(5, 3), flux)
    expected = flux.sum(axis=1) / (4 * math.pi * RADIUS**2)
    np.testing.assert_allclose(light, np.repeat(expected[:, None], 7, axis=1))


def test_inside_a_sphere_each_light_alone_gives_its_share():
    flux = np.random.default_rng(1).random((3, 4))
    position, normal = (plane.reshape(3, 2, 3) for plane in sphere(6, 2))
    pixels = [np.array([[0, 1, 2], [3, -1, 5]]), np.array([[4, -1]])]
    for pixel, got in zip(pixels, multires_lights.samples(position, normal, pixels, *sphere(4, 3), flux), strict=True):
        expected = np.where(pixel >= 0, flux.T[:, :, None, None] / (4 * math.pi * RADIUS**2), 0)
        np.testing.assert_allclose(got, expected)


def test_points_of_a_cell_by_hand():
    """Three pixels of a cell of 2 x 2: the one right and below of its centre, or their mean."""
    position = np.arange(12.0).reshape(3, 2, 2)
    normal = np.zeros((3, 2, 2))
    normal[0, 0, 1] = normal[1, 1, 0] = normal[1, 1, 1] = 1
    triangle_id, cell = np.array([[-1, 0], [0, 0]]), [np.array([one]) for one in (1, 0, 0, 3)]
    point, up = multires_lights.points(position, normal, triangle_id, *cell, False)
    assert (point[:, 0].tolist(), up[:, 0].tolist()) == ([3, 7, 11], [0, 1, 0])
    point, up = multires_lights.points(position, normal, triangle_id, *cell, True)
    assert point[:, 0].tolist() == [2, 6, 10]
    assert up[:, 0] == pytest.approx(np.array([1, 2, 0]) / math.sqrt(5))


@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize("finest", [0, 1])
def test_lists_are_the_published_ones(relative, finest):
    """Pass by pass, cell by cell (Sec. 3.3.1): irradiance of three lights at pixels, with holes."""
    rng = np.random.default_rng(4)
    shown, top, threshold = rng.random((11, 14)) < 0.8, 3, 0.4
    light = np.cumsum(rng.random((3, 3, 11, 14)) < 0.06, axis=3) * rng.random((3, 3, 1, 1))  # steps along rows
    pixels = multires.representatives(np.where(shown, 0, -1), top)
    samples = [np.where(pixel >= 0, light.reshape(3, 3, -1)[:, :, pixel], 0) for pixel in pixels]
    splits = multires_lights.splits(pixels, samples, finest, threshold,
                                    "relative" if relative else "absolute")
    first, level, row, column, values = multires_lights.lists(pixels, samples, splits)
    for k in range(3):
        expected = per_light.subsplats(shown, lambda at, k=k: light[k][:, *at], top, finest,
                                       lambda largest: threshold * (largest if relative else 1))
        own = slice(first[k], first[k + 1])
        cells = list(zip(level[own].tolist(), row[own].tolist(), column[own].tolist(), strict=True))
        assert cells == sorted(expected, key=lambda cell: (-cell[0], *cell[1:]))
        np.testing.assert_array_equal(values[:, own].T, [expected[cell] for cell in cells])
    assert 0 < splits[top - 1].sum() < splits[top - 1].size
    assert splits[0].any() == (finest == 0)


def test_detail_by_hand():
    """Seen head on, by 4/5, from the side and from behind (Eq. 3)."""
    normal = np.array([[0.0, 0, 1], [0.6, 0, 0.8], [1, 0, 0], [0, 0, -1]]).T[:, None]
    position = np.broadcast_to(np.array([1.0, 2, 3])[:, None, None], normal.shape)
    got = multires_lights.detail(np.ones((3, 1, 4)), position, normal, np.zeros((1, 4)), np.array([[1.0, 2, 8]]), 0.5)
    assert got[1, 0] == pytest.approx([1, 0.9, 0.5, 0.5])
    assert not multires_lights.detail(got, position, normal, np.full((1, 4), -1), np.zeros((1, 3)), 0.5).any()


def test_a_picture_of_half_the_size_by_hand():
    light = np.broadcast_to(np.array([[1.0, 3, 0, 0], [5, 0, 0, 0]]), (3, 2, 4))
    triangle_id = np.array([[0, 0, -1, -1], [0, -1, -1, -1]])
    both, left = np.array([[True, True]]), np.array([[True, False]])
    assert multires_lights.halved(light, triangle_id, both)[2].tolist() == [[3, 3]]  # the right one as its neighbour
    assert multires_lights.halved(light, triangle_id, left)[2].tolist() == [[3, 0]]


def test_subsplats_as_a_picture_of_one_row():
    """Property: a row holds the pixels that stand for subsplats, in their order; light is a row without its axis."""
    random = np.random.default_rng(4)
    position, normal = random.normal(size=(2, 3, 5, 7))
    triangle_id, pixel = np.arange(35).reshape(5, 7) % 4, np.array([33, 2, 17])
    place, up, triangle = multires_lights.one_row(position, normal, triangle_id, pixel)
    for got, plane in ((place, position), (up, normal), (triangle[None], triangle_id[None])):
        assert np.array_equal(got[:, 0], np.stack([plane[:, i // 7, i % 7] for i in pixel], axis=1))
    assert np.array_equal(multires_lights.of_row(place), place.reshape(3, 3))
