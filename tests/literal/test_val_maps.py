"""Literal maps of area lights: distances against Embree, scales by hand, the series of their basis by closed forms."""

import math
import struct

import numpy as np
import pytest

from refgi.literal.val_areas import map_frames
from refgi.literal.val_maps import (
    basis,
    depth_maps,
    depth_scale,
    direction,
    frames_behind,
    map_depths,
    map_ranges,
    map_views,
    occluders,
    rounded_level,
    seen_vertices,
    texel_centers,
)
from refgi.rays import Tracer
from refgi.scene import Geometry

CLOSE = 1e-12
RAYS = 1e-5  # of a distance: Embree's rays are float32
EDGES = 1e-3  # share of texels whose ray may pass an edge on its other side in float32
TEXELS = 32


def test_a_map_looks_from_a_lifted_centre():
    visible, illuminated = np.array([[0.0, 0, 0], [3, 1, 1]]), np.array([[-5.0, 0, 0], [1, 1, 4]])
    place, ball, far = map_views(visible, illuminated, np.array([[1.0], [0], [2]]), np.array([[0.0], [1], [0]]),
                                 np.array([2.0]), 0.4)
    np.testing.assert_allclose(place, [[1, 4e-6 * 5, 2]])
    assert ball.tolist() == [0.8]
    assert far[0] == pytest.approx(math.sqrt(6**2 + 1 + 2**2), rel=1e-5)


def test_walls_do_not_block_and_what_stands_in_a_room_does():
    """A floor that is seen, a lamp's light on the ceiling, and a leaf between; one that lies on the floor is no end."""
    vertices = np.array([[-1.0, 0, -1], [3, 0, -1], [-1, 0, 3], [0, 0.5, 0], [1, 0.5, 0], [0, 0.5, 1], [0, -2, 0],
                         [1, -2, 0], [0, -2, 1], [0, 0, 0], [1, 0, 0], [0, 0, 1]])
    faces, box = np.arange(12).reshape(4, 3), np.array([[-1.0, 0, -1], [3, 1, 3]])
    seen = seen_vertices(vertices, faces, np.array([[0, 0, -1]]))
    assert seen.tolist() == vertices[:3].tolist()
    given = vertices, faces, seen, np.array([[0.2], [1.0], [0.2]]), box, box
    assert occluders(*given, touching=False).tolist() == [False, True, False, False]
    assert occluders(*given, touching=True).tolist() == [True, True, False, True]


def test_texels_cover_the_hemisphere():
    s, t = texel_centers(np.zeros((200, 200)))
    x, y, z = direction(s, t)
    np.testing.assert_allclose(x * x + y * y + z * z, 1, atol=CLOSE)
    np.testing.assert_allclose(x / (1 + z), s, atol=CLOSE)
    np.testing.assert_allclose(y / (1 + z), t, atol=CLOSE)
    q = s * s + t * t
    solid_angle = 4 / (1 + q) ** 2 * (2 / 200) ** 2  # VAL-11: of a texel
    assert solid_angle[q <= 1].sum() == pytest.approx(2 * math.pi, rel=1e-3)
    assert (z > 0)[q < 1].all()


def leaves():
    """Return random triangles around two area lights that face apart, and one without members."""
    random = np.random.default_rng(2)
    vertices = (random.uniform(-1.5, 1.5, (60, 1, 3)) + random.normal(0, 0.4, (60, 3, 3))).reshape(-1, 3)
    faces = np.arange(180).reshape(60, 3)
    frame = map_frames(np.array([[0.6, 0, 0], [0.8, -1, 1], [0, 0, 0.0]]))
    return vertices, faces, np.arange(60) % 4 > 0, np.array([[0.1, 0, 0], [0, 0.2, 0], [0, 0, 0]]), frame


@pytest.mark.parametrize("behind", [False, True])
@pytest.mark.parametrize("ball", [0.0, 0.7])
def test_distances_are_those_of_rays(behind, ball):
    vertices, faces, blocks, center, frame = leaves()
    members = np.array([3, 1, 0])
    made = depth_maps(vertices, faces, blocks, center, frames_behind(frame) if behind else frame, np.full(3, ball),
                      members, TEXELS)
    tracer = Tracer(Geometry(vertices, faces[blocks], np.zeros(int(blocks.sum()), np.int32)))
    s, t = texel_centers(made)
    inside, toward = s * s + t * t <= 1, direction(s, t)
    toward = toward * np.array([-1, 1, -1])[:, None, None] if behind else toward
    for k in range(2):
        rays = toward[:, inside].T @ frame[k]
        hit = tracer.closest(center[k] + ball * rays, rays).distance + ball
        same = np.isclose(hit, made[k][inside], rtol=RAYS, atol=RAYS)
        assert (~same).mean() < EDGES
        assert 0.2 < np.isfinite(hit).mean() < 1
    assert np.isinf(made[:, ~inside]).all()
    assert np.isinf(made[2]).all()


def test_nearest_and_farthest_of_a_map():
    near, far = map_ranges(np.array([[[np.inf, 2.0], [5, 3]], np.full((2, 2), np.inf)]))
    assert near.tolist() == [2, np.inf]
    assert far.tolist() == [5, 0]


@pytest.mark.parametrize(("kind", "origin", "slope"), [
    ("log_map", [1, 2], [0.6 / 2, 0.6 / math.log2(1.05)]), ("map", [1, 2], [0.6 / 3, 0.6 / 0.1]),
    ("scene", [0, 0], [0.8 / 16, 0.8 / 8])])
def test_a_scale_reaches_from_what_is_nearest_to_two_biases_below_its_end(kind, origin, slope):
    """From 1 m to 4 m, at 2 m alone, on no map; the end at 0.8, so the top at 0.6."""
    made = depth_scale(np.array([1, 2, np.inf]), np.array([4.0, 2, 0]), np.array([16.0, 8, 8]), np.array([0.8]), kind)
    np.testing.assert_allclose(made, [[*origin, 0], [*slope, 0]])


def test_few_terms_leave_half_of_the_range():
    assert depth_scale(np.array([1.0]), np.array([2.0]), np.array([9.0]), np.array([0.4]), "map")[1] == [0.2]


def test_depths_on_a_scale_by_hand():
    """Of one map from 2 m on, of an empty one and of one from 1 m on."""
    z = np.array([[[0.5, 2, 4, 8, 1e3, np.inf]], [[np.inf] * 6], [[0.5, 1, 2, 4, 6, np.inf]]])
    given = np.array([2, 0, 1.0]), np.array([0.3, 0, 0.2]), np.array([0.8])
    logs, linear = (map_depths(z, *given, logarithmic=one, mirrored=False)[:, 0] for one in (True, False))
    np.testing.assert_allclose(logs, [[0, 0, 0.3, 0.6, 0.8, 0.8], [0] * 6, [0, 0, 0.2, 0.4, 0.2 * math.log2(6), 0.8]])
    np.testing.assert_allclose(linear, [[0, 0, 0.6, 0.8, 0.8, 0.8], [0] * 6, [0, 0, 0.2, 0.6, 0.8, 0.8]])


def test_texels_beyond_the_disc_see_the_mirrored_hemisphere():
    """Of a map whose depth is a function of |z|, x and y alone: the same function beyond, to about a texel."""
    s, t = texel_centers(np.zeros((64, 64)))
    x, y, z = direction(s, t)
    depth = 3 + x + 0.5 * y + np.abs(z)
    held = np.where(s * s + t * t <= 1, depth, np.inf)[None]
    made = map_depths(held, np.zeros(1), np.array([0.1]), np.array([0.9]), logarithmic=False, mirrored=True)
    np.testing.assert_allclose(made[0] / 0.1, depth, atol=4 * 2 / 64)


def test_products_of_the_basis_are_the_series():
    """E-VAL-02, 03: f_M from S, C at d and z; slope 2 M where it is 1/2; 1 first at b* = 0.0763 for M = 4."""
    t = np.array([[[0.3, 0.5], [0.3 + 0.0763, 0.3001]]])
    made = basis(t, 4, in_bytes=False)[0]
    weight = 2 / ((2 * np.arange(1, 5) - 1) * math.pi)
    own = made[:, 0, 0]  # a receiver at d = 0.3
    f = 0.5 + np.tensordot(weight * own[4:8], made[:4], 1) - np.tensordot(weight * own[:4], made[4:8], 1)
    assert f[0, 0] == pytest.approx(0.5)
    assert f[1, 0] == pytest.approx(1, abs=1e-4)
    assert (f[1, 1] - f[0, 0]) / 1e-4 == pytest.approx(8, rel=1e-3)
    np.testing.assert_allclose(made[8:16], t * made[:8])
    assert (made[16] == t[0]).all()
    np.testing.assert_allclose(made[:4] ** 2 + made[4:8] ** 2, 1)
    both = basis(np.concatenate([0 * t, t]), 4, in_bytes=False)
    assert not both[0].any()
    assert (both[1] == made).all()


def test_published_textures_hold_bytes_and_halves():
    """E-VAL-05: within half a step of [-1, 1] in 255; halves as the standard library packs them."""
    t = np.random.default_rng(4).random((1, 20, 20))
    exact, made = basis(t, 4, in_bytes=False)[0], basis(t, 4, in_bytes=True)[0]
    steps = (made[:8] + 1) * 255 / 2
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
    assert np.abs(made[:8] - exact[:8]).max() <= 1.001 / 255
    assert made[8:].ravel().tolist() == [struct.unpack("e", struct.pack("e", x))[0] for x in exact[8:].ravel()]
    assert not rounded_level(np.zeros((1, 17, 2, 2))).any()
