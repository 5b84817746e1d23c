"""Errors made by hand: each kind is found, and what is not of that kind is not named so."""

import numpy as np
import pytest

from refgi.compare.findings import LEAST_SIDE, LEAST_TILES, TILE, findings, worst_crops

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


WHOLE = np.ones((64, 96), bool)


def test_the_worst_places_come_in_order_and_do_not_overlap():
    error = np.zeros((64, 96))
    error[10:14, 20:24], error[50, 90], error[30:32, 60:62] = -2.0, 5.0, 1.0  # squares: 64, 25, 4
    found = worst_crops(error, WHOLE)
    assert [round(crop.share, 6) for crop in found] == [round(s / 93, 6) for s in (64, 25, 4)]
    for crop, (x, y) in zip(found, ((22, 12), (90, 50), (61, 31)), strict=True):
        assert crop.side == LEAST_SIDE
        assert crop.x <= x < crop.x + crop.side
        assert crop.y <= y < crop.y + crop.side


def test_neighbouring_squares_do_not_share_pixels():
    found = worst_crops(np.ones((64, 96)), WHOLE)
    assert len(found) == 3
    boxes = [np.zeros((64, 96), int) for _ in found]
    for box, crop in zip(boxes, found, strict=True):
        box[crop.y:crop.y + crop.side, crop.x:crop.x + crop.side] = 1
        assert box.sum() == crop.side**2
        assert crop.share == pytest.approx(crop.side**2 / (64 * 96))
    assert sum(boxes).max() == 1


def test_what_is_not_covered_has_no_error_and_nan_has_the_most():
    error = np.full((64, 96), 0.01)
    error[5, 5], error[20, 20], error[40, 70:72] = 100.0, 1.0, np.nan
    covered = WHOLE.copy()
    covered[5, 5] = False
    crop = worst_crops(error, covered)[0]
    assert crop.x <= 70 < crop.x + crop.side
    assert crop.y <= 40 < crop.y + crop.side


def test_no_error_has_no_worst_place():
    assert worst_crops(np.zeros((64, 96)), WHOLE) == ()
    assert len(worst_crops(np.ones((4, 3)), np.ones((4, 3), bool))) == 1
