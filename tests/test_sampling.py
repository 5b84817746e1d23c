"""Point sets: known points, nets, permutations and densities."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from refgi.errors import InputError
from refgi.jit import kernel
from refgi.literal.lights import radical_inverse
from refgi.sampling import (
    cosine_hemisphere,
    grid,
    halton,
    hash_bits,
    hilbert_order,
    reverse_bits,
    scramble,
    sobol_owen,
)


@kernel
def sobol_points(count, dimensions, seed):
    points = np.empty((count, dimensions))
    for i in range(count):
        for d in range(dimensions):
            points[i, d] = sobol_owen(i, d, seed)
    return points


def test_halton_first_points():
    expected = [[0, 0], [1 / 2, 1 / 3], [1 / 4, 2 / 3], [3 / 4, 1 / 9], [1 / 8, 4 / 9]]
    np.testing.assert_allclose(halton(5), expected, atol=1e-16)
    np.testing.assert_array_equal(halton(3, start=2), halton(5)[2:])
    assert halton(0).shape == (0, 2)
    for base in (2, 3, 7, 101):
        np.testing.assert_array_equal(halton(5000, (base,), start=9)[:, 0], radical_inverse(np.arange(9, 5009), base))


def test_halton_shift_stays_in_the_square_and_keeps_distances():
    shifted = halton(1000, (2, 3, 5), shift=(0.3, 0.999999, 1.0))
    assert (shifted >= 0).all()
    assert (shifted < 1).all()
    turn = (shifted - halton(1000, (2, 3, 5))) % 1.0
    np.testing.assert_allclose(np.cos(2 * math.pi * (turn - [0.3, 0.999999, 0.0])), 1, atol=1e-12)


def test_halton_rejects_a_negative_count():
    with pytest.raises(InputError, match="count"):
        halton(-1)


def test_grid_holds_centres():
    points = grid(16)
    assert points.shape == (256, 2)
    assert len(np.unique(np.floor(points * 16), axis=0)) == 256
    np.testing.assert_allclose(points.mean(axis=0), 0.5)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 7), (16, 16), (5, 12), (33, 32)])
def test_hilbert_order_visits_every_pixel_once(height, width):
    order = hilbert_order(height, width)
    assert order.dtype == np.int64
    assert sorted(order) == list(range(height * width))


def test_hilbert_order_moves_to_neighbours():
    row, column = np.divmod(hilbert_order(64, 64), 64)
    assert (np.abs(np.diff(row)) + np.abs(np.diff(column)) == 1).all()


def test_reverse_bits():
    assert [int(reverse_bits(v)) for v in (0, 1, 2, 0x80000000, 0xF0000000)] == [0, 0x80000000, 0x40000000, 1, 15]


def test_scramble_keeps_elementary_intervals():
    for seed in range(5):
        top = np.array([int(scramble(v << 24, seed)) >> 24 for v in range(256)])
        assert len(set(top)) == 256  # a permutation of the upper eight bits ...
        assert all(len(set(top[a : a + 16] >> 4)) == 1 for a in range(0, 256, 16))  # ... nested


@pytest.mark.parametrize("pair", [0, 2])
def test_sobol_pairs_are_nets(pair):
    points = sobol_points(512, pair + 2, 11)[:, pair:]
    for start in (0, 256):
        block = points[start : start + 256]
        for a in range(9):
            cells = np.floor(block * [2**a, 2 ** (8 - a)])
            assert len(np.unique(cells, axis=0)) == 256


def test_sobol_is_uniform_over_seeds():
    means = np.array([sobol_points(1, 4, seed)[0] for seed in range(4000)])
    assert np.abs(means.mean(axis=0) - 0.5).max() < 5 * math.sqrt(1 / 12 / 4000)
    correlation = np.corrcoef(means.T) - np.eye(4)
    assert np.abs(correlation).max() < 5 / math.sqrt(4000)


def test_hash_has_no_bias_in_any_bit():
    bits = np.array([int(hash_bits(v)) for v in range(4000)])
    ones = [(bits >> b & 1).sum() for b in range(32)]
    assert max(abs(n - 2000) for n in ones) < 5 * math.sqrt(4000) / 2


def test_cosine_hemisphere_has_density_cosine_over_pi():
    points = np.random.default_rng(8).random((40000, 2))
    directions = np.array([cosine_hemisphere(u, v) for u, v in points])
    np.testing.assert_allclose((directions**2).sum(axis=1), 1, atol=1e-12)
    rings = np.floor((1 - directions[:, 2] ** 2) * 10).clip(0, 9)  # sin^2 and azimuth are uniform
    wedges = np.floor((np.arctan2(directions[:, 1], directions[:, 0]) / (2 * math.pi) % 1) * 8).clip(0, 7)
    counts = np.bincount((rings * 8 + wedges).astype(int), minlength=80)
    statistic = ((counts - 500) ** 2 / 500).sum()
    assert statistic < chi2.ppf(0.999, 79)
