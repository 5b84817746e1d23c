"""Bias and variance apart: closed forms of pictures made with known bias, spread and noise of the reference."""

import math

import numpy as np
import pytest

from refgi.bench.error import error_in, error_of, front, knee
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


def test_the_front_is_what_nothing_beats():
    points = [(1, 9), (2, 4), (3, 4), (4, 1), (5, 2), (1, 10), (math.nan, 0), (0.5, math.inf)]
    assert front(points) == [True, True, False, True, False, False, False, False]
    assert front([(1, 1), (1, 1)]) == [True, True]
    assert front([]) == []


def test_a_monte_carlo_line_is_met_between_and_after_its_points():
    line = [(seconds, 0.3 / math.sqrt(seconds)) for seconds in (4.0, 1.0, 16.0)]
    for seconds in (1.0, 1.7, 4.0, 9.0, 16.0, 400.0):
        assert error_in(line, seconds) == pytest.approx(0.3 / math.sqrt(seconds))
    assert error_in(line, 0.99) == math.inf
    assert error_in([], 1.0) == math.inf


def test_the_knee_is_where_noise_has_come_down_to_bias():
    """Of e^2 = b^2 + c / t that is t = c / b^2, wherever the points begin."""
    for bias, noise in ((0.1, 0.04), (0.3, 0.9), (0.02, 0.001)):
        times = [noise / bias**2 * 2**k for k in range(-3, 5)]
        points = [(t, math.sqrt(bias**2 + noise / t)) for t in times]
        assert times[knee(points)] == pytest.approx(noise / bias**2)
        assert times[::-1][knee(points[::-1])] == pytest.approx(noise / bias**2)


def test_a_knee_is_one_of_the_points_that_are_known():
    assert knee([]) is None
    assert knee([(1, math.nan), (0, 1), (math.inf, 1), (1, math.inf), (1, 0)]) is None
    assert knee([(1, math.nan), (2, 0.5), (3, 0.5)]) == 1
    assert knee([(1, 0.5), (1, 0.5)]) == 0
