"""The front and the path tracer's line against closed forms."""

import math

import pytest

from refgi.bench.error import error_in, front, knee


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
