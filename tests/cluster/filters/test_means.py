"""Means over discs and boxes against the literal text, and the three filters against each other (VAL-16, VAL-17)."""

import numpy as np
import pytest

from refgi.cluster.filters.mip import Mip, build_mips, mips
from refgi.literal import val_filters, val_series
from tests.cluster.filters import reads

EXACT = 1e-13  # sums of some 100 numbers of float64
SUMS = 1e-11  # differences of sums of 33^2 over an area of one texel
SINGLE = 2e-6  # float32: channels (4e-7), places between texels (n 6e-8) and weights
SIZES = [1, 2, 7, 16, 33]


def reference(depth, terms, discs, mean):
    """Read each disc of the exact channels by `mean`."""
    region = np.array(discs, float)[None, :, None]
    return mean(np.ones((1, *region.shape[2:]), bool), region, terms, True, reads.texels(depth, terms))[0, :, 0]


def by_mip(asked, region, terms, weighed, texels, in_bytes=False):
    """Return means by levels of the disc's whole diameter; the literal text reads those of half."""
    levels = [texels, *val_filters.mip_levels(texels, in_bytes)]
    return val_filters.mip_means(asked, region * np.array([1, 1, 2])[:, None, None], terms, weighed, levels)


@pytest.mark.feature("VAL-16")
@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("terms", [1, 4, 5])
def test_mip_is_the_trilinear_mean(n, terms):
    depth, discs = reads.random_map(n, np.float64), reads.random_discs(21, np.float64)
    error = np.abs(reads.means(reads.mip(depth, terms), discs, terms) - reference(depth, terms, discs, by_mip)).max()
    assert error < EXACT
    single = reads.random_map(n, np.float32), reads.random_discs(21, np.float32)
    found = reads.means(reads.mip(single[0], terms), single[1], terms)
    assert np.abs(found - reference(single[0], terms, single[1], by_mip)).max() < SINGLE * terms


@pytest.mark.feature("VAL-16")
def test_boxes_texel_by_texel_equal_summed_areas(evidence):
    worst = {}
    for dtype, tolerance in ((np.float64, SUMS), (np.float32, SINGLE)):
        for n in SIZES:
            depth, discs = reads.random_map(n, dtype), reads.random_discs(30, dtype)
            boxes = reads.means(reads.brute(depth, 4, box=True), discs, 4)
            error = np.abs(reads.means(reads.sat(depth, 4), discs, 4) - boxes).max()
            assert error < tolerance
            assert np.abs(boxes - reference(depth, 4, discs, val_filters.box_means)).max() < tolerance
            worst[dtype] = max(error, worst.get(dtype, 0.0))
    evidence(f"summed areas less box: {worst[np.float64]:.1e} (float64), {worst[np.float32]:.1e} (float32)")


@pytest.mark.feature("VAL-16")
@pytest.mark.parametrize("n", SIZES)
def test_discs_texel_by_texel(n):
    depth, discs = reads.random_map(n, np.float64), reads.random_discs(30, np.float64)
    found = reads.means(reads.brute(depth, 3), discs, 3)
    assert np.abs(found - reference(depth, 3, discs, val_filters.disc_means)).max() < EXACT


@pytest.mark.parametrize("kind", ["mip", "sat", "brute"])
def test_lanes_that_are_not_wanted(kind):
    depth, discs = reads.random_map(16, np.float32), reads.random_discs(150, np.float32)
    filters = getattr(reads, kind)(depth, 4)
    every = reads.means(filters, discs, 4)
    assert np.isfinite(every).all()
    wanted = np.random.default_rng(4).uniform(size=150) < 0.3
    with_nan = [np.where(wanted, values, np.float32(np.nan)) for values in discs]
    some = reads.means(filters, with_nan, 4, wanted=wanted, count=141)
    assert (some[:, :141][:, wanted[:141]] == every[:, :141][:, wanted[:141]]).all()
    assert np.isnan(some[:, 141:]).all()
    assert (reads.means(filters, discs, 4, with_z=False) == every[:8]).all()
    assert np.isnan(reads.means(filters, discs, 4, wanted=np.zeros(150, bool))[:, -1]).all()


@pytest.mark.parametrize("kind", ["mip", "sat", "brute"])
def test_one_depth_everywhere_is_its_own_mean(kind):
    depth, discs = np.full((9, 9), 2.0), reads.random_discs(40, np.float64)
    expected = reads.texels(depth, 4)[0, :, 0, 0]
    found = reads.means(getattr(reads, kind)(depth, 4), discs, 4)
    assert np.abs(found - expected[:, None]).max() < SUMS


@pytest.mark.parametrize("kind", ["mip", "sat", "brute"])
def test_discs_without_end_or_number_read_within_the_map(kind):
    depth, none = reads.random_map(16, np.float32), np.zeros(4, np.float32)
    bad = np.array([np.nan, np.inf, -np.inf, 1e30], np.float32)
    filters = getattr(reads, kind)(depth, 4)
    for discs in ((bad, none, none + 0.1), (none, bad, none + 0.1), (none, none, np.abs(bad))):
        means = reads.means(filters, discs, 4)
        assert (np.abs(means[np.isfinite(means)]) <= 1).all()
        assert np.isfinite(means[:, 1:]).all() or kind != "mip"


def test_several_maps_at_once_are_those_of_each():
    depth = np.stack([reads.random_map(17, np.float32, seed) for seed in range(3)])
    several = mips(3, 17, 4, np.float32)
    build_mips(depth, reads.linear(0)._replace(origin=np.zeros(3), slope=np.full(3, reads.MOST / 4)), several)
    for k in range(3):
        one = reads.mip(depth[k], 4)
        for name in ("depth", "basis", "basis_z", "mean_depth"):
            assert (getattr(several, name)[k] == getattr(one, name)).all()


@pytest.mark.feature("VAL-17")
@pytest.mark.parametrize("n", [1, 7, 16])
def test_every_level_of_a_mip_is_rounded(n, evidence):
    depth, terms = reads.random_map(n, np.float64), 4
    filters = reads.mip(depth, terms, quantised=True)
    discs = reads.random_discs(40, np.float64)
    region, texels = np.array(discs)[None, :, None], reads.texels(depth, terms, in_bytes=True)
    expected = by_mip(np.ones((1, 1, 40), bool), region, terms, True, texels, in_bytes=True)[0, :, 0]
    found = reads.means(filters, discs, terms)
    assert np.abs(found - expected).max() < EXACT
    plain = reads.means(reads.mip(depth, terms), discs, terms)
    weight, off = val_series.weights(terms, 0.0), (found - plain)[None, : 2 * terms, None]
    worst = max(np.abs(val_series.shade(off, np.full((1, 1, 40), d), 0, weight)).max() for d in (0.2, 0.5))
    assert 0 < worst < 0.006
    if n == 16:
        evidence(f"8 bits on every level of a mip map: V off by {worst:.4f} at most")


def test_a_pyramid_has_no_room_for_the_map_itself():
    first = mips(1, 256, 4, np.float32)
    assert isinstance(first, Mip)
    assert first.basis.shape[1] < 256**2 / 2.9
    assert (first.first == [0, 0, 16384, 20480, 21504, 21760, 21824, 21840, 21844]).all()
