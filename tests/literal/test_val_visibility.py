"""Literal visibility by maps: cones as circles, printed numbers, plates in closed form; hard shadows against Embree."""

import math

import numpy as np
import pytest

from refgi.literal.val_maps import direction, frames_behind, texel_centers
from refgi.literal.val_visibility import (
    depth_tests,
    disc,
    half_angle,
    of_both,
    pcss,
    pcss_penumbra,
    penumbra_angle,
    plane_distance,
    search,
    square,
    widest_angle,
)
from refgi.rays import Tracer
from refgi.scene import Geometry

CLOSE = 1e-12
CENTS = 0.005  # half of the last digit of printed ratios
NEAR, FAR, DELTA, TEXELS = 1.0, 3.0, 0.6, 512
STEP = 0.004  # of V: a row of texels in a disc of 50
ONE = np.zeros((1, 3)), np.eye(3)[None]  # a map at the origin, right, down and forward along the axes


def pixels(points):
    """Return points (3, n) as one row of pixels."""
    return np.asarray(points, float)[:, None]


def covered(points):
    return np.zeros((1, points.shape[1]), int)


@pytest.mark.parametrize("theta", [0.0, 0.3, 1.0, 1.5])
@pytest.mark.parametrize("a", [1e-3, 0.2, 0.9, math.radians(80)])
def test_a_cone_is_a_circle_on_the_map(theta, a):
    axis, up = np.array([0.6 * math.sin(theta), 0.8 * math.sin(theta), math.cos(theta)]), np.array([0.8, -0.6, 0.0])
    s, t, radius = disc(3 * axis.reshape(3, 1, 1, 1), np.full((1, 1, 1), 3.0), np.full((1, 1, 1), a))[0, :, 0, 0]
    phi = np.linspace(0, 6, 7)
    rim = math.cos(a) * axis[:, None] + math.sin(a) * (np.outer(up, np.cos(phi)) + np.outer(
        np.cross(axis, up), np.sin(phi)))
    off = np.hypot(rim[0] / (1 + rim[2]) - s, rim[1] / (1 + rim[2]) - t) - radius
    assert np.abs(off).max() < CLOSE * max(1, radius)


def test_the_printed_angle_and_the_printed_square():
    """E-VAL-07: 45 and 53.13 degrees at p cos(beta) = d; E-VAL-08: alpha / pi over the exact width."""
    assert 2 * math.degrees(half_angle(2.0, 2.0, 1.0)) == pytest.approx(53.13, abs=CENTS)
    assert 2 * math.degrees(penumbra_angle(2.0, 2.0, 1.0, alpha=True)) == pytest.approx(45)
    for degrees, ratio in ((0, 1.27), (30, 1.19), (60, 0.95), (80, 0.75), (90, 0.635)):
        way = np.array([math.sin(math.radians(degrees)), 0, math.cos(math.radians(degrees))]).reshape(3, 1, 1, 1)
        narrow = way, np.ones((1, 1, 1)), np.full((1, 1, 1), 1e-4)
        assert square(*narrow)[0, 2] / disc(*narrow)[0, 2] == pytest.approx(ratio, abs=CENTS)


def test_the_printed_search_misses_what_is_near():
    """E-VAL-09: of a light of 1 m seen from 4 m it covers 0.025 m at 0.2 m; with the axial depth 0.475."""
    x = pixels([[0.0, 0, 0, 0], [0, 0, 0, 0], [4, -4, 0.1, 4]])
    found = {solid_angle: search(x, np.array([[0, 0, 0, -1]]), *ONE, np.ones(1), np.array([0.2]), solid_angle)
             for solid_angle in (True, False)}
    for solid_angle, covers in ((True, 0.025), (False, 0.475)):
        pending, region, d = found[solid_angle]
        assert pending.tolist() == [[[True, False, False, False]]]  # behind the light, nearer than all, no surface
        assert 0.2 * math.tan(2 * math.atan(region[0, 2, 0, 0])) == pytest.approx(covers)
        assert d[0, 0].tolist() == [4, 0, 0, 0]


@pytest.mark.parametrize(("size", "d", "z"), [(1.0, 4.0, 0.6), (1.0, 4.0, 2.0), (3.0, 2.0, 1.7), (0.1, 5.0, 4.9)])
def test_the_farthest_blocker_lies_on_the_line_to_the_light_s_edge(size, d, z):
    a = widest_angle(size, d, z)
    assert z * math.sin(a) == pytest.approx(size / 2 * (1 - z * math.cos(a) / d))
    assert widest_angle(size, d, 0.3 * size) == math.radians(80)
    assert widest_angle(size, d, d) == 0


def test_planes_are_met_where_they_are():
    x, n = np.array([1.0, -0.5, 2.0]), np.array([0.2, 0.3, -0.9])
    w = np.array([0.48, 0.6, 0.64])
    assert w @ n * plane_distance(w, x, 3.0, n) == pytest.approx(x @ n)
    assert plane_distance(-w, x, 3.0, n) == 3
    assert plane_distance(w, x, 3.0, -n) == plane_distance(w, x, 3.0, n)


def plate_map(n, height, floor):
    """Return distances of a plate at x > 0 and of a floor behind it."""
    s, t = texel_centers(np.zeros((n, n)))
    x, _, z = direction(s, t)
    with np.errstate(divide="ignore"):
        return np.where(s * s + t * t > 1, np.inf, np.where(x > 0, height, floor) / z)[None]


def test_texels_that_hide_are_counted():
    """A pixel just left of a plate's edge: 2 of 5 columns about its texel lie under the plate, 1 of 3."""
    depth, delta, near = plate_map(64, 1.0, 3.0), np.ones(1), np.ones(1)
    x, up = pixels([[-1e-6], [0.0], [3.0]]), pixels([[0.0], [0.0], [-1.0]])
    for texels, share in ((1, 1.0), (3, 2 / 3), (5, 3 / 5), (7, 4 / 7)):
        assert depth_tests(x, covered(x[:, 0]), up, depth, *ONE, delta, near, texels)[0, 0, 0] == pytest.approx(share)
    given = depth, *ONE, np.zeros(1), near
    assert depth_tests(x, covered(x[:, 0]), up, *given, 5)[0, 0, 0] == 1  # a light without extent
    assert depth_tests(-x, covered(x[:, 0]), up, depth, *ONE, delta, near, 5)[0, 0, 0] == 1  # behind the light


@pytest.mark.parametrize("texels", [1, 5])
def test_a_lone_surface_does_not_hide_itself(texels):
    """VAL-22: along its plane, even seen aslant; and what a light sees of a room by rays is what it lights."""
    up = np.array([0.6, 0.0, -0.8])
    s, t = texel_centers(np.zeros((32, 32)))
    with np.errstate(divide="ignore"):
        r = -2 / np.tensordot(up, direction(s, t), 1)
    depth = np.where((r > 0) & (s * s + t * t <= 1), r, np.inf)[None]
    aside = np.linspace(-3, 3, 30)
    x = -2 * up[:, None] + np.array([0.8, 0, 0.6])[:, None] * aside + np.array([0, 1.0, 0])[:, None] * aside[::-1] ** 2
    v = depth_tests(pixels(x), covered(x), pixels(np.tile(up[:, None], 30)), depth, *ONE, np.ones(1),
                    np.array([depth.min()]), texels)
    assert (v == 1).all()


def test_hard_shadows_are_those_of_rays():
    """Embree: rays from a light past a leaf to a floor, map by rays too; pixels beside its edges may differ."""
    leaf = np.array([[-0.5, -0.4, 1.0], [0.7, -0.3, 1.2], [0.1, 0.8, 0.9]])
    geometry = Geometry(leaf, np.array([[0, 1, 2]], np.int32), np.zeros(1, np.int32))
    tracer = Tracer(geometry)
    s, t = texel_centers(np.zeros((256, 256)))
    way = direction(s, t).reshape(3, -1)
    z = tracer.closest(np.zeros_like(way.T), way.T).distance.reshape(256, 256)
    depth = np.where(s * s + t * t <= 1, z, np.inf)[None]
    u, v = (one.ravel() for one in np.meshgrid(np.linspace(-2, 2, 40), np.linspace(-2, 2, 40)))
    x = np.stack([u, v, np.full_like(u, 3.0)])
    seen = depth_tests(pixels(x), covered(x), pixels(np.tile([[0.0], [0.0], [-1.0]], len(u))), depth, *ONE, np.zeros(1),
                       np.array([depth.min()]))[0, 0]
    hidden = tracer.occluded(np.zeros_like(x.T), x.T)
    assert (seen == hidden).mean() < 0.02
    assert 0.1 < hidden.mean() < 0.5


def test_the_map_behind_is_turned_round():
    """A plate at x > 0 behind the light hides what lies there, and what is ahead is seen by the map ahead."""
    empty, behind = np.full((1, 64, 64), np.inf), plate_map(64, 1.0, np.inf)  # right of the map behind: -x
    x = pixels([[-1.0, 1.0, -1.0], [0.3, 0.3, 0.3], [-3.0, -3.0, 3.0]])
    up = pixels([[0.0, 0, 0], [0, 0, 0], [1.0, 1, -1]])
    center, frame = ONE
    ahead, back = (depth_tests(x, covered(x[:, 0]), up, depth, center, axes, np.ones(1), depth.min(axis=(1, 2)))
                   for depth, axes in ((empty, frame), (behind, frames_behind(frame))))
    assert of_both(ahead, back)[0, 0].tolist() == [0, 1, 1]


def edge_of_spheres():
    """Return the map of a half sphere at NEAR, half open, and pixels behind its edge."""
    s, t = texel_centers(np.zeros((TEXELS, TEXELS)))
    depth = np.where(s * s + t * t > 1, np.inf, np.where(t < 0, NEAR, np.inf))[None]
    turn = np.linspace(-0.4, 0.4, 41)
    return depth, turn, lambda theta: FAR * np.stack([np.cos(turn) * math.sin(theta), np.sin(turn),
                                                      np.cos(turn) * math.cos(theta)])


@pytest.mark.parametrize("degrees", [0, 60])
def test_penumbrae_are_as_wide_as_their_cones(degrees):
    """Closed form: the plane of the edge cuts a cone of half-angle a; what faces the light does not hide itself."""
    depth, turn, across = edge_of_spheres()
    x = across(math.radians(degrees))
    position, facing, near = pixels(x), pixels(-x / FAR), np.array([NEAR])
    for k in range(0, 41, 4):
        one, up = position[..., k : k + 1], facing[..., k : k + 1]
        pending, region, _ = search(one, np.zeros((1, 1), int), *ONE, np.array([DELTA]), near)
        shaded, z_avg, region = pcss_penumbra(one, up, depth, *ONE, np.array([DELTA]), near, pending, region)
        v = pcss(one, up, depth, *ONE, shaded, region)
        u = np.clip(np.sin(turn[k]) / math.sin(half_angle(DELTA, FAR, NEAR)), -1, 1)
        ramp = 0.5 + (np.arcsin(u) + u * np.sqrt(1 - u * u)) / math.pi
        assert z_avg[0, 0, 0] == (NEAR if ramp < 1 else 0)
        assert v[0, 0, 0] == pytest.approx(ramp, abs=STEP)


def test_blockers_beside_the_light_do_not_count():
    """A low plate aside within the search disc of something nearer: outside the cone to the light."""
    s, t = texel_centers(np.zeros((96, 96)))
    x, _, z = direction(s, t)
    with np.errstate(divide="ignore", invalid="ignore"):
        aside = (2.5 * x / z > 1.2) & (2.5 * x / z < 3)
        depth = np.where(s * s + t * t > 1, np.inf, np.where(aside, 2.5, 3) / z)[None]
    at, up = pixels([[0.0], [0.0], [3.0]]), pixels([[0.0], [0.0], [-1.0]])
    pending, region, _ = search(at, np.zeros((1, 1), int), *ONE, np.ones(1), np.array([0.3]))
    assert pending.all()
    assert not pcss_penumbra(at, up, depth, *ONE, np.ones(1), np.array([0.3]), pending, region)[0].any()
