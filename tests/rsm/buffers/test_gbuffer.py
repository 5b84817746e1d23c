"""The G-buffer: attributes against a literal twin, conventions where nothing is seen, channels one by one."""

import dataclasses
import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.jit import threads
from refgi.rsm import facing_normals, gbuffer
from refgi.rsm.buffers.attributes import ChannelMask
from refgi.rsm.buffers.gbuffer import GBuffer
from refgi.rsm.buffers.lines import SIDE
from refgi.rsm.raster.projection import (
    ORTHOGRAPHIC,
    PARABOLOID,
    camera_projection,
    cube_projection,
    directional_projection,
    paraboloid_projection,
)
from refgi.rsm.raster.visibility_buffer import rasterize
from refgi.scene import Camera, DirectionalLight, Material, material_table
from tests.naive import raster as naive
from tests.rsm.shapes import geometry, sheet, soup, sphere

CHANNELS = (*ChannelMask._fields, "triangle_id", "covered")
MATERIALS = (Material(diffuse=(0.1, 0.2, 0.3)), Material(diffuse=(0.4, 0.5, 0.6)), Material(diffuse=(0.7, 0.8, 0.9)))
CAMERA = Camera((0.4, 0.3, 2.5), (0.1, 0, 0), vfov=math.radians(55), width=44, height=36)
FLOAT64 = 1e-12  # two ways to the same point in float64; cancellation at grazing angles costs some digits
DOUBT = 1e-7


def shapes():
    rng = np.random.default_rng(11)
    flat = soup(rng, 60)
    ball = sphere(8)
    inverted = geometry(ball.vertices, ball.faces[:, ::-1], ball.vertex_normals)
    banded = geometry(flat.vertices, flat.faces, materials=np.arange(60) % 3)
    return {"flat": banded, "smooth": ball, "smooth inverted": inverted}


def buffer(shape, dtype=np.float64, camera=CAMERA, **size):
    return gbuffer(shape, material_table(MATERIALS, dtype), camera, dtype=dtype, **size)


@pytest.mark.parametrize("name", shapes())
def test_channels_equal_those_of_a_literal_twin(name):
    shape = shapes()[name]
    seen = buffer(shape)
    frame = naive.look(np.subtract(CAMERA.target, CAMERA.eye), CAMERA.up)
    half = (math.tan(CAMERA.vfov / 2) * CAMERA.width / CAMERA.height, math.tan(CAMERA.vfov / 2))
    compared = 0
    for row in range(CAMERA.height):
        for column in range(CAMERA.width):
            ray = naive.perspective_ray(CAMERA.eye, frame, half, CAMERA.height, CAMERA.width, row, column)
            hit = naive.nearest(*ray, shape.vertices, shape.faces)
            if hit[0] < 0 or hit[3] < DOUBT:
                continue
            expected = naive.attributes(ray[1], hit, shape.vertices, shape.faces, shape.vertex_normals)
            position, normal, distance = expected
            at = row, column
            assert seen.triangle_id[at] == hit[0]
            np.testing.assert_allclose(seen.depth[at], hit[1], rtol=FLOAT64)
            np.testing.assert_allclose(seen.distance[at], distance, rtol=FLOAT64)
            np.testing.assert_allclose(seen.position[:, row, column], position, atol=FLOAT64)
            np.testing.assert_allclose(seen.normal[:, row, column], normal, atol=1e3 * FLOAT64)
            material = shape.material_of_face[hit[0]]
            assert seen.material_id[at] == material
            np.testing.assert_array_equal(seen.albedo[:, row, column], MATERIALS[material].diffuse)
            compared += 1
    assert compared > 300


RAYS = {ORTHOGRAPHIC: naive.orthographic_ray, PARABOLOID: naive.paraboloid_ray}


def maps():
    light = DirectionalLight((0.3, -0.8, -0.4), (1, 1, 1))
    return {
        "orthographic": directional_projection(light, (np.full(3, -1.4), np.full(3, 1.4)), 28),
        "cube": cube_projection((0.2, 0.1, 0.3), 14),
        "paraboloid": paraboloid_projection([(0.2, 0.1, 1.9), (0, 0, -2.2)], [(0.1, 0, -1), (0, 0.2, 1)], 22),
        "wide": camera_projection(dataclasses.replace(CAMERA, width=2 * SIDE + 13, height=19)),
    }


@pytest.mark.parametrize("kind", maps())
@pytest.mark.parametrize("name", ["flat", "smooth"])
def test_channels_of_maps_equal_those_of_a_literal_twin(name, kind):
    """Of lights' maps, several of which are stacked, and of rows that are longer than a tile."""
    shape, projection = shapes()[name], maps()[kind]
    seen = GBuffer(shape, material_table(MATERIALS, np.float64), projection, rasterize(shape, projection), np.float64)
    make, compared = RAYS.get(projection.kind, naive.perspective_ray), set()
    for row in range(seen.height):
        m, local = divmod(row, projection.height)
        for column in range(row % 5, seen.width, 5):
            ray = make(projection.origin[m], projection.frame[m], projection.half, projection.height,
                       projection.width, local, column)  # fmt: skip
            if ray is None:
                continue
            hit = naive.nearest(*ray, shape.vertices, shape.faces)
            if hit[0] < 0 or hit[3] < DOUBT:
                continue
            expected = naive.attributes(ray[1], hit, shape.vertices, shape.faces, shape.vertex_normals)
            position, normal, distance = expected
            np.testing.assert_allclose(seen.position[:, row, column], position, atol=FLOAT64)
            np.testing.assert_allclose(seen.normal[:, row, column], normal, atol=1e3 * FLOAT64)
            np.testing.assert_allclose([seen.distance[row, column], seen.depth[row, column]], [distance, hit[1]],
                                       rtol=FLOAT64)  # fmt: skip
            material = shape.material_of_face[hit[0]]
            np.testing.assert_array_equal(seen.albedo[:, row, column], MATERIALS[material].diffuse)
            assert seen.material_id[row, column] == material
            compared.add((m, column // SIDE))
    assert len(compared) >= {"orthographic": 1, "cube": 4, "paraboloid": 2, "wide": 2}[kind]  # maps and tiles


@pytest.mark.parametrize("order", ["sorted", "as drawn"])
def test_texels_of_several_maps_are_those_of_the_whole(order):
    """Maps with centres of their own."""
    shape, projection = shapes()["smooth"], maps()["paraboloid"]
    visibility, materials = rasterize(shape, projection), material_table(MATERIALS, np.float64)
    texel = np.random.default_rng(2).choice(2 * 22 * 22, 120, replace=False)
    texel = np.sort(texel) if order == "sorted" else texel
    some = GBuffer(shape, materials, projection, visibility, np.float64).at(texel, *CHANNELS)
    whole = GBuffer(shape, materials, projection, visibility, np.float64).resolve(*CHANNELS)
    for part, full in zip(some, whole, strict=True):
        np.testing.assert_array_equal(part, full.reshape(*full.shape[:-2], -1)[..., texel])


def test_the_same_bits_for_any_threads_and_tiles():
    """Texels alone, which know of no tile, have the bits of pictures of several tiles a row and a column."""
    rng = np.random.default_rng(9)
    for shape in shapes().values():
        projection = camera_projection(dataclasses.replace(CAMERA, width=SIDE + 61, height=75))
        visibility, materials = rasterize(shape, projection), material_table(MATERIALS, np.float32)
        texel = np.sort(rng.choice(projection.width * 75, 2000, replace=False))
        channels = []
        for count in (1, 2):
            with threads(count):
                whole = GBuffer(shape, materials, projection, visibility, np.float32)
                channels.append([whole.resolve(name)[0] for name in CHANNELS])
        some = GBuffer(shape, materials, projection, visibility, np.float32).at(texel, *CHANNELS)
        for one, two, part in zip(*channels, some, strict=True):
            np.testing.assert_array_equal(one, two)
            np.testing.assert_array_equal(one.reshape(*one.shape[:-2], -1)[..., texel], part)


def test_positions_lie_on_their_triangles_planes():
    shape = shapes()["flat"]
    seen = buffer(shape, camera=dataclasses.replace(CAMERA, width=300, height=200))
    ids = seen.triangle_id[seen.covered]
    corners = shape.vertices[shape.faces[ids]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = np.einsum("ij,ij->i", seen.position[:, seen.covered].T - corners[:, 0], normal)
    assert np.abs(height).max() < 1e-14


def test_normals_are_unit_vectors_that_face_the_eye():
    for shape in shapes().values():
        seen = buffer(shape)
        normal, position = seen.normal[:, seen.covered], seen.position[:, seen.covered]
        np.testing.assert_allclose(np.linalg.norm(normal, axis=0), 1, rtol=1e-15 * 4)
        if shape.vertex_normals is None:
            assert ((normal * (np.array(CAMERA.eye)[:, None] - position)).sum(axis=0) > 0).all()


@pytest.mark.feature("REF-19")
def test_float32_is_the_rounded_float64(evidence):
    for name, shape in shapes().items():
        double, single = buffer(shape), buffer(shape, np.float32)
        for channel in CHANNELS:
            exact, (rounded,) = double.resolve(channel)[0], single.resolve(channel)
            if channel in ("triangle_id", "material_id", "covered"):
                np.testing.assert_array_equal(exact, rounded)
            else:
                assert rounded.dtype == np.float32
                np.testing.assert_array_equal(exact.astype(np.float32), rounded, err_msg=f"{name} {channel}")
    evidence("every channel: float32 equals the rounded float64")


@pytest.mark.parametrize("name", shapes())
def test_channels_alone_equal_channels_together(name):
    shape = shapes()[name]
    together = dict(zip(CHANNELS, buffer(shape).resolve(*CHANNELS), strict=True))
    for channel in CHANNELS:
        alone = buffer(shape)
        np.testing.assert_array_equal(getattr(alone, channel), together[channel])
        assert getattr(alone, channel) is getattr(alone, channel)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("name", shapes())
def test_channels_at_some_texels_are_those_of_the_whole(name, dtype):
    rng = np.random.default_rng(4)
    whole = buffer(shapes()[name], dtype)
    for texel in (rng.integers(0, 36 * 44, 150), np.arange(36 * 44), np.zeros(0, np.int64), np.array([7, 7])):
        some = buffer(shapes()[name], dtype)
        for given, channel in zip(some.at(texel, *CHANNELS), CHANNELS, strict=True):
            full = getattr(whole, channel)
            np.testing.assert_array_equal(given, full.reshape(*full.shape[:-2], -1)[..., texel])
            assert given.dtype == full.dtype


def test_a_channel_is_computed_only_when_asked_for():
    seen = buffer(shapes()["flat"])
    assert set(seen._channels) == set()
    _ = seen.depth
    assert set(seen._channels) == {"depth"}


def test_where_there_is_no_surface():
    seen = buffer(shapes()["smooth"])
    empty = ~seen.covered
    assert empty.any()
    assert np.isinf(seen.depth[empty]).all()
    assert np.isinf(seen.distance[empty]).all()
    assert (seen.triangle_id[empty] == -1).all()
    assert (seen.material_id[empty] == -1).all()
    for channel in (seen.position, seen.normal, seen.albedo):
        assert (channel[:, empty] == 0).all()
        assert channel.flags.c_contiguous
    assert (seen.height, seen.width) == (36, 44)


def test_nothing_to_see():
    seen = buffer(geometry(np.zeros((0, 3)), np.zeros((0, 3))))
    assert not seen.covered.any()
    assert np.isinf(seen.depth).all()


def test_a_vertex_without_a_normal_shades_with_the_faces():
    ball = sphere(6)
    bare = geometry(ball.vertices, ball.faces, np.zeros_like(ball.vertices))
    flat = geometry(ball.vertices, ball.faces)
    np.testing.assert_allclose(buffer(bare).normal, buffer(flat).normal)


def test_errors_name_what_is_wrong():
    shape = shapes()["flat"]
    with pytest.raises(InputError, match="channel: expected a channel of the G-buffer, got 'colour'"):
        buffer(shape).resolve("colour")
    with pytest.raises(InputError, match="dtype: expected float32 or float64, got 'float16'"):
        buffer(shape, np.float16)


@pytest.mark.parametrize("kind", ["camera", "paraboloid"])
def test_triangles_seen_edge_on_lie_between_their_corners(kind):
    """With the eye in a triangle's plane d . N is rounding or 0; its points must still have a depth of the triangle."""
    rng, covered = np.random.default_rng(5), 0
    for _ in range(150):
        corners = rng.uniform(-1, 1, (3, 3))
        eye, target = (3 * rng.dirichlet((1, 1, 1)) - 2 / 3) @ corners, rng.dirichlet((1, 1, 1)) @ corners
        if kind == "camera":
            view = camera_projection(Camera(tuple(eye), tuple(target), vfov=math.radians(40), width=7, height=3))
            reach = (corners - eye) @ view.frame[0, 2]
        else:
            view = paraboloid_projection(eye[None], (target - eye)[None], 7)
            reach = np.linalg.norm(corners - eye, axis=1)
        shape = geometry(corners, np.array([[0, 1, 2]], np.int32))
        seen = GBuffer(shape, material_table(MATERIALS), view, rasterize(shape, view), np.float64)
        here = seen.covered
        covered += np.count_nonzero(here)
        least = max(reach.min(), 0) if kind == "camera" else 0
        assert ((seen.depth[here] >= least - 1e-15) & (seen.depth[here] <= reach.max() + 1e-15)).all()
        assert np.isfinite(seen.position).all()
    assert covered > 25


ROUNDING = {np.float32: 1e-7, np.float64: 4e-16}  # of a unit vector's components


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_the_normal_of_the_face_on_the_side_of_the_shading_normal(dtype):
    rng, ball = np.random.default_rng(5), sphere(6)
    face = rng.integers(-1, len(ball.faces), (7, 9)).astype(np.int32)
    shading = rng.normal(size=(3, 7, 9)).astype(dtype)
    expected = np.zeros((3, 7, 9))
    for i, j in np.ndindex(face.shape):
        if face[i, j] >= 0:
            a, b, c = ball.vertices[ball.faces[face[i, j]]]
            n = np.cross(b - a, c - a)
            n /= np.linalg.norm(n)
            expected[:, i, j] = n if n @ shading[:, i, j] >= 0 else -n
    found = facing_normals(ball, face, shading)
    assert found.dtype == dtype
    assert np.abs(found - expected).max() <= ROUNDING[dtype]


def test_without_vertex_normals_the_shading_normals_are_the_faces():
    flat = sheet(2)
    flat = geometry(flat.vertices, flat.faces)
    shading = np.zeros((3, 2, 2), np.float32)
    assert facing_normals(flat, np.zeros((2, 2), np.int32), shading) is shading


def test_a_face_without_area_has_no_normal():
    none = geometry([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], normals=np.tile([0.0, 1.0, 0.0], (3, 1)))
    assert not facing_normals(none, np.zeros((1, 1), np.int32), np.ones((3, 1, 1), np.float32)).any()
