"""Literal buffers against rays of Embree, and against numbers by hand."""

import numpy as np
import pytest

from refgi.literal.buffers import image_points, rays, surface, tint, visible_triangles
from refgi.rays import Tracer
from refgi.rsm.raster.projection import view_frame
from refgi.scene import Geometry

SIZE = {"rows": 40, "columns": 56}
FRAMES = np.stack([view_frame((1.0, 0.2, 0.3)), view_frame((-1.0, 0.1, -0.4))])
EYES = np.array([[0.1, 0.2, -0.1], [0.3, -0.2, 0.2]])
HALF = np.array([1.2, 0.9])
EDGES = 0.002  # share of rays that pass an edge within float32's rounding
SINGLE = 3e-5  # m: float32 rays over a few metres, at a slant


def triangles(count=60):
    random = np.random.default_rng(7)
    middle = random.normal(size=(count, 1, 3)) * 3
    vertices = (middle + random.normal(size=(count, 3, 3))).reshape(-1, 3)
    return vertices, np.arange(3 * count).reshape(-1, 3)


@pytest.mark.parametrize("parallel", [False, True])
def test_nearest_triangles_depths_and_positions_are_those_of_rays(parallel):
    vertices, faces = triangles()
    half = HALF * (3 if parallel else 1)
    found = visible_triangles(vertices, faces, EYES, FRAMES, half, **SIZE, parallel=parallel)
    o, d = rays(EYES, FRAMES, half, **SIZE, parallel=parallel)
    back = 50.0 if parallel else 0.0  # maps of parallel rays see what lies behind their plane as well
    hits = Tracer(Geometry(vertices, faces, np.zeros(len(faces), np.int32))).closest(
        (o - back * d).reshape(3, -1).T, d.reshape(3, -1).T)
    same = found == hits.triangle_id.reshape(found.shape)
    assert same.mean() > 1 - EDGES
    assert 0.3 < (found >= 0).mean() < 1
    depth, position, normal, _ = surface(found, vertices, faces, np.zeros(len(faces), int), np.ones((1, 3)), EYES,
                                         FRAMES, half, **SIZE, parallel=parallel)
    seen = same & (found >= 0)
    far = hits.distance.reshape(found.shape)[seen] - back  # in lengths of d, 1 along the view's axis
    assert np.quantile(np.abs(depth[seen] - far), 0.99) < SINGLE
    np.testing.assert_allclose(position[:, seen], (o + depth * d)[:, seen])
    assert ((normal * d).sum(axis=0)[seen] < 0).all()
    assert np.isinf(depth[found < 0]).all()
    assert not position[:, found < 0].any()


def test_centres_of_two_by_two_texels_lie_at_half_of_the_half_extent():
    x, y = image_points(np.array([2.0, 1.0]), 1, 2, 2)
    assert x.tolist() == [[-1, 1], [-1, 1]]
    assert y.tolist() == [[-0.5, -0.5], [0.5, 0.5]]


def test_a_floor_seen_from_above_by_hand():
    corner = np.array([[-9.0, 0, -9], [9, 0, -9], [0, 0, 9]])
    up = np.array([[0.0, 1, 0]] * 3)
    up[0] = (0.6, 0.8, 0.0)
    down = np.array([[[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]])  # right, down, forward
    depth, position, normal, albedo = surface(
        np.array([[0]]), corner, np.array([[0, 1, 2]]), np.array([1]), np.array([[0.1] * 3, [0.2, 0.3, 0.4]]),
        np.array([[0.0, 2, -3]]), down, np.array([1.0, 1.0]), 1, 1, False, vertex_normals=up)
    assert depth.item() == pytest.approx(2)
    assert position[:, 0, 0] == pytest.approx([0, 0, -3])
    mean = np.array([0.6, 0.8 + 1 + 1, 0]) / 3  # (0, 0, -3) is the triangle's centre
    assert normal[:, 0, 0] == pytest.approx(mean / np.linalg.norm(mean))
    assert albedo[:, 0, 0] == pytest.approx([0.2, 0.3, 0.4])


def test_vertex_colours_are_linear_within_a_triangle():
    """Closed form: a corner has its own colour, the middle of an edge the mean of two, the centroid that of three."""
    vertices, faces = np.array([[0.0, 0, 0], [4, 0, 1], [0, 3, 2]]), np.array([[0, 1, 2]])
    colours = np.array([[[1.0, 0, 0], [0, 1, 0], [0.2, 0.4, 0.9]]])
    places = np.stack([vertices[0], vertices[2], (vertices[1] + vertices[2]) / 2, vertices.mean(axis=0), vertices[1]])
    triangle_id = np.array([[0, 0, 0, 0, -1]])
    expected = [colours[0, 0], colours[0, 2], colours[0, 1:].mean(axis=0), colours[0].mean(axis=0), np.zeros(3)]
    np.testing.assert_allclose(tint(triangle_id, places.T[:, None], vertices, faces, colours)[:, 0].T, expected,
                               atol=1e-15)
