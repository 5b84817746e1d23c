"""Depth maps on hemispheres: triangles that reach behind them, maps of any width, and chunks that are skipped."""

import numpy as np
import pytest

from refgi.rsm import paraboloid_depth_maps
from refgi.rsm.raster.projection import paraboloid_projection
from refgi.rsm.raster.triangle import CHUNK, chunks
from tests.naive import raster as naive
from tests.rsm.shapes import geometry, soup

FLOAT32 = 3e-7  # two roundings
CLEAR = 1e-6  # barycentric coordinate, or share of a distance, that decides a texel beyond doubt


def expected(shape, center, frame, size):
    """Distances by rays against every triangle, and where they are beyond doubt."""
    distance, clear = np.full((size, size), np.inf), np.ones((size, size), bool)
    for row in range(size):
        for column in range(size):
            ray = naive.paraboloid_ray(center, frame, (1, 1), size, size, row, column)
            if ray is not None:
                winner, t, _, margin = naive.nearest(*ray, shape.vertices, shape.faces)
                clear[row, column] = margin > CLEAR
                distance[row, column] = t if winner >= 0 else np.inf
    return distance, clear


@pytest.mark.feature("VAL-11")
@pytest.mark.parametrize("behind", [(0, 0, -1), (0, 0, -1e-9), (1e-3, 0, -1), (-0.4, 0.3, -0.2)])
def test_a_corner_behind_draws_the_triangle_to_the_rim(behind):
    shape = geometry([(0.5, 0, 1), behind, (0.5, 0.6, 1)], [[0, 1, 2]])
    axis = np.array([0.0, 0, 1])
    frame = paraboloid_projection([(0, 0, 0)], [axis], 1).frame[0]
    seen = paraboloid_depth_maps(shape, [(0, 0, 0.0)], [axis], 33)[0]
    distance, clear = expected(shape, np.zeros(3), frame, 33)
    np.testing.assert_allclose(seen[clear], distance[clear], rtol=FLOAT32)
    assert np.isfinite(distance).sum() > 20 or behind[2] == -1e-9


@pytest.mark.parametrize("count", [1, CHUNK, CHUNK + 1, 3 * CHUNK - 1])
def test_skipped_chunks_hold_nothing_that_is_seen(count):
    rng = np.random.default_rng(count)
    shape = soup(rng, count, spread=1.5, size=0.2)
    shape = geometry(shape.vertices[np.argsort(shape.vertices[::3, 2], kind="stable").repeat(3) * 3 + np.tile(
        np.arange(3), count)], shape.faces)  # neighbours lie together, so that whole chunks are behind
    center, axis = np.array([0.1, 0, 0.2]), np.array([0.2, 0.1, 1.0])
    seen = paraboloid_depth_maps(shape, [center], [axis], 20, np.float64)[0]
    distance, clear = expected(shape, center, paraboloid_projection([center], [axis], 1).frame[0], 20)
    np.testing.assert_allclose(seen[clear], distance[clear], rtol=1e-11)


def test_chunks_hold_every_triangle_and_their_boxes():
    shape = soup(np.random.default_rng(3), CHUNK + 5)
    laid = chunks(shape.vertices, shape.faces)
    corners = laid.vertices[laid.faces]
    np.testing.assert_array_equal(corners[: CHUNK + 5], shape.vertices[shape.faces])
    local = (corners - laid.box[:, :3].repeat(CHUNK, axis=0)[:, None]).astype(np.float32)
    np.testing.assert_array_equal(laid.corners.transpose(0, 2, 1).reshape(-1, 3, 3), local)
    padding = corners[CHUNK + 5 :]
    np.testing.assert_array_equal(padding, np.repeat(padding[:, :1], 3, axis=1))
    for chunk, part in enumerate((corners[:CHUNK], corners[CHUNK : CHUNK + 5])):
        np.testing.assert_array_equal(laid.box[chunk], [*part.min(axis=(0, 1)), *part.max(axis=(0, 1))])


def test_nothing_to_draw():
    none = geometry(np.zeros((0, 3)), np.zeros((0, 3), int))
    assert np.isinf(paraboloid_depth_maps(none, [(0, 0, 0)], [(0, 0, 1)], 5)).all()
    assert paraboloid_depth_maps(soup(np.random.default_rng(1), 3), np.zeros((0, 3)), np.zeros((0, 3)), 5).shape == (
        0, 5, 5)  # fmt: skip


@pytest.mark.feature("VAL-11")
def test_what_sees_nothing_is_at_the_far_end(evidence):
    sheet = geometry([[-9, -9, 1], [9, -9, 1], [0, 15, 1]], [[0, 1, 2]])
    maps = paraboloid_depth_maps(sheet, [(0, 0, 0.0)] * 2, [(0, 0, 1.0), (0, 0, -1)], 16)
    s = (2 * np.arange(16) + 1) / 16 - 1
    outside = s[:, None] ** 2 + s**2 > 1
    assert np.isinf(maps[1]).all()
    assert np.isinf(maps[:, outside]).all()
    assert np.isfinite(maps[0, ~outside]).mean() > 0.7
    evidence("inf (far) outside the disc and where nothing is, also where memory held an earlier map")
