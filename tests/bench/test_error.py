"""Bias and variance apart: closed forms of pictures made with known bias, spread and noise of the reference."""

import numpy as np
import pytest

from refgi.bench.error import error_of
from refgi.errors import InputError

SHAPE = (3, 96, 128)
COVERED = np.ones(SHAPE[1:], bool)
MEAN = 2.0


def made(seeds, bias=0.0, spread=0.0, noise=0.0):
    """Return pictures, a reference and its variance."""
    random = np.random.default_rng(1)
    right = random.uniform(0.5, 1.5, SHAPE)
    right *= MEAN / right.mean()
    away = bias * random.choice([-1, 1], SHAPE)
    pictures = [right + away + spread * random.standard_normal(SHAPE) for _ in range(seeds)]
    return pictures, right + noise * random.standard_normal(SHAPE), np.full(SHAPE, noise**2)


@pytest.mark.parametrize(("bias", "spread", "noise"), [(0.3, 0, 0), (0, 0.3, 0), (0, 0, 0.3), (0.2, 0.3, 0.1),
                                                       (0.1, 0.1, 0.4)])
def test_each_part_is_found(bias, spread, noise):
    found = error_of(*made(4, bias, spread, noise), COVERED)
    assert found.rmse == pytest.approx(np.sqrt(bias**2 + spread**2 + noise**2) / MEAN, rel=0.02)
    assert found.spread == pytest.approx(spread / MEAN, rel=0.02, abs=1e-12)
    assert found.noise == pytest.approx(noise / MEAN, rel=0.01)
    assert found.bias == pytest.approx(bias / MEAN, rel=0.1, abs=0.02)


def test_two_seeds_are_no_less_right_on_the_mean():
    """Without the terms for few seeds and for noise the bias would be 0.27 here."""
    assert error_of(*made(2, 0.0, 0.5, 0.4), COVERED).bias < 0.03


def test_one_picture_tells_no_variance():
    found = error_of(*made(1, 0.2, 0.1), COVERED)
    assert np.isnan([found.bias, found.spread]).all()
    assert found.rmse == pytest.approx(np.hypot(0.2, 0.1) / MEAN, rel=0.02)


def test_pictures_without_random_numbers_have_no_spread():
    (picture,), reference, variance = made(1, 0.2)
    found = error_of([picture] * 3, reference, variance, COVERED)
    assert (found.spread, found.bias) == (0, pytest.approx(found.rmse))


def test_the_interval_holds_what_other_parts_of_the_picture_have():
    """Errors of blocks that are alike within: the interval is of the blocks, not of their pixels."""
    random, inside = np.random.default_rng(5), 0
    right = np.full(SHAPE, MEAN)
    for _ in range(100):
        error = np.kron(np.exp(random.standard_normal((6, 8))), np.ones((16, 16)))
        found = error_of([right + error], right, 0 * right, COVERED)
        inside += found.low <= np.sqrt(np.exp(2)) / MEAN <= found.high  # E e^(2 z)
    assert 70 <= inside <= 100
    assert found.low < found.rmse < found.high


def test_pixels_without_surface_do_not_count():
    pictures, reference, variance = made(2, 0.2, 0.1)
    covered = COVERED.copy()
    covered[:, 64:] = False
    half = error_of([picture[..., :64] for picture in pictures], reference[..., :64], variance[..., :64],
                    COVERED[:, :64])
    for picture in pictures:
        picture[..., 64:] = np.nan
    assert error_of(pictures, reference, variance, covered) == half


def test_black_references_and_broken_pictures():
    black, nothing = np.zeros(SHAPE), np.zeros(SHAPE)
    assert error_of([black], black, nothing, COVERED).rmse == 0
    assert error_of([black + 1], black, nothing, COVERED).rmse == np.inf
    broken = np.ones(SHAPE)
    broken[0, 3, 4] = np.nan
    found = error_of([broken, broken], np.ones(SHAPE), nothing, COVERED)
    assert np.isnan(found[:5]).all()
    with pytest.raises(InputError, match="pictures"):
        error_of([], black, nothing, COVERED)
    with pytest.raises(InputError, match="covered"):
        error_of([black], black, nothing, ~COVERED)
