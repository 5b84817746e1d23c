"""Soft shadows by filtered series: the chain against its literal text, its limits and its failures."""

from typing import NamedTuple

import numpy as np
import pytest

from refgi.cluster.filters.basis import DepthScale
from refgi.cluster.settings import ConstantBias, Csm, ValSettings
from refgi.cluster.visibility.csm import compare_filtered, find_penumbra
from refgi.cluster.visibility.search_region import (
    BIAS,
    DELTA,
    DEPTH,
    EXTENT,
    FRAME,
    GAIN,
    NEAREST,
    ON_SERIES,
    SEARCH_BIAS,
    D,
    FilterSizing,
    Z,
    above_half,
    find_search_regions,
    first_lit,
    frequencies,
    series,
    weights,
)
from refgi.cluster.visibility.shadow import visibility
from refgi.settings import of
from tests.cluster.visibility.plates import (
    lit_by,
    map_of_plates,
    on_plane,
    scratch_arrays,
    square_share,
)
from tests.literal.shadows import at_origin
from tests.literal.shadows import shadow as literal_shadow

ROUNDING = 1e-10  # float64 sums over discs of some hundred texels, in another order
PLATES = [(-0.6, -0.1, -0.3, 0.3, 1.0), (0.1, 0.6, -0.3, 0.3, 1.0)]
FAR = 6.4
AS_WRITTEN = FilterSizing(False, False, False, False, False)
OVERSHOOT = 0.092  # of the series with four terms
RINGS = 1.4  # times the overshoot: what one depth alone cannot make
SAME = 0.01  # of V: a texel of 256 in a disc
METRES = DepthScale(False, 0.0, 1.0, 1.0)  # depths of the series are metres


def rmse(a, b):
    return float(np.sqrt(((a - b) ** 2).mean()))


def shadow(areas, maps, points, normals, **settings):
    """V; on the scene's scale, whose bias is a known length, where the settings name none."""
    scale = {} if "visibility" in settings else {"depth_scale": "scene"}
    return visibility(maps, areas, 0, points, normals, of(ValSettings, **scale | settings))


@pytest.mark.feature("VAL-12", "VAL-13", "VAL-20")
@pytest.mark.parametrize("scale", ["log_map", "map", "scene"])
@pytest.mark.parametrize("terms", [1, 4, 9])
def test_chain_is_its_literal_text(terms, scale):
    depth = map_of_plates(24, PLATES, 3.0)
    points, normals = on_plane(3.0, 2.2, 7)
    for delta in (0.2, 1.0):
        areas, maps = lit_by(depth, delta, FAR)
        for prefilter, bias in (("brute", None), ("brute", 0.2), ("mip", None)):
            how = {"prefilter": prefilter, "terms": terms, "depth_scale": scale, "bias": bias}
            got = shadow(areas, maps, points, normals, **how)
            expected, _ = literal_shadow(of(ValSettings, **how), at_origin(depth, FAR), delta, points, normals)
            assert np.abs(got - expected).max() < ROUNDING


def mixture(terms, *parts):
    """Means over a filter that holds shares of depths."""
    c = frequencies(terms)
    return sum(share * np.concatenate([np.sin(c * z), np.cos(c * z), z * np.sin(c * z), z * np.cos(c * z), [z]])
               for share, z in parts)[:, None]


def mean_depth(bias, d=0.7, parts=((0.1, 0.3), (0.9, 0.7))):
    """z_avg of a search kernel that a blocker covers by a tenth; the receiver's own distance is d."""
    constants, scratch, means, pending, _ = scratch_arrays(1, 4)
    constants[[NEAREST, SEARCH_BIAS]] = 1e-9, bias
    scratch[D], scratch[Z], means[:] = d, d, mixture(4, *parts)
    count = find_penumbra(constants, AS_WRITTEN, METRES, weights(4), means, 1, pending, scratch)
    return float(scratch[DEPTH, 0]), count


@pytest.mark.feature("VAL-13")
def test_mean_depth_of_blockers_before_a_receiver(evidence):
    b = first_lit(weights(4))
    plain, rounded, right = mean_depth(0.0)[0], mean_depth(0.075)[0], mean_depth(b)[0]
    assert plain == pytest.approx(0.625, abs=5e-4)  # the receiver counts as half a blocker
    assert rounded == pytest.approx(0.318, abs=5e-4)  # with b* rounded to 0.3 / M
    assert right == pytest.approx(0.3, abs=1e-12)  # at b* itself the receiver does not count at all
    means = mixture(4, (0.1, 0.3), (0.9, 0.7))[:, 0]
    c, d = frequencies(4), 0.7 - 0.125
    w, cosine, sine = weights(4), np.cos(c * d), np.sin(c * d)
    blocked = 0.5 - w @ (cosine * means[:4] - sine * means[4:8])
    wild = (0.5 * means[16] - w @ (cosine * means[8:12] - sine * means[12:16])) / blocked
    assert wild == pytest.approx(-2.3, abs=0.05)
    assert mean_depth(0.125) == (0.7, 0)  # so little blocked that nothing is
    evidence(f"z_avg {plain:.3f} (b = 0), {rounded:.3f} (b = 0.075), {right:.3f} (b*), {wild:.2f} (0.125, refused); "
             "truth 0.3")


@pytest.mark.feature("VAL-13")
def test_mean_depth_stays_between_the_nearest_and_the_receiver():
    for bias in (0.0, 0.05, 0.0763, 0.2):
        for share in (0.0, 0.03, 0.1, 0.5, 1.0):
            for blocker in (0.05, 0.3, 0.69):
                depth, count = mean_depth(bias, parts=((share, blocker), (1 - share, 0.7)))
                assert 1e-9 <= depth <= 0.7
                assert (count == 1 or depth == 0.7)


@pytest.mark.feature("VAL-18")
@pytest.mark.parametrize("rescale", ["none", "scale2", "plateau"])
def test_comparison_is_the_series(rescale):
    chain = series(Csm(attenuation=1.0, rescale=rescale))
    for blocker in (0.1, 0.45, 0.5, 0.55, 0.7):
        constants, scratch, means, pending, visible = scratch_arrays(1, 4)
        constants[[BIAS, GAIN]] = chain.bias, chain.gain
        scratch[ON_SERIES], means[:] = 0.6, mixture(4, (1.0, blocker))
        compare_filtered(constants, chain.weight, means, 1, pending, visible, scratch)
        value = chain.gain * (0.5 + above_half(blocker - 0.6 + chain.bias, chain.weight))
        assert visible[0] == pytest.approx(np.clip(value, 0, 1), abs=1e-13)


@pytest.mark.feature("VAL-12")
def test_more_terms_tend_to_comparing_every_texel(evidence):
    depth = map_of_plates(48, PLATES)  # no plane: nothing shadows itself
    points, normals = on_plane(3.0, 1.8, 12)
    areas, maps = lit_by(depth, 0.5, FAR)
    every = shadow(areas, maps, points, normals, visibility="pcss", constant_bias=ConstantBias(), cone=False)
    off = [rmse(shadow(areas, maps, points, normals, prefilter="brute", terms=m), every) for m in (1, 2, 4, 8, 16, 64)]
    assert off[0] > off[1] > off[2] > off[3] > off[4] > off[5]
    assert off[5] < 0.03
    evidence("RMSE to PCF for M = 1, 2, 4, 8, 16, 64: " + ", ".join(f"{e:.4f}" for e in off))


@pytest.mark.feature("VAL-20")
def test_light_leaks_at_contacts(evidence):
    """A plate just above the plane: its shadow's middle gets no light at all."""
    seen = {}
    for gap in (0.05, 0.2, 0.5, 1.0):
        plates = [(-1.5, 1.5, -1.5, 1.5, 3.0 - gap)]
        areas, maps = lit_by(map_of_plates(64, plates, 3.0), 0.3, FAR)
        points, normals = on_plane(3.0, 1e-3, 2)
        seen[gap] = [float(shadow(areas, maps, points, normals, **kw)[0])
                     for kw in ({"prefilter": "brute"}, {"prefilter": "brute", "terms": 16}, {"visibility": "pcss"})]
    assert seen[0.05][0] > 0.9
    assert seen[0.2][0] > 0.6
    assert seen[1.0][0] < 0.1
    assert all(values[0] >= values[1] >= values[2] for values in seen.values())
    assert all(values[2] == 0 for values in seen.values())  # PCSS leaks nothing
    evidence("V below a plate (truth 0), M = 4 / 16 / PCSS: " + ", ".join(
        f"{v[0]:.2f} / {v[1]:.2f} / {v[2]:.2f} at {gap} m" for gap, v in seen.items()))


@pytest.mark.feature("VAL-20")
def test_huge_senders_ring(evidence):
    """V across the shadow of a half plane rises from 0 to 1 in truth; a huge sender's swings about that ramp.

    Where the filter is small, all it holds is near one depth, and V is off by the series' overshoot at most. Depth
    tests over the same discs (PCSS) swing by neither.
    """
    x = np.linspace(-6, 6, 121)
    points, normals = np.stack([x, 0 * x, 0 * x + 3.0]), np.tile([[0.0], [0.0], [-1.0]], (1, len(x)))
    depth, found = map_of_plates(256, [(-30.0, 0.0, -30.0, 30.0, 1.0)], 3.0), {}
    for delta in (0.5, 4.0):
        areas, maps = lit_by(depth, delta, 9.0)
        truth = np.clip(0.5 + x / (2 * delta), 0, 1)  # the penumbra is Delta (d - z) / z wide
        for name, settings in (("CSM", {"prefilter": "brute"}), ("PCSS", {"visibility": "pcss"})):
            found[name, delta] = swings(shadow(areas, maps, points, normals, **settings), truth)
    small, huge, steps = found["CSM", 0.5], found["CSM", 4.0], found["PCSS", 4.0]
    evidence("M = 4, Delta 0.5 and 4 m (4 m by PCSS): brightest in full shadow {}, darkest where all is lit {}, V "
             "falls where it should rise by {} in all, least of four swings about the ramp {}".format(*(
                 f"{a:.3f} and {b:.3f} ({c:.3f})" for a, b, c in zip(small, huge, steps, strict=True))))
    assert max(small.brightest, small.darkest) < OVERSHOOT
    assert min(huge.brightest, huge.darkest, huge.least) > RINGS * OVERSHOOT
    assert huge.fall > 2 * small.fall
    assert max(steps) < OVERSHOOT - 0.02


class Swings(NamedTuple):
    """How V along a profile strays from a ramp of 0 to 1."""

    brightest: float  # V where the truth is 0
    darkest: float  # 1 - V where it is 1
    fall: float  # sum of the steps down
    least: float  # magnitude of the fourth largest swing above or below the ramp; 0 without so many


def swings(v, truth):
    """Measure a profile; a swing is what lies between two changes of sign, by more than SAME."""
    off = np.where(np.abs(v - truth) < SAME, 0, v - truth)
    off = off[off != 0]
    runs = np.split(off, np.flatnonzero(np.diff(np.sign(off))) + 1)
    heights = sorted((np.abs(run).max() for run in runs if len(run)), reverse=True)
    return Swings(v[truth == 0].max(), 1 - v[truth == 1].min(), -np.minimum(np.diff(v), 0).sum(),
                  heights[3] if len(heights) > 3 else 0.0)


@pytest.mark.feature("VAL-20")
def test_penumbrae_of_straight_edges_are_curved(evidence):
    """The line V = 0.8 of a half plane's edge, under a large sender: straight in truth."""
    plates = [(-9.0, 9.0, 0.5, 9.0, 1.0)]
    areas, maps = lit_by(map_of_plates(96, plates, 3.0), 1.5, 9.0)
    x, y = np.meshgrid(np.linspace(0, 4, 5), np.linspace(0, 4, 81))
    points = np.stack([x.ravel(), y.ravel(), np.full(x.size, 3.0)])
    normals = np.tile([[0.0], [0.0], [-1.0]], (1, x.size))

    def line(v):
        v = v.reshape(x.shape)
        return np.array([y[np.argmax(v[:, k] < 0.8), k] for k in range(v.shape[1])])

    truth = line(square_share(points, 1.5, plates, 32))
    found = line(shadow(areas, maps, points, normals, prefilter="brute"))
    exact = line(shadow(areas, maps, points, normals, visibility="pcss"))
    assert np.ptp(truth) == 0
    assert np.ptp(found) > 0.3
    evidence(f"the line V = 0.8 along a straight edge moves by {np.ptp(found):.2f} m over 4 m, {np.ptp(exact):.2f} m "
             "by PCSS")


@pytest.mark.feature("VAL-20")
def test_mip_levels_show_as_steps(evidence):
    """The same shadow on a map turned by half a texel of a coarse level: a mip map answers differently."""
    off = {}
    points, normals = on_plane(3.0, 1.5, 15)
    for name in ("mip", "brute"):
        seen = []
        for shift in (0.0, 0.125):  # 8 texels of 128: the grid of coarse levels moves against the plates
            plates = [(a + shift, b + shift, *rest) for a, b, *rest in PLATES]
            areas, maps = lit_by(map_of_plates(128, plates, 3.0, dtype=np.float32), 1.0, FAR)
            moved = points + np.array([[3 * shift], [0.0], [0.0]])
            truth = square_share(moved, 1.0, plates, 16)
            seen.append(shadow(areas, maps, moved, normals, prefilter=name) - truth)
        off[name] = rmse(*seen)
    assert off["mip"] > 1.5 * off["brute"]
    evidence(f"change of the error as the plates move against the map: mip {off['mip']:.4f}, disc {off['brute']:.4f}")


def test_each_receiver_is_on_its_own():
    areas, maps = lit_by(map_of_plates(32, PLATES, 3.0, dtype=np.float32), 0.7, FAR)
    points, normals = on_plane(3.0, 2.0, 23)
    points, normals = points.astype(np.float32), normals.astype(np.float32)
    whole = shadow(areas, maps, points, normals)
    order = np.random.default_rng(1).permutation(points.shape[1])[:300]
    assert np.array_equal(shadow(areas, maps, points[:, order], normals[:, order]), whole[order])
    assert len(shadow(areas, maps, points[:, :0], normals[:, :0])) == 0
    assert shadow(areas, maps, points[:, 7:8], normals[:, 7:8])[0] == whole[7]


@pytest.mark.feature("VAL-09")
def test_a_light_seen_aslant_is_smaller():
    for foreshortened, share in ((False, 1.0), (True, np.sqrt(0.6))):
        constants, scratch, _, pending, visible = scratch_arrays(1, 4)
        constants[[DELTA, NEAREST]] = 0.7, 0.5
        constants[FRAME : FRAME + 9] = np.eye(3).ravel()
        chosen = AS_WRITTEN._replace(foreshortened=foreshortened)
        point, active = np.array([[4.0], [0.0], [3.0]]), pending.copy()
        assert find_search_regions(constants, chosen, point, 1, active, pending, visible, scratch) == 1
        assert scratch[EXTENT, 0] == pytest.approx(0.7 * share, rel=1e-15)
