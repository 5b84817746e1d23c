"""The worst places of errors made by hand."""

import numpy as np
import pytest

from refgi.compare.page.album import LEAST_SIDE, worst_crops

COVERED = np.ones((64, 96), bool)


def test_the_worst_places_come_in_order_and_do_not_overlap():
    error = np.zeros((64, 96))
    error[10:14, 20:24], error[50, 90], error[30:32, 60:62] = -2.0, 5.0, 1.0  # squares: 64, 25, 4
    found = worst_crops(error, COVERED)
    assert [round(crop.share, 6) for crop in found] == [round(s / 93, 6) for s in (64, 25, 4)]
    for crop, (x, y) in zip(found, ((22, 12), (90, 50), (61, 31)), strict=True):
        assert crop.side == LEAST_SIDE
        assert crop.x <= x < crop.x + crop.side
        assert crop.y <= y < crop.y + crop.side


def test_neighbouring_squares_do_not_share_pixels():
    found = worst_crops(np.ones((64, 96)), COVERED)
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
    covered = COVERED.copy()
    covered[5, 5] = False
    crop = worst_crops(error, covered)[0]
    assert crop.x <= 70 < crop.x + crop.side
    assert crop.y <= 40 < crop.y + crop.side


def test_no_error_has_no_worst_place():
    assert worst_crops(np.zeros((64, 96)), COVERED) == ()
    assert len(worst_crops(np.ones((4, 3)), np.ones((4, 3), bool))) == 1
