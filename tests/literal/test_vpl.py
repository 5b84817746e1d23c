"""Literal visibility against Embree, faces and one shadowed pair by hand."""

import math

import numpy as np
import pytest

from refgi.literal.vpl import facing, shadowed_sum, visible
from refgi.rays import Tracer
from refgi.scene import Geometry

FEW = 1e-3  # share of rays along edges, which float32 decides


def test_faces_look_to_the_side_of_the_normal():
    vertices = np.array([[0.0, 0, 0], [2, 0, 0], [0, 3, 0]])
    normal = np.array([[0.0, 0.6, 0.0], [0.0, 0.0, 0.0], [1.0, -0.8, 0.0]])[:, None]
    found = facing(vertices, np.array([[0, 1, 2]]), normal, np.array([[0, 0, -1]]))
    np.testing.assert_array_equal(found[:, 0].T, [(0, 0, 1), (0, 0, -1), (0, 0, 0)])


def test_rays_among_random_triangles_agree_with_embree():
    rng = np.random.default_rng(8)
    vertices = np.float32(rng.uniform(-1, 1, (60, 3)))
    faces = np.arange(60, dtype=np.int32).reshape(20, 3)
    x, p = (np.float32(rng.uniform(-2, 2, (3, count))) for count in (500, 30))
    toward = (p[:, None] - x[:, :, None]).astype(float)
    seen = np.zeros((30, 500), bool)
    for k in range(30):  # normals look at the other: cosines decide nothing
        look = toward[:, :, k] / np.linalg.norm(toward[:, :, k], axis=0)
        one = visible(vertices.astype(float), faces, x[:, None].astype(float), look[:, None], np.zeros((1, 500), int),
                      look[:, None], p[:, k : k + 1].astype(float), -look[:, :1])
        ahead = (toward[:, :, k] * look[:, :1]).sum(axis=0) > 0
        seen[k] = np.where(ahead, one[0, 0], True)
        blocked = np.zeros(500, bool)
        Tracer(Geometry(vertices.astype(float), faces, np.zeros(20, np.int32), None)).fill_occluded(
            np.ascontiguousarray(x.T), np.ascontiguousarray(toward[:, :, k].T.astype(np.float32)),
            np.ones(500, np.float32), blocked)
        seen[k] ^= np.where(ahead, ~blocked, True)
    assert seen.mean() < FEW
    assert 0.05 < blocked.mean() < 0.95


def test_one_pair_and_its_shadow_by_hand():
    x, up, ids = np.zeros((3, 1, 1)), np.reshape([0.0, 0.0, 1.0], (3, 1, 1)), np.zeros((1, 1), int)
    p, m = np.array([[0.0], [1.0], [1.0]]), np.array([[0.0], [0.0], [-1.0]])
    wall = np.array([[-1.0, 0.5, 0.1], [1.0, 0.5, 0.1], [0.0, 0.5, 0.9]])
    low = wall - (0, 0, 0.5)  # ends below the ray
    for corners, free in ((wall, False), (low, True)):
        seen = visible(corners, np.array([[0, 1, 2]]), x, up, ids, up, p, m)
        assert seen.shape == (1, 1, 1)
        assert seen.item() is free
        light = shadowed_sum(x, up, ids, seen, p, m, np.full((3, 1), math.pi))
        np.testing.assert_allclose(light.ravel(), 0.25 * free)  # cos^2 45 degrees over r^2 = 2


@pytest.mark.parametrize("turned", ["normal", "face_normal", "light_normal"])
def test_what_looks_away_is_not_seen(turned):
    known = {"normal": np.reshape([0.0, 0.0, 1.0], (3, 1, 1)), "face_normal": np.reshape([0.0, 0.0, 1.0], (3, 1, 1)),
             "light_normal": np.array([[0.0], [0.0], [-1.0]])}
    mesh = np.full((3, 3), 9.0) + np.eye(3), np.array([[0, 1, 2]])
    rest = {"position": np.zeros((3, 1, 1)), "triangle_id": np.zeros((1, 1), int), "light_position": np.array(
        [[0.0], [0.0], [1.0]])}
    assert visible(*mesh, **rest, **known).all()
    assert not visible(*mesh, **rest, **(known | {turned: -known[turned]})).any()
