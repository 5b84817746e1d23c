"""Polygons as triangles: areas add up to the shoelace formula's, whatever the shape, and every corner is used."""

import itertools

import numpy as np
import pytest

from refgi.scene.repair import triangles_of

SHAPES = {
    "square": [(0, 0), (1, 0), (1, 1), (0, 1)],
    "pentagon": [(0, 0), (1, 0), (1, 1), (0.5, 1.6), (0, 1)],
    "dart": [(0, 0), (2, -1), (1, 0), (2, 1)],
    "L": [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)],
    "comb": [(0, 0), (7, 0), (7, 3), (6, 3), (6, 1), (5, 1), (5, 3), (4, 3), (4, 1), (3, 1), (3, 3), (2, 3), (2, 1),
             (0, 1)],
    "star": [(radius * np.cos(np.pi * k / 6), radius * np.sin(np.pi * k / 6)) for k, radius in enumerate((5, 2) * 6)],
    "flat corners": [(0, 0), (1, 0), (2, 0), (2, 1), (1, 0.5), (0, 1), (0, 0.5)],
    # a hole, joined to the outline by a slit there and back
    "frame": [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)],
}
TO_PLANE = {"z": np.eye(3), "x": np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0.0]]),
            "slanted": np.array([[1, 0, 0.5], [0, 1, -0.25], [0, 0, 1]])}


def shoelace(points: np.ndarray) -> float:
    x, y = points.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


@pytest.mark.parametrize("plane", TO_PLANE)
@pytest.mark.parametrize("name", SHAPES)
def test_areas_add_up_from_any_first_corner_and_either_way_around(name: str, plane: str) -> None:
    outline = np.array(SHAPES[name], np.float64)
    for first, way in itertools.product(range(len(outline)), (1, -1)):
        points = np.roll(outline, -first, axis=0)[::way]
        solid = np.column_stack([points, np.zeros(len(points))]) @ TO_PLANE[plane]
        triangles, left = triangles_of(solid, np.arange(len(points)), np.array([len(points)]))
        corners = points[triangles]
        areas = [shoelace(corner) for corner in corners]
        assert left == 0
        assert len(triangles) == len(points) - 2
        assert min(way * area for area in areas) >= 0  # none is turned over
        assert np.isclose(sum(areas), shoelace(points), rtol=1e-12)


def test_convex_polygons_are_fans_in_their_order() -> None:
    points = np.array([*SHAPES["pentagon"], *SHAPES["square"], (0, 0), (1, 0), (0, 1)], np.float64)
    solid = np.column_stack([points, np.zeros(len(points))])
    triangles, left = triangles_of(solid, np.arange(12), np.array([5, 4, 3]))
    assert left == 0
    assert triangles.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [5, 6, 7], [5, 7, 8], [9, 10, 11]]


def test_ears_lie_where_their_polygon_was() -> None:
    bent = np.concatenate([np.roll(SHAPES[name], -1, axis=0) for name in ("L", "dart")])  # of which no fan holds
    points = np.array([*SHAPES["square"], *bent, (0, 0), (1, 0), (0, 1)], np.float64)
    solid = np.column_stack([points, np.zeros(len(points))])
    triangles, _ = triangles_of(solid, np.arange(len(points)), np.array([4, 6, 4, 3]))
    assert len({tuple(one) for one in triangles.tolist()}) == 9
    assert np.isclose(sum(shoelace(points[one]) for one in triangles), 1 + 3 + 1 + 0.5)
    owner = np.repeat(np.arange(4), [4, 6, 4, 3])[triangles]
    assert owner.tolist() == [[k] * 3 for k in (0, 0, 1, 1, 1, 1, 2, 2, 3)]


def test_more_corners_than_are_cut_into_ears_are_counted() -> None:
    angle = np.linspace(0, 2 * np.pi, 5000, endpoint=False)
    radius = 1 + 0.5 * np.cos(9 * angle)
    flower = np.stack([np.cos(angle) * radius, np.sin(angle) * radius, 0 * angle], axis=1)
    triangles, left = triangles_of(flower, np.arange(5000), np.array([5000]))
    assert (len(triangles), left) == (4998, 1)


def test_not_a_number_is_left_to_the_checks_of_meshes() -> None:
    points = np.array([(0, 0, 0), (1, np.nan, 0), (1, 1, np.inf), (0, 1, 0)])
    triangles, left = triangles_of(points, np.arange(4), np.array([4]))
    assert triangles.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert left == 0
