"""Projections: conventions of the picture, and that points come back to the texel they were seen through."""

import math

import numpy as np
import pytest

from refgi.rsm.buffers.surfaces import texel_ray
from refgi.rsm.raster.projection import (
    camera_projection,
    cube_projection,
    directional_projection,
    dual_paraboloid_projection,
    paraboloid_projection,
    project,
    spot_projection,
    view_frame,
)
from refgi.scene import Camera, DirectionalLight, SpotLight

ROUND_TRIP = 1e-12  # float64 rounding of a few operations on numbers of order one, in texels over a map of hundreds


def maps():
    bounds = np.array([-1.0, -2, -3]), np.array([2.0, 1, 4])
    return {
        "camera": camera_projection(Camera((1, 2, 3), (0, 0.5, 0.2), width=64, height=40)),
        "spot": spot_projection(SpotLight((0, 3, 0), (0.1, -1, 0.2), 0.2, 0.9, (1, 1, 1)), 32),
        "cube": cube_projection((0.3, -0.1, 0.4), 16),
        "paraboloid": paraboloid_projection([(0.3, 0.2, 0.1)], [(1, -2, 0.5)], 48),
        "dual paraboloid": dual_paraboloid_projection((0.3, -0.1, 0.4), 32),
        "directional": directional_projection(DirectionalLight((0.3, -1, 0.2), (1, 1, 1)), bounds, 24),
    }


@pytest.mark.parametrize("name", maps())
def test_a_point_on_a_texels_ray_comes_back_to_its_centre(name):
    projection, rng = maps()[name], np.random.default_rng(3)
    worst = 0.0
    for row in range(projection.shape[0]):
        for column in range(projection.width):
            u = (2 * column + 1) / projection.width - 1
            v = (2 * (row % projection.height) + 1) / projection.height - 1
            if "paraboloid" in name and u * u + v * v > 1 - 1e-9:
                continue
            ray = np.array(texel_ray(projection, row, column))
            depth = rng.uniform(0.1, 5)
            point = ray[:3] + depth * ray[3:]
            back = np.array(project(projection, point[:, None]))[:, 0]
            worst = max(worst, np.abs(back - (row + 0.5, column + 0.5, depth)).max())
    assert worst < ROUND_TRIP * max(projection.shape)


@pytest.mark.feature("VAL-11")
def test_paraboloid_round_trip(evidence):
    projection = paraboloid_projection([(0, 0, 0)], [(0, 0, 1)], 2)  # frame: right, down, forward along +z
    rng = np.random.default_rng(4)
    directions = rng.normal(size=(3, 10000))
    directions[2] = np.abs(directions[2])
    directions /= np.linalg.norm(directions, axis=0)
    row, column, distance = project(projection, directions)
    s, t = column - 1, row - 1
    square = s * s + t * t
    local = np.stack([2 * s, 2 * t, 1 - square]) / (1 + square)
    error = np.abs(projection.frame[0].T @ local - directions).max()
    assert error < 1e-12
    np.testing.assert_allclose(distance, 1, rtol=1e-15 * 4)
    evidence(f"largest error of the direction {error:.1e} over 1e4 directions")


def test_pictures_are_the_right_way_round():
    projection = camera_projection(Camera((0, 0, 0), (0, 0, -1), width=40, height=20, vfov=math.radians(90)))
    points = np.array([[0, 0, -2], [1, 0, -2], [0, 1, -2], [0, 0, 2], [5, 0, -2]], float).T
    row, column, depth = project(projection, points)
    np.testing.assert_allclose((row[0], column[0], depth[0]), (10, 20, 2))
    assert column[1] > 20  # +x to the right
    assert row[2] < 10  # +y upwards, and row 0 is the top
    assert np.isnan([row[3:], column[3:], depth[3:]]).all()  # behind, and beside
    np.testing.assert_allclose(row[2], 10 - 5)  # 45 degrees up would be row 0, tan 1/2 is half of that


def test_frames_are_right_handed():
    rng = np.random.default_rng(1)
    for forward in [*rng.normal(size=(20, 3)), (0, 1, 0), (0, -1, 0), (0, 0, 1)]:
        frame = view_frame(forward)
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-15 * 8)
        assert np.linalg.det(frame) > 0
        np.testing.assert_allclose(frame[2], forward / np.linalg.norm(forward))


def test_a_cube_sees_every_direction_once():
    projection = cube_projection((0, 0, 0), 8)
    directions = np.random.default_rng(2).normal(size=(3, 1000))
    row, _, _ = project(projection, directions)
    face = (row // 8).astype(int)
    axis = np.abs(directions).argmax(axis=0)
    sign = np.take_along_axis(directions, axis[None], axis=0)[0] < 0
    np.testing.assert_array_equal(face, 2 * axis + sign)


@pytest.mark.parametrize("texels", [1, 7, 64, 100])
def test_the_bottom_border_of_a_face_is_its_own(texels):
    """Of the first face that sees it, though that is not the first of the stacked maps, nor the next one's top row."""
    for point, face in (((0.5, 1, -1), 2), ((-1, -1, 0.5), 1), ((0.5, -1, -1), 3), ((1, -1, 0.5), 0)):
        row, _, depth = (float(value[0]) for value in project(cube_projection((0, 0, 0), texels),
                                                               np.array(point, float)[:, None]))
        assert int(row // texels) == face
        assert depth == 1
    for face in range(6):  # just within the border
        frame = cube_projection((0, 0, 0), texels).frame[face]
        row, _, _ = project(cube_projection((0, 0, 0), texels), (frame[2] + (1 - 1e-15) * frame[1])[:, None])
        assert row[0] < (face + 1) * texels


def test_a_directional_map_encloses_the_box():
    rng = np.random.default_rng(6)
    bounds = np.array([-1.0, -2, -3]), np.array([2.0, 1, 4])
    corners = np.array(np.meshgrid(*np.stack(bounds, axis=1))).reshape(3, -1)
    for direction in [*rng.normal(size=(10, 3)), (0, -1, 0), (1, 0, 0)]:
        projection = directional_projection(DirectionalLight(tuple(direction), (1, 1, 1)), bounds, 7)
        row, column, depth = project(projection, corners)
        assert np.isfinite([row, column, depth]).all()
        assert (depth > 0).all()
        assert (depth < 0.9 * projection.reach).all()


def test_a_flat_or_single_point_box_is_enclosed():
    for high in ((1.0, 0.0, 1.0), (0.0, 0.0, 0.0)):
        bounds = np.zeros(3), np.array(high)
        projection = directional_projection(DirectionalLight((0, -1, 0), (1, 1, 1)), bounds, 4)
        assert (projection.half > 0).all()
        assert np.isfinite(np.array(project(projection, np.zeros((3, 1))))).all()


def test_a_spots_cone_touches_the_border_of_its_map():
    light = SpotLight((1, 2, 3), (0.2, -1, 0.1), 0.3, 0.8, (1, 1, 1))
    projection = spot_projection(light, 10)
    axis = np.asarray(light.direction) / np.linalg.norm(light.direction)
    side = projection.frame[0, 0]
    for angle, inside in ((0.799, True), (0.801, False)):
        point = np.asarray(light.position) + math.cos(angle) * axis + math.sin(angle) * side
        assert np.isfinite(project(projection, point[:, None])[0][0]) == inside
