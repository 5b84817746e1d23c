"""Upsampling as literal text: bilinear interpolation, ramps, constants, the published table of a step."""

import numpy as np
import pytest

from refgi.literal import multires
from refgi.literal.multires_upsample import sum_of_pictures, upsample

ROUNDING = 1e-14
TABLE_DIGIT = 5e-4  # half of the last digit of the table of E-AMS-09
MODES = ("tent", "demo", "nearest", "naive_bilinear")


def of_level(level, light):
    """A picture of no holes and its subsplats, all of one level; light (3, h_l, w_l)."""
    row, column = (one.reshape(-1) for one in np.indices(light.shape[1:]))
    return np.zeros([size << level for size in light.shape[1:]], int), np.full(row.size, level), row, column, \
        light.reshape(3, -1)


def interpolated(light):
    """np.interp along each axis, twice as many pixels."""
    for axis in (1, 2):
        centres = (np.arange(2 * light.shape[axis]) + 0.5) / 2 - 0.5
        light = np.apply_along_axis(lambda row, at=centres: np.interp(at, np.arange(len(row)), row), axis, light)
    return light


@pytest.mark.parametrize("mode", ["tent", "naive_bilinear"])
def test_a_doubling_is_bilinear_interpolation(mode):
    light = np.random.default_rng(1).random((3, 4, 7))
    np.testing.assert_allclose(upsample(*of_level(1, light), 1, mode), interpolated(light), rtol=ROUNDING)


@pytest.mark.parametrize("mode", ["tent", "demo", "naive_bilinear"])
def test_a_ramp_stays_a_ramp(mode):
    light = np.broadcast_to(np.arange(6.0)[:, None] + 10 * np.arange(5.0), (3, 6, 5))
    got, expected = upsample(*of_level(1, light), 1, mode), interpolated(light)
    np.testing.assert_allclose(got[:, 2:-2, 2:-2], expected[:, 2:-2, 2:-2], rtol=ROUNDING)


def ragged(seed):
    """Random surfaces and subsplats of all levels: triangle ids, and level, row and column."""
    rng = np.random.default_rng(seed)
    triangle_id = np.where(rng.random((21, 34)) < 0.7, 0, -1)
    marks = [rng.random(multires.grid(triangle_id.shape, level)) < 0.7 for level in (1, 2, 3)]
    return triangle_id, multires.subsplats(triangle_id, multires.states(marks, triangle_id, "off"), 0)[:3]


@pytest.mark.parametrize("mode", MODES[:-1])
def test_a_constant_stays_and_nothing_enters_what_is_empty(mode):
    triangle_id, cells = ragged(2)
    light = np.full((3, len(cells[0])), 0.3)
    for options in ({}, {"filter_all": True}, {"corner_rule": False}):
        got = upsample(triangle_id, *cells, light, 3, mode, **options)
        np.testing.assert_allclose(got, np.where(triangle_id >= 0, 0.3, 0)[None].repeat(3, axis=0), rtol=ROUNDING)


@pytest.mark.parametrize("mode", MODES)
def test_subsplats_of_pixels_are_the_picture(mode):
    light = np.random.default_rng(3).random((3, 5, 4))
    np.testing.assert_allclose(upsample(*of_level(0, light), 2, mode), light, rtol=ROUNDING)


def test_lists_of_lights_are_upsampled_one_by_one():
    """A light of cells and one of pixels: each is interpolated by itself."""
    coarse, fine = np.random.default_rng(4).random((3, 3, 4)), np.random.default_rng(5).random((3, 6, 8))
    triangle_id, *one = of_level(1, coarse)
    _, *other = of_level(0, fine)
    columns = [np.concatenate(both, axis=-1) for both in zip(one, other, strict=True)]
    got = sum_of_pictures(triangle_id, np.array([0, 12, 12 + 48]), *columns, 1, "tent")
    np.testing.assert_allclose(got, interpolated(coarse) + fine, rtol=ROUNDING)


@pytest.mark.parametrize(("published", "options"), [
    (0.061, {"filter_all": True, "corner_rule": False}), (0.054, {"filter_all": True}), (0.032, {})])
def test_the_table_of_a_step(published, options):
    """RMSE over a disc of 3 on 1, 512 x 512, 2017 subsplats (E-AMS-09)."""
    y, x = np.mgrid[0:512, 0:512]
    image = np.where((y - 256) ** 2 + (x - 0.4 * 512) ** 2 < (0.23 * 512) ** 2, 3.0, 1.0)
    triangle_id = np.zeros(image.shape, int)
    ranges = multires.depth_ranges(image, triangle_id, 5, 0)
    marks = multires.discontinuities(5, 0, ranges[:5], ranges[5:], depth_threshold=0, depth_measure="absolute")
    *cells, pixel = multires.subsplats(triangle_id, multires.states(marks, triangle_id, "off"), 0)
    assert len(pixel) == 2017
    light = np.repeat(image.reshape(-1)[None, pixel], 3, axis=0)
    got = upsample(triangle_id, *cells, light, 5, "tent", **options)[0]
    assert np.sqrt(np.mean((got - image) ** 2)) == pytest.approx(published, abs=TABLE_DIGIT)
