"""Upsampling and blurs: what planes and linear functions must become, numbers by hand."""

import numpy as np
import pytest

from refgi.literal import upsampling as literal


def plane(shape, across=0.3, down=1.0):
    """Return depths of a plane, whose nearness is linear in the picture, and its constant normal."""
    y, x = ((np.arange(size) + 0.5) / size for size in shape)
    return 1 / (0.2 + down * y[:, None] + across * x), np.array([0.0, 1, 0])[:, None, None] * np.ones((3, *shape))


def wall(shape):
    """Return places, normals and depths of a wall seen head-on, a texel 1/8 m wide."""
    y, x = np.mgrid[: shape[0], : shape[1]] / 8
    return np.stack([x, y, np.full(shape, -3.0)]), np.array([0.0, 0, 1])[:, None, None] * np.ones((3, *shape)), \
        np.full(shape, 3.0)


def test_tents_leave_linear_functions_as_they_are():
    """Analytic: their sum is 1, the mean place is t; the weights that docs/methods/hssil prints."""
    t = np.linspace(-0.5, 0.5, 41)
    weights = [literal.tent(step, t) for step in (-1, 0, 1)]
    np.testing.assert_allclose(sum(weights), 1)
    np.testing.assert_allclose(weights[2] - weights[0], t, atol=1e-15)
    far = np.where(t > 0, weights[0], weights[2])
    np.testing.assert_allclose(far, (1 - 2 * np.abs(t)) / 6, atol=1e-15)
    np.testing.assert_allclose(weights[1], (2 - np.abs(t)) / 3)


@pytest.mark.parametrize("axis", [0, 1])
def test_slopes_of_planes_and_of_silhouettes(axis):
    nearness = 1 / plane((6, 9))[0]
    step = (1.0 / 6, 0.3 / 9)[axis]
    np.testing.assert_allclose(literal.slope(nearness, axis), step)
    nearness[2:4, 3:5] = 0  # nothing is seen: neighbours have no slope there
    g = literal.slope(nearness, axis)
    assert not g[2:4, 3:5].any()
    assert g[0, 0] == pytest.approx(step)
    assert g[(1, 2)[axis], (3, 2)[axis]] == 0  # beside them


@pytest.mark.feature("HSS-11")
@pytest.mark.parametrize("factor", [2, 4])
@pytest.mark.parametrize("nearest", [True, False])
def test_linear_light_stays_linear_on_a_plane(factor, nearest):
    """Analytic: away from the rim of the picture, whether texels have the depth of a corner or of their middle."""
    depth, normal = plane((32, 48), down=4.0)
    ramp = 3 * np.arange(48) + 5 * np.arange(32)[:, None] + 1.0
    tiles = (32 // factor, factor, 48 // factor, factor)
    light, below = ramp.reshape(tiles).mean((1, 3)), 1 / (1 / depth).reshape(tiles).mean((1, 3))
    if nearest:
        light, below = (array[factor - 1 :: factor, factor - 1 :: factor] for array in (ramp, depth))
    found = literal.upsample(np.stack([light] * 3), below, normal[:, ::factor, ::factor], depth, normal, factor, 0.02,
                             8.0, nearest)
    np.testing.assert_allclose(found[:, factor:-factor, factor:-factor], [ramp[factor:-factor, factor:-factor]] * 3)
    summed = literal.level_sum(np.stack([light] * 3), below, normal[:, ::factor, ::factor], depth, normal, found,
                               factor, 0.02, 8.0, nearest)
    np.testing.assert_allclose(summed, 2 * found)


@pytest.mark.feature("HSS-11")
def test_no_light_crosses_a_step_or_an_edge():
    depth, normal = np.full((8, 12), 2.0), np.array([0.0, 0, 1])[:, None, None] * np.ones((3, 8, 12))
    light = (np.arange(6) < 3) * np.ones((3, 4, 1))
    for other in ((np.where(np.arange(12) < 6, 2.0, 3.0) + 0 * depth, normal),
                  (depth, np.where(np.arange(12) < 6, normal, normal[[2, 0, 1]]))):
        found = literal.upsample(light, other[0][::2, ::2], other[1][:, ::2, ::2], *other, 2, 0.02, 8.0, True)
        np.testing.assert_allclose(found, (np.arange(12) < 6) * np.ones((3, 8, 1)), atol=1e-15)
    plain = literal.bilinear(light, depth[::2, ::2], depth, 2)
    np.testing.assert_allclose(plain[0, 3], [1] * 5 + [0.75, 0.25] + [0] * 5)  # a quarter from beyond


@pytest.mark.parametrize("size", [3, 4, 8])
def test_a_blur_is_the_mean_of_a_tile(size):
    """Analytic: light that repeats in tiles becomes its mean over one."""
    tile = np.random.default_rng(3).random((3, size, size))
    count = 32 // size
    found = literal.blur(np.tile(tile, (1, count, count)), *wall((count * size, count * size)), size, 0.01, 0.9)
    inner = found[:, size:-size, size:-size]
    np.testing.assert_allclose(inner, tile.mean(axis=(1, 2))[:, None, None] * np.ones_like(inner))


def test_a_blur_stays_on_its_surface():
    position, normal, depth = wall((6, 10))
    light = (np.arange(10) >= 5) * np.ones((3, 6, 1))
    lower = position - (np.arange(10) >= 5) * np.array([0, 0, 0.1])[:, None, None]
    for place, up in ((lower, normal), (position, np.where(np.arange(10) >= 5, normal[[2, 0, 1]], normal))):
        np.testing.assert_array_equal(literal.blur(light, place, up, depth, 3, 0.01, 0.9), light)
    assert (literal.blur(light, position, normal, depth, 3, 0.01, 0.9) != light).any()


def test_blocks_of_two_keep_a_ramp_on_a_wall():
    """Analytic: bilinear weights leave linear light as it is; the chosen pixels keep theirs (SII Table 3)."""
    position, normal, depth = wall((9, 12))
    covered = np.isfinite(depth)
    ramp = (2 * np.arange(12) + 3 * np.arange(9)[:, None]) * np.ones((3, 1, 1))
    found = literal.joint_bilateral(position, normal, covered, ramp)
    np.testing.assert_allclose(found[:, :, :-1], ramp[:, :, :-1])
    covered[0, 0] = False
    found = literal.joint_bilateral(position, normal, covered, ramp)
    assert not found[:, 0, 0].any()
    np.testing.assert_array_equal(found[:, 0, 1], ramp[:, 0, 1])  # the first with a surface of its block


def test_weights_by_hand():
    """Two texels, one 1 % farther away and turned by a cosine of 0.9; a pixel a quarter texel beside the other."""
    depth, normal = np.full((2, 4), 2.0), np.array([0.0, 0, 1])[:, None, None] * np.ones((3, 2, 4))
    below, turned = np.array([[2.0, 2.02]]), normal[:, :1, :2].copy()
    turned[:, 0, 1] = np.sqrt(0.19), 0, 0.9
    found = literal.upsample(np.array([[[1.0, 5.0]]] * 3), below, turned, depth, normal, 2, 0.02, 8.0, False)
    delta = 1 - 2 / 2.02
    other = (1 + 4 * 0.25) / 6 * (1 - delta**2 / (32 * 0.02**2)) ** 16 * 0.9**8
    own = (2 - 0.25) / 3
    assert found[0, 0, 1] == pytest.approx((own + 5 * other) / (own + other))
    assert 0.8 < (1 - delta**2 / (32 * 0.02**2)) ** 16 < np.exp(-(delta**2) / (2 * 0.02**2)) + 1e-3


def test_a_pixel_that_no_texel_is_like_takes_the_nearest_in_depth():
    depth, normal = np.full((2, 4), 2.0), np.array([0.0, 0, 1])[:, None, None] * np.ones((3, 2, 4))
    found = literal.upsample(np.array([[[1.0, 5.0]]] * 3), np.array([[9.0, 4.0]]), normal[:, :1, :2], depth, normal, 2,
                             0.02, 8.0, True)
    np.testing.assert_array_equal(found, 5.0)


def test_of_texels_as_near_in_depth_the_closest_is_taken():
    """A sliver of one pixel, unlike all texels: by rows first, each row's own column, then the one beside it."""
    depth, normal = np.full((6, 6), 2.0), np.array([0.0, 0, 1])[:, None, None] * np.ones((3, 6, 6))
    texels, other = np.arange(9.0).reshape(3, 3) * np.ones((3, 1, 1)), -normal[:, ::2, ::2]
    for missing, expected in (((), 4), ([4], 5), ([4, 5], 3), ([3, 4, 5], 1), ([0, 1, 2, 3, 4, 5], 7)):
        below = np.full(9, 4.0)
        below[list(missing)] = np.inf
        found = literal.upsample(texels, below.reshape(3, 3), other, depth, normal, 2, 0.02, 8.0, True)
        assert found[0, 2, 3] == expected  # an upper right pixel of the texel in the middle


@pytest.mark.parametrize(("size", "window"), [(3, [0, 1, 1, 1, 0]), (4, [0.5, 1, 1, 1, 0.5])])
def test_a_window_by_hand(size, window):
    """One bright texel of a wall spreads over a box about it, along both axes."""
    light = np.zeros((3, 11, 11))
    light[:, 5, 5] = 1
    found = literal.blur(light, *wall((11, 11)), size, 0.01, 0.9)
    spread = np.pad(window, 3) / size
    np.testing.assert_allclose(found, [np.outer(spread, spread)] * 3)


@pytest.mark.parametrize(("height", "mixes"), [(0.029, True), (0.031, False), (-0.031, False)])
def test_a_blur_allows_a_share_of_the_depth(height, mixes):
    """1 % of 3 m."""
    position, normal, depth = wall((5, 8))
    position[2] += height * (np.arange(8) >= 4)
    light = (np.arange(8) >= 4) * np.ones((3, 5, 1))
    assert (literal.blur(light, position, normal, depth, 3, 0.01, 0.9) != light).any() == mixes


@pytest.mark.parametrize("axis", [0, 1])
def test_the_smaller_of_two_slopes_by_hand(axis):
    nearness = np.array([3.0, 4, 6, 6.5, 5])
    nearness = (nearness[:, None] if axis == 0 else nearness[None]) * np.ones((5, 5))
    g = literal.slope(nearness, axis)
    np.testing.assert_allclose(g[:, 2] if axis == 0 else g[2], [1, 1, 0.5, 0, -1.5])  # 0: a ridge


def test_channels_stay_apart():
    depth, normal = np.full((2, 4), 2.0), np.array([0.0, 0, 1])[:, None, None] * np.ones((3, 2, 4))
    light = np.array([1.0, 2, 3])[:, None, None] * np.ones((3, 1, 2))
    found = literal.level_sum(light, depth[::2, ::2], normal[:, ::2, ::2], depth, normal, 10 + 0 * normal, 2, 0.02, 8.0,
                              True)
    np.testing.assert_allclose(found, np.array([11.0, 12, 13])[:, None, None] * np.ones((3, 2, 4)))


def test_a_blur_beyond_a_gap_at_the_rim_and_over_a_crease():
    """A texel of another depth between two of one wall; the mean at the rim is over what there is; creases by hand."""
    position, normal, depth = wall((1, 5))
    position[2, 0, 2] -= 1
    light = np.array([1.0, 2, 50, 4, 5]) * np.ones((3, 1, 1))
    found = literal.blur(light, position, normal, depth, 5, 0.01, 0.9)
    np.testing.assert_allclose(found[0, 0], [1.5, (1 + 2 + 4) / 3, 50, (2 + 4 + 5) / 3, 4.5])
    position, normal, depth = wall((1, 5))
    normal[:, 0, 3:] = np.array([0.0, np.sin(0.2), np.cos(0.2)])[:, None]  # 11 degrees about the row: in both planes
    found = literal.blur(light, position, normal, depth, 3, 0.01, 0.9)
    np.testing.assert_allclose(found[0, 0], [1.5, 53 / 3, 56 / 3, 59 / 3, 4.5])


def test_a_tolerance_is_of_the_texels_own_plane_and_depth():
    """A step of 0.035 m: within 1 % of the 4 m that the farther ones are away, not of the nearer ones' 3 m."""
    position, normal, depth = wall((1, 4))
    position[2, 0, 2:] -= 0.035
    depth[0, 2:] = 4
    light = np.array([1.0, 1, 3, 3]) * np.ones((3, 1, 1))
    np.testing.assert_allclose(literal.blur(light, position, normal, depth, 3, 0.01, 0.9)[0, 0], [1, 1, 7 / 3, 3])
    position, normal, depth = wall((1, 2))
    normal[:, 0, 1] = np.sin(0.3), 0, np.cos(0.3)  # the other's plane passes 0.037 m beside, its own through it
    light = np.array([1.0, 3]) * np.ones((3, 1, 1))
    np.testing.assert_allclose(literal.blur(light, position, normal, depth, 3, 0.01, 0.9)[0, 0], [2, 3])


def test_passes_run_along_rows_then_columns():
    """Three texels about a hole, by hand."""
    position, normal, depth = wall((2, 2))
    depth[0, 0] = np.inf
    light = np.array([[0.0, 2], [4, 8]]) * np.ones((3, 1, 1))
    np.testing.assert_allclose(literal.blur(light, position, normal, depth, 3, 0.01, 0.9)[0], [[0, 4], [6, 4]])


def test_normals_are_compared_with_the_pixels_own():
    depth, normal = np.full((2, 4), 2.0), np.array([0.0, 0, 1])[:, None, None] * np.ones((3, 2, 4))
    turned = normal.copy()
    turned[:, 0, 1] = np.sqrt(0.75), 0, 0.5  # its own texel's is straight, the other's as its own
    below = np.stack([normal[:, 0, 0], turned[:, 0, 1]], axis=1)[:, None]
    found = literal.upsample(np.array([[[1.0, 5.0]]] * 3), depth[:1, :2], below, depth, turned, 2, 0.02, 8.0, True)
    own, other = (2 - 0.25) / 3 * 0.5**8, (1 + 4 * 0.25) / 6
    assert found[0, 0, 1] == pytest.approx((own + 5 * other) / (own + other))
