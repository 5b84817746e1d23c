"""Geometry-aware blur of a level: against the literal text, and what it must keep."""

import numpy as np
import pytest

from refgi.literal import upsampling as literal
from refgi.sssil.blur import TALL, WIDE, blur
from refgi.sssil.settings import GeometryBlur
from refgi.sssil.view import Level

# of the largest value: means of up to 17 terms
ROUNDING = {np.float64: 1e-14, np.float32: 3e-6}
FLAT = np.array([0.0, 0.0, 1.0])


def level_of(position, normal, covered, dtype=np.float64):
    """Return a level that lies where `position` says, with the depth -z."""
    depth = np.where(covered, -position[2], np.inf)
    arrays = (position * covered, depth, normal * covered, np.zeros_like(position), np.ones(depth.shape))
    return Level(1, *(np.ascontiguousarray(array, dtype) for array in arrays), np.zeros(depth.shape, np.int32))


def steps(shape, dtype=np.float64, seed=0):
    """Return stairs of small and of large steps whose texels lean, with holes, and noise to blur."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[: shape[0], : shape[1]] / 8.0
    position = np.stack([x, y, -3.0 - 0.5 * (x.astype(int) % 3 == 2) - rng.choice([0.0, 0.05, 0.2], shape)])
    normal = FLAT[:, None, None] + 0.35 * rng.normal(size=(3, *shape))
    level = level_of(position, normal / np.linalg.norm(normal, axis=0), rng.random(shape) > 0.2, dtype)
    return level, rng.random((3, *shape)).astype(dtype)


def plain(shape, dtype=np.float64):
    """Return a wall seen head-on."""
    y, x = np.mgrid[: shape[0], : shape[1]] / 8.0
    return level_of(np.stack([x, y, np.full(shape, -3.0)]), np.broadcast_to(FLAT[:, None, None], (3, *shape)),
                    np.ones(shape, bool), dtype)


@pytest.mark.parametrize("settings", [GeometryBlur(), GeometryBlur(1), GeometryBlur(3, 0.05, 0.5),
                                      GeometryBlur(8, 0.02, -1.0), GeometryBlur(16, 1e6, 0.8)], ids=str)
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_equals_the_literal_text(dtype, settings, evidence):
    """Oracle: more texels than a tile of work along both axes, and pictures smaller than the window."""
    for shape in ((TALL + 5, WIDE + 9), (3, 5), (1, 1)):
        level, light = steps(shape, dtype)
        planes = (plane.astype(float) for plane in (light, level.position, level.normal, level.depth))
        expected = literal.blur(*planes, settings.size, settings.plane_tolerance, settings.cosine)
        found = blur(light, level, settings)
        assert found.dtype == dtype
        np.testing.assert_allclose(found, expected, rtol=0, atol=ROUNDING[dtype] * expected.max())
    evidence(f"{settings}: within {ROUNDING[dtype]:.0e} of the literal text, {np.dtype(dtype).name}")


@pytest.mark.parametrize("size", [2, 4, 8])
def test_a_window_holds_each_place_of_a_tile_once(size, evidence):
    """Analytic: light that repeats in tiles becomes its mean over one tile, away from the rim of the picture."""
    rng = np.random.default_rng(3)
    tile = rng.random((3, size, size))
    light = np.tile(tile, (1, 48 // size, 48 // size))
    found = blur(light, plain((48, 48)), GeometryBlur(size))
    off = np.abs(found[:, size:-size, size:-size] - tile.mean(axis=(1, 2))[:, None, None]).max()
    evidence(f"light that repeats in tiles of {size} x {size}: its mean to {off:.0e}")
    assert off < ROUNDING[np.float64]


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_equal_light_stays_to_the_bit(dtype):
    """Property: on any surface, and nothing where there is none."""
    level, _ = steps((40, 70), dtype)
    found = blur(np.full((3, 40, 70), 0.3, dtype), level, GeometryBlur())
    np.testing.assert_array_equal(found, np.where(np.isinf(level.depth), dtype(0), dtype(0.3)) * np.ones((3, 1, 1)))


def test_light_stays_on_its_surface():
    """Property: no light over a step, an edge between two normals, or a hole."""
    shape = (20, 30)
    right = np.arange(30) >= 15
    wall = plain(shape)
    light = np.broadcast_to(right.astype(float), (3, *shape))
    lower = wall.position - np.stack([np.zeros(shape), np.zeros(shape), right * 0.1 * np.ones(shape)])
    turned = np.where(right, np.array([0.6, 0.0, 0.8])[:, None, None], wall.normal)
    for other in (level_of(lower, wall.normal, np.ones(shape, bool)),
                  level_of(wall.position, turned, np.ones(shape, bool)),
                  level_of(wall.position, wall.normal, np.broadcast_to(np.arange(30) != 14, shape))):
        found = blur(light, other, GeometryBlur(3))
        np.testing.assert_array_equal(found, light)
    assert (blur(light, wall, GeometryBlur(3)) != light).any()
