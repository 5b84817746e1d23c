"""Maps drawn by clusters are those drawn triangle by triangle, to the bit, whatever is hidden, small or edge-on."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.jit import threads
from refgi.rsm.raster import visibility_buffer
from refgi.rsm.raster.placed_clusters import SLACK, place
from refgi.rsm.raster.projection import ORTHOGRAPHIC, Projection, camera_projection, directional_projection, view_frame
from refgi.rsm.raster.visibility_buffer import Visibility, rasterize, scratch
from refgi.scene import Camera, DirectionalLight
from refgi.scene.triangles import CLUSTER
from refgi.skips import count_skips, without_skip
from tests.rsm.shapes import geometry, height_field, rotation, sheet, soup, sphere

CAMERA = Camera((0.3, 0.2, 2.5), (0.0, 0.1, 0.0), vfov=math.radians(60), width=150, height=131)
LIGHT = DirectionalLight((0.2, -0.7, -0.4), (1, 1, 1))


def one_by_one(shape, projection):
    """One map drawn as several are: triangle by triangle in mesh order, row by row, without clusters."""
    seen = Visibility(np.empty(projection.shape, np.int32), np.empty(projection.shape, np.float32))
    local = scratch(1, len(shape.vertices), projection)
    with threads(1):
        visibility_buffer._draw_maps(projection, shape.vertices, shape.faces, None, local, seen)
    return seen


def expect_same(shape, projection):
    seen, expected = rasterize(shape, projection), one_by_one(shape, projection)
    np.testing.assert_array_equal(seen.triangle_id, expected.triangle_id)
    np.testing.assert_array_equal(seen.inverse_depth, expected.inverse_depth)
    return seen


def projections():
    return {
        "perspective": camera_projection(CAMERA),
        "narrow": camera_projection(dataclasses.replace(CAMERA, eye=(3, 40, 60), vfov=math.radians(2))),
        "inside": camera_projection(dataclasses.replace(CAMERA, eye=(0.1, 0.05, -0.1), target=(1, 0.3, 0.2))),
        "wide": camera_projection(dataclasses.replace(CAMERA, eye=(0.1, 0.05, -0.1), vfov=math.radians(150))),
        "orthographic": directional_projection(LIGHT, (np.full(3, -2.0), np.full(3, 2.0)), 140),
    }


def joined(*shapes):
    starts = np.cumsum([0, *(len(shape.vertices) for shape in shapes)])
    return geometry(np.concatenate([shape.vertices for shape in shapes]),
                    np.concatenate([shape.faces + start for shape, start in zip(shapes, starts, strict=False)]))


def shuffled(shape, rng):
    return geometry(shape.vertices, rng.permutation(shape.faces))


def test_clusters_hold_each_triangle_once_with_its_own_corners():
    rng = np.random.default_rng(1)
    for shape in (shuffled(sphere(17), rng), soup(rng, 3 * CLUSTER), soup(rng, 1), height_field(5000)):
        found = shape.clusters
        assert shape.clusters is found
        np.testing.assert_array_equal(np.sort(found.face), np.arange(len(shape.faces)))
        of_place = np.arange(len(found.face)) // CLUSTER
        corners = found.vertex[:, found.start[of_place][:, None] + found.corner].transpose(1, 2, 0)
        np.testing.assert_array_equal(corners, shape.vertices[shape.faces[found.face]])
        for c in range(len(found.box)):
            here = corners[of_place == c]
            np.testing.assert_array_equal(found.box[c], [*here.min(axis=(0, 1)), *here.max(axis=(0, 1))])
            first, second = here[:, 1] - here[:, 0], here[:, 2] - here[:, 0]
            longest = (np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)).max()
            assert found.product[c] == pytest.approx(longest, rel=1e-12)
            normal = np.cross(first, second)
            offset = np.einsum("ij,ij->i", normal, here[:, 0] - (found.box[c, :3] + found.box[c, 3:]) / 2)
            np.testing.assert_allclose(found.plane[:3, of_place == c].T, normal, atol=2e-7 * longest)
            np.testing.assert_allclose(found.plane[3, of_place == c], offset, atol=1e-6 * longest)


@pytest.mark.parametrize("away", [0.0, 100.0])
def test_a_cluster_of_a_mesh_without_order_is_small_and_shares_its_vertices(away):
    field = height_field(20_000)
    shape = shuffled(geometry(field.vertices + away, field.faces), np.random.default_rng(2))
    side = (shape.clusters.box[:, 3:] - shape.clusters.box[:, :3]).max(axis=1)
    assert np.median(side) < 0.3  # of a square of 2, of which 64 of 20,000 triangles take 0.11 x 0.11
    assert np.diff(shape.clusters.start).mean() < CLUSTER


@pytest.mark.parametrize("name", projections())
def test_pictures_are_those_of_triangles_one_by_one(name):
    rng, projection = np.random.default_rng(3), projections()[name]
    for shape in (soup(rng, 300), soup(rng, 2000, 1.2, 0.02), shuffled(sphere(40), rng), height_field(30_000),
                  joined(height_field(3000), sphere(60, 0.4), soup(rng, 100))):
        expect_same(shape, projection)


@pytest.mark.parametrize("count", [1, 2])
def test_bands_and_threads_change_no_bit(count):
    shape, projection = joined(sphere(60), height_field(9000)), projections()["perspective"]
    expected = one_by_one(shape, projection)
    for rows in (None, 1, 2, 7, 1000):
        with threads(count):
            seen = rasterize(shape, projection, band_rows=rows)
        np.testing.assert_array_equal(seen.triangle_id, expected.triangle_id)
        np.testing.assert_array_equal(seen.inverse_depth, expected.inverse_depth)


@pytest.mark.parametrize("name", ["perspective", "orthographic"])
def test_hidden_clusters_are_passed_over_and_change_no_bit(name, evidence):
    """A ball behind a screen, and the far side of a ball in front of it, in the worst order of the mesh."""
    shape = joined(sphere(60, 0.5, (0, 0, -0.5)), height_field(4000), sphere(70, 0.6, (0.1, 0.1, 1.0)))
    projection = projections()[name]
    with count_skips() as counts:
        seen = expect_same(shape, projection)
    count = counts["rsm.clusters"]
    assert 0.2 * count.of < count.left_out < count.of
    with without_skip("rsm.clusters"):
        every = rasterize(shape, projection)
    np.testing.assert_array_equal(seen.triangle_id, every.triangle_id)
    np.testing.assert_array_equal(seen.inverse_depth, every.inverse_depth)
    evidence(f"{name}: {count.left_out} of {count.of} clusters and bands hidden, the same bits")


def edge_on(rng, axis):
    """Triangles almost or wholly within planes through the eye, along rows or columns of texel centres."""
    corners = rng.uniform(-1, 1, (40 * CLUSTER, 3, 3)) * (0.02, 0.02, 0.02)
    corners += rng.uniform(-0.6, 0.6, (len(corners), 1, 3)) * (1, 1, 0.2) + (0, 0, -2)
    noise = rng.choice([0.0, 1e-17, 1e-16, 1e-14, 1e-9], (len(corners), 1))
    # at the middle of an odd number of texels, at another centre, and anywhere
    slope = rng.choice([0.0, 2 / 131, -40 / 131], (len(corners), 1))
    corners[..., axis] = slope * math.tan(0.5) * corners[..., 2] + noise * rng.normal(size=(len(corners), 3))
    return geometry(corners, np.arange(3 * len(corners)))


@pytest.mark.parametrize("axis", [0, 1])
def test_what_is_seen_edge_on_is_drawn_where_it_is_alone(axis):
    rng = np.random.default_rng(4 + axis)
    projection = camera_projection(Camera((0, 0, 0), (0, 0, -1), vfov=1.0, width=131, height=131))
    thin = edge_on(rng, axis)
    shown = expect_same(thin, projection)
    assert (shown.triangle_id >= 0).sum() > 20  # rounding lets some of them count as seen
    front = sheet(40)
    near = geometry(front.vertices * (1.5, 1.5, 1) - (0, 0, 1.2), front.faces)
    expect_same(joined(thin, near), projection)  # behind a screen, where some come out in front of it


def test_planes_of_parallel_light_are_drawn_where_they_are_alone():
    rng = np.random.default_rng(6)
    corners = rng.uniform(-1, 1, (20 * CLUSTER, 1, 3)) + rng.normal(0, 0.02, (20 * CLUSTER, 3, 3))
    corners[::2, :, 0] = np.round(corners[::2, :1, 0] * 30) / 30 + rng.normal(0, 1e-17, (10 * CLUSTER, 3))
    thin = geometry(corners, np.arange(3 * len(corners)))
    projection = Projection(ORTHOGRAPHIC, 60, 60, np.array([[0.0, 0, 4]]), view_frame((0, 0, -1), (0, 1, 0))[None],
                            np.array([1.0, 1.0]), 8.0)
    expect_same(thin, projection)
    expect_same(joined(thin, geometry(np.add(sheet(20).vertices, (0, 0, 0.9)), sheet(20).faces)), projection)


@pytest.mark.parametrize("name", projections())
def test_bounds_of_clusters_hold_for_each_of_their_triangles(name):
    """Texels and keys of triangles drawn alone, and determinants in exact numbers where planes call all sound."""
    rng, projection = np.random.default_rng(7), projections()[name]
    sound = 0
    for size in (0.3, 0.05, 0.004):
        corners = soup(rng, CLUSTER, 0.3, size).vertices.reshape(-1, 3, 3)
        away = corners[::4, 0] - projection.origin[0]
        along = np.broadcast_to(projection.frame[0, 2], away.shape) if projection.kind == ORTHOGRAPHIC else away
        corners[::4, 1] = corners[::4, 0] + 0.1 * along  # edge-on
        shape = geometry(corners, np.arange(3 * CLUSTER))
        placed = place(projection, shape.clusters)
        drawn = one_by_one(shape, projection)
        rows, columns = np.nonzero(drawn.triangle_id >= 0)
        left, right, top, bottom = placed.rect[0]
        assert ((columns >= left) & (columns <= right) & (rows >= top) & (rows <= bottom)).all()
        volume = np.abs(placed.ahead[0] @ shape.clusters.plane)
        exact = np.abs(determinants(shape, projection))[shape.clusters.face]
        certain = volume >= placed.least_volume[0]
        assert (exact[certain] >= placed.least_det[0]).all()
        assert not certain[shape.clusters.face % 4 == 0].any()
        sound += certain.sum()
        ids = drawn.triangle_id[rows, columns]
        trusted = np.isin(ids, np.flatnonzero(np.abs(determinants(shape, projection)) >= placed.least_det[0]))
        assert (drawn.inverse_depth[rows, columns][trusted] <= placed.nearest[0] * (1 + SLACK)).all()
    assert sound > CLUSTER // 2 or name in ("inside", "wide")  # across the plane of the eye nothing is certain


def determinants(shape, projection):
    """Of corners (column w, row w, w), by NumPy, in extended precision."""
    local = (shape.vertices - projection.origin[0]).astype(np.longdouble) @ projection.frame[0].T
    w = np.ones(len(local)) if projection.kind == ORTHOGRAPHIC else local[:, 2]
    columns = (local[:, 0] / projection.half[0] + w) * (0.5 * projection.width)
    rows = (local[:, 1] / projection.half[1] + w) * (0.5 * projection.height)
    a, b, c = np.stack([columns, rows, w], axis=1)[shape.faces].transpose(1, 0, 2)
    return (np.cross(a, b) * c).sum(axis=1)


def test_screens_a_little_nearer_or_farther_hide_what_they_should():
    """Sheets a ten-thousandth to a tenth apart, small triangles and large ones."""
    rng = np.random.default_rng(8)
    projection = projections()["perspective"]
    for n in (9, 60):
        for gap in (0.0, 1e-7, 1e-4, 1e-3, 3e-3, 0.1):
            turn = rotation(rng) * (1, 1, 0.3)
            back = sheet(n, rng, 0.4)
            first, second = back.vertices @ turn.T, np.add(back.vertices, (0, 0, gap)) @ turn.T
            expect_same(joined(geometry(first, back.faces), geometry(second, back.faces)), projection)
