"""Literal direct light by hand, its shadow rays against Embree, its shadow maps against rays."""

import math

import numpy as np
import pytest

from refgi.literal.buffers import surface, visible_triangles
from refgi.literal.direct import direct_irradiance, emission, leaving_radiance, plane_bias, shadow_map, shadow_rays
from refgi.rays import Tracer
from refgi.rsm.raster.projection import cube_projection, directional_projection
from refgi.scene import DirectionalLight, Geometry, PointLight

LAMP = np.array([0.3, 2.5, -0.2])
SUN = np.array([0.5, -2.0, 0.3])
EDGES = 0.05  # share of points in the texels that a shadow's edge runs through: maps of some 5 cm a texel


def floor_and_leaves():
    """Return a floor and twelve triangles over it, and points of the floor."""
    random = np.random.default_rng(3)
    leaves = random.uniform((-2, 0.5, -2), (2, 1.5, 2), (12, 1, 3)) + random.normal(size=(12, 3, 3)) * 0.4
    vertices = np.concatenate([np.array([[-40.0, 0, -40], [40, 0, -40], [0, 0, 70]]), leaves.reshape(-1, 3)])
    position = np.zeros((3, 30, 40))
    position[0], position[2] = np.meshgrid(np.linspace(-3, 3, 40), np.linspace(-3, 3, 30))
    normal = np.zeros_like(position)
    normal[1] = 1
    return vertices, np.arange(39).reshape(-1, 3), position, normal, np.zeros((30, 40), int)


@pytest.mark.parametrize(("key", "value"), [("place", LAMP), ("direction", SUN)])
def test_shadow_rays_are_those_of_embree(key, value):
    vertices, faces, position, normal, ids = floor_and_leaves()
    visible = shadow_rays(position, normal, ids, vertices, faces, **{key: value})
    light = PointLight(tuple(value), (1.0, 1, 1)) if key == "place" else DirectionalLight(tuple(value), (1.0, 1, 1))
    expected = Tracer(Geometry(vertices, faces, np.zeros(13, np.int32))).visible_from_light(
        position, normal, ids >= 0, light)
    assert (visible == expected).mean() > 0.999
    assert 0.2 < visible.mean() < 0.95


@pytest.mark.parametrize("key", ["place", "direction"])
def test_a_shadow_map_shows_what_rays_do_but_for_edges(key):
    vertices, faces, position, normal, ids = floor_and_leaves()
    sun = DirectionalLight(tuple(SUN), (1.0, 1, 1))
    maps = cube_projection(tuple(LAMP), 64) if key == "place" else directional_projection(
        sun, (np.array([-3.0, 0, -3]), np.array([3.0, 3, 3])), 128)
    view = {"origin": maps.origin, "frame": maps.frame, "half": maps.half, "rows": maps.height,
            "columns": maps.width, "parallel": key == "direction"}
    seen = visible_triangles(vertices, faces, **view)
    depth, there, _, _ = surface(seen, vertices, faces, np.zeros(13, int), np.ones((1, 3)), **view)
    visible = shadow_map(position, normal, ids, depth=depth, map_position=there, **view)
    expected = shadow_rays(position, normal, ids, vertices, faces, **{key: LAMP if key == "place" else SUN})
    assert (visible == expected).mean() > 1 - EDGES


def test_bias_of_a_floor_two_metres_below_and_45_degrees_off():
    points = np.array([[0.0, 2], [0, 0], [0, 0]])[:, None]
    normal = np.array([0.0, 1, 0]).reshape(3, 1, 1) + 0 * points
    down = np.array([[[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]])
    bias = plane_bias(points, normal, np.array([[0.0, 2, 0]]), down, np.array([1.0, 0.5]), np.zeros((1, 2), int), 10,
                      10, False)
    texel = 2 * 1.0 / 10  # at 1 m
    assert bias[0] == pytest.approx([0.1 * texel * 2, 0.1 * texel * 2 * math.sqrt(2) * (1 + 1)])


def test_three_lamps_by_hand():
    position = np.zeros((3, 1, 2))
    normal = np.array([0.0, 1, 0]).reshape(3, 1, 1) + 0 * position
    spot = {"place": np.array([0.0, 2, 0]), "direction": np.array([0.0, -3, 0]), "angles": np.array([0.2, 0.5])}
    side = np.array([math.sqrt(3), 1, 0])  # 2 m away, 60 degrees off the normal
    lit, dark = np.array([[True, True]]), np.array([[False, True]])
    total = direct_irradiance(
        position, normal, np.array([[0, -1]]), (lit, lit, dark),
        (np.array([4.0, 0, 0]), np.array([0.0, 8, 0]), np.array([0.0, 0, 5])), (spot["place"], side, None),
        (spot["direction"], None, np.array([1.0, -1, 0])), (spot["angles"], None, None), ("smoothstep", None, None))
    assert total[:, 0, 0] == pytest.approx([4 / 4, 8 * 0.5 / 4, 0])
    assert not total[:, 0, 1].any()
    sun = direct_irradiance(position, normal, np.array([[0, 0]]), (lit,), (np.ones(3),), (None,),
                            (np.array([2.0, -2, 0]),), (None,), (None,))
    assert sun == pytest.approx(math.sqrt(0.5))


def test_half_way_between_the_cosines_of_its_cones_a_spot_shines_with_half_its_intensity():
    angle = math.acos((math.cos(0.2) + math.cos(0.8)) / 2)
    place = np.array([-math.tan(angle), 1.0, 0])
    normal = np.array([0.0, 1, 0]).reshape(3, 1, 1)
    total = direct_irradiance(np.zeros((3, 1, 1)), normal, np.zeros((1, 1), int), (np.ones((1, 1), bool),),
                              (np.ones(3),), (place,), (np.array([0.0, -1, 0]),), (np.array([0.2, 0.8]),),
                              ("smoothstep",))
    assert total[0, 0, 0] == pytest.approx(0.5 * math.cos(angle) ** 3)  # d = 1 / cos


def test_irradiance_of_pi_leaves_as_the_albedo_beside_what_is_emitted():
    irradiance, albedo = np.full((3, 1, 2), math.pi), np.array([0.5, 0.25, 0.0]).reshape(3, 1, 1) + np.zeros((3, 1, 2))
    own = emission(np.array([[1, -1]]), np.array([0, 2]), np.array([[9.0, 9, 9], [8, 8, 8], [1, 2, 3]]))
    np.testing.assert_array_equal(own[:, 0], [[1, 0], [2, 0], [3, 0]])
    got = leaving_radiance(irradiance, 2 * irradiance, albedo=albedo, emission=own)
    np.testing.assert_allclose(got[:, 0], [[2.5, 1.5], [2.75, 0.75], [3.0, 0.0]])
    np.testing.assert_allclose(leaving_radiance(irradiance, albedo=albedo), albedo)
