"""`look_up`: against the literal text and closed forms, what it refuses, and that it depends on nothing else."""

import math

import numpy as np
import pytest

from refgi.errors import InputError
from refgi.frame import Frame
from refgi.literal import temporal as literal
from refgi.rsm.raster.projection import camera_projection, cube_projection
from refgi.scene import Camera, load_scene
from refgi.sssil.reprojection import SourceView, reproject

TESTS = {"depth_tolerance": 0.02, "normal_cosine": 0.95}
# float32 places are right to 1e-6 of a room a metre deep: 1e-4 texels at 40 rows, and as much of a value's step
TWIN_32, TWIN_64 = 2e-3, 1e-9


def source_of(frame):
    depth, normal = frame.gbuffer.resolve("depth", "normal")
    return SourceView(frame.gbuffer.projection, depth, normal, frame.origin)


def reprojected(values, there, frame, **changed):
    buffer = frame.gbuffer
    return reproject(values, there, buffer.position, buffer.normal, buffer.covered, origin=frame.origin,
                   **{**TESTS, **changed})


def wall(height=6, width=8, distance=2.0, dtype=np.float64, shift=(0.0, 0.0)):
    """A view straight at a wall whose pixels are 0.1 m wide, moved along the wall by pixels."""
    tan_half = 0.1 * height / 2 / distance
    x, y = shift[0] * 0.1, -shift[1] * 0.1
    camera = Camera((x, y, 0.0), (x, y, -distance), vfov=2 * math.atan(tan_half), width=width, height=height)
    view = camera_projection(camera)
    normal = np.zeros((3, height, width), dtype)
    normal[2] = 1
    rows, columns = np.mgrid[0:height, 0:width]
    position = np.stack([x + (columns + 0.5 - width / 2) * 0.1, y - (rows + 0.5 - height / 2) * 0.1,
                         np.full((height, width), -distance)]).astype(dtype)
    return SourceView(view, np.full((height, width), distance, dtype), normal), position


def ramp(height=6, width=8, dtype=np.float64):
    rows, columns = np.mgrid[0:height, 0:width]
    return np.stack([columns, rows, 10.0 + 0 * rows]).astype(dtype)


@pytest.fixture(scope="module")
def views():
    scene = load_scene("cornell_box").with_camera(width=40, height=30)
    x, y, z = scene.camera.eye
    other = scene.with_camera(eye=(x + 0.11, y + 0.05, z + 0.07))
    return [[Frame(s, dtype=dtype) for s in (scene, other)] for dtype in (np.float32, np.float64)]


@pytest.mark.feature("HSS-13")
@pytest.mark.parametrize("single", [True, False])
def test_equals_the_literal_text(views, single):
    there, here = views[0 if single else 1]
    values = np.random.default_rng(3).random((3, 30, 40)).astype(here.dtype)
    seen, buffer = source_of(there), here.gbuffer
    found, weight = reprojected(values, seen, here)
    half_v = math.tan(there.scene.camera.vfov / 2)
    camera = seen.projection.origin, seen.projection.frame, np.array([half_v * 40 / 30, half_v])
    mean, share = literal.reproject(*(plane.astype(float) for plane in (values, buffer.position, buffer.normal)),
                                    buffer.covered, *camera, seen.depth.astype(float), seen.normal.astype(float),
                                    *TESTS.values(), "bilinear")
    alike = np.abs(share - weight) <= TWIN_32  # others are tests that rounding decides
    assert np.abs(mean - found)[:, alike].max() < (TWIN_32 if single else TWIN_64)
    assert (~alike).sum() <= (2 if single else 0)
    assert 0.5 < weight[buffer.covered].mean() < 1


@pytest.mark.parametrize("single", [True, False])
def test_a_view_that_did_not_move_gives_its_values_back_to_the_bit(views, single):
    frame = views[0 if single else 1][0]
    values = np.random.default_rng(4).random((3, 30, 40)).astype(frame.dtype)
    found, weight = reprojected(values, source_of(frame), frame)
    covered = frame.gbuffer.covered
    assert np.array_equal(found, values * covered)
    assert np.array_equal(weight, covered.astype(frame.dtype))


@pytest.mark.feature("HSS-13")
def test_a_shift_by_whole_and_half_pixels(evidence):
    there, _ = wall()
    whole = reproject(ramp(), there, wall(shift=(2, 1))[1], there.normal, np.ones((6, 8), np.bool_), **TESTS)
    assert np.allclose(whole[0][:, :5, :6], ramp()[:, 1:, 2:], atol=1e-12)
    assert not whole[1][5].any()  # a row below the picture that was asked
    assert not whole[1][:, 6:].any()
    found, weight = reproject(ramp(), there, wall(shift=(0.5, 0.25))[1], there.normal, np.ones((6, 8), np.bool_),
                              **TESTS)
    inner = np.s_[:5, :7]
    error = max(np.abs(found[0] - ramp()[0] - 0.5)[inner].max(), np.abs(found[1] - ramp()[1] - 0.25)[inner].max())
    assert error < 1e-12
    assert np.allclose(weight[:5, 7], 0.5)  # half of the last column's texels lie beside the picture
    assert np.allclose(found[0][:5, 7], 7)  # and those that there are are renormalised
    evidence(f"a ramp shifted by (1/2, 1/4) pixel: {error:.0e} of a step off")


@pytest.mark.feature("HSS-13")
def test_nearest_takes_the_texel_the_point_falls_in():
    there, _ = wall()
    found, weight = reproject(ramp(), there, wall(shift=(0.4, 0.6))[1], there.normal, np.ones((6, 8), np.bool_),
                            fetch="nearest", **TESTS)
    assert np.array_equal(found[0][:5], ramp()[0][:5])
    assert np.array_equal(found[1][:5], ramp()[1][:5] + 1)
    assert not weight[5].any()
    assert set(np.unique(weight)) == {0.0, 1.0}


@pytest.mark.feature("HSS-13")
@pytest.mark.parametrize(("depth", "passes"), [(2.0, True), (2.03, True), (1.97, True), (2.05, False), (1.95, False),
                                               (np.inf, False)])
def test_another_depth_is_another_surface(depth, passes):
    there, position = wall()
    there = there._replace(depth=np.full_like(there.depth, depth))
    found, weight = reproject(ramp(), there, position, there.normal, np.ones((6, 8), np.bool_), **TESTS)
    assert (weight == passes).all()
    assert np.array_equal(found, ramp() * passes)


@pytest.mark.feature("HSS-13")
@pytest.mark.parametrize(("degrees", "passes"), [(0, True), (17, True), (19, False), (180, False)])
def test_another_normal_is_another_surface(degrees, passes):  # arccos 0.95 is 18.2 degrees
    there, position = wall()
    turned = np.zeros_like(there.normal)
    turned[0], turned[2] = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
    weight = reproject(ramp(), there, position, turned, np.ones((6, 8), np.bool_), **TESTS)[1]
    assert (weight == passes).all()


@pytest.mark.parametrize("distance", [2.0, 1.0])
def test_points_behind_beside_and_nowhere_find_nothing(distance):
    there, position = wall(distance=distance, dtype=np.float32)
    far = position.copy()
    far[0] += 5
    behind = -position
    lost = np.full_like(position, np.nan)
    for points in (far, behind, lost):
        found, weight = reproject(ramp(dtype=np.float32), there, points, there.normal, np.ones((6, 8), np.bool_),
                                  **TESTS)
        assert not weight.any()
        assert not found.any()
    found, weight = reproject(ramp(dtype=np.float32), there, position, there.normal, np.zeros((6, 8), np.bool_),
                              **TESTS)
    assert not weight.any()
    assert not found.any()


@pytest.mark.feature("HSS-13")
def test_the_origins_of_two_views_may_differ(views):
    there, here = views[1]
    values = np.random.default_rng(5).random((3, 30, 40))
    seen, buffer = source_of(there), here.gbuffer
    plain = reprojected(values, seen, here)[0]
    moved = reproject(values, seen._replace(origin=(8.0, 0.0, -4.0)),
                      buffer.position - np.reshape([-8, 0, 4], (3, 1, 1)), buffer.normal, buffer.covered,
                      origin=(0.0, 0.0, 0.0), **TESTS)[0]
    assert np.allclose(plain, moved, atol=1e-9)


def test_what_is_refused():
    there, position = wall()
    covered = np.ones((6, 8), np.bool_)
    with pytest.raises(InputError, match="values"):
        reproject(ramp(5), there, position, there.normal, covered, **TESTS)
    with pytest.raises(InputError, match="one perspective map"):
        reproject(ramp(), there._replace(projection=cube_projection((0, 0, 0), 4)), position, there.normal, covered,
                **TESTS)
