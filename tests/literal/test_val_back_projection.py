"""Literal back projection: a plate's shadow in closed form, cells, what lies behind."""

import numpy as np
import pytest

from refgi.literal.val_back_projection import back_projection, cells_below, covered, patches, projected
from refgi.literal.val_maps import direction, texel_centers

LEAK = 0.2  # of V: patches of a plane stand at unlike distances and leave gaps, as published; measured 0.17
EDGE = 0.05  # of V: a texel at the plate's edge is 0.015 m on the light's plane, 0.03 of the side; half of a cell
SIDE = 0.5


def plate_map(n, edge, height=1.0):
    """Return distances of a plate at x > edge."""
    s, t = texel_centers(np.zeros((n, n)))
    x, _, z = direction(s, t)
    with np.errstate(divide="ignore", invalid="ignore"):
        r = np.where((s * s + t * t <= 1) & (z > 0), height / z, np.inf)
        return np.where(np.isfinite(r) & (x * r > edge), r, np.inf)[None]


def seen(x, depth, facing, offset=0.0, axes=((1, 0, 0), (0, 1, 0))):
    """Return V of pixels (3, n) under a square of SIDE about (offset, 0, 0)."""
    ids = np.zeros((1, x.shape[1]), int)
    return back_projection(x[:, None], ids, facing[:, None], depth, np.zeros((1, 3)), np.eye(3)[None], np.array(
        [axes], float), np.full((2, 1), SIDE), np.array([[offset], [0.0]]), np.zeros((3, 1)), np.array(
            [[0.0], [0], [1]]), np.full(1, 9.0))[0, 0]


@pytest.mark.parametrize(("edge", "offset"), [(0.0, 0.0), (0.05, 0.0), (0.0, 0.1)])
def test_a_plate_hides_the_part_of_the_square_behind_it(edge, offset):
    """Similar triangles: from (x, 0, 3) the edge at z = 1 falls on u = x + 3/2 (edge - x) of the light's plane."""
    at = np.linspace(-0.6, 0.6, 13)
    x, up = np.stack([at, 0 * at, 0 * at + 3]), np.tile([[0.0], [0.0], [-1.0]], 13)
    falls = at + 1.5 * (edge - at)
    share = np.clip((falls - (offset - SIDE / 2)) / SIDE, 0, 1)
    leak = seen(x, plate_map(200, edge), up, offset) - share
    assert leak.min() > -EDGE
    assert leak.max() < LEAK
    assert (seen(x * np.array([[1], [1], [-1]]), plate_map(200, edge), -up, offset) == 1).all()  # behind the light


def sphere(n, half):
    """Return the map of a half sphere of radius 1, or of a quarter, which has no gaps."""
    s, t = texel_centers(np.zeros((n, n)))
    return np.where((s * s + t * t <= 1) & ((s > 0) | (not half)), 1.0, np.inf)[None]


def test_a_sphere_has_no_gaps():
    x, up = np.array([[0.0], [0.2], [3.0]]), np.array([[0.0], [0.0], [-1.0]])
    assert seen(x, sphere(100, half=False), up)[0] == 0
    assert seen(x, sphere(100, half=True), up)[0] == pytest.approx(0.5, abs=1e-12)


def test_what_lies_below_the_pixel_s_plane_does_not_count():
    """A pixel beside the light that faces aslant: half of the square is above its plane, and none of the plate."""
    x, up = np.array([[0.0], [0.0], [3.0]]), np.array([[1.0], [0.0], [0.0]])
    low, extent = np.full(2, -SIDE / 2), np.full(2, SIDE)
    u, v = cells_below(low, extent, x[:, 0], up[:, 0], 0.0)
    assert len(u) == len(v) == 32 * 16
    assert (u > 0).all()
    assert seen(x, np.full((1, 8, 8), np.inf), up)[0] == 1
    assert seen(x, np.full((1, 8, 8), np.inf), -up)[0] == 1
    assert seen(x, sphere(100, half=True), up)[0] == 0
    assert seen(x, sphere(100, half=True), -up)[0] == 1


def test_patches_stand_at_their_texels():
    depth = np.full((4, 4), np.inf)
    depth[1, 2] = 2.0
    toward, corners, z = patches(depth, np.eye(3), np.eye(3))
    assert z.tolist() == [2]
    np.testing.assert_allclose(np.linalg.norm(corners, axis=0), 2)
    np.testing.assert_allclose((corners[:2] / (2 + corners[2]))[..., 0], [[0, 0.5, 0.5, 0], [-0.5, -0.5, 0, 0]])
    np.testing.assert_allclose(toward[:, 0], direction(0.25, -0.25))


def test_a_patch_half_way_falls_twice_as_large_on_the_light():
    corners = np.array([[0.0, 1, 1, 0], [0, 0, 1, 1], [1, 1, 1, 1]])[..., None]
    np.testing.assert_allclose(projected(corners, np.array([0.0, 0, 2]), 0.0)[..., 0], 2 * corners[:2, :, 0])
    assert projected(corners, np.array([0.0, 0, 0.5]), 0.0).shape == (2, 4, 0)  # the patch lies behind the pixel


def test_places_within_a_quadrilateral():
    quad = np.array([[0.0, 2, 3, 0], [0, 0, 2, 1]])[..., None]
    for turn in (1, -1):
        inside = covered(quad[:, ::turn], np.array([1.0, 2.5, 2.9, -0.1]), np.array([0.5, 1.5, 0.1, 0.5]))
        assert inside.tolist() == [True, True, False, False]
