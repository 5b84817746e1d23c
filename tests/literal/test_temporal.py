"""Temporal coherence: rigid motion, shifts by parts of a pixel, clamps and means by hand."""

import math

import numpy as np
import pytest

from refgi.literal import temporal as literal

CAMERA = np.zeros((1, 3)), np.array([[[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]]), np.array([0.2, 0.15])  # 4 : 3
SHAPE = (6, 8)
TESTS = (0.02, 0.95, "bilinear")


def wall(shift=(0.0, 0.0), distance=2.0):
    """Return the points of a wall whose pixels are 0.1 m wide, at pixel centres moved right and down by pixels."""
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]
    place = np.stack([(column + 0.5 - 4 + shift[0]) * 0.1, -(row + 0.5 - 3 + shift[1]) * 0.1, -2.0 + 0.0 * row])
    return place * distance / 2, np.array([0.0, 0, 1])[:, None, None] * np.ones((3, *SHAPE)), np.full(SHAPE, distance)


def ramp():
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]
    return np.stack([column, row, 10.0 + 0 * row])


def shown(shift=(0.0, 0.0), **changed):
    """Return a ramp reprojected from a wall to its points moved by pixels."""
    position, normal, depth = wall(shift)
    depth = changed.get("depth", depth)
    return literal.reprojection(position, changed.get("normal", normal), np.zeros(SHAPE, int), *CAMERA, depth, normal,
                                ramp(), *TESTS)


@pytest.mark.feature("HSS-13")
def test_shifts_by_parts_of_a_pixel():
    light, weight = shown()
    np.testing.assert_array_equal(light, ramp())
    light, weight = shown((0.5, 0.25))
    np.testing.assert_allclose(light[:2, :5, :7], (ramp() + np.array([0.5, 0.25, 0])[:, None, None])[:2, :5, :7])
    np.testing.assert_allclose(weight[:5, 7], 0.5)  # half of the last column's texels lie beside the picture
    np.testing.assert_allclose(light[0, :5, 7], 7)  # and those that there are are their mean
    light, weight = shown((2.0, 1.0))
    np.testing.assert_array_equal(light[:, :5, :6], ramp()[:, 1:, 2:])
    assert not weight[5].any()
    assert not weight[:, 6:].any()


@pytest.mark.parametrize(("depth", "passes"), [(2.03, True), (1.97, True), (2.05, False), (1.95, False),
                                               (np.inf, False)])
def test_another_depth_is_another_surface(depth, passes):
    assert (shown(depth=np.full(SHAPE, depth))[1] == passes).all()


@pytest.mark.parametrize(("degrees", "passes"), [(17, True), (19, False), (180, False)])  # arccos 0.95 is 18.2 degrees
def test_another_normal_is_another_surface(degrees, passes):
    turned = np.array([math.sin(math.radians(degrees)), 0, math.cos(math.radians(degrees))])[:, None, None]
    assert (shown(normal=turned * np.ones((3, *SHAPE)))[1] == passes).all()


@pytest.mark.feature("HSS-14")
@pytest.mark.parametrize("smooth", [False, True])
def test_rigid_motion_is_taken_back(smooth):
    """Analytic: a turn and a shift of a triangle take its points and its normal along."""
    rng = np.random.default_rng(4)
    before = np.array([[-1.0, -1, -2], [1, -1, -3], [0, 1, -2.5]])
    c, s = math.cos(0.3), math.sin(0.3)
    turn, shift = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), np.array([0.1, 0.2, 0.05])
    now = before @ turn.T + shift
    weights = rng.dirichlet(np.ones(3), (2, 3))
    old = np.moveaxis(weights @ before, -1, 0)
    normals = rng.normal(size=(3, 3)) * 0.1 + [0, 0, 1] if smooth else None
    up = np.moveaxis(weights @ normals, -1, 0) if smooth else (
        np.cross(before[1] - before[0], before[2] - before[0])[:, None, None] * np.ones((3, 2, 3)))
    up /= np.sqrt((up**2).sum(axis=0))
    forward = np.tensordot(turn, old, 1) + shift[:, None, None], np.tensordot(turn, up, 1)
    vertex_normals = (normals @ turn.T, normals) if smooth else (None, None)
    found = literal.motion(*forward, np.zeros((2, 3), int), np.array([[0, 1, 2]]), now, before, *CAMERA,
                           *vertex_normals)
    np.testing.assert_allclose(found[0], old, atol=1e-14)
    np.testing.assert_allclose(found[1], up, atol=1e-14)
    still = literal.motion(*forward, np.zeros((2, 3), int), np.array([[0, 1, 2]]), now, now, *CAMERA)
    assert not still[2].any()


def test_speed_is_in_pixels():
    """Analytic: a wall that moves by (3, 4) pixels of 0.1 m moves by 5."""
    position, normal, _ = wall()
    corners = np.array([[-9.0, -9, -2], [9, -9, -2], [0, 9, -2]])
    before = corners - [0.3, 0.4, 0]
    speed = literal.motion(position, normal, np.zeros(SHAPE, int), np.array([[0, 1, 2]]), corners, before, *CAMERA)[2]
    np.testing.assert_allclose(speed, 5.0)


@pytest.mark.feature("HSS-13")
def test_points_that_enter_take_the_light_of_the_edge():
    """Analytic: a wall moved by three columns: they come in from the right, three pixels away, at exp(-3 / 6)."""
    position, _, depth = wall((3.0, 0.0))
    weight = np.where(np.arange(8) < 5, 1.0, 0.0) * np.ones(SHAPE)
    light, share = literal.entering(np.zeros((3, *SHAPE)), weight, position, np.zeros(SHAPE, int), *CAMERA, depth,
                                    ramp(), 6.0)
    np.testing.assert_allclose(share, np.where(np.arange(8) < 5, 0, math.exp(-0.5)) * np.ones(SHAPE))
    np.testing.assert_array_equal(light[:, :, 5:], ramp()[:, :, 7:] * np.ones((3, 6, 3)))
    assert not light[:, :, :5].any()


def test_a_clamp_by_hand():
    """Mean 2 and deviation 1 of four known pixels; one without a surface counts for nothing."""
    new = np.array([[[1.0, 3, 1], [3, 100, 0]]] * 3)
    triangle_id = np.array([[0, 0, -1], [0, -1, -1]])
    new[:, 0, 0] = 2 - math.sqrt(1.5)
    new[:, 0, 1] = new[:, 1, 0] = 2 + math.sqrt(1.5) / 2  # mean 2, variance (1.5 + 2 * 1.5 / 4) / 3 = 0.75
    earlier = np.full((3, 2, 3), 9.0)
    found = literal.clamp(earlier, new, triangle_id, 2.0, 1)
    np.testing.assert_allclose(found[:, triangle_id >= 0], 2 + 2 * math.sqrt(0.75))
    assert (found[:, triangle_id < 0] == 9).all()


@pytest.mark.feature("HSS-13")
def test_warming_up_is_the_mean_of_all_frames():
    """Analytic: a share of n / (n + 1) makes F the mean of n + 1 frames."""
    lights, seen = np.random.default_rng(5).random((6, 3, 2, 2)), np.ones((2, 2))
    light, n = lights[0], seen
    for new in lights[1:]:
        light, share, n = literal.blend(new, light, seen, 0.9, 10.0, n)
    np.testing.assert_allclose(light, lights.mean(axis=0))
    assert (n == 6).all()
    np.testing.assert_allclose(share, 5 / 6)


@pytest.mark.feature("HSS-13")
def test_the_recursion_keeps_its_share_of_the_variance():
    """Analytic (E-HSS-11): (1 - a) / (1 + a) of the variance of independent frames, as the sum of squared shares."""
    a, frames = 0.9, 400
    shares = literal.recursion(np.eye(frames), a)
    assert (shares**2).sum() == pytest.approx((1 - a) / (1 + a), rel=1e-12)
    weights = literal.blend(np.ones((3, 1, 2)), np.zeros((3, 1, 2)), np.array([[1.0, 0.0]]), a, 10.0)[1]
    assert weights.tolist() == [[a, 0.0]]  # what was not found has a = 0


def test_shares_fall_with_speed():
    seen = np.array([[1.0, 0.0]])
    share = literal.blend(np.ones((3, 1, 2)), np.zeros((3, 1, 2)), seen, 0.8, 4.0, None, np.array([[0.0, 0.5]]),
                          np.array([[4.0, 0.0]]))[1]
    np.testing.assert_allclose(share, [[0.8 / math.e, 0.4]])


def test_nothing_found_is_nothing_and_counts_anew():
    position, normal, depth = wall((2.0, 0.0))
    frames = np.full(SHAPE, 3.0)
    light, weight, n = literal.reprojection(position, normal, np.zeros(SHAPE, int), *CAMERA, depth, normal,
                                            ramp() + 1, *TESTS, frames)
    assert (weight > 0).any()
    assert not light[:, weight == 0].any()
    np.testing.assert_array_equal(n, 3 * (weight > 0))
    made, share, counted = literal.blend(np.full((3, *SHAPE), 7.0), light, weight, 0.9, 10.0, n)
    np.testing.assert_array_equal(counted, np.where(weight > 0, 4, 1))
    np.testing.assert_allclose(share, np.where(weight > 0, 0.75, 0))
    assert (made[:, weight == 0] == 7).all()


def test_the_eye_of_the_frame_before_counts():
    """Property: eye and points moved together see the same."""
    position, normal, depth = wall((0.5, 0.25))
    away = np.array([3.0, -2, 5])
    camera = CAMERA[0] + away, *CAMERA[1:]
    found = literal.reprojection(position + away[:, None, None], normal, np.zeros(SHAPE, int), *camera, depth, normal,
                                 ramp(), *TESTS)
    np.testing.assert_allclose(found[0], shown((0.5, 0.25))[0])


def test_a_square_ends_at_its_radius():
    """A bright pixel two columns away is no part of a square of radius 1, and of one of radius 2."""
    new = np.zeros((3, 1, 5))
    new[:, 0, 4] = 1
    found = [literal.clamp(np.ones((3, 1, 5)), new, np.zeros((1, 5), int), 1.0, radius)[0, 0, 2] for radius in (1, 2)]
    np.testing.assert_allclose(found, [0.0, 0.2 + 0.4])  # mean 1/5, deviation 2/5


def test_a_leaning_plane_is_one_surface():
    """Depths of neighbouring texels differ by 5 to 8 %, more than the tolerance: the plane tells."""
    n = np.array([math.sin(1.2), 0, math.cos(1.2)])
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]]

    def seen(shift):
        rays = np.stack([0.2 * (2 * (column + shift) + 1 - 8) / 8, -0.15 * (2 * row + 1 - 6) / 6, -1.0 + 0 * row])
        depth = -2.0 / np.tensordot(n, rays, 1)
        return depth * rays, depth

    normal = n[:, None, None] * np.ones((3, *SHAPE))
    (_, depth), (points, _) = seen(0.0), seen(0.5)
    assert (np.abs(np.diff(depth, axis=1)) / depth[:, 1:]).min() > 0.05
    light, weight = literal.reprojection(points, normal, np.zeros(SHAPE, int), *CAMERA, depth, normal, ramp(), *TESTS)
    np.testing.assert_allclose(weight[:, :7], 1)
    np.testing.assert_allclose(light[0, :, :7], column[:, :7] + 0.5)
