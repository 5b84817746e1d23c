"""docs/conventions.md: which way up a light's map lies, from each statement of the page."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from refgi.rsm.buffers.light_projection import light_projection
from refgi.rsm.raster.projection import PARABOLOID, PERSPECTIVE, cube_projection, dual_paraboloid_projection, project
from refgi.scene import DirectionalLight, SpotLight, load_scene

DOCUMENT = (Path(__file__).parents[1] / "docs" / "conventions.md").read_text(encoding="utf-8")
ROUNDING = 1e-12  # a dozen operations in float64


def frame_of(direction):
    """Right and down as the page has them."""
    f = np.array(direction, float) / np.linalg.norm(direction)
    up = np.array([0.0, 1.0, 0.0]) if abs(f[1]) < 0.999 else np.array([0.0, 0.0, -1.0])
    right = np.cross(f, up) / np.linalg.norm(np.cross(f, up))
    return np.stack([right, np.cross(f, right), f])


DIRECTIONS = [(0.3, -1, 0.2), (0, -1, 0), (0, 1, 0), (1, 0, 0), (0, 0, -1), (0.04, -1, 0.0), (0.05, -1, 0.0),
              (0, -1, 0.04), (0, -1, -0.04), (-0.04, 1, 0.01)]


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("half", [0.5, 1.5])
def test_rows_and_columns_of_a_spots_map(direction, half):
    light, scene = SpotLight((0.1, 0.2, 0.3), direction, 0.1, half, (1, 1, 1)), load_scene("cornell_box")
    maps = light_projection(light, scene.geometry, 8)
    assert maps.kind == (PERSPECTIVE if half < math.radians(75) else PARABOLOID)
    right, down, forward = frame_of(direction)
    np.testing.assert_allclose(np.cross(right, down), forward, atol=ROUNDING)
    reach = math.tan(half) if half < math.radians(75) else math.tan(half / 2)
    for row, column in ((0, 3), (6, 1), (5, 2)):
        a, b = (reach * ((place + 0.5) / 4 - 1) for place in (column, row))
        along = 1.0 if half < math.radians(75) else 1 - a * a - b * b
        scale = 1.0 if half < math.radians(75) else 2.0
        point = light.position + 0.7 * (scale * a * right + scale * b * down + along * forward)
        got_row, got_column, _ = project(maps, point)
        assert (got_row, got_column) == pytest.approx((row + 0.5, column + 0.5), abs=1e-9)
    rim = light.position + math.cos(half) * forward - math.sin(half) * (1 - 1e-9) * down  # the cone's top
    assert project(maps, rim)[0] == pytest.approx(0, abs=1e-6)


def test_the_map_turns_where_the_light_leaves_the_vertical():
    def turn(lean):
        steep, flat = (look([lean[0] * s, -1.0, lean[1] * s]) for s in (0.0447, 0.0448))  # |f_y| 0.99900 on either side
        return math.degrees(math.acos(np.clip(steep @ flat, -1, 1)))

    def look(direction):
        maps = light_projection(SpotLight((0, 0, 0), tuple(direction), 0.1, 0.5, (1, 1, 1)),
                                load_scene("cornell_box").geometry, 4)
        return maps.frame[0, 0]

    assert abs(1 / math.hypot(1, 0.0447)) > 0.999 > abs(1 / math.hypot(1, 0.0448))
    assert math.degrees(math.acos(0.999)) == pytest.approx(2.56, abs=0.005)
    for lean, degrees in (((0, -1), 0), ((1, 0), 90), ((-1, 0), 90), ((0, 1), 180)):
        assert turn(lean) == pytest.approx(degrees, abs=0.5)
    for y, right, down in ((-1, (1, 0, 0), (0, 0, 1)), (1, (-1, 0, 0), (0, 0, 1))):
        np.testing.assert_allclose(frame_of((0, y, 0))[:2], [right, down], atol=ROUNDING)


AXES = {f"{sign}{'xyz'[axis]}": np.eye(3)[axis] * (1 if sign == "+" else -1) for sign in "+-" for axis in range(3)}


def test_faces_of_a_cube_are_those_of_the_table():
    table = re.findall(r"\| (\d) \| ([+-][xyz]) \| ([+-][xyz]) \| ([+-][xyz]) \|", DOCUMENT)
    maps, centre = cube_projection((0.3, 0.4, 0.5), 4), np.array([0.3, 0.4, 0.5])
    assert [int(row[0]) for row in table] == list(range(6))
    for face, *axes in table:
        forward, right, down = (AXES[name] for name in axes)
        for row, column in ((0, 0), (3, 1)):
            point = centre + 2.0 * (forward + ((column + 0.5) / 2 - 1) * right + ((row + 0.5) / 2 - 1) * down)
            assert project(maps, point)[:2] == pytest.approx((4 * int(face) + row + 0.5, column + 0.5), abs=1e-9)
    edge = centre + np.array([1.0, 0.0, -1.0])  # of faces 0 and 5
    assert project(maps, edge)[0] < 4


def test_halves_of_a_dual_paraboloid():
    maps = dual_paraboloid_projection((0, 0, 0), 4)
    for half, forward, right in ((0, (0, 0, 1), (-1, 0, 0)), (1, (0, 0, -1), (1, 0, 0))):
        for a, b in ((0.25, -0.5), (-0.25, 0.25)):
            d = np.multiply(forward, 1 - a * a - b * b) + np.multiply(right, 2 * a) + np.multiply((0, -1, 0), 2 * b)
            row, column, _ = project(maps, 3.0 * d)
            assert (row, column) == pytest.approx((4 * half + 2 + 2 * b, 2 + 2 * a), abs=1e-9)


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_directional_map_covers_the_box(direction):
    scene = load_scene("cornell_box")
    maps = light_projection(DirectionalLight(direction, (1, 1, 1)), scene.geometry, 16)
    axes = frame_of(direction)
    corners = np.array(np.meshgrid(*np.stack(scene.geometry.bounds, axis=1))).reshape(3, -1)
    inside = axes @ corners
    low, high = inside.min(axis=1), inside.max(axis=1)
    margin = 1e-6 * np.linalg.norm(high - low)
    for place in corners.T:
        row, column, depth = project(maps, place)
        x, y, z = axes @ place
        assert column == pytest.approx(16 * (x - low[0] + margin) / (high[0] - low[0] + 2 * margin), abs=1e-9)
        assert row == pytest.approx(16 * (y - low[1] + margin) / (high[1] - low[1] + 2 * margin), abs=1e-9)
        assert depth == pytest.approx(z - low[2] + margin, abs=1e-12)
