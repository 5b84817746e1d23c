"""FLIP in a child process: sane figures, and a reason wherever there is none."""

import importlib.util
import math
import sys

import numpy as np
import pytest

from refgi.compare import flip as module
from refgi.compare.flip import choose_exposures, flip


@pytest.fixture
def picture():
    y, x = np.mgrid[0:24, 0:32] / 8
    return np.stack([1 + np.sin(x), 1 + np.cos(y), np.full_like(x, 0.5)]).astype(np.float32)


@pytest.fixture
def everywhere():
    return np.ones((24, 32), bool)


def test_equal_pictures_differ_by_nothing(picture, everywhere):
    got = flip(picture, picture, everywhere)
    assert (got.mean, got.skipped) == (0.0, "")
    assert got.error.shape == (24, 32)


@pytest.mark.slow
def test_a_larger_error_is_seen_more(picture, everywhere):
    means = [flip(picture * factor, picture, everywhere).mean for factor in (1.1, 1.5, 3.0)]
    assert 0 < means[0] < means[1] < means[2] <= 1


def test_a_black_picture_does_not_end_this_process(picture, everywhere):
    assert flip(picture, 0 * picture, everywhere).skipped == "the reference is black"
    assert flip(0 * picture, picture, everywhere).mean > 0.3


def test_non_finite_pixels_are_a_reason(picture, everywhere):
    picture[1, 3, 4] = np.nan
    assert "1 pixels are NaN" in flip(picture, np.ones_like(picture), everywhere).skipped


def test_pixels_outside_the_mask_do_not_count(picture, everywhere):
    everywhere[:, 16:] = False
    changed = picture.copy()
    changed[:, :, 16:] = np.nan
    assert flip(changed, picture, everywhere).mean == 0.0


def test_without_the_package_it_says_so(picture, everywhere, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    assert "pip install" in flip(picture, picture, everywhere).skipped


def test_a_child_that_dies_is_a_reason(picture, everywhere, monkeypatch):
    monkeypatch.setattr(module.sys, "executable", sys.executable)
    monkeypatch.setattr(module, "choose_exposures", lambda *_: (5.0, -5.0, 3))  # it refuses start > stop by exit()
    assert "flip-evaluator ended with" in flip(picture, picture, everywhere).skipped


def test_exposures_by_hand(everywhere):
    """Analytic: grey 2^-3 with 5 % at 2^2 shows white at -2 stops and grey at +3."""
    grey = np.full((3, 24, 32), 2.0**-3)
    grey[:, :2] = 4.0
    assert choose_exposures(grey, everywhere) == pytest.approx((-2.0, 3.0, 3))
    assert choose_exposures(np.full((3, 24, 32), 0.5), everywhere) == pytest.approx((1.0, 1.0, 1))
    assert math.isclose(choose_exposures(np.where(grey > 1, 4.0, 1e-9), everywhere)[1], 6.0)
    assert choose_exposures(0 * grey, everywhere) is None
