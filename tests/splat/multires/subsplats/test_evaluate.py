"""Irradiance at subsplats: the bits of the full sum, and representative points."""


import numpy as np
import pytest

from refgi.error_target.grid import Subsplats, level_shape, representatives
from refgi.frame import Frame
from refgi.jit import threads
from refgi.lights.selection import choose_lights, footprints
from refgi.scene import load_scene
from refgi.splat import Receivers, irradiance
from refgi.splat.multires.subsplats.evaluate import evaluate, representative_points
from tests.splat.multires.choices import unclamped

MEAN_ERROR = 1e-6  # a float32 mean over at most 64 positions below 1 m and unit normals


@pytest.fixture(scope="module")
def box():
    return Frame(load_scene("cornell_box"), width=37, height=29, rsm_resolution=32)


def cells(covered, level):
    """Every filled cell of one level as a subsplat."""
    places = representatives(covered, level)
    row, column = np.nonzero(places[level] >= 0)
    empty = tuple(np.zeros(level_shape(*covered.shape, k), bool) for k in range(level))
    return Subsplats(np.full(len(row), level, np.uint8), row.astype(np.int32), column.astype(np.int32),
                     places[level][row, column].astype(np.int64), (*empty, places[level] >= 0), covered.shape)


@pytest.mark.parametrize("change", [{}, {"clamp": "disc"}, {"clamp": "sphere"}, {"clamp": "distance",
                                                                               "clamp_value": 0.1}])
def test_points_get_the_bits_of_the_full_sum(box, change):
    """Oracle: `irradiance` at the same pixels, in another order and on one thread."""
    settings = unclamped(lights=64, **change)
    lights, buffer, pairs = choose_lights(box, settings.lights), box.gbuffer, settings.pairs
    area = footprints(box, settings.lights, pairs)
    full = irradiance(Receivers(buffer.position, buffer.normal, buffer.covered), lights, pairs, area)
    some = cells(buffer.covered, 2)
    points = representative_points(buffer, some)
    np.testing.assert_array_equal(evaluate(*points, lights, pairs, area), full.reshape(3, -1)[:, some.pixel])
    with threads(1):
        np.testing.assert_array_equal(evaluate(*points, lights, pairs, area), full.reshape(3, -1)[:, some.pixel])


def test_no_points_get_no_light(box):
    lights = choose_lights(box, unclamped(lights=16).lights)
    assert evaluate(np.zeros((3, 0), np.float32), np.zeros((3, 0), np.float32), lights, unclamped().pairs).size == 0


def test_means_are_those_of_the_cells_surface(box):
    """Oracle: means over slices, cut at the border and by what is not covered."""
    position, normal, covered = box.gbuffer.resolve("position", "normal", "covered")
    some = cells(covered, 3)
    points, normals = representative_points(box.gbuffer, some, "mean")
    for k, (i, j) in enumerate(zip(some.row, some.column, strict=True)):
        inside = np.s_[8 * i : 8 * i + 8, 8 * j : 8 * j + 8]
        mask = covered[inside]
        mean = normal[:, *inside][:, mask].astype(float).mean(axis=1)
        np.testing.assert_allclose(points[:, k], position[:, *inside][:, mask].mean(axis=1), atol=MEAN_ERROR)
        np.testing.assert_allclose(normals[:, k], mean / np.linalg.norm(mean), atol=MEAN_ERROR)
    one = cells(covered, 0)
    means, pixels = representative_points(box.gbuffer, one, "mean"), representative_points(box.gbuffer, one)
    for mean, own in zip(means, pixels, strict=True):
        np.testing.assert_array_equal(mean, own)
