"""Pairs of float64 numbers against exact fractions and mpmath."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest

from refgi.elementary.twofold import (
    add,
    length_across,
    length_along,
    multiply,
    root,
    sine_cosine_digits,
    two_product,
    two_sum,
    twofold,
)

BOUND = Fraction(1, 2**100)  # as promised in the docstrings
DIGITS = 1e-58


def numbers(count, seed=1):
    rng = np.random.default_rng(seed)
    return (rng.choice([-1, 1], count) * rng.random(count) * 10 ** rng.uniform(-6, 6, count)).tolist()


def pairs(count, seed=2):
    return [two_sum(x, y * 2**-55) for x, y in zip(numbers(count, seed), numbers(count, seed + 1), strict=True)]


def exact(pair):
    return Fraction(pair[0]) + Fraction(pair[1])


def test_sums_and_products_lose_nothing():
    for x, y in zip(numbers(2000), numbers(2000, 5), strict=True):
        assert exact(two_sum(x, y)) == Fraction(x) + Fraction(y)
        assert exact(two_product(x, y)) == Fraction(x) * Fraction(y)
        assert two_sum(x, y)[0] == x + y
        assert two_product(x, y)[0] == x * y


def test_sums_products_and_roots_of_pairs():
    for x, y in zip(pairs(2000), pairs(2000, 7), strict=True):
        assert abs(exact(add(x, y)) - exact(x) - exact(y)) <= BOUND * max(abs(exact(x)), abs(exact(y)))
        product = exact(x) * exact(y)
        assert abs(exact(multiply(x, y)) - product) <= BOUND * abs(product)
        square = multiply(x, x)
        with mpmath.workdps(60):
            expected = mpmath.sqrt(mpmath.mpf(square[0]) + mpmath.mpf(square[1]))
            found = root(square)
            assert abs(mpmath.mpf(found[0]) + mpmath.mpf(found[1]) - expected) <= 2.0**-100 * expected
    assert root((0.0, 0.0)) == (0.0, 0.0)


def test_lengths_along_and_across_of_nearly_parallel_vectors():
    rng = np.random.default_rng(3)
    for _ in range(500):
        axis = rng.normal(size=3)
        d = axis * 10 ** rng.uniform(-3, 3) + rng.normal(size=3) * 10 ** rng.uniform(-12, 0)
        with mpmath.workdps(60):
            a, b = ([mpmath.mpf(float(c)) for c in vector] for vector in (d, axis))
            along = sum(p * q for p, q in zip(a, b, strict=True))
            cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
            across = mpmath.sqrt(sum(c * c for c in cross))
            for function, expected in ((length_along, along), (length_across, across)):
                high, low = function(tuple(map(float, d)), tuple(map(float, axis)))
                limit = 2.0**-100 * np.linalg.norm(d) * np.linalg.norm(axis)
                assert abs(mpmath.mpf(high) + mpmath.mpf(low) - expected) <= limit


@pytest.mark.parametrize("angle", [0.0, 1e-7, 1e-3, 0.5, 1.0, 1.5707963])
def test_digits_of_sines_and_cosines(angle):
    with mpmath.workdps(80):
        for digits, expected in zip(sine_cosine_digits(angle), (mpmath.sin(angle), mpmath.cos(angle)), strict=True):
            assert abs(mpmath.mpf(str(digits)) - expected) <= DIGITS
            high, low = twofold(digits)
            assert abs(mpmath.mpf(high) + mpmath.mpf(low) - expected) <= 2.0**-104 * abs(expected)
