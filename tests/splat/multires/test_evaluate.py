"""Irradiance at subsplats: the bits of the full sum, of `vpl` and `val`, and representative points."""

import numpy as np
import pytest

from refgi.cluster import ValSettings, val
from refgi.error_target.grid import Subsplats, level_shape, representatives
from refgi.frame import Frame
from refgi.jit import threads
from refgi.lights.selection import choose_lights, footprints
from refgi.scene import load_scene
from refgi.settings import of
from refgi.splat import Receivers, irradiance
from refgi.splat.multires.evaluate import evaluate, evaluate_shadowed, evaluate_visible, representative_points
from refgi.splat.multires.settings import MultiresSettings
from refgi.truth import VplSettings, vpl
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


@pytest.mark.feature("AMS-10")
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


@pytest.mark.feature("AMS-10")
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


@pytest.mark.feature("AMS-18", "REF-02")
@pytest.mark.parametrize("level", [0, 2])
def test_subsplats_get_the_bits_of_vpl(box, level):
    """Oracle: `vpl` with the same lights, which lights every pixel."""
    lights = choose_lights(box, of(MultiresSettings, lights=64).lights)
    some = cells(box.gbuffer.covered, level)
    ours = evaluate_visible(box.tracer, box.scene.geometry, box.gbuffer, some, lights)
    full = vpl(box, of(VplSettings, lights=64, pattern="grid"))
    assert ours.dtype == box.dtype
    np.testing.assert_array_equal(ours, full.reshape(3, -1)[:, some.pixel])
    free = vpl(box, of(VplSettings, lights=64, pattern="grid", visibility=False)).reshape(3, -1)[:, some.pixel]
    assert (ours <= free).all()
    assert 0.5 < ours.mean() / free.mean() < 0.95


def test_no_subsplats_trace_no_rays(box):
    lights = choose_lights(box, of(MultiresSettings, lights=16).lights)
    nothing = cells(np.zeros((27, 33), bool), 1)
    assert evaluate_visible(box.tracer, box.scene.geometry, box.gbuffer, nothing, lights).shape == (3, 0)


@pytest.mark.parametrize("scene", ["cornell_box", "cornell_sphere"])
@pytest.mark.parametrize("shadow", ["csm", "pcss", "rays_vpls"])
def test_subsplats_get_the_bits_of_val(scene, shadow):
    """Oracle: `val` with the same lights, which lights every pixel."""
    frame = Frame(load_scene(scene), width=33, height=27, rsm_resolution=32)
    settings = of(ValSettings, lights=64, clusters=5, maps=32, visibility=shadow, interleaving=1, clamp="none")
    some = cells(frame.gbuffer.covered, 1)
    light = evaluate_shadowed(frame, frame.gbuffer, some, choose_lights(frame, settings.lights), settings)
    assert light.dtype == frame.dtype
    np.testing.assert_array_equal(light, val(frame, settings).reshape(3, -1)[:, some.pixel])


def test_no_subsplats_have_no_shadows(box):
    settings = of(ValSettings, lights=16, maps=16)
    nothing = cells(np.zeros((27, 33), bool), 1)
    lights = choose_lights(box, settings.lights)
    assert evaluate_shadowed(box, box.gbuffer, nothing, lights, settings).shape == (3, 0)
