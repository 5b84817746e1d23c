"""Means over discs and boxes against the literal text, and the three filters against each other (VAL-16, VAL-17)."""

import numpy as np
import pytest

from refgi.cluster.filters.mip_build import build_mips
from refgi.cluster.filters.prefilter import build_filters
from refgi.cluster.filters.pyramid import Mip, mips
from refgi.cluster.settings import Csm
from refgi.literal import val_filters, val_series
from refgi.literal.val_maps import map_depths
from refgi.literal.val_series import shade, weights
from refgi.rsm.raster.paraboloid import paraboloid_depth_maps
from refgi.scene import load_scene
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
            error = np.abs(reads.sat_means(discs, reads.texels(depth, 4)[0]) - boxes).max()
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


@pytest.mark.parametrize("kind", ["mip", "brute"])
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


@pytest.mark.parametrize("kind", ["mip", "brute"])
def test_discs_without_end_or_number_read_within_the_map(kind):
    depth, none = reads.random_map(16, np.float32), np.zeros(4, np.float32)
    bad = np.array([np.nan, np.inf, -np.inf, 1e30], np.float32)
    filters = getattr(reads, kind)(depth, 4)
    for discs in ((bad, none, none + 0.1), (none, bad, none + 0.1), (none, none, np.abs(bad))):
        means = reads.means(filters, discs, 4)
        assert (np.abs(means[np.isfinite(means)]) <= 1).all()
        assert np.isfinite(means[:, 1:]).all() or kind != "mip"


@pytest.mark.feature("VAL-16")
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


SIDE, CENTRES = 256, 4000
# of R^2 / 4: texels are points of the parabola, 1 / w^2 of a level's w, and 4000 places within a texel (0.9 % at most)
TEXELS = 0.03
BETWEEN = 1.27  # most of (1 + 3 f) / 4^f: a level's variance grows by 4, between two levels by a straight line


def spread(prefilter, diameter):
    """Return the variance of a filter along the rows over R^2 / 4, that of a disc of its diameter (texels).

    What it reads of a parabola, less the parabola at its middle, in the mean over where its middle lies in a texel.
    """
    x = np.arange(SIDE) + 0.5
    depth = np.broadcast_to((x - SIDE / 2) ** 2, (SIDE, SIDE)).copy()
    scale = reads.linear(reads.MOST / depth.max())
    filters = build_filters(depth, scale, Csm(terms=1, prefilter=prefilter), box=False)
    middle = np.random.default_rng(1).uniform(-32, 32, (2, CENTRES))
    discs = (*(2 * middle / SIDE), np.full(CENTRES, diameter / SIDE))
    moment = reads.means(filters, discs, 1)[4] * depth.max() / reads.MOST - middle[0] ** 2
    return moment.mean() / (diameter / 4) ** 2


@pytest.mark.feature("VAL-16")
def test_a_read_of_the_mip_map_is_as_wide_as_the_disc(evidence):
    """Texels of side w read between their centres: w^2 / 12 + w^2 / 6 = w^2 / 4, which is the disc's at w = R.

    One level off would make it 4 or 1/4 of that.
    """
    exact = {diameter: spread("mip", diameter) for diameter in (16.0, 32.0, 64.0)}
    between = {diameter: spread("mip", diameter) for diameter in (20.0, 22.6, 28.0, 45.0)}
    disc = spread("brute", 32.0)
    evidence("variance over the disc's: " + ", ".join(f"{v:.3f} at {d:g} texels" for d, v in (exact | between).items())
             + f"; of the disc read texel by texel {disc:.3f}")
    assert list(exact.values()) == pytest.approx([1] * 3, rel=TEXELS)
    assert disc == pytest.approx(1, rel=TEXELS)
    for diameter, found in between.items():
        f = np.log2(diameter) % 1
        assert found == pytest.approx((1 + 3 * f) / 4**f, rel=TEXELS)
        assert 1 < found < BETWEEN


ROUNDED = 1e-12  # sums of 64^2 texels
EDGE = 1 / 16  # of a mip map: an edge where texels of the level meet is off by this part of its height at most
BIAS = 0.0763  # b* of four terms
TERMS = 4


@pytest.mark.feature("VAL-16")
def test_mip_has_steps_where_boxes_and_discs_have_none(evidence):
    """A disc whose middle lies on a straight edge sees half of either side, wherever the edge lies."""
    n, worst = 64, {}
    for edge in range(16, 48):
        depth = np.full((n, n), 1.0)
        depth[:, edge:] = 3.0
        radii = np.array([0.1, 0.25, 0.5])
        discs = np.full(3, 2 * edge / n - 1), np.zeros(3), radii
        for kind, options in (("mip", {}), ("mip", {"shift": -1.0}), ("brute", {"box": True}), ("brute", {})):
            found = reads.means(getattr(reads, kind)(depth, 1, **options), discs, 1)[4] / (reads.MOST / 4)
            name = kind + str(options.get("shift", "")) + "s" * options.get("box", False)
            worst[name] = max(worst.get(name, 0.0), float(np.abs(found - 2).max()) / 2)
    assert worst["brutes"] < ROUNDED
    assert worst["brute"] < ROUNDED
    for name in ("mip", "mip-1.0"):
        assert 0.5 * EDGE < worst[name] <= EDGE + ROUNDED
    evidence(f"disc on a straight edge, off by: mip {worst['mip']:.4f} of the edge, box {worst['brutes']:.0e}, "
             f"disc {worst['brute']:.0e}")


def seen(means, d):
    """V of each disc, cut to [0, 1]."""
    means = means[None, : 2 * TERMS, None].astype(float)
    return np.clip(0.5 + shade(means, d[None, None], 0, weights(TERMS, 0.0))[0, 0], 0, 1)


def maps_of(geometry, count, rng):
    """Depth maps from points of the surface, and the depth of the series per metre."""
    corners = geometry.vertices[geometry.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    face = rng.choice(len(area), count, p=area / area.sum())
    center, normal = corners[face].mean(axis=1), cross[face] / area[face, None]
    depth = paraboloid_depth_maps(geometry, center + 1e-4 * normal, normal, 256, np.float32)
    return depth, (1 - 2 * BIAS) / geometry.diagonal


def receivers(t, count, rng):
    """Discs within the hemisphere, and depths of receivers: half of them on the nearest surface, half behind it."""
    rho, angle = np.sqrt(rng.uniform(0, 0.98, count)), rng.uniform(0, 2 * np.pi, count)
    s, v = (rho * np.cos(angle)).astype(np.float32), (rho * np.sin(angle)).astype(np.float32)
    radius = np.exp(rng.uniform(np.log(0.01), np.log(0.4), count)).astype(np.float32)
    d = t[((v + 1) * 128).astype(int), ((s + 1) * 128).astype(int)].astype(float)
    behind = rng.uniform(size=count) * (rng.uniform(size=count) < 0.5)
    return (s, v, radius), d + behind * (1 - 2 * BIAS - d) - BIAS


KINDS = {"mip": ("mip", {}), "mip, level - 1": ("mip", {"shift": -1.0}), "boxes": ("brute", {"box": True}),
         "mip, level - 1, mirrored": ("mip", {"shift": -1.0, "mirrored": True}),
         "boxes, mirrored": ("brute", {"box": True, "mirrored": True})}


@pytest.mark.feature("VAL-16")
@pytest.mark.parametrize("name", ["cornell_horse", "kitchen"])
def test_error_against_the_disc_on_real_maps(name, data_dir, evidence):
    rng = np.random.default_rng(7)
    depth, per_metre = maps_of(load_scene(data_dir / f"{name}.json").geometry, 6, rng)
    squares = {kind: [] for kind in KINDS}
    for one in depth[np.isfinite(depth).any(axis=(1, 2))]:
        disc = reads.brute(one, TERMS, per_metre)
        discs, d = receivers(disc.depth, 1500, rng)
        truth = seen(reads.means(disc, discs, TERMS), d)
        for kind, (filters, options) in KINDS.items():
            found = seen(reads.means(getattr(reads, filters)(one, TERMS, per_metre, **options), discs, TERMS), d)
            squares[kind].append(np.mean((found - truth) ** 2))
    rms = {kind: float(np.sqrt(np.mean(values))) for kind, values in squares.items()}
    assert rms["boxes"] < rms["mip"]
    assert rms["mip, level - 1"] < 0.75 * rms["mip"]  # a read between texels is twice as wide as they are
    assert rms["mip, level - 1, mirrored"] < 0.7 * rms["mip, level - 1"]  # the rest leaks in over the rim
    assert rms["boxes, mirrored"] < 0.7 * rms["boxes"]
    evidence(f"{name}: RMSE of V against the disc: " + ", ".join(f"{kind} {value:.4f}" for kind, value in rms.items()))


@pytest.mark.feature("VAL-16")
@pytest.mark.parametrize("n", [1, 4, 7, 16, 33])
def test_the_square_beyond_the_disc_mirrors_it(n):
    depth = reads.random_map(n, np.float64)
    scale = np.zeros(1), np.array([reads.MOST / 4]), np.array([reads.MOST])
    expected, plain = (map_depths(depth[None], *scale, False, mirrored)[0] for mirrored in (True, False))
    for kind in ("mip", "brute"):
        assert np.abs(getattr(reads, kind)(depth, 1, mirrored=True).depth - expected).max() < ROUNDED
    squares = ((np.arange(n) + 0.5) * 2 / n - 1) ** 2
    assert ((expected == plain) | (np.add.outer(squares, squares) > 1)).all()
