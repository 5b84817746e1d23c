"""Literal imperfect shadow maps against areas, walls whose distance is known, and holes by hand."""

import math

import numpy as np
import pytest

from refgi.literal.imperfect import depth_maps, filled, looked_up, map_frames, scattered_points

# a square of 2 m by 2 m and a triangle of a quarter of its area, beside it
VERTICES = np.array([[-1.0, -1, 2], [1, -1, 2], [1, 1, 2], [-1, 1, 2], [3, 0, 2], [4, 0, 2], [3, 2, 2]])
FACES = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6]])
NEAREST = 0.025  # half a texel and a disc towards the middle of the wall, where it slants most
SHIFT = np.array([[0.3, 0.6, 0.1], [0.9, 0.2, 0.5]])


def test_points_are_as_dense_on_every_triangle():
    point, face, radius = scattered_points(VERTICES, FACES, SHIFT, 5000)
    for own in face:
        np.testing.assert_allclose(np.bincount(own, minlength=3), [2000, 2000, 1000], atol=1)
    on_square = point[0][face[0] < 2]
    np.testing.assert_allclose(on_square.mean(axis=0), (0, 0, 2), atol=2e-3)
    np.testing.assert_allclose((on_square[:, :2] ** 2).mean(axis=0), 1 / 3, rtol=3e-3)
    np.testing.assert_allclose(point[1][face[1] == 2].mean(axis=0), (10 / 3, 2 / 3, 2), atol=5e-3)
    assert radius**2 * math.pi * 5000 == pytest.approx(5)


def test_frames_are_right_handed_about_the_normal():
    normal = np.random.default_rng(0).normal(size=(3, 50))
    normal = np.concatenate([normal / np.linalg.norm(normal, axis=0), [[0.0, 0.0], [0.0, 0.0], [1.0, -1.0]]], axis=1)
    frame = map_frames(normal)
    np.testing.assert_allclose(frame @ frame.transpose(0, 2, 1), np.tile(np.eye(3), (52, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frame), 1)
    np.testing.assert_array_equal(frame[:, 2].T, normal)
    np.testing.assert_allclose(frame[50], np.eye(3))  # as the paper has it for z


def wall_map(points, side, **how):
    """Return the map of a light at the origin that faces the square, 2 m away."""
    vertices, faces = VERTICES[:4], FACES[:2]
    point, face, radius = scattered_points(vertices, faces, SHIFT[:1], points)
    frame = np.eye(3)[None]
    return depth_maps(vertices, faces, point, face, radius, np.zeros((3, 1)), frame, side, **how)[0], radius


def test_a_wall_is_as_far_as_it_is():
    """At (s, t) of the paraboloid z = (1 - q) / (1 + q), q = s^2 + t^2: the wall z = 2 lies 2 / z away."""
    depth, _ = wall_map(20_000, 64)
    centre = (np.arange(64) + 0.5) / 32 - 1
    q = centre**2 + centre[:, None] ** 2
    far = 2 * (1 + q) / np.where(q < 1, 1 - q, 1)
    x, y = (2 * one / (1 + q) * far for one in np.broadcast_arrays(centre, centre[:, None]))  # w_x = 2 s / (1 + q)
    inside = (q < 1) & (np.maximum(np.abs(x), np.abs(y)) < 0.95)
    outside = (q >= 1) | (np.maximum(np.abs(x), np.abs(y)) > 1.2)
    assert inside.sum() > 100
    np.testing.assert_allclose(depth[inside], far[inside], rtol=NEAREST)
    assert np.isinf(depth[outside]).all()


def test_holes_take_what_is_around_them_and_nothing_else_changes():
    depth = np.full((1, 8, 8), 3.0)
    depth[0, 2:4, 3] = depth[0, 6, 6] = np.inf
    np.testing.assert_array_equal(filled(depth, 2), np.full((1, 8, 8), 3.0))
    empty = np.full((1, 8, 8), np.inf)
    empty[0, 0, 0] = 5.0
    once = filled(empty, 1)
    assert np.isfinite(once[0, :3, :3]).sum() == 9  # the coarse texel and the halves of those beside it
    assert np.isinf(once[0, 4:, 4:]).all()


def test_near_and_far_are_not_mixed():
    depth = np.array([[[1.0, 1.05, np.inf, np.inf], [9.0, np.inf, np.inf, np.inf]] * 2])
    assert filled(depth, 1)[0, 1, 1] == pytest.approx(1.025)  # of 1, 1.05 and 9


@pytest.mark.parametrize(("z", "free"), [(1.98, True), (2.0, True), (2.5, False), (4.0, False)])
def test_what_lies_behind_a_wall_is_hidden(z, free):
    depth, radius = wall_map(20_000, 64)
    receiver = np.reshape([0.1, -0.2, z], (3, 1, 1))
    down = np.reshape([0.0, 0.0, -1.0], (3, 1, 1))
    seen = looked_up(receiver, down, np.zeros((1, 1), int), down, np.zeros((3, 1)), -down[:, :, 0], np.eye(3)[None],
                     depth[None], radius, bias=1.0)
    assert seen.item() is free
