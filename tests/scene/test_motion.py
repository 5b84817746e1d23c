"""Meshes moved by matrices; the placed camera looks into what is open, the placed lamp lights the side that is seen."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.scene import Camera, Geometry, load_scene
from refgi.scene.motion import faces_of, moved, rotation_about, with_own_vertices
from refgi.scene.placed import LIGHT_DIRECTION, VIEWS, default_camera, default_light

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


CORNERS = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
# two triangles a side: where x, y or z is 0 or 1
SIDES = {"-x": (0, 1, 3, 2), "+x": (4, 5, 7, 6), "-y": (0, 1, 5, 4), "+y": (2, 3, 7, 6), "-z": (0, 2, 6, 4),
         "+z": (1, 3, 7, 5)}
OUTWARDS = {f"{sign}{axis}": (1 if sign == "+" else -1) * np.eye(3)[k] for k, axis in enumerate("xyz") for sign in "+-"}


def box(*without: str, size: float = 1.0) -> Geometry:
    """Return a box without some of its sides."""
    quads = [corners for side, corners in SIDES.items() if side not in without]
    faces = np.array([[(a, b, c), (a, c, d)] for a, b, c, d in quads], np.int32).reshape(-1, 3)
    return Geometry(CORNERS * size, faces, np.zeros(len(faces), np.int32))


def unit(vector: object) -> np.ndarray:
    values = np.asarray(vector, np.float64)
    return values / np.linalg.norm(values)


def view(geometry: Geometry) -> np.ndarray:
    camera = default_camera(geometry)
    return unit(np.subtract(camera.eye, camera.target))


@pytest.mark.parametrize("size", [1e-3, 1.0, 552.8])
@pytest.mark.parametrize("side", ["+x", "-x", "+z", "-z"])
def test_an_open_box_is_looked_into(side: str, size: float) -> None:
    geometry = box(side, size=size)
    assert view(geometry) @ OUTWARDS[side] > 0.99
    lamp = default_light(geometry)
    middle = np.mean(geometry.bounds, axis=0)
    assert unit(np.subtract(lamp.position, middle)) @ OUTWARDS[side] > 0.7  # through the opening


def test_a_box_without_its_lid_is_looked_into_from_above() -> None:
    geometry = box("+y")
    assert view(geometry)[1] > 0.8
    assert default_light(geometry).position[1] > 1


@pytest.mark.parametrize("name", ["closed", "ball", "floor"])
def test_what_shows_as_much_from_anywhere_is_seen_from_the_front_right(name: str) -> None:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3)
    round_one = Geometry(ball.vertices, np.array(ball.faces, np.int32), np.zeros(len(ball.faces), np.int32))
    geometry = {"closed": box(), "floor": box("-x", "+x", "+y", "-z", "+z"), "ball": round_one}[name]
    assert np.allclose(view(geometry), unit(VIEWS[0]))
    lamp, middle = default_light(geometry), np.mean(geometry.bounds, axis=0)
    assert np.allclose(unit(np.subtract(lamp.position, middle)), unit(LIGHT_DIRECTION))


def test_walls_that_are_seen_edge_on_show_nothing() -> None:
    """Of eight boxes side by side, walls in the middle's planes hold a third of all points, and hide in each other."""
    parts = [box() for _ in range(8)]
    vertices = np.concatenate([part.vertices + CORNERS[k] for k, part in enumerate(parts)])
    faces = np.concatenate([part.faces + 8 * k for k, part in enumerate(parts)])
    assert np.allclose(view(Geometry(vertices, faces, np.zeros(len(faces), np.int32))), unit(VIEWS[0]))


@pytest.mark.parametrize("seed", range(24))
def test_a_flat_mesh_is_lit_on_the_side_that_is_seen(seed: int) -> None:
    vertices = np.random.default_rng(seed).normal(size=(3, 3))
    geometry = Geometry(vertices, np.array([[0, 1, 2]], np.int32), np.zeros(1, np.int32))
    camera = default_camera(geometry)
    lamp = default_light(geometry, camera)
    normal = np.cross(vertices[1] - vertices[0], vertices[2] - vertices[0])
    assert (normal @ (camera.eye - vertices[0])) * (normal @ (np.array(lamp.position) - vertices[0])) > 0


def test_inside_of_a_closed_room_the_lamp_is_where_the_eye_is() -> None:
    camera = Camera((0.5, 0.5, 0.9), (0.5, 0.4, 0.0))
    lamp = default_light(box(), camera)
    assert lamp.position == camera.eye
    assert unit(lamp.direction) @ unit(np.subtract(camera.target, camera.eye)) > 0.999
    seen = default_light(box("+z"), Camera((0.5, 0.5, 3.0), (0.5, 0.5, 0.0)))
    assert seen.position[2] > 1


def test_a_dense_mesh_is_judged_by_some_of_its_faces() -> None:
    geometry = box("-z")
    for _ in range(6):  # each triangle into four
        corners = geometry.vertices[geometry.faces]
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        parts = np.stack([np.stack(part, axis=1) for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
        vertices = parts.reshape(-1, 3)
        faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
        geometry = Geometry(vertices, faces, np.zeros(len(faces), np.int32))
    depth = geometry.vertices[geometry.faces][..., 2].mean(axis=1)
    geometry = Geometry(geometry.vertices, geometry.faces[np.argsort(-depth)], geometry.material_of_face)
    assert len(geometry.faces) == 10 * 4**6
    assert view(geometry)[2] < -0.99
