"""What closest and mean texels do to coverage and to the flux that leaves a picture."""

import math

import numpy as np
import pytest

from refgi.frame import Frame
from refgi.scene import PointLight, load_scene
from refgi.settings import of, replaced
from refgi.sssil.levels import pyramid, sender_pyramid
from refgi.sssil.settings import HssilSettings
from tests.sssil.pictures import FLOAT64, camera, made, random_picture

SIZE = 512
STANDARD_ERRORS = 4.0  # a chance of 6e-5 to fail for a seed


def flux(level):
    return (level.radiance.astype(float) * level.area).sum(axis=(1, 2))


@pytest.mark.feature("HSS-09")
def test_foreground_grows_by_the_law_of_coverage(evidence):
    """Random foreground of share q covers 1 - (1 - q)^(4^k) of level k."""
    q, rng, figures = 0.1, np.random.default_rng(5), []
    before = rng.random((SIZE, SIZE)) < q
    _, _, albedo, direct = random_picture(SIZE, SIZE)
    normal = np.zeros((3, SIZE, SIZE))
    normal[2] = 1
    picture = (np.where(before, 1.0, 2.0), normal, albedo, direct)
    for level in made(picture, camera(SIZE, SIZE), 0, 4, dtype=np.float32):
        expected = 1 - (1 - q) ** (4.0**level.number)
        deviation = np.sqrt(expected * (1 - expected) / level.area.size)
        share = (level.depth == 1.0).mean()
        assert abs(share - expected) <= STANDARD_ERRORS * deviation
        figures.append(f"{share:.3f} ({expected:.3f})")
    evidence(f"q = 0.1 at levels 0 to 3 (law): {', '.join(figures)}")


@pytest.mark.feature("HSS-09")
def test_means_keep_the_flux(evidence):
    """The sum of radiance times area is that of the pixels at every level; that of the closest is not."""
    picture, view = random_picture(83, 45), camera(83, 45)
    expected = flux(made(picture, view, 0, 1)[0])
    for first in range(3):
        for level in made(picture, view, first, 5, "average"):
            np.testing.assert_allclose(flux(level), expected, rtol=FLOAT64)
    closest = [float((flux(level) / expected).mean()) for level in made(picture, view, 0, 4)]
    assert abs(closest[0] - 1) < FLOAT64
    assert abs(closest[3] - 1) > 0.1
    evidence(f"average: flux equal to {FLOAT64:g}; closest: {', '.join(f'{share:.2f}' for share in closest)} of it")


@pytest.mark.feature("HSS-09")
def test_a_texel_without_area_shows_its_closest_pixel():
    """Normals that look away send nothing, but receive."""
    depth, normal, albedo, direct = random_picture(4, 4, behind=0.0)
    closest = made((depth, -normal, albedo, direct), camera(4, 4), 0, 3)
    for level, expected in zip(made((depth, -normal, albedo, direct), camera(4, 4), 0, 3, "average"), closest,
                               strict=True):
        assert (level.area == 0).all()
        assert np.array_equal(level.position, expected.position)
        assert np.array_equal(level.normal, expected.normal)


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


@pytest.mark.feature("HSS-09")
@pytest.mark.parametrize("start", ["full", "half", "quarter"])
def test_every_level_sends_the_flux_of_the_pixels(frame, start, evidence):
    pixels = levels_of(frame, start="full", downsample="closest")[0][0]
    receivers, senders = levels_of(frame, start=start)
    kept = [flux(level) / flux(pixels) for level in senders]
    np.testing.assert_allclose(kept, 1.0, rtol=ROUNDING)
    grown = ", ".join(f"{flux(level).sum() / flux(pixels).sum():.2f}" for level in receivers)
    evidence(f"from {start}: flux of each level over that of the pixels is 1 to 1e-5; of the closest {grown}")


@pytest.mark.feature("HSS-01", "HSS-09")
@pytest.mark.parametrize("start", ["half", "quarter"])
def test_a_sender_is_one_of_its_pixels(frame, start):
    _, senders = levels_of(frame, seed=3, start=start)
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
