"""Errors made by hand: each kind is found, and what is not of that kind is not named so."""

import numpy as np
import pytest

from refgi.compare.page.detectors import LEAST_TILES, TILE, findings

SIDE = 160
Y, X = np.mgrid[0:SIDE, 0:SIDE] / SIDE
TRUTH = np.stack([2 + np.sin(5 * X), 2 + np.cos(4 * Y), 1.5 + 0.4 * X])
QUIET = np.full_like(TRUTH, 1e-8)
COVERED = np.ones((SIDE, SIDE), bool)


def noise(seed=7):
    return np.random.default_rng(seed).standard_normal((SIDE, SIDE))


def blurred(values, size):
    kernel = np.ones(size) / size
    rows = np.apply_along_axis(np.convolve, 1, values, kernel, "same")
    return np.apply_along_axis(np.convolve, 0, rows, kernel, "same")


def names(error, variance=QUIET, covered=COVERED):
    return {one.name.split(" by ")[0]: one.figure for one in findings(TRUTH + error, TRUTH, variance, covered)}


def rows_of_eight(values):
    """Noise of one value for each eight pixels of a row."""
    return np.repeat(values[:, ::8], 8, axis=1)


def test_streaks_along_rows_and_columns_are_told_apart():
    streaky = rows_of_eight(noise())
    assert set(names(0.1 * streaky)) == {"row streaks"}
    assert set(names(0.1 * streaky.T)) == {"column streaks"}
    assert names(0.1 * streaky)["row streaks"] == pytest.approx(5 / 8, abs=0.06)  # lag of 3 in runs of 8 pixels
    assert set(names(0.1 * streaky + 0.05 * noise(8))) == {"row streaks"}


@pytest.mark.parametrize("error", [0.1 * noise(), 0.5 * blurred(noise(), 5), 0.5 * blurred(noise(), 15),
                                   0.3 * np.sin(20 * X) * np.cos(20 * Y), 0.2 * (X > 0.42) - 0.15 * (Y > 0.37)],
                         ids=["white", "blurred", "smooth", "waves", "edges"])
def test_what_has_no_name_gets_none(error):
    assert names(error - (error * TRUTH[1]).sum() / (TRUTH[1] ** 2).sum() * TRUTH[1]) == {}


def test_few_tiles_say_nothing_of_streaks():
    covered = COVERED.copy()
    covered[TILE:, :] = False
    assert SIDE // TILE < LEAST_TILES
    assert "row streaks" not in names(0.1 * rows_of_eight(noise()), covered=covered)


def test_isolated_bright_pixels_are_spikes():
    error = 0.01 * noise()
    places = np.random.default_rng(9).permutation(SIDE * SIDE)[:40]
    error.reshape(-1)[places] = 30.0
    found = names(error)
    assert set(found) == {"spikes"}
    assert found["spikes"] == pytest.approx(1e4 * 40 / SIDE**2, rel=0.1)  # but for neighbours by chance
    assert "spikes" not in names(-error)
    assert "spikes" not in names(np.minimum(error, 0.7))  # less than the light itself


def test_bright_areas_are_no_spikes():
    error = 0.01 * noise()
    for y, x in np.random.default_rng(9).integers(5, 150, (40, 2)):
        error[y:y + 3, x:x + 3] = 30.0
    assert "spikes" not in names(error)


def test_what_the_truth_s_noise_explains_is_no_spike():
    error = 0.01 * noise()
    error[::20, ::20] = 30.0
    variance = np.where(error > 1, 100.0, QUIET)
    assert names(error) == pytest.approx({"spikes": 1e4 * 64 / SIDE**2})
    assert names(error, variance=variance) == {}


@pytest.mark.parametrize("size", [2, 4, 8, 16])
def test_blocks_are_named_by_their_size(size):
    blocky = np.kron(noise()[: SIDE // size, : SIDE // size], np.ones((size, size)))
    found = names(0.1 * blocky + 0.02 * noise(8))
    assert f"blocks of {size} x {size}" in found
    assert not {name for name in found if name.startswith("blocks")} - {f"blocks of {size} x {size}"}


@pytest.mark.parametrize(("factor", "name"), [(0.8, "too dark"), (1.25, "too bright")])
def test_one_factor_all_over(factor, name):
    found = findings(factor * TRUTH + 0.01 * noise(), TRUTH, QUIET, COVERED)
    assert [one.name for one in found] == [f"{name} by {abs(factor - 1):.0%} all over"]
    assert found[0].figure > 0.99
    share = names((factor - 1) * TRUTH + abs(factor - 1) * 3 * TRUTH * noise())  # a tenth of the squares is the factor
    assert name not in share


def test_the_factor_is_right_however_noisy_the_truth():
    deviation = 0.3 * TRUTH
    noisy = TRUTH + deviation * noise()
    found = findings(0.5 * TRUTH, noisy, deviation**2, COVERED)
    assert [one.name for one in found] == ["too dark by 50% all over"]
    assert found[0].figure == pytest.approx(1, abs=0.03)


def test_no_more_than_the_truth_s_noise_is_nothing():
    deviation = 0.1 * TRUTH
    streaky = rows_of_eight(noise())
    assert findings(TRUTH + deviation * streaky, TRUTH, deviation**2, COVERED) == ()
    assert "row streaks" in names(2 * deviation * streaky, variance=deviation**2)


def test_pixels_without_surface_or_number_do_not_count():
    error, covered = 0.1 * noise(), COVERED.copy()
    covered[:, 100:] = False
    error[:, 100:] = 50 * rows_of_eight(noise())[:, 100:]
    broken = TRUTH + error
    broken[0, 3, 3] = np.nan
    assert findings(broken, TRUTH, QUIET, covered) == ()
