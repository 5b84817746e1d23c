"""The front and the path tracer's line against closed forms."""

import math

import pytest

from refgi.bench.curves import error_in, front


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
