"""Visibility: the same triangle as a ray through each texel centre finds, no crack, no double cover, same bits."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.jit import threads
from refgi.rsm.buffers.light_projection import light_projection
from refgi.rsm.raster.projection import (
    ORTHOGRAPHIC,
    Projection,
    camera_projection,
    cube_projection,
    directional_projection,
    dual_paraboloid_projection,
    paraboloid_projection,
    view_frame,
)
from refgi.rsm.raster.visibility_buffer import rasterize
from refgi.scene import Camera, DirectionalLight, Geometry, PointLight
from tests.naive import raster
from tests.naive import raster as naive
from tests.rsm.shapes import geometry, height_field, rotation, sheet, soup, sphere

DOUBT = 1e-7  # barycentric or relative depth: closer decisions are rounding, of float32 nearness for the most part
CAMERA = Camera((0.3, 0.2, 2.5), (0.0, 0.1, 0.0), vfov=math.radians(60), width=48, height=40)
RAYS = {0: naive.perspective_ray, 1: naive.orthographic_ray, 2: naive.paraboloid_ray}


def expected(shape, projection):
    """Ids, nearest depths along the ray and margins at every texel of the stacked maps."""
    ids = np.full(projection.shape, -1)
    t = np.full(projection.shape, np.inf)
    margin = np.full(projection.shape, np.inf)
    for row in range(projection.shape[0]):
        m, local = divmod(row, projection.height)
        for column in range(projection.width):
            ray = RAYS[projection.kind](projection.origin[m], projection.frame[m], projection.half,
                                        projection.height, projection.width, local, column)  # fmt: skip
            if ray is not None:
                ids[row, column], t[row, column], _, margin[row, column] = naive.nearest(
                    *ray, shape.vertices, shape.faces
                )
    return ids, t, margin


def projections():
    light = DirectionalLight((0.2, -0.7, -0.4), (1, 1, 1))
    bounds = np.full(3, -2.0), np.full(3, 2.0)
    return {
        "perspective": camera_projection(CAMERA),
        "inside": camera_projection(dataclasses.replace(CAMERA, eye=(0.1, 0.05, -0.1), target=(1, 0.3, 0.2))),
        "wide": camera_projection(dataclasses.replace(CAMERA, eye=(0.1, 0.05, -0.1), vfov=math.radians(150))),
        "orthographic": directional_projection(light, bounds, 40),
        "cube": cube_projection((0.1, 0.2, 0.05), 20),
        "paraboloid": paraboloid_projection([(0.1, 0.2, 0.05), (0, 0, 2)], [(1, 2, 0.5), (0.1, 0, -1)], 32),
    }


@pytest.mark.parametrize("name", projections())
@pytest.mark.parametrize("count", [3, 40])
def test_ids_equal_those_of_a_ray_through_each_texel(name, count):
    rng = np.random.default_rng(count)
    for _ in range(3):
        shape, projection = soup(rng, count), projections()[name]
        ids, t, margin = expected(shape, projection)
        seen = rasterize(shape, projection)
        clear = margin > DOUBT
        assert clear.mean() > 0.98
        np.testing.assert_array_equal(seen.triangle_id[clear], ids[clear])
        hit = (seen.triangle_id >= 0) & clear
        assert hit.any() or count == 3
        near = 1 - t / projection.reach if projection.kind == ORTHOGRAPHIC else 1 / t
        if name == "paraboloid":  # 1/tau of a direction of length 1 + s^2 + t^2
            s = (2 * np.arange(32) + 1) / 32 - 1
            near = near * (1 + np.tile(np.add.outer(s**2, s**2), (2, 1)))
        np.testing.assert_allclose(seen.inverse_depth[hit], near[hit], rtol=3e-7)


def alone(shape, projection):
    """How many triangles of a shape cover each texel, drawn one by one."""
    count = np.zeros(projection.shape, int)
    for face in shape.faces:
        count += rasterize(geometry(shape.vertices, face), projection).triangle_id >= 0
    return count


@pytest.mark.parametrize("kind", ["perspective", "orthographic", "paraboloid", "cube"])
def test_a_sheet_covers_each_texel_exactly_once(kind):
    rng = np.random.default_rng(5)
    for _ in range(6):
        flat = sheet(5, rng, 0.4)
        turn = rotation(rng)
        shape = geometry(40 * flat.vertices @ turn.T + turn[:, 2], flat.faces)
        above, along = -turn[None, :, 2], view_frame(turn[:, 2])[None]
        projection = {
            "perspective": camera_projection(Camera((0, 0, 0), tuple(turn[:, 2]), tuple(turn[:, 1]), 1.5, 37, 29)),
            "orthographic": Projection(ORTHOGRAPHIC, 31, 33, above, along, np.array([20.0, 25.0]), 10.0),
            "paraboloid": paraboloid_projection([(0, 0, 0)], [turn[:, 2]], 33, 0.7),
            "cube": cube_projection((0, 0, 0), 15),
        }[kind]
        count = alone(shape, projection)
        assert count.max() == 1
        if kind != "cube":
            assert count.min() == 1


def test_shared_edges_and_vertices_on_texel_centres_belong_to_one_triangle():
    projection = Projection(ORTHOGRAPHIC, 16, 16, np.array([[0.0, 0, 4]]), view_frame((0, 0, -1), (0, 1, 0))[None],
                            np.array([1.0, 1.0]), 8.0)  # fmt: skip
    for n in (4, 8, 16, 32):
        flat = sheet(n)
        for shift in (0.0, 1 / 16):  # edges through the centres, and between them
            count = alone(geometry(flat.vertices * 2 + shift, flat.faces), projection)
            assert (count == 1).all()


def test_planes_through_texel_centres_of_a_paraboloid_belong_to_one_triangle():
    projection = paraboloid_projection([(0, 0, 0)], [(0, 0, 1)], 17)  # s = 0, t = 0 and s = t are texel centres
    s = (2 * np.arange(17) + 1) / 17 - 1
    inner = np.add.outer(s**2, s**2) < 0.9
    for n in (2, 4):
        flat = sheet(n)
        count = alone(geometry(flat.vertices * (64, 64, 1) + (0, 0, 1), flat.faces), projection)
        assert (count[inner] == 1).all()
        assert count.max() == 1


def test_a_lone_quad_owns_its_top_and_left_border():
    projection = Projection(ORTHOGRAPHIC, 8, 8, np.array([[0.0, 0, 4]]), view_frame((0, 0, -1), (0, 1, 0))[None],
                            np.array([4.0, 4.0]), 8.0)  # fmt: skip
    quad = geometry([[-1.5, 1.5, 0], [0.5, 1.5, 0], [0.5, -0.5, 0], [-1.5, -0.5, 0]], [[0, 1, 2], [0, 2, 3]])
    seen = rasterize(quad, projection).triangle_id >= 0
    rows, columns = np.nonzero(seen)  # x = -1.5 is the centre of column 2, y = 1.5 that of row 2
    assert (set(rows), set(columns)) == ({2, 3}, {2, 3})


def test_closed_meshes_have_no_hole():
    rng = np.random.default_rng(2)
    ball = sphere(14)
    for _ in range(4):
        turn, eye = rotation(rng), rng.uniform(-0.5, 0.5, 3)
        shape = geometry(ball.vertices @ turn.T, ball.faces)
        assert (rasterize(shape, cube_projection(eye, 64)).triangle_id >= 0).all()
        camera = Camera(tuple(eye), tuple(eye + turn[0]), tuple(turn[1]), math.radians(140), 97, 61)
        assert (rasterize(shape, camera_projection(camera)).triangle_id >= 0).all()
        both = dual_paraboloid_projection(eye, 64)
        s = (2 * np.arange(64) + 1) / 64 - 1
        disc = np.tile(np.add.outer(s**2, s**2) <= 1, (2, 1))
        np.testing.assert_array_equal(rasterize(shape, both).triangle_id >= 0, disc)


def test_a_closed_mesh_seen_from_outside_covers_what_lies_inside_its_silhouette():
    ball = sphere(20)
    projection = camera_projection(dataclasses.replace(CAMERA, width=200, height=160))
    covered = rasterize(ball, projection).triangle_id >= 0
    for row in range(160):
        columns = np.flatnonzero(covered[row])
        if len(columns):  # convex: every row is one run
            assert covered[row, columns[0] : columns[-1] + 1].all()
    assert covered.any()
    assert not covered.all()


def test_every_triangle_that_crosses_the_plane_of_the_eye_is_seen():
    camera = Camera((0, 0, 0), (0, 0, -1), width=32, height=24, vfov=math.radians(90))
    floor = geometry([[-50, -1, 50], [50, -1, 50], [0, -1, -90]], [[0, 1, 2]])
    seen = rasterize(floor, camera_projection(camera)).triangle_id
    ids, _, margin = expected(floor, camera_projection(camera))
    clear = margin > DOUBT
    np.testing.assert_array_equal(seen[clear], ids[clear])
    assert (seen[-1] == 0).all()
    assert (seen[:12] == -1).all()


@pytest.mark.feature("REF-19")
@pytest.mark.parametrize("name", projections())
def test_same_bits_for_any_threads_and_bands(name, evidence):
    shape, projection = soup(np.random.default_rng(8), 300), projections()[name]
    with threads(1):
        first = rasterize(shape, projection)
    for count, rows in ((1, 3), (2, None), (2, 1), (2, 17), (2, 1000)):
        with threads(count):
            again = rasterize(shape, projection, band_rows=rows)
        np.testing.assert_array_equal(first.triangle_id, again.triangle_id)
        np.testing.assert_array_equal(first.inverse_depth, again.inverse_depth)
    evidence(f"{name}: equal bits for 1 and 2 threads and 5 band heights")


def odd(rng):
    """Slivers, huge and tiny triangles, some twice, some through the eyes of `projections`."""
    common = soup(rng, 60).vertices.reshape(-1, 3, 3)
    slivers = common[:20] * 1.0
    slivers[:, 2] = slivers[:, 0] + (slivers[:, 1] - slivers[:, 0]) * 0.7 + rng.normal(0, 1e-5, (20, 3))
    tiny, huge = common[20:35] * 0.8 + rng.normal(0, 1e-3, (15, 3, 3)), common[35:45] * 0.3
    huge[:, 1] += rng.normal(0, 300, (10, 3))
    tiny = tiny.mean(axis=1, keepdims=True) + (tiny - tiny.mean(axis=1, keepdims=True)) * 0.02
    through = np.array([0.1, 0.05, -0.1]) + rng.normal(0, 0.5, (15, 1, 3)) + rng.normal(0, 0.05, (15, 3, 3))
    through[:, 1] += rng.normal(0, 4, (15, 3))  # long, thin, many across the plane of the eye
    parts = np.concatenate([common, slivers, tiny, huge, through, common[:10]])
    return geometry(parts, np.arange(3 * len(parts)))


@pytest.mark.parametrize("name", projections())
def test_all_at_once_is_each_alone_to_the_bit(name):
    """Whatever bounds, batches and bands do: nearest of the triangles drawn one by one, ties to the lowest id."""
    shape, projection = odd(np.random.default_rng(21)), projections()[name]
    assert len(shape.faces) == 130  # two batches and two triangles
    near = np.zeros(projection.shape, np.float32)
    ids = np.full(projection.shape, -1)
    for number, face in enumerate(shape.faces):
        one = rasterize(geometry(shape.vertices[face], [0, 1, 2]), projection)
        nearer = (one.triangle_id >= 0) & (one.inverse_depth > near)
        near[nearer], ids[nearer] = one.inverse_depth[nearer], number
    seen = rasterize(shape, projection)
    np.testing.assert_array_equal(seen.triangle_id, ids)
    np.testing.assert_array_equal(seen.inverse_depth, near)
    assert len(np.unique(ids)) > 10  # and not one triangle in front of all


def test_of_equal_triangles_the_first_is_seen():
    one = height_field(200)
    twice = geometry(one.vertices, np.concatenate([one.faces, one.faces]))
    projection = camera_projection(dataclasses.replace(CAMERA, eye=(0, 2, 2)))
    np.testing.assert_array_equal(rasterize(one, projection).triangle_id, rasterize(twice, projection).triangle_id)


@pytest.mark.parametrize("name", projections())
def test_triangles_without_area_are_passed_over(name):
    shape = soup(np.random.default_rng(9), 30)
    point, line = [0, 0, 0], [0, 1, 0]
    more = geometry(shape.vertices, np.concatenate([[point, line], shape.faces]))
    seen, plain = rasterize(more, projections()[name]), rasterize(shape, projections()[name])
    np.testing.assert_array_equal(np.where(seen.triangle_id < 0, -1, seen.triangle_id - 2), plain.triangle_id)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 40), (40, 1), (3, 17), (15, 16), (65, 15)])
def test_every_size_is_the_same_picture(height, width):
    shape = height_field(400)
    projection = camera_projection(dataclasses.replace(CAMERA, eye=(0, 2, 2)), width, height)
    ids, _, margin = expected(shape, projection)
    clear = margin > DOUBT
    seen = rasterize(shape, projection)
    assert seen.triangle_id.shape == seen.inverse_depth.shape == (height, width)
    np.testing.assert_array_equal(seen.triangle_id[clear], ids[clear])


@pytest.mark.parametrize("name", projections())
def test_nothing_is_seen_of_nothing(name):
    seen = rasterize(geometry(np.zeros((0, 3)), np.zeros((0, 3))), projections()[name])
    assert (seen.triangle_id == -1).all()
    assert (seen.inverse_depth == 0).all()


@pytest.mark.parametrize(("width", "height"), [(0, 5), (5, 0), (65537, 5), (-1, 5)])
def test_sizes_that_cannot_be_drawn_are_named(width, height):
    with pytest.raises(InputError, match="expected 1 to 65536 texels, got"):
        camera_projection(CAMERA, width, height)


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
def test_a_plane_past_the_eye_hides_what_its_distance_says(size):
    """A triangle of the plane y = -h, seen from the origin: h above 1e-9 of its size counts, below does not."""
    shape = geometry(size * np.array([[-1.0, 0, 0.5], [1, 0, 0.5], [0.1, 0, -3]]), [[0, 1, 2]])
    for height, seen in ((3e-8, True), (1e-11, False)):
        camera = Camera((0.0, height * size, 0.0), (0.0, height * size, -size), width=9, height=9)
        assert (rasterize(shape, camera_projection(camera)).triangle_id == 0).any() == seen


def test_a_plane_through_the_eye_hides_nothing():
    wall = [[-9, -9, -3], [9, -9, -3], [9, 9, -3], [-9, 9, -3]]
    edge_on = [[-1, 0.1, 5], [1, 0.1, 5], [0.2, 0.1, -7]]
    shape = geometry(wall + edge_on, [[0, 1, 2], [0, 2, 3], [4, 5, 6]])
    camera = Camera((0.0, 0.1, 0.0), (0.0, 0.1, -1.0), width=33, height=33)
    assert set(np.unique(rasterize(shape, camera_projection(camera)).triangle_id)) == {0, 1}


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
