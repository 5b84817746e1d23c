"""Triangles with a corner in the plane through the eye that is parallel to the map: their part ahead is drawn."""

import numpy as np
import pytest

from refgi.rsm.buffers.light_projection import light_projection
from refgi.rsm.raster.projection import camera_projection
from refgi.rsm.raster.visibility_buffer import rasterize
from refgi.scene import Camera, Geometry, PointLight
from tests.naive import raster

SIZE = (19, 13)  # columns, rows
EYE = np.array([0.2, 0.9, 0.3])


def first_hits(vertices, faces):
    """Return the nearest triangle at each texel's centre by rays, -1 for none, and whether one passes near an edge."""
    half = np.array([SIZE[0] / SIZE[1], 1.0]) * np.tan(0.5)
    view = raster.look(np.array([0.0, 0.0, -1.0]), np.array([0.0, 1.0, 0.0]))
    found, doubtful = np.full(SIZE[::-1], -1), np.zeros(SIZE[::-1], bool)
    for row, column in np.ndindex(*SIZE[::-1]):
        origin, direction = raster.perspective_ray(EYE, view, half, SIZE[1], SIZE[0], row, column)
        found[row, column], _, weights, _ = raster.nearest(origin, direction, vertices, faces)
        doubtful[row, column] = found[row, column] >= 0 and np.min(weights) < 1e-6
    return found, doubtful


@pytest.mark.parametrize("offset", [0.0, 1e-14, -1e-14, 1e-12, -1e-12, 1e-9, -1e-9, 1e-7, 1e-5])
@pytest.mark.parametrize("corner", [0, 1, 2])
@pytest.mark.parametrize("many", [1, 40])  # more are drawn by clusters
def test_ahead_of_it_nothing_is_lost(offset, corner, many):
    random = np.random.default_rng([corner, many])
    ahead = EYE + np.stack([random.uniform(-1, 1, (many, 3)), random.uniform(-1, 1, (many, 3)),
                            -random.uniform(0.4, 2, (many, 3))], axis=-1)
    ahead[:, corner, 2] = EYE[2] - offset  # one corner in the plane, or by rounding not ahead of it
    vertices, faces = ahead.reshape(-1, 3), np.arange(3 * many, dtype=np.int32).reshape(-1, 3)
    geometry = Geometry(vertices, faces, np.zeros(many, np.int32))
    camera = Camera(tuple(EYE), tuple(EYE - (0, 0, 1)), vfov=1.0, width=SIZE[0], height=SIZE[1])
    drawn = rasterize(geometry, camera_projection(camera, *SIZE)).triangle_id
    expected, doubtful = first_hits(vertices, faces)
    assert (expected >= 0).sum() > 5
    np.testing.assert_array_equal(drawn[~doubtful], expected[~doubtful])


def test_a_table_beside_a_point_lamp_is_on_its_map():
    corners = np.array([[-0.35, 0.7, 0.3], [0.37, 0.8, -0.3], [-0.33, 0.74, -0.35]])
    geometry = Geometry(corners, np.array([[0, 1, 2]], np.int32), np.zeros(1, np.int32))
    maps = light_projection(PointLight(tuple(EYE), (1.0, 1.0, 1.0)), geometry, 13)
    face = rasterize(geometry, maps).triangle_id[5 * 13 :]  # along -z: a corner lies in its plane
    assert (face == 0).sum() > 5
