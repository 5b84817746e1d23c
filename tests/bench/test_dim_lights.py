"""Lights below a share of the sum: parts light by light, the fewest that carry a share, what the others cost."""

import itertools

import numpy as np
import pytest

from refgi.bench import skips as module
from refgi.bench.skips import brightest, dim_lights, parts_of_lights
from refgi.frame import Frame
from refgi.lights.selection import choose_lights
from refgi.methods import METHODS
from refgi.pairs.settings import DiscClamp, PairSettings
from refgi.scene import load_scene
from refgi.settings import from_text
from tests.pairs import sets

ROUNDING = 1e-6  # of float32, in a sum of few terms
UNLIKE = 1e-4  # roundings of cosines of pairs that nearly lie in one plane
SIZE = {"width": 24, "height": 18, "rsm_resolution": 64}


def settings_of(method, *changes):
    return from_text(METHODS[method].settings(), changes)


@pytest.mark.parametrize(("share", "kept"), [
    (0.5, [1]), (0.51, [1, 3]), (0.9, [1, 3]), (0.95, [0, 1, 3]), (1.0, [0, 1, 3])])
def test_the_fewest_lights_that_carry_a_share(share, kept):
    parts = np.array([1.0, 5.0, 0.0, 4.0])
    assert brightest(parts, share).tolist() == kept


def test_dark_lights_carry_nothing():
    assert brightest(np.zeros(3), 0.9).tolist() == []
    assert brightest(np.zeros(0), 0.9).tolist() == []


def test_a_light_over_a_point_gives_it_the_inverse_square():
    """Closed form: head on at distance r, E = Phi / (pi r^2); behind the point, nothing."""
    real = np.float32
    up = np.array([[0.0], [1.0], [0.0]])
    heights = np.array([1.0, 2.0, -1.0])
    lights = sets.lights(up * heights, np.repeat(-up, 3, axis=1), np.array([[3.0, 8.0, 1.0]]), real)
    parts = parts_of_lights(sets.receivers(0 * up, up, real), lights, PairSettings(clamp=None))
    np.testing.assert_allclose(parts, np.array([3.0, 2.0, 0.0]) / np.pi, rtol=ROUNDING)


def test_each_light_is_clamped_by_its_own_disc():
    """Closed form: head on at distance r from a disc of area A, E = Phi / (pi r^2 + A)."""
    real, up, area = np.float32, np.array([[0.0], [1.0], [0.0]]), np.array([1.0, 5.0], np.float32)
    lights = sets.lights(np.repeat(up, 2, axis=1), np.repeat(-up, 2, axis=1), np.full((1, 2), 2.0), real)
    parts = parts_of_lights(sets.receivers(0 * up, up, real), lights, PairSettings(clamp=DiscClamp()), area)
    np.testing.assert_allclose(parts, 2.0 / (np.pi + area), rtol=ROUNDING)


def test_error_is_that_of_the_lights_left_out():
    """Independent: light by light in float64, without a clamp; the picture is smaller than a sample of one would be."""
    settings = settings_of("sii", "lights=48", "pairs.clamp=none")
    frame = Frame(load_scene("cornell_box"), **SIZE)
    ticks = itertools.count()
    found = dim_lights(frame, settings, 2, share=0.8, clock=lambda: next(ticks) ** 2.0)
    lights, buffer = choose_lights(frame, settings.lights), frame.gbuffer
    x, n = (plane[:, buffer.covered].astype(np.float64) for plane in (buffer.position, buffer.normal))
    to = lights.position[:, None].astype(np.float64) - x[:, :, None]
    square = (to**2).sum(axis=0)
    g = (np.maximum((to * n[:, :, None]).sum(axis=0), 0) * np.maximum(-(to * lights.normal[:, None]).sum(axis=0), 0)
         / np.maximum(square, 1e-30) ** 2)
    light = g * lights.flux[:, None] / np.pi  # (3, pixels, lights)
    parts = light.mean(axis=(0, 1))
    order = np.argsort(-parts)
    carrying = 1 + np.flatnonzero(np.cumsum(parts[order]) >= 0.8 * parts.sum())[0]
    lost = light[:, :, order[carrying:]].sum(axis=2)
    assert (found.lights, found.carrying, found.share) == (len(parts), carrying, 0.8)
    assert 1 < carrying < len(parts) < 48  # some of those drawn have no flux
    assert abs(found.count - 48 * carrying / len(parts)) <= 0.5
    assert found.error == pytest.approx(np.sqrt((lost**2).mean()) / light.sum(axis=2).mean(), rel=UNLIKE)
    assert (found.times, found.times_carrying) == ((1.0, 9.0), (5.0, 13.0))  # in turn: 1 - 0, 9 - 4, 25 - 16, 49 - 36


def test_footprints_go_with_their_lights():
    frame = Frame(load_scene("cornell_box"), **SIZE)
    found = dim_lights(frame, settings_of("multires", "lights=100"), 1)
    assert 0 < found.carrying < found.lights <= 100
    assert 0 < found.error < 0.02  # a thousandth of the light, spread unevenly


def test_methods_without_pixel_lights_and_dark_scenes_have_none(monkeypatch):
    frame = Frame(load_scene("cornell_box"), **SIZE)
    assert dim_lights(frame, settings_of("gather"), 1) is None
    assert dim_lights(frame, settings_of("vpl"), 1) is None
    monkeypatch.setattr(module, "MOST", 10)
    assert dim_lights(frame, settings_of("sii", "lights=64"), 1) is None
