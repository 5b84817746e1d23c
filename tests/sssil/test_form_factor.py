"""The disc of one texel, times the texels that a sample stands for: unbiased where Eq. 4 is dark."""

import math

import numpy as np
import pytest

from refgi.settings import of, replaced
from refgi.sssil.crown import gather
from refgi.sssil.settings import HssilSettings
from refgi.sssil.view import Level

SIDE, HEIGHT, SPACING, RADIUS = 49, 1.0, 0.25, 12.0
SEEDS, SAMPLES = 100, 16


def plane_below():
    """A plane of radiance 1 in texels of `SPACING`, and one receiver `HEIGHT` above its middle that faces it."""
    x, y = np.meshgrid(np.arange(SIDE) - SIDE // 2, np.arange(SIDE) - SIDE // 2)
    position = np.stack([x * SPACING, y * SPACING, np.full(x.shape, -5.0)]).astype(float)
    normal = np.stack([np.zeros(x.shape), np.zeros(x.shape), np.ones(x.shape)])
    middle = (SIDE // 2, SIDE // 2)
    position[2][middle], normal[2][middle] = -5.0 + HEIGHT, -1.0
    area = np.full(x.shape, SPACING**2)
    area[middle] = 0.0
    radiance = np.ones((3, *x.shape))
    radiance[:, *middle] = 0.0
    return Level(1, position, np.full(x.shape, 5.0), normal, radiance, area, np.arange(x.size).reshape(x.shape)), middle


def texel_sum(form):
    """Sum of pi cos R^2 / (r^2 + R^2) over the texels in the crowns, by hand: cos of both ends are h / r."""
    total = 0.0
    for i in range(-SIDE // 2, SIDE // 2 + 1):
        for j in range(-SIDE // 2, SIDE // 2 + 1):
            if 0 < math.hypot(i, j) < 2 * RADIUS:
                square = SPACING**2 * (i * i + j * j) + HEIGHT**2
                cosine = HEIGHT / math.sqrt(square)
                disc = cosine * SPACING**2 / math.pi
                total += math.pi * cosine * disc / (square + (disc if form == "texel" else 0.0))
    return total


@pytest.mark.slow
@pytest.mark.feature("HSS-04")
def test_few_samples_are_unbiased(evidence):
    """Analytic and statistical: a constant plane, 16 samples in a crown and 5 within, and Eq. 4 dark."""
    level, middle = plane_below()
    expected = texel_sum("texel")
    means, noise = {}, {}
    for form in ("disc", "texel"):
        drawn = [gather(level, 0, of(HssilSettings, samples=SAMPLES, radius=RADIUS, levels=1, pattern="pixel",
                                     form_factor=form, seed=seed))[0, *middle] for seed in range(SEEDS)]
        means[form], noise[form] = np.mean(drawn), np.std(drawn, ddof=1)
    assert abs(means["texel"] - expected) < 4 * noise["texel"] / math.sqrt(SEEDS)
    assert means["disc"] < expected - 4 * noise["disc"] / math.sqrt(SEEDS)
    assert noise["disc"] < noise["texel"]
    found = (f"{form} {means[form] / expected:.3f} +- {noise[form] / expected:.2f}" for form in means)
    evidence(f"{SAMPLES} samples over every texel: {', '.join(found)}")


@pytest.mark.slow("1.0")
@pytest.mark.feature("HSS-04")
@pytest.mark.parametrize("share", [0.25, 1.0])
def test_a_disc_of_a_share_is_as_dark_as_that(share, evidence):
    """Analytic and statistical: uniform samples, whose expectation is Eq. 4 with the disc of a share for each texel."""
    level, middle = plane_below()
    disc, crown = math.pi * RADIUS**2 / round(SAMPLES / 3), 3 * math.pi * RADIUS**2 / SAMPLES
    expected = 0.0
    for i in range(-SIDE // 2, SIDE // 2 + 1):
        for j in range(-SIDE // 2, SIDE // 2 + 1):
            if 0 < math.hypot(i, j) < 2 * RADIUS:
                square = SPACING**2 * (i * i + j * j) + HEIGHT**2
                one = HEIGHT / math.sqrt(square) * SPACING**2 / math.pi
                covered = share * (disc if math.hypot(i, j) < RADIUS else crown)
                expected += math.pi * HEIGHT / math.sqrt(square) * one / (square + covered * one)
    settings = of(HssilSettings, samples=SAMPLES, radius=RADIUS, levels=1, pattern="pixel", density="uniform",
                  disc_share=share)
    drawn = [gather(level, 0, replaced(settings, {"seed": seed}))[0, *middle] for seed in range(4 * SEEDS)]
    error = np.std(drawn, ddof=1) / math.sqrt(4 * SEEDS)
    assert abs(np.mean(drawn) - expected) < 4 * error
    assert expected + 4 * error < texel_sum("texel")
    evidence(f"a disc of {share} of all: {np.mean(drawn) / expected:.3f} +- {error / expected:.3f} of its sum by hand")


@pytest.mark.feature("HSS-04")
def test_every_texel_is_the_sum_of_eq_4():
    """Where each sample stands for one texel both forms are Eq. 4, and the sum by hand."""
    level, middle = plane_below()
    every = {form: gather(level, 0, of(HssilSettings, radius=RADIUS, levels=1, pattern="all", form_factor=form))
             for form in ("disc", "texel", "point")}
    np.testing.assert_array_equal(every["disc"], every["texel"])
    assert every["texel"][0, *middle] == pytest.approx(texel_sum("texel"), rel=1e-12)
    assert every["point"][0, *middle] == pytest.approx(texel_sum("point"), rel=1e-12)
