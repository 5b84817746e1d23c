"""Literal series of convolution shadow maps: printed numbers, mixtures of two depths, ramps in closed form."""

import math

import numpy as np
import pytest

from refgi.literal.val_maps import series_depth
from refgi.literal.val_series import (
    above_half,
    csm,
    csm_penumbra,
    first_lit,
    plateau,
    series,
    series_distance,
    shade,
    weights,
)

PRINTED = 5.1e-5  # half of the last digit of the crossings, and rounding
DIGITS = 5e-4  # half of the last digit of plateaus and depths
SHADES = 5e-3  # of shares of light
ONE = np.zeros((1, 3)), np.eye(3)[None]


def waves(t, terms):
    """Return sin(c_k t), cos(c_k t), those times t, and t of a depth."""
    c = (2 * np.arange(1, terms + 1) - 1) * math.pi
    return np.concatenate([np.sin(c * t), np.cos(c * t), t * np.sin(c * t), t * np.cos(c * t), [t]])


def mixture(parts, terms):
    """Return means (1, C, 1, 1) over shares of depths."""
    return sum(share * waves(t, terms) for share, t in parts)[None, :, None, None]


def test_the_bias_is_where_the_series_is_first_one():
    """E-VAL-03: b* of 4, 8 and 16 terms; E-VAL-05: depths end at 1 - 2 b*."""
    for terms, known in ((4, 0.0763), (8, 0.0383), (16, 0.0192)):
        weight, bias, end = series(terms)
        assert bias == pytest.approx([known, known], abs=PRINTED)
        assert end[0] == pytest.approx(1 - 2 * bias[0])
        assert above_half(bias[0], weight) == pytest.approx(0.5)
    assert series(4)[2][0] == pytest.approx(0.847, abs=DIGITS)
    assert series(4, fixed=0.2)[1].tolist() == [0.2, 0.2]
    assert series(4, rescale="scale2")[1][1] == 0


def test_the_series_is_a_step_of_slope_2_m():
    for terms in (1, 4, 64):
        weight, h = weights(terms, 0.0), 1e-6
        assert (above_half(h, weight) - above_half(-h, weight)) / (2 * h) == pytest.approx(2 * terms)
        assert above_half(1.0, weight) == pytest.approx(0, abs=1e-12)  # E-VAL-05: 1/2 again
    assert above_half(np.linspace(0, 1, 4001), weights(4, 0.0)).max() == pytest.approx(0.592, abs=DIGITS)


def test_damped_series_stay_below_one():
    for attenuation, low, high in ((1.0, 0.965, 0.993), (2.0, 0.941, 0.966)):
        weight = weights(4, attenuation)
        value = 0.5 + above_half(np.linspace(0.2, 0.5, 20001), weight)
        assert (value.min(), value.max()) == pytest.approx((low, high), abs=DIGITS)
        assert value.min() < 0.5 + plateau(weight) < value.max()
        lifted, first = series(4, attenuation, "plateau")[0], first_lit(weight)
        assert above_half(np.linspace(first, 1 - first, 2001), lifted).mean() == pytest.approx(0.5, abs=DIGITS)


def test_the_mean_of_products_is_the_mean_of_the_step():
    depths, weight = np.random.default_rng(1).uniform(0, 0.8, 30), weights(4, 0.0)
    means = mixture([(1 / 30, z) for z in depths], 4)
    for t in (0.1, 0.4, 0.8):
        found = shade(means[:, :8], np.full((1, 1, 1), t), 0.07, weight)[0, 0, 0]
        assert found == pytest.approx(above_half(depths - (t - 0.07), weight).mean())


@pytest.mark.parametrize(("bias", "known"), [(0.0, 0.625), (0.075, 0.318), (0.0763, 0.300)])
def test_a_bias_keeps_the_receiver_out_of_the_mean_blocker(bias, known):
    """E-VAL-04: a tenth of the region at 0.3, the rest the receiver's own plane at 0.7, four terms."""
    bias = series(4)[1][0] if bias == 0.0763 else bias
    x, unit = np.array([0.0, 0, 0.7]).reshape(3, 1, 1), np.ones(1)
    shaded, z_avg, _, t = csm_penumbra(
        x, *ONE, unit, np.array([0.1]), 0 * unit, unit, unit, weights(4, 0.0), np.array([bias, bias]),
        np.ones((1, 1, 1), bool), mixture([(0.1, 0.3), (0.9, 0.7)], 4), logarithmic=False)
    assert shaded.all()
    assert t[0, 0, 0] == pytest.approx(0.7)
    assert z_avg[0, 0, 0] == pytest.approx(known, abs=2 * DIGITS)


def test_depths_are_octaves_or_metres_and_come_back():
    d, origin, slope = np.array([0.5, 1.0, 3.0, 50.0]).reshape(1, 2, 2), np.array([0.5]), np.array([0.2])
    t = series_depth(d, origin, slope, np.array([0.8]), True)
    np.testing.assert_allclose(t.ravel(), [0, 0.2, 0.2 * math.log2(6), 0.8])
    np.testing.assert_allclose(series_distance(t, origin, slope, True).ravel(), [0.5, 1, 3, 8])
    t = series_depth(d, origin, slope, np.array([0.8]), False)
    np.testing.assert_allclose(t.ravel(), [0, 0.1, 0.5, 0.8])
    np.testing.assert_allclose(series_distance(t, origin, slope, False).ravel(), [0.5, 1, 3, 4.5])


def test_contacts_leak_light():
    """E-VAL-03: a blocker at a gap of b* gives 1/2, of 2 b* none; the doubled series 0.84, 0.27 and 0."""
    weight, bias, _ = series(4)
    shaded, at = np.array([[[True]], [[False]]]), np.full((2, 1, 1), 0.6)

    def seen(gap, b, gain=1.0):
        means = np.repeat(mixture([(1.0, 0.6 - gap)], 4)[:, :8], 2, axis=0)
        v = csm(shaded, at, means, weight, np.array([0, b]), gain, np.full((2, 1, 1), 0.25))
        assert v[1] == 0.25  # a hard shadow's
        return v[0, 0, 0]

    assert seen(bias[1], bias[1]) == pytest.approx(0.5)
    assert seen(2 * bias[1], bias[1]) == pytest.approx(0, abs=1e-12)
    for gap, known in ((0.0, 1.0), (0.01, 0.84), (0.05, 0.27), (0.1, 0.0)):
        assert seen(gap, 0.0, 2.0) == pytest.approx(known, abs=SHADES)
