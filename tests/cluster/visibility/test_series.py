"""The depth comparison as a series: its shape, its bias and what becomes of it (VAL-12, VAL-18)."""

import math

import numpy as np
import pytest

from refgi.cluster.filters.basis import depth_scale, series_depths, series_distance
from refgi.cluster.maps import ShadowMaps
from refgi.cluster.settings import ConstantBias, Csm, Pcss
from refgi.cluster.visibility.pcss import blocker_test
from refgi.cluster.visibility.search_region import above_half, first_lit, plateau, scale_of, series, weights
from refgi.literal import val_series as literal

EXACT = 1e-13  # sums of up to 64 sines in another order
PRINTED = 5.1e-5  # half of the last digit of the known crossings, and rounding
DIGITS = 5e-4  # half of the last digit of the known plateaus
LEAST = 0.84  # of the way to the top: the undershoot of two terms, the deepest, is 0.849


@pytest.mark.feature("VAL-12")
@pytest.mark.parametrize("terms", [1, 4, 16, 64])
def test_series_is_the_sum_of_sines(terms):
    differences = np.linspace(-1.2, 1.2, 49)
    for attenuation in (0.0, 1.0):
        expected = literal.above_half(differences, literal.weights(terms, attenuation))
        assert np.abs(above_half(differences, weights(terms, attenuation)) - expected).max() < EXACT


@pytest.mark.feature("VAL-12")
def test_overshoot_of_the_plain_series(evidence):
    overshoot = float(above_half(np.linspace(0, 1, 4001), weights(4)).max()) - 0.5
    assert overshoot == pytest.approx(0.092, abs=DIGITS)  # of four terms
    gibbs = float(above_half(np.linspace(0, 0.02, 4001), weights(64)).max()) - 0.5
    assert gibbs == pytest.approx(0.0895, abs=DIGITS)  # Gibbs: Si(pi)/pi - 1/2 = 0.08949
    evidence(f"overshoot {overshoot:.4f} (M = 4), {gibbs:.4f} (M = 64)")


@pytest.mark.feature("VAL-12")
def test_bias_is_the_first_crossing_of_one(evidence):
    found = {terms: first_lit(weights(terms)) for terms in (4, 8, 16)}
    for terms, known in ((4, 0.0763), (8, 0.0383), (16, 0.0192)):
        assert found[terms] == pytest.approx(known, abs=PRINTED)
        assert found[terms] == pytest.approx(literal.first_lit(literal.weights(terms, 0.0)), abs=1e-12)
        assert series(Csm(terms=terms)).bias == found[terms]
    evidence("b* = " + ", ".join(f"{b:.4f} (M = {m})" for m, b in found.items()))


@pytest.mark.feature("VAL-12")
@pytest.mark.parametrize("terms", [1, 2, 3, 4, 7, 16, 64])
@pytest.mark.parametrize("attenuation", [0.0, 0.5, 1.0, 2.0, 100.0])
@pytest.mark.parametrize("rescale", ["none", "plateau"])
def test_no_difference_of_depths_wraps_around(terms, attenuation, rescale):
    chain = series(Csm(terms=terms, attenuation=attenuation, rescale=rescale))
    assert chain.range == pytest.approx(1 - 2 * chain.first)
    assert 0.17 < chain.range < 1
    lit = np.linspace(chain.first, 1 - chain.first, 101)
    top = float(above_half(lit, chain.weight)[0])
    assert (above_half(lit, chain.weight) > LEAST * top).all()  # farther than b* is lit, as far as the range goes
    assert (above_half(-lit, chain.weight) < -LEAST * top).all()


@pytest.mark.feature("VAL-18")
def test_attenuation_lowers_the_plateau(evidence):
    for attenuation, low, high in ((1.0, 0.965, 0.993), (2.0, 0.941, 0.966)):
        w = weights(4, attenuation)
        values = 0.5 + above_half(np.linspace(0.2, 0.5, 20001), w)
        assert (values.min(), values.max()) == pytest.approx((low, high), abs=DIGITS)
        assert values.min() < 0.5 + plateau(w) < values.max()
        evidence(f"A = {attenuation:.0f}: {values.min():.4f} .. {values.max():.4f}")


@pytest.mark.feature("VAL-18")
def test_plateau_is_stretched_to_one():
    for attenuation in (1.0, 2.0, 5.0):
        chain = series(Csm(attenuation=attenuation, rescale="plateau"))
        lit = above_half(np.linspace(chain.first, 1 - chain.first, 2001), chain.weight)
        assert 0.47 < lit.mean() < 0.51
        assert np.array_equal(chain.weight, weights(4, attenuation) / (2 * plateau(weights(4, attenuation))))
    assert np.array_equal(series(Csm(rescale="plateau")).weight, weights(4))  # nothing to stretch


@pytest.mark.feature("VAL-18")
def test_doubled_series_needs_no_bias(evidence):
    chain = series(Csm(rescale="scale2"))
    assert (chain.bias, chain.gain) == (0.0, 2.0)
    assert chain.search_bias == chain.first
    seen = {gap: float(np.clip(2 * (0.5 + above_half(-gap, chain.weight)), 0, 1)) for gap in (0.0, 0.01, 0.05, 0.1)}
    for gap, known in ((0.0, 1.0), (0.01, 0.84), (0.05, 0.27), (0.1, 0.0)):
        assert seen[gap] == pytest.approx(known, abs=5e-3)
    evidence("clamp(2 f): " + ", ".join(f"{v:.3f} at a gap of {gap}" for gap, v in seen.items()))


@pytest.mark.feature("VAL-18")
def test_bias_of_the_settings_counts():
    chain = series(Csm(bias=0.2))
    assert chain.bias == chain.search_bias == 0.2
    assert chain.range == pytest.approx(1 - chain.first - 0.2)
    assert series(Csm(bias=0.0)).range == series(Csm()).range
    assert math.isclose(series(Csm(bias=0.0)).first, series(Csm()).first)


CLOSE = 1e-14
OVERSHOOT = 0.1  # of the series, 9 % of its height
SINGLE = 1e-6  # a share of a range of four octaves, by float32 logarithms
KINDS = ["log_map", "map", "scene"]
NEAR, FAR, SCENE = 0.25, 4.0, 8.0


def depths(scale, distances, dtype=np.float64):
    out = np.empty(len(distances), dtype)
    series_depths(scale, np.asarray(distances, dtype), out, len(out))
    return out


@pytest.mark.feature("VAL-12")
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, CLOSE), (np.float32, SINGLE)])
def test_depths_of_distances(dtype, tolerance):
    """Analytic, with a far end of 0.8 and so 0.6 for the farthest that the map holds."""
    z = [NEAR, 0.5, 1.0, FAR, 4.5, SCENE, np.inf]
    for kind, expected in (("log_map", [0, 0.15, 0.3, 0.6, 0.6 * math.log(18) / math.log(16), 0.75, 0.8]),
                           ("map", [0, 0.04, 0.12, 0.6, 0.68, 0.8, 0.8]),
                           ("scene", [0.025, 0.05, 0.1, 0.4, 0.45, 0.8, 0.8])):
        assert np.abs(depths(depth_scale(kind, NEAR, FAR, SCENE, 0.8), z, dtype) - expected).max() < tolerance


@pytest.mark.feature("VAL-12")
@pytest.mark.parametrize("kind", KINDS)
def test_distances_of_depths(kind):
    scale, z = depth_scale(kind, NEAR, FAR, SCENE, 0.8), np.geomspace(NEAR, FAR, 31)
    back = [series_distance(scale, t) for t in depths(scale, z)]
    assert np.abs(np.array(back) / z - 1).max() < CLOSE


@pytest.mark.feature("VAL-12")
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("settings", [{}, {"terms": 1}, {"terms": 2}, {"terms": 16}, {"bias": 0.25}, {"bias": 0.0},
                                      {"attenuation": 2.0, "rescale": "plateau"}])
def test_no_comparison_wraps_around(kind, settings, evidence):
    """Differences of biased depths stay within 1 - b* of 0, where the series is past its last crossing at most."""
    chain = series(Csm(**settings))
    z = np.concatenate([np.geomspace(NEAR, FAR, 40), np.geomspace(FAR, 1e6, 20), [np.inf]])
    t = depths(depth_scale(kind, NEAR, FAR, SCENE, chain.range), z)
    assert (np.diff(t) >= 0).all()
    worst = max(np.abs(np.subtract.outer(t, t - bias)).max() for bias in (chain.bias, chain.search_bias))
    evidence(f"{kind}, {settings or 'four terms'}: depths differ by {worst:.3f} at most, bound {1 - chain.first:.3f}")
    assert worst <= 1 - chain.first + CLOSE
    beyond = t[-1] - chain.search_bias - depths(depth_scale(kind, NEAR, FAR, SCENE, chain.range), [FAR])[0]
    if kind != "scene" and chain.range > 2 / 3:
        assert beyond >= chain.first - CLOSE  # the farthest blocker hides what lies far behind it
        assert above_half(-beyond, chain.weight) == pytest.approx(-0.5, abs=OVERSHOOT)


def test_few_terms_leave_the_map_half_of_the_range():
    chain = series(Csm(terms=1))
    assert chain.range < 0.5
    scale = depth_scale("log_map", NEAR, FAR, SCENE, chain.range)
    assert depths(scale, [FAR])[0] == pytest.approx(chain.range / 2, abs=CLOSE)


@pytest.mark.parametrize("kind", KINDS)
def test_maps_of_one_distance_or_of_none_at_the_centre(kind):
    for near, far in ((1.0, 1.0), (0.0, 2.0), (1e-30, 1.0)):
        scale = depth_scale(kind, near, far, SCENE, 0.8)
        t = depths(scale, sorted([0.0, 1e-30, near, far, 1.01 * far, np.inf]))
        assert ((t >= 0) & (t <= 0.8)).all()
        assert (np.diff(t) >= 0).all()
        assert t[-1] == 0.8
    plate = depth_scale("map", 1.0, 1.0, SCENE, 0.8)
    assert depths(plate, [1.0 + 1e-3])[0] < series(Csm()).first  # a thousandth farther is no shadow yet


def two_sided():
    """One map that holds 1 to 2 m ahead and 3 to 12 m behind, of a scene that ends at 20 m."""
    one = np.ones(1)
    return ShadowMaps(np.zeros((1, 2, 2)), np.zeros(1, np.int32), np.zeros((1, 3)), np.eye(3)[None], one, 2 * one,
                      20 * one, np.zeros((1, 2, 2)), 3 * one, 12 * one)


@pytest.mark.feature("VAL-21")
def test_each_hemisphere_has_the_scale_of_its_own_map():
    maps = two_sided()
    for kind in KINDS:
        chain = series(Csm())
        end = chain.range
        assert scale_of(maps, 0, kind, chain) == depth_scale(kind, 1.0, 2.0, 20.0, end)
        assert scale_of(maps, 0, kind, chain, behind=True) == depth_scale(kind, 3.0, 12.0, 20.0, end)


@pytest.mark.feature("VAL-14")
@pytest.mark.parametrize("kind", KINDS)
def test_the_bias_of_pcss_is_one_of_the_same_scale(kind):
    """A receiver at d is compared at the distance whose depth is t(d) - b."""
    scale = scale_of(two_sided(), 0, kind, series(Csm(bias=0.1)))
    test = blocker_test(Pcss(constant_bias=ConstantBias(0.1, kind)), scale)
    for d in (1.3, 1.5, 2.0):
        moved = depths(scale, [test.share * d - test.bias])[0]
        assert moved == pytest.approx(max(depths(scale, [d])[0] - 0.1, 0.0), abs=CLOSE)
    assert blocker_test(Pcss(constant_bias=ConstantBias(0.0, kind)), scale)[2:] == (1.0, 0.0)
