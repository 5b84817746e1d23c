"""Literal area lights by hand, by closed forms and by SciPy's k-means."""

import math

import numpy as np
import pytest
from scipy.cluster.vq import kmeans2

from refgi.literal.val_areas import (
    areas,
    dithered,
    facing,
    illuminated_extent,
    interleaving,
    kmeans_assign,
    kmeans_each,
    kmeans_means,
    kmeans_rounds,
    kmeans_start,
    map_frames,
    parts,
    shadowed,
    visible_extent,
)

CLOSE = 1e-12
BAYER = [[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]]  # Bayer 1973
UP = np.array([[0.0], [1.0], [0.0]])


def test_boxes_hold_what_is_seen_and_what_reflects():
    position = np.array([[[1.0, 2, 0]], [[3, -1, 0]], [[0, 5, 0]]])
    dark, lit = np.zeros((3, 1, 2)), np.array([[[0.0, 0]], [[0, 0]], [[0, 1]]])
    places = [np.array([[[9.0, -4]], [[9, 6]], [[9, 2]]]), np.array([[[7.0, 8]], [[7, 8]], [[7, 8]]])]
    ids = np.array([[0, 4, -1]])
    boxes = (visible_extent(position, ids), illuminated_extent(places, [lit, lit]),
             illuminated_extent(places, [lit, dark], [dark, lit[..., ::-1]]))
    assert np.array(boxes).tolist() == [[[1, -1, 0], [2, 3, 5]], [[-4, 6, 2], [8, 8, 8]], [[-4, 6, 2], [7, 7, 7]]]


def test_clusters_begin_at_every_nth_light():
    center, axis = kmeans_start(np.arange(10.0) + np.zeros((3, 1)), -np.arange(10.0) + np.zeros((3, 1)), 4)
    assert center[0].tolist() == [0, 2, 5, 7]  # floor(k 10 / 4)
    assert axis[0].tolist() == [0, -2, -5, -7]


@pytest.mark.parametrize(("distance", "expected"), [
    ("raw", 0.7 * 5 + 0.3 * math.pi / 3), ("normalised", 0.7 * 5 / 10 + 0.3 / 3), ("squared", 0.7 * 0.25 + 0.3)])
def test_a_distance_by_hand(distance, expected):
    """5 m and 60 degrees, in a box whose diagonal is 10 m: from the second of three clusters and the third."""
    box, center, axis = np.array([[1.0, -2, 3], [7, -2, 11]]), np.zeros((3, 3)), np.zeros((3, 3))
    center[0, 0], axis[0], axis[1] = -9, math.sqrt(0.75), 0.5
    of, least = kmeans_assign(np.array([[3.0], [4], [0]]), UP, box, center, axis, distance)
    assert of.tolist() == [1]
    assert least == pytest.approx([expected])


def test_means_of_normals_lie_half_way_and_clusters_may_keep_their_own():
    place = np.array([[0.0, 2, 5, 5], [0, 0, 0, 0], [0, 4, 0, 0]])
    turn = np.radians([20, 50, 0, 180])
    normal = np.array([np.cos(turn), np.sin(turn), 0 * turn])
    before = np.arange(9.0).reshape(3, 3)
    center, axis = kmeans_means(place, normal, np.array([0, 0, 2, 2]), before, -before)
    np.testing.assert_allclose(center, [[1, 1, 5], [0, 4, 0], [2, 7, 0]], atol=CLOSE)
    np.testing.assert_allclose(axis[:, 0], [math.cos(math.radians(35)), math.sin(math.radians(35)), 0], atol=CLOSE)
    assert (axis[:, 1:] == -before[:, 1:]).all()  # no light; normals that cancel


def test_rounds_without_normals_are_those_of_scipy():
    random = np.random.default_rng(3)
    place, normal = random.random((3, 200)), random.normal(size=(3, 200))
    center, axis = kmeans_start(place, normal, 7)
    box = np.array([[0.0] * 3, [1] * 3])
    center, axis, of = kmeans_rounds(place, normal, box, center, axis, "squared", 1.0, 0.0, 200)
    expected, label = kmeans2(place.T, place.T[[k * 200 // 7 for k in range(7)]], iter=200, minit="matrix")
    assert (of == label).all()
    np.testing.assert_allclose(center.T, expected, atol=CLOSE)
    assert ((axis[:, of] * normal).sum(axis=0) > 0).mean() > 0.5


def test_as_many_clusters_as_lights_are_the_lights():
    place = np.zeros((3, 4))
    center, axis, of = kmeans_each(place, 2 * UP + place)
    assert (center == place).all()
    assert (axis == UP).all()
    assert of.tolist() == [0, 1, 2, 3]


def rectangle(turn):
    """Return a grid of lights, 2 m x 0.75 m, turned within a slanted plane, and its frame."""
    normal = np.array([[0.48], [0.6], [0.64]])
    right, down, _ = map_frames(normal)[0]
    s, t = (grid.ravel() for grid in np.meshgrid(np.linspace(1, 3, 6), np.linspace(-0.25, 0.5, 4)))
    c, d = math.cos(turn), math.sin(turn)
    return np.outer(right, c * s - d * t) + np.outer(down, d * s + c * t), normal


@pytest.mark.parametrize("axes", ["fixed", "pca", "min_area"])
@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_a_rectangle_of_known_size_is_found(axes, turn):
    place, normal = rectangle(turn)
    center = place.mean(axis=1, keepdims=True)
    frame, along, side, offset, delta, radius, members = areas(
        place, center, normal, np.zeros(24, int), axes, "root", unbiased=False)
    c, d = (abs(math.cos(turn)), abs(math.sin(turn))) if axes == "fixed" else (1, 0)
    sides = [2 * c + 0.75 * d, 2 * d + 0.75 * c]
    np.testing.assert_allclose(sorted(side[:, 0]), sorted(sides), atol=CLOSE)
    np.testing.assert_allclose(offset, 0, atol=CLOSE)
    np.testing.assert_allclose(delta, math.sqrt(sides[0] * sides[1]), atol=CLOSE)
    np.testing.assert_allclose(radius, math.hypot(1, 0.375), atol=CLOSE)
    np.testing.assert_allclose(along[0] @ normal, 0, atol=CLOSE)
    np.testing.assert_allclose(along[0] @ along[0].T, np.eye(2), atol=CLOSE)
    assert members.tolist() == [24]
    assert frame[0, 2].tolist() == normal[:, 0].tolist()
    assert frame[0, 1] @ [0, 1, 0] < 0  # down
    assert np.linalg.det(frame[0]) == pytest.approx(1)  # right, down and forward are right-handed


@pytest.mark.parametrize(("extent", "expected"), [("root", math.sqrt(1.5)), ("longer", 2.0), ("shorter", 0.75)])
def test_a_sample_falls_short_of_its_rectangle(extent, expected):
    """E-VAL-10: (n - 1) / (n + 1) of a side. A light off the middle of its rectangle; a line has no width."""
    place, normal = rectangle(0.0)
    center = place[:, :1]
    made = {unbiased: areas(place, center, normal, np.zeros(24, int), "fixed", extent, unbiased) for unbiased in (
        False, True)}
    assert made[False][4][0] == pytest.approx(expected)
    assert made[True][4][0] == pytest.approx(expected * 25 / 23)
    np.testing.assert_allclose(made[True][3], [[1], [0.375]])
    line = areas(place[:, :6], center, normal, np.zeros(6, int), "fixed", "root", unbiased=False)
    assert line[2][1, 0] == line[4][0] == 0


def test_facing_normals_are_on_the_side_of_interpolated_ones():
    vertices = np.array([[0.0, 0, 0], [2, 0, 0], [0, 3, 0], [0, 0, 4]])
    faces, ids = np.array([[0, 1, 2], [0, 2, 3]]), np.array([[0, 0, 1, -1]])
    normal = np.array([[[0.6, 0.6, 0.1, 0]], [[0, 0, 0.9, 0]], [[0.8, -0.8, 0.2, 0]]])
    assert facing(normal, ids, vertices, faces)[:, 0].T.tolist() == [[0, 0, 1], [0, 0, -1], [1, 0, 0], [0, 0, 0]]
    assert facing(normal, ids) is normal


@pytest.mark.parametrize("assignment", ["index", "cluster"])
def test_1024_lights_are_16_for_each_pixel_of_a_block(assignment):
    """Sec. 6: blocks of 8 x 8 pixels, 1024 / 64 lights per pixel. By cluster: in runs, so of few area lights."""
    of = np.random.default_rng(1).integers(0, 30, 1024)
    subset = interleaving(of, 8, assignment)
    assert (np.bincount(subset, minlength=64) == 16).all()
    assert assignment == "cluster" or subset[62:66].tolist() == [62, 63, 0, 1]
    clusters = [len(np.unique(of[subset == k])) for k in range(64)]
    assert max(clusters) <= 6 if assignment == "cluster" else min(clusters) > 6
    assert np.argsort(dithered(4)).reshape(4, 4).tolist() == BAYER


def test_light_of_a_block_is_that_of_all_lights():
    """VAL-23: the mean over a block of pixels with one surface is the sum over all lights, each of its own cluster."""
    random = np.random.default_rng(5)
    lights = random.random((3, 20)) + 2 * UP
    axis, flux = random.random((3, 20)) - [[0.5], [2], [0.5]], random.random((3, 20))
    of, subset = random.integers(0, 3, 20), np.arange(20) % 9
    position = np.zeros((3, 3, 3))
    normal = UP[:, :, None] + position
    made = parts(position, normal, np.zeros((3, 3), int), lights, axis, flux, of, np.zeros((3, 3)), subset, 3)
    r = np.sqrt((lights**2).sum(axis=0))
    each = flux / math.pi * lights[1] / r * (-axis * lights).sum(axis=0) / r / r**2  # cosines there and here
    for k in range(3):
        np.testing.assert_allclose(made[k].mean(axis=(1, 2)), each[:, of == k].sum(axis=1))
        np.testing.assert_allclose(made[k, :, 1, 0], 9 * each[:, (of == k) & (subset == 3)].sum(axis=1))


def test_light_under_visibility_by_hand():
    irradiance = np.array([[[[2.0, 1], [4, 8]]] * 3, [[[10, 20], [30, 40]]] * 3])
    share = np.array([[[0.5, 1], [0, 0.25]], [[0.1, 0.8], [0.2, 0.6]]])
    assert shadowed(irradiance, share).tolist() == [[[2, 17], [6, 26]]] * 3
