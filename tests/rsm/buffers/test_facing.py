"""Normals of triangles on the side of the shading normal."""

import numpy as np
import pytest

from refgi.rsm import facing_normals
from tests.rsm.shapes import geometry, sheet, sphere

ROUNDING = {np.float32: 1e-7, np.float64: 4e-16}  # of a unit vector's components


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_normal_of_the_face_on_the_side_of_the_shading_normal(dtype):
    rng, ball = np.random.default_rng(5), sphere(6)
    face = rng.integers(-1, len(ball.faces), (7, 9)).astype(np.int32)
    shading = rng.normal(size=(3, 7, 9)).astype(dtype)
    expected = np.zeros((3, 7, 9))
    for i, j in np.ndindex(face.shape):
        if face[i, j] >= 0:
            a, b, c = ball.vertices[ball.faces[face[i, j]]]
            n = np.cross(b - a, c - a)
            n /= np.linalg.norm(n)
            expected[:, i, j] = n if n @ shading[:, i, j] >= 0 else -n
    found = facing_normals(ball, face, shading)
    assert found.dtype == dtype
    assert np.abs(found - expected).max() <= ROUNDING[dtype]


def test_without_vertex_normals_the_shading_normals_are_the_faces():
    flat = sheet(2)
    flat = geometry(flat.vertices, flat.faces)
    shading = np.zeros((3, 2, 2), np.float32)
    assert facing_normals(flat, np.zeros((2, 2), np.int32), shading) is shading


def test_a_face_without_area_has_no_normal():
    none = geometry([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], normals=np.tile([0.0, 1.0, 0.0], (3, 1)))
    assert not facing_normals(none, np.zeros((1, 1), np.int32), np.ones((3, 1, 1), np.float32)).any()
