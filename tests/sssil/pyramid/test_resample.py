"""Drawn senders: they keep the flux, stand where one of their pixels does, and are unbiased over seeds."""

import math

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.scene import PointLight, load_scene
from refgi.settings import of, replaced
from refgi.sssil.levels import pyramid, sender_pyramid
from refgi.sssil.settings import HssilSettings

SETTINGS = of(HssilSettings, levels=4, radius=2.0, start="half", downsample="resampled")
SEEDS = 60
ROUNDING = 1e-5  # float32 sums over a few hundred texels


@pytest.fixture(scope="module")
def frame():
    """A sphere in the Cornell box: silhouettes before lit walls; 45 columns end levels in cut texels."""
    return Frame(load_scene("cornell_sphere"), width=45, height=38)


def levels_of(frame, **changes):
    settings = replaced(SETTINGS, changes)
    receivers = pyramid(frame, settings)
    return receivers, sender_pyramid(frame, receivers, settings)


def flux(level):
    return (level.radiance.astype(float) * level.area).sum(axis=(1, 2))


@pytest.mark.feature("HSS-09")
@pytest.mark.parametrize("start", ["full", "half", "quarter"])
def test_every_level_sends_the_flux_of_the_pixels(frame, start, evidence):
    pixels = levels_of(frame, start="full", downsample="closest")[0][0]
    receivers, senders = levels_of(frame, start=start)
    kept = [flux(level) / flux(pixels) for level in senders]
    np.testing.assert_allclose(kept, 1.0, rtol=ROUNDING)
    grown = ", ".join(f"{flux(level).sum() / flux(pixels).sum():.2f}" for level in receivers)
    evidence(f"from {start}: flux of each level over that of the pixels is 1 to 1e-5; of the closest {grown}")


@pytest.mark.feature("HSS-09")
def test_a_sender_is_one_of_its_pixels(frame):
    _, senders = levels_of(frame, seed=3)
    position, normal = frame.gbuffer.resolve("position", "normal")
    eye = np.asarray(frame.scene.camera.eye)
    for level in senders:
        rows, columns = np.nonzero(level.radiance.any(axis=0))
        row, column = np.divmod(level.pixel[rows, columns], frame.width)
        assert (row >> level.number == rows).all()
        assert (column >> level.number == columns).all()
        np.testing.assert_array_equal(level.normal[:, rows, columns], normal[:, row, column])
        np.testing.assert_allclose(level.position[:, rows, columns] + eye[:, None], position[:, row, column], atol=2e-6)


@pytest.mark.feature("HSS-09")
def test_the_place_is_unbiased(frame, evidence):
    """Statistical: the mean place of senders, weighted by flux, is that of pixels, within 4 standard errors."""
    pixels = levels_of(frame, start="full", downsample="closest")[0][0]
    light = (pixels.radiance.sum(axis=0) * pixels.area).astype(float)
    expected = (pixels.position * light).sum(axis=(1, 2)) / light.sum()
    places = []
    for seed in range(SEEDS):
        level = levels_of(frame, seed=seed)[1][-1]
        sent = (level.radiance.sum(axis=0) * level.area).astype(float)
        places.append((level.position * sent).sum(axis=(1, 2)) / sent.sum())
    error = np.std(places, axis=0, ddof=1) / math.sqrt(SEEDS)
    off = (np.mean(places, axis=0) - expected) / error
    assert np.abs(off).max() < 4
    evidence(f"mean place of {SEEDS} seeds off by {np.abs(off).max():.1f} standard errors")


def test_dark_texels_are_as_the_closest(frame):
    below = PointLight((0.28, -1.0, -0.28), (1.0, 1.0, 1.0))  # lights the floor from below alone
    dark = Frame(frame.scene.with_lights(below).with_camera(eye=(0.28, 0.4, -0.3), target=(0.28, 0.0, -0.2)), width=45,
                 height=38, shadows="exact")
    assert not dark.direct.any()
    receivers, senders = levels_of(dark)
    for near, level in zip(receivers, senders, strict=True):
        np.testing.assert_array_equal(level.pixel, near.pixel)
        np.testing.assert_array_equal(level.position, near.position)
        assert not level.radiance.any()
