"""Rigid motion of some faces: what moves, what rests, and what would tear."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.scene import Geometry, load_scene
from refgi.scene.motion import faces_of, moved, rotation_about, with_own_vertices

ORIGIN = (0.0, 0.0, 0.0)


@pytest.fixture
def fold():
    """Two triangles with a common edge, smooth."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1]], np.float64)
    normals = np.array([[0, 0, 1], [0, 0, 1], [0, 0, 1], [1, 0, 0]], np.float64)
    return Geometry(vertices, np.array([[0, 1, 2], [1, 3, 2]], np.int32), np.zeros(2, np.int32), normals)


def test_rotation_is_rodrigues():
    axis, angle = np.array([1.0, 2.0, -0.5]), 0.7
    rotation, unit = rotation_about(tuple(axis), angle), axis / np.linalg.norm(axis)
    assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
    assert np.allclose(rotation @ unit, unit)
    across = np.cross(unit, (0, 0, 1))
    expected = math.cos(angle) * across + math.sin(angle) * np.cross(unit, across)
    assert np.allclose(rotation @ across, expected)
    assert np.array_equal(rotation_about(tuple(axis), 0.0), np.eye(3))
    with pytest.raises(InputError, match="axis"):
        rotation_about(ORIGIN, 1.0)


def test_faces_that_share_vertices_are_parted_before_they_move(fold):
    second = np.array([False, True])
    with pytest.raises(InputError, match="with_own_vertices"):
        moved(fold, second, np.eye(3), ORIGIN, (0, 0, 1))
    parted = with_own_vertices(fold, second)
    assert len(parted.vertices) == 6
    assert np.array_equal(parted.vertices[parted.faces], fold.vertices[fold.faces])
    assert np.array_equal(parted.vertex_normals[parted.faces], fold.vertex_normals[fold.faces])
    assert with_own_vertices(parted, second) is parted
    up = moved(parted, second, np.eye(3), ORIGIN, (0, 0, 1))
    assert up.faces is parted.faces
    assert np.array_equal(up.vertices[up.faces[0]], fold.vertices[fold.faces[0]])
    assert np.array_equal(up.vertices[up.faces[1]], fold.vertices[fold.faces[1]] + (0, 0, 1))


def test_a_quarter_turn_about_a_point_and_then_a_step(fold):
    both = np.array([True, True])
    geometry = moved(fold, both, rotation_about((0, 0, 1), math.pi / 2), (1, 1, 0), (0, 0, 5))
    assert np.allclose(geometry.vertices, [[2, 0, 5], [2, 1, 5], [1, 0, 5], [1, 1, 6]])
    assert np.allclose(geometry.vertex_normals, [[0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 1, 0]])
    assert np.array_equal(fold.vertices[3], [1, 1, 1])


def test_a_step_alone_is_rounded_once(fold):
    geometry = moved(fold, np.array([True, True]), np.eye(3), (0.1, 0.7, 1e6), (0.25, 0, 0))
    assert np.array_equal(geometry.vertices, fold.vertices + np.array([0.25, 0, 0]))


def test_faces_of_a_material():
    scene = load_scene("cornell_box")
    red = faces_of(scene, "red")
    assert [scene.materials[i].name for i in np.unique(scene.geometry.material_of_face[red])] == ["red"]
    assert red.sum() == (scene.geometry.material_of_face == 2).sum()
    with pytest.raises(InputError, match="did you mean 'red'"):
        faces_of(scene, "rde")
    bare = dataclasses.replace(scene, materials=(*scene.materials, dataclasses.replace(scene.materials[0], name="new")))
    with pytest.raises(InputError, match="one that a face shows"):
        faces_of(bare, "new")
