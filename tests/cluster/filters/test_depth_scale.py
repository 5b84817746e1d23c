"""The scale of depths: closed forms, its bound against wrap-around (E-VAL-05), and maps that hold next to nothing."""

import math

import numpy as np
import pytest

from refgi.cluster.filters.basis import depth_scale, series_depths, series_distance
from refgi.cluster.maps import ShadowMaps
from refgi.cluster.settings import ConstantBias, Csm, Pcss
from refgi.cluster.visibility.pcss import blocker_test
from refgi.cluster.visibility.search_region import above_half, scale_of, series

EXACT = 1e-14
OVERSHOOT = 0.1  # of the series, 9 % of its height
SINGLE = 1e-6  # a share of a range of four octaves, by float32 logarithms
KINDS = ["log_map", "map", "scene"]
NEAR, FAR, SCENE = 0.25, 4.0, 8.0


def depths(scale, distances, dtype=np.float64):
    out = np.empty(len(distances), dtype)
    series_depths(scale, np.asarray(distances, dtype), out, len(out))
    return out


@pytest.mark.feature("VAL-12")
@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float64, EXACT), (np.float32, SINGLE)])
def test_depths_of_distances(dtype, tolerance):
    """Analytic, with a far end of 0.8 and so 0.6 for the farthest that the map holds."""
    z = [NEAR, 0.5, 1.0, FAR, 4.5, SCENE, np.inf]
    for kind, expected in (("log_map", [0, 0.15, 0.3, 0.6, 0.6 * math.log(18) / math.log(16), 0.75, 0.8]),
                           ("map", [0, 0.04, 0.12, 0.6, 0.68, 0.8, 0.8]),
                           ("scene", [0.025, 0.05, 0.1, 0.4, 0.45, 0.8, 0.8])):
        assert np.abs(depths(depth_scale(kind, NEAR, FAR, SCENE, 0.8), z, dtype) - expected).max() < tolerance


@pytest.mark.parametrize("kind", KINDS)
def test_distances_of_depths(kind):
    scale, z = depth_scale(kind, NEAR, FAR, SCENE, 0.8), np.geomspace(NEAR, FAR, 31)
    back = [series_distance(scale, t) for t in depths(scale, z)]
    assert np.abs(np.array(back) / z - 1).max() < EXACT


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
    assert worst <= 1 - chain.first + EXACT
    beyond = t[-1] - chain.search_bias - depths(depth_scale(kind, NEAR, FAR, SCENE, chain.range), [FAR])[0]
    if kind != "scene" and chain.range > 2 / 3:
        assert beyond >= chain.first - EXACT  # the farthest blocker hides what lies far behind it
        assert above_half(-beyond, chain.weight) == pytest.approx(-0.5, abs=OVERSHOOT)


def test_few_terms_leave_the_map_half_of_the_range():
    chain = series(Csm(terms=1))
    assert chain.range < 0.5
    scale = depth_scale("log_map", NEAR, FAR, SCENE, chain.range)
    assert depths(scale, [FAR])[0] == pytest.approx(chain.range / 2, abs=EXACT)


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


def test_each_hemisphere_has_the_scale_of_its_own_map():
    maps = two_sided()
    for kind in KINDS:
        chain = series(Csm())
        end = chain.range
        assert scale_of(maps, 0, kind, chain) == depth_scale(kind, 1.0, 2.0, 20.0, end)
        assert scale_of(maps, 0, kind, chain, behind=True) == depth_scale(kind, 3.0, 12.0, 20.0, end)


@pytest.mark.parametrize("kind", KINDS)
def test_the_bias_of_pcss_is_one_of_the_same_scale(kind):
    """A receiver at d is compared at the distance whose depth is t(d) - b."""
    scale = scale_of(two_sided(), 0, kind, series(Csm(bias=0.1)))
    test = blocker_test(Pcss(constant_bias=ConstantBias(0.1, kind)), scale)
    for d in (1.3, 1.5, 2.0):
        moved = depths(scale, [test.share * d - test.bias])[0]
        assert moved == pytest.approx(max(depths(scale, [d])[0] - 0.1, 0.0), abs=EXACT)
    assert blocker_test(Pcss(constant_bias=ConstantBias(0.0, kind)), scale)[2:] == (1.0, 0.0)
