"""The literal range of pixel lights against the law of its loss, published ellipsoids and counts."""

import math

import numpy as np
import pytest

from refgi.literal import pairs
from refgi.literal.sii import (
    ellipsoids,
    kept,
    low_irradiance,
    peaks,
    reference_length,
    sii,
    squares,
    stored_lights,
    stored_surface,
    strengths,
)
from tests.naive import storage

UP = np.array([[0.0], [0.0], [1.0]])
PRINTED = 0.5e-3  # E-SII-13 and E-SII-15 give three digits


def plane(distance, radius, count=4000):
    """Return points on a line out of the axis of a light, facing it, and the area of their rings."""
    edges = np.linspace(0, radius, count + 1)
    rho = (edges[1:] + edges[:-1]) / 2
    position = np.stack([rho, 0 * rho, 0 * rho + distance])[:, None]
    return position, -np.repeat(UP, count, axis=1)[:, None], np.zeros((1, count), int), np.pi * np.diff(edges**2)


@pytest.mark.parametrize(("share", "loss"), [(0.01, 0.046), (0.05, 0.136), (0.1, 0.215)])
def test_a_cut_loses_the_printed_share_of_a_diffuse_light(share, loss):
    """E-SII-15: (D / R_0)^(2 (n + 1) / (n + 2)) of the flux that arrives on a plane at D = 1 m."""
    position, normal, ids, area = plane(1.0, 12.0)
    light = np.zeros((3, 1)), UP, np.full((3, 1), math.pi)
    b = strengths(position, normal, ids, *light)
    low = low_irradiance(np.ones(1), peaks(*light[1:]), share=share)
    assert low == pytest.approx(share)  # I_0 = 1 W/sr
    counts = kept(low, b)
    captured = (pairs.irradiance(position, normal, ids, *light)[0, 0] * counts[0, 0] * area).sum() / math.pi
    assert 1 - captured == pytest.approx(loss, abs=PRINTED)
    assert 1 - captured == pytest.approx(share ** (0.5 * 4 / 3), abs=PRINTED)


def test_on_its_axis_a_light_counts_up_to_the_root_of_the_square():
    axis = np.array([[0.6], [0.0], [0.8]])
    light = np.zeros((3, 1)), UP, np.full((3, 1), 2.0), np.full((3, 1), 3.0), axis, np.array([20.0])
    peak, low, length = peaks(*light[1:]), np.array([0.02]), np.ones(1)
    for part, way in ((0, UP), (1, axis)):
        r = math.sqrt(squares(low, length, *peak, share=0.1)[part][0])
        near, far = (way[:, :, None] * factor * r for factor in (1 - 1e-9, 1 + 1e-9))
        for place, counts in ((near, True), (far, False)):
            b = strengths(place, -UP[:, :, None], np.zeros((1, 1), int), *light)
            assert kept(low, *b)[part].item() is counts
    own = squares(low, 2 * length, np.array([1.0, 50.0, 0.0]), share=0.1, per_light=True)
    np.testing.assert_allclose(own, [40, 40, 0])  # L^2 / x whatever the flux


def test_under_the_reference_length_the_papers_share_of_pairs_is_left():
    rng = np.random.default_rng(2)
    position = rng.uniform(-1, 1, (3, 20, 16)) + np.array([0, 0, 4.0])[:, None, None]
    ids = np.where(rng.random((20, 16)) < 0.1, -1, 0)
    normal = -np.ones((3, 20, 16)) * UP[:, :, None]
    light = np.concatenate([rng.uniform(-1, 1, (2, 12)), np.zeros((1, 12))]), np.repeat(UP, 12, axis=1), rng.random(
        (3, 12))
    length = reference_length(position, normal, ids, *light, drawn=12)
    low = low_irradiance(length * (1 + 1e-9), peaks(*light[1:]), share=0.05)
    b = strengths(position, normal, ids, *light)
    assert kept(low, b).sum() == round(125 / 768 * 12 * (ids >= 0).sum())
    light_of_pairs = sii(position, normal, ids, *light, drawn=12)
    whole = pairs.irradiance(position, normal, ids, *light)
    assert 0.2 < light_of_pairs.sum() / whole.sum() < 0.9
    np.testing.assert_allclose(sii(position, normal, ids, *light, drawn=12, share=1e-9), whole)


def test_nothing_lit_has_a_length_of_one():
    nothing = np.zeros((3, 0))
    assert reference_length(np.ones((3, 1, 1)), UP[:, :, None], np.zeros((1, 1), int), nothing, nothing, nothing,
                            drawn=5) == 1


def test_ellipsoids_have_the_published_numbers_and_hold_the_region():
    n = np.array([1.0, 2.0, 10.0, 100.0, 1000.0])
    made = ellipsoids(n)
    np.testing.assert_allclose(made[0][:3], [0.438691, 0.5, 0.578704], atol=1e-6)
    volume = math.pi * ((n + 2) / (3 * n + 2) - 1 / 3)  # E-SII-13
    waste = [4 / 3 * math.pi * made[k + 1] * made[k + 2] ** 2 / volume for k in (0, 3)]
    np.testing.assert_allclose(waste[0], [1.080, 1.000, 1.240, 1.328, 1.338], atol=PRINTED)
    np.testing.assert_allclose(waste[1][[2, 3]], [1.169, 1.233], atol=2 * PRINTED)
    angle = np.linspace(0, math.pi / 2, 1001)[1:-1]
    for k in (0, 3):
        center, half_width, height = (one[:, None] for one in made[k : k + 3])
        r = np.cos(angle) ** (n[:, None] / 2)  # the region's border, in R_0
        inside = ((r * np.cos(angle) - center) / half_width) ** 2 + (r * np.sin(angle) / height) ** 2
        assert (inside <= 1 + 1e-9).all()


@pytest.mark.feature("SII-31")
def test_stored_numbers_are_those_of_ieee_halves_and_codes_of_bytes():
    rng = np.random.default_rng(3)
    position, vectors = rng.normal(size=(3, 5, 7)) * 100, rng.normal(size=(3, 5, 7))
    vectors[:, 0] = 0
    vectors /= np.maximum(np.linalg.norm(vectors, axis=0), 1)
    place, normal = stored_surface(position, vectors)
    np.testing.assert_array_equal(place, storage.halves(position))
    np.testing.assert_allclose(normal, storage.directions(vectors), atol=1e-15)
    flux, lobe_flux = np.array([[0.0, 0.2, 255]]), np.array([[510.0, 1.0, 0.9]])  # steps of 510 / 255 = 2
    _, _, phi, lobe, axis = stored_lights(position[:, 0, :3], vectors[:, 1, :3], flux, lobe_flux, vectors[:, 2, :3])
    np.testing.assert_allclose([*phi, *lobe], [[0, 0, 256], [510, 2, 0]], atol=1e-12)
    np.testing.assert_allclose(axis, storage.directions(vectors[:, 2, :3]), atol=1e-15)
