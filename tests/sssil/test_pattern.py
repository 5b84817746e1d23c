"""Where samples lie: the share that each texel gets, mirror images, and who shares them."""

import math
import warnings

import numpy as np
import pytest

from refgi.errors import InputError, RefgiWarning
from refgi.settings import of, replaced
from refgi.sssil.pattern import (
    chosen_radius,
    coverage,
    covering_radius,
    reach,
    row_offsets,
    samples_at,
    texel_weights,
    warn_short_reach,
)
from refgi.sssil.settings import HssilSettings
from tests.sssil.counting import share_inside

SETTINGS = of(HssilSettings, radius=4.0, samples=12, inner_samples=5, levels=3)
ROWS = 6000
EVEN = 1e-3  # of the area: 6000 rows of low-discrepancy points at distances that count as they are far
DEVIATIONS = 4.5  # of the mean weight of one texel out of 270: 1 in 500 sets of independent ones would pass it


@pytest.mark.feature("HSS-05")
@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize("density", ["inverse_distance", "uniform"])
def test_texels_get_their_share_of_the_crown(density, index, evidence):
    """Statistical: the mean weight of a texel is the share of it that lies in the crown, in the first level's disc."""
    found = texel_weights(replaced(SETTINGS, {"pattern": "row", "density": density}).sampling, index, 1 + index, ROWS)
    reach = found.shape[0] // 2
    low = 0.0 if index == 0 else SETTINGS.sampling.radius
    share = np.array([[share_inside(ox, oy, low, 2 * SETTINGS.sampling.radius) for ox in range(-reach, reach + 1)]
                      for oy in range(-reach, reach + 1)])
    most = 3 * math.pi * 16 / 12
    error = np.abs(found - share) / np.sqrt(most * np.maximum(share, 1e-9) / ROWS + 1e-5)
    assert error.max() < DEVIATIONS
    area = math.pi * 64 - (0 if index == 0 else math.pi * 16)
    assert found.sum() == pytest.approx(area, rel=1e-12 if density == "uniform" else EVEN)
    evidence(f"{density}, level {index}: weight of {(share > 0).sum()} texels = their share of the crown within "
             f"{np.abs(found - share).max():.3f} over {ROWS} rows; sum exact")


@pytest.mark.feature("HSS-05")
def test_every_offset_is_covered_once(evidence):
    """Property: the crowns of all levels together cover each offset within reach once, and none beyond."""
    settings = of(HssilSettings, radius=8.0, levels=3, pattern="all")
    weight = coverage(settings.sampling, (80, 80))
    oy, ox = np.mgrid[-79:80, -79:80]
    length = np.hypot(ox, oy)
    # offsets of coarse texels are known to half of one: rings blur by 2^k texels where they meet
    within = (length > 0) & (length < 8.0 * 8 - 6.0)
    inside = weight[within].mean()
    assert inside == pytest.approx(1.0, abs=0.01)
    assert weight[within].min() >= 0.5
    assert weight[within].max() <= 1.5
    assert weight[length > 8.0 * 8 + 6.0].max() == 0.0
    assert weight[79, 79] == 0.0
    evidence(f"pattern all, r = 8, 3 levels: mean weight {inside:.4f} of {within.sum()} offsets within reach, "
             f"{weight[within].min():.2f} to {weight[within].max():.2f}; 0 beyond")


@pytest.mark.feature("HSS-05")
def test_all_has_each_texel_of_the_crown_once():
    """Analytic: by brute force over a square."""
    offsets, weight = row_offsets(replaced(SETTINGS, {"pattern": "all"}).sampling, 1, 1, 3)
    expected = {(x, y) for x in range(-9, 10) for y in range(-9, 10) if 16 <= x * x + y * y < 64}
    assert offsets.shape[0] == 1
    assert len(offsets[0]) == len(expected)
    assert set(map(tuple, offsets[0].tolist())) == expected
    assert (weight == 1).all()


@pytest.mark.feature("HSS-10")
@pytest.mark.parametrize(("pattern", "samples"), [("fixed", 12), ("fixed", 7), ("all", 12)])
def test_symmetric_patterns_are_pairs_of_mirror_images(pattern, samples):
    """Property: partners follow each other; those on the middle line come last."""
    offsets, weight = row_offsets(replaced(SETTINGS, {"pattern": pattern, "samples": samples}).sampling, 0, 1, 3)
    even = len(weight) // 2 * 2
    first, second = offsets[0, :even:2], offsets[0, 1:even:2]
    mirrored = (first * (-1, 1) == second).all(axis=1)
    middle = (first[:, 0] == 0) & (second[:, 0] == 0)
    assert (mirrored | middle).all()
    np.testing.assert_array_equal(weight[:even:2][mirrored], weight[1:even:2][mirrored])
    if len(weight) % 2:
        assert offsets[0, -1, 0] == 0


@pytest.mark.parametrize("pattern", ["interleaved", "row", "pixel", "fixed"])
def test_samples_lie_in_disc_and_crown(pattern):
    """Property: as far from the receiver as their texel may be from their point."""
    settings = replaced(SETTINGS, {"pattern": pattern})
    length = np.hypot(*samples_at(settings.sampling, 0, 1, 5, 6)[0].T)
    assert (length[:5] <= 4.0 + math.sqrt(0.5)).all() or pattern == "fixed"
    assert (length <= 8.0 + math.sqrt(0.5)).all()
    assert len(length) == 17


def test_receivers_of_a_row_share_samples_with_every_second():
    """Property: by row and phase, and by seed and level."""
    row = replaced(SETTINGS, {"pattern": "row"})
    offsets, _ = row_offsets(row.sampling, 0, 1, 8)
    odd, _ = row_offsets(row.sampling, 0, 1, 8, column=1)
    np.testing.assert_array_equal(offsets[3], samples_at(row.sampling, 0, 1, 3, 10)[0])
    np.testing.assert_array_equal(odd[3], samples_at(row.sampling, 0, 1, 3, 11)[0])
    assert (offsets[3] != odd[3]).any()
    assert (offsets[3] != offsets[4]).any()
    assert (offsets != row_offsets(replaced(row, {"seed": 1}).sampling, 0, 1, 8)[0]).any()
    assert (offsets != row_offsets(row.sampling, 0, 2, 8)[0]).any()


@pytest.mark.parametrize("side", [1, 2, 4])
def test_interleaved_samples_repeat_in_tiles(side):
    """Property: texels share samples where both their row and their column are equal modulo the tile's side."""
    sampling = replaced(SETTINGS, {"tile": side, "samples": 40}).sampling
    sets = {(row, column): tuple(map(tuple, samples_at(sampling, 1, 2, row, column)[0])) for row in range(8)
            for column in range(8)}
    for (row, column), found in sets.items():
        assert found == sets[row % side, column % side]
    assert len(set(sets.values())) == side**2


@pytest.mark.feature("HSS-06")
def test_a_tile_holds_one_set_of_low_discrepancy(evidence):
    """Property: of a tile's 16 x 64 points each of 256 cells of equal weight has its four to within two.

    Of as many independent points a cell would have 4 +- 2, and one of the 256 would have 10 or more.
    """
    sampling = of(HssilSettings, radius=2000.0, samples=64).sampling
    offsets = np.concatenate([samples_at(sampling, 1, 1, row, column)[0] for row in range(4) for column in range(4)])
    u = np.hypot(*offsets.T) / 2000.0 - 1.0
    v = np.arctan2(offsets[:, 1], offsets[:, 0]) / (2 * math.pi) % 1.0
    counts, *_ = np.histogram2d(u, v, bins=16, range=((0, 1), (0, 1)))
    evidence(f"16 sets of 64 samples: {counts.min():.0f} to {counts.max():.0f} in each of 256 cells, 4 in the mean")
    assert counts.min() >= 2
    assert counts.max() <= 6


@pytest.mark.feature("HSS-05")
def test_weights_are_those_of_rings():
    """Analytic: 2 pi d r / N texels at the distance d in the crown of N points, as much in the disc."""
    offsets, weight = samples_at(of(HssilSettings, radius=3000.0, samples=32).sampling, 0, 1, 2, 3)
    expected = 2 * math.pi * np.hypot(*offsets.T) * 3000.0 / 16
    np.testing.assert_allclose(weight, expected, atol=2 * math.pi * 3000.0 / 16)  # to a texel
    assert (np.hypot(*offsets[:16].T) < 3001).all()
    assert (np.hypot(*offsets[16:].T) > 2999).all()


def test_what_cannot_be_is_refused():
    """No shared samples where each pixel has its own; no samples without a radius."""
    with pytest.raises(InputError, match="pattern"):
        row_offsets(replaced(SETTINGS, {"pattern": "pixel"}).sampling, 0, 1, 8)
    with pytest.raises(InputError, match="radius"):
        row_offsets(replaced(SETTINGS, {"radius": None}).sampling, 0, 1, 8)


# first level, levels, radius -> reach and diagonal, texels: Fig. 6 at 1280 x 720 and Fig. 5 at 720 x 720
PAPER = [((180, 320), 4, 20.0, 320, 367), ((360, 640), 4, 20.0, 320, 734), ((360, 640), 5, 20.0, 640, 734),
         ((720, 720), 4, 40.0, 640, 1018)]


@pytest.mark.feature("HSS-07")
@pytest.mark.parametrize(("shape", "levels", "radius", "far", "diagonal"), PAPER)
def test_the_papers_settings_do_not_cover_the_screen(shape, levels, radius, far, diagonal, evidence):
    """Analytic: r 2^K against the diagonal; the warning names both and the radius that would do."""
    settings = of(HssilSettings, radius=radius, levels=levels)
    assert reach(settings.sampling, chosen_radius(shape, settings.sampling)) == far
    assert int(math.hypot(*shape)) == diagonal
    with pytest.warns(RefgiWarning, match=rf"{far}.*{diagonal}.*{math.ceil(diagonal / 2**levels)} texels"):
        warn_short_reach(shape, settings.sampling)
    evidence(f"{shape[1]} x {shape[0]}, r = {radius:g}, K = {levels}: reaches {far} of {diagonal} texels")


@pytest.mark.feature("HSS-07")
@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (90, 160), (361, 641)])
def test_the_chosen_radius_covers_the_screen(shape):
    """Property: without a radius nothing is warned of, and one texel less would not do."""
    settings = of(HssilSettings, radius=None, levels=3)
    radius = chosen_radius(shape, settings.sampling)
    assert reach(settings.sampling, radius) >= math.hypot(*shape) * (1 - 1e-12)
    assert radius == max(1.0, math.hypot(*shape) / 8) == covering_radius(shape, 3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_short_reach(shape, settings.sampling)
