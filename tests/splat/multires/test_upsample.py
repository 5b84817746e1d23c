"""Upsampling of subsplats: the literal text, constants, bilinear interpolation, what bleeds and what rings."""

import numpy as np
import pytest

from refgi.error_target.grid import level_shape, top_level
from refgi.errors import InputError
from refgi.jit import threads
from refgi.literal import multires_upsample as literal
from refgi.splat.multires.refine import refine
from refgi.splat.multires.upsample import upsample

ROUNDING = 1e-15  # values up to 1: up to five passes, each the mean of 9, or the sum of as many levels
ONE_PASS = 1e-15  # of values up to 1: the bound asked for of one doubling in float64
TABLE_DIGIT = 5e-4  # half of the last digit of the published table
FILTERS = [("tent", {"filter_all": a, "corner_rule": b}) for a in (False, True) for b in (False, True)]
FILTERS += [("demo", {"filter_all": a}) for a in (False, True)]
MODES = [*FILTERS, ("nearest", {}), ("naive_bilinear", {})]


def leaves(need, covered, diagonal="off"):
    return refine(need, covered, diagonal)


def ragged(height, width, share, finest=0, seed=4):
    """Random surfaces and leaves of all levels from `finest` on; 3 cells along the longer side are the coarsest."""
    rng = np.random.default_rng(seed)
    covered = rng.random((height, width)) < share
    shapes = [level_shape(height, width, level) for level in range(top_level(height, width, 3) + 1)]
    need = tuple((rng.random(shape) < 0.7) & (level > finest) for level, shape in enumerate(shapes))
    return leaves(need, covered), covered


def uniform(height, width, level):
    """Leaves of one level only."""
    covered = np.ones((height, width), bool)
    shapes = [level_shape(height, width, k) for k in range(level + 1)]
    return leaves(tuple(np.zeros(shape, bool) for shape in shapes), covered), covered


def discontinuities(image, top, rim=0):
    """Which cells of levels 0 to `top` hold different values, the pixels around them counted in if `rim` is 1."""
    low, high = image, image
    if rim:
        framed = np.pad(image, 1, mode="edge")
        windows = np.lib.stride_tricks.sliding_window_view(framed, (3, 3))
        low, high = windows.min((2, 3)), windows.max((2, 3))
    need = [np.zeros(image.shape, bool)]
    for _ in range(top):
        low, high = (pick(part.reshape(len(part) // 2, 2, -1, 2), (1, 3))
                     for pick, part in ((np.min, low), (np.max, high)))  # fmt: skip
        need.append(high > low)
    return tuple(need)


def values_at(image, subsplats):
    """Values of a picture at the subsplats' pixels, in three channels."""
    return np.stack([image.reshape(-1)[subsplats.pixel]] * 3)


def disc(size=512):
    """The step of E-AMS-09: 3 inside, 1 outside."""
    y, x = np.mgrid[0:size, 0:size]
    return np.where((y - 0.5 * size) ** 2 + (x - 0.4 * size) ** 2 < (0.23 * size) ** 2, 3.0, 1.0)


def rmse(got, truth):
    return float(np.sqrt(np.mean((got - truth) ** 2)))


@pytest.mark.parametrize(("size", "share", "finest"), [
    ((1, 1), 1.0, 0), ((1, 7), 0.7, 0), ((9, 1), 1.0, 0), ((21, 34), 0.7, 0), ((37, 19), 1.0, 2), ((16, 16), 0.0, 0),
    ((24, 20), 0.1, 0)])
@pytest.mark.feature("AMS-11")
def test_every_mode_is_the_literal_text(size, share, finest, evidence):
    """Oracle: sizes odd and even, with holes, with nothing, with leaves that stop short of pixels."""
    subsplats, covered = ragged(*size, share, finest)
    values = np.random.default_rng(1).random((3, len(subsplats.level)))
    worst = 0.0
    for mode, options in MODES:
        got = upsample(values, subsplats, covered, mode, **options)
        columns = (one.astype(int) for one in subsplats[:3])
        expected = literal.upsample(np.where(covered, 0, -1), *columns, values, subsplats.top, mode, **options)
        worst = max(worst, float(np.abs(got - expected).max()))
        assert not got[:, ~covered].any()
    assert worst < ROUNDING
    evidence(f"{size[0]} x {size[1]}, {share:.0%} covered: {len(subsplats.level)} leaves, largest error {worst:.1e}")


@pytest.mark.parametrize("real", [np.float32, np.float64])
@pytest.mark.feature("AMS-11")
def test_a_constant_stays_the_same_to_the_bit_and_empty_pixels_stay_empty(real, evidence):
    """Analytic: no weight is lost, nothing enters from or spreads into what is empty, at any level."""
    subsplats, covered = ragged(70, 51, 0.6)
    values = np.stack([np.full(len(subsplats.level), value, real) for value in (0.1, 1 / 3, 1.9999999)])
    for mode, options in MODES[:-1]:
        got = upsample(values, subsplats, covered, mode, **options)
        assert got.dtype == real
        assert np.array_equal(got, values[:, :1, None] * covered)
    evidence(f"{len(subsplats.level)} leaves on {int(covered.sum())} pixels: tent, demo and nearest exact to the bit")


@pytest.mark.parametrize("size", [(64, 64), (33, 47)])
@pytest.mark.feature("AMS-11")
def test_a_doubling_of_a_coarse_picture_is_its_bilinear_interpolation(size, evidence):
    """Analytic: against np.interp along each axis, at even and at odd sizes."""
    subsplats, covered = uniform(*size, 1)
    values = np.random.default_rng(2).random((3, len(subsplats.level)))
    grid = np.zeros((3, *level_shape(*size, 1)))
    grid[:, subsplats.row, subsplats.column] = values
    centres = [(np.arange(length) + 0.5) / 2 - 0.5 for length in size]
    along = np.apply_along_axis(lambda row: np.interp(centres[1], np.arange(grid.shape[2]), row), 2, grid)
    expected = np.apply_along_axis(lambda column: np.interp(centres[0], np.arange(grid.shape[1]), column), 1, along)
    error = np.abs(upsample(values, subsplats, covered) - expected).max()
    plain = np.abs(upsample(values, subsplats, covered, "naive_bilinear") - expected).max()
    assert max(error, plain) < ONE_PASS
    evidence(f"{size[0]} x {size[1]}: tent and bilinear interpolation differ by {error:.1e}")


@pytest.mark.feature("AMS-11")
def test_a_fully_refined_picture_is_kept_to_the_bit(evidence):
    """Property: pixels evaluated one by one are copied; the published filter blurs them."""
    subsplats, covered = uniform(20, 30, 0)
    values = np.random.default_rng(3).random((3, 600))
    whole = values[:, np.argsort(subsplats.pixel)].reshape(3, 20, 30)
    assert np.array_equal(upsample(values, subsplats, covered), whole)
    assert np.array_equal(upsample(values, subsplats, covered, "demo"), whole)
    blurred = upsample(values, subsplats, covered, filter_all=True)
    evidence(f"kept to the bit; filtered as published, noise of 0 to 1 changes by {rmse(blurred, whole):.3f} RMSE")
    assert rmse(blurred, whole) > 0.2


@pytest.mark.feature("AMS-11")
def test_the_table_of_the_step(evidence):
    """Statistical: RMSE over a disc of 3 on 1 (E-AMS-09), leaf counts and every digit of the table."""
    image, found = disc(), {}
    need, covered = discontinuities(image, 5), np.ones(image.shape, bool)
    for name, rule, count, published, options in (
        ("literal", "off", 2017, 0.061, {"filter_all": True, "corner_rule": False}),
        ("corner rule", "off", 2017, 0.054, {"filter_all": True}),
        ("kept", "off", 2017, 0.032, {}),
        ("literal diagonals", "literal", 6427, 0.021, {}),
        ("8 neighbours", "full8", 7273, 0.015, {}),
    ):
        subsplats = leaves(need, covered, rule)
        assert len(subsplats.level) == count
        found[name] = rmse(upsample(values_at(image, subsplats), subsplats, covered, **options)[0], image)
        assert abs(found[name] - published) < TABLE_DIGIT
    evidence("RMSE " + ", ".join(f"{name} {value:.4f}" for name, value in found.items()))


@pytest.mark.feature("AMS-11")
def test_naive_interpolation_rings_and_the_tent_does_not(evidence):
    """Picture: Fig. 7 on a constant and on the disc; overshoot and undershoot beyond the range of the values."""
    image, beyond = disc(256), {}
    covered = np.ones(image.shape, bool)
    subsplats = leaves(discontinuities(image, 4), covered)
    for mode in ("tent", "demo", "nearest", "naive_bilinear"):
        got = upsample(values_at(image, subsplats), subsplats, covered, mode)
        beyond[mode] = float(got.max()) - 3.0, 1.0 - float(got.min())
    one = upsample(np.ones((3, len(subsplats.level))), subsplats, covered, "naive_bilinear")
    evidence("above 3 and below 1: " + ", ".join(f"{mode} {a:.3f} and {b:.3f}" for mode, (a, b) in beyond.items())
             + f"; a constant 1 becomes {one.min():.2f} to {one.max():.2f}")
    assert max(max(pair) for mode, pair in beyond.items() if mode != "naive_bilinear") <= ONE_PASS
    assert min(beyond["naive_bilinear"]) > 0.3
    assert one.min() < 0.8
    assert one.max() > 1.2


@pytest.mark.feature("AMS-12")
def test_energy_across_an_edge_by_the_rules_of_refinement(evidence):
    """Picture: Fig. 15, an edge on the boundary of coarse cells and edges seen across corners."""
    across, counts = {}, {}
    boundary = np.where(np.arange(256)[:, None] < 128, 3.0, 1.0) * np.ones((1, 256))
    covered = np.ones((256, 256), bool)
    for name, image in (("boundary", boundary), ("disc", disc(256))):
        for rim, rule in ((0, "off"), (0, "corner"), (0, "literal"), (0, "full8"), (1, "off"), (1, "corner")):
            subsplats = leaves(discontinuities(image, 4, rim), covered, rule)
            got = upsample(values_at(image, subsplats), subsplats, covered)[0]
            across[name, rim, rule] = float(np.abs(got - image).sum() / image.sum())
            counts[name, rim, rule] = len(subsplats.level)
    for name in ("boundary", "disc"):
        rows = (f"{'rim + ' * key[1]}{key[2]} {across[key]:.3%} at {counts[key]}" for key in across if key[0] == name)
        evidence(f"{name}, share of the energy that is astray at how many leaves: " + ", ".join(rows))
    # no cell sees an edge between cells, and no rule about neighbours helps; pixels around the cell do
    assert across["boundary", 0, "off"] == across["boundary", 0, "full8"] > 0.01
    assert across["boundary", 1, "off"] == 0
    of_disc = [across["disc", 0, rule] for rule in ("off", "corner", "literal", "full8")]
    assert of_disc == sorted(of_disc, reverse=True)
    assert of_disc[1] < 0.7 * of_disc[0]
    assert across["disc", 1, "corner"] < 0.5 * of_disc[1]


def test_the_picture_does_not_depend_on_threads_and_hardly_on_precision():
    """Property: bits for 1 and 2 threads; float32 within rounding of float64."""
    subsplats, covered = ragged(290, 260, 0.8)  # smaller levels are filled by one thread anyway
    values = np.random.default_rng(5).random((3, len(subsplats.level)))
    for mode, options in (MODES[1], *MODES[-3:]):
        pictures = []
        for count in (1, 2):
            with threads(count):
                pictures.append(upsample(values.astype(np.float32), subsplats, covered, mode, **options))
        assert np.array_equal(*pictures)
        exact = upsample(values, subsplats, covered, mode, **options)
        assert np.abs(pictures[0] - exact).max() < 2e-6


def test_what_does_not_belong_together_is_refused():
    subsplats, covered = uniform(8, 8, 1)
    with pytest.raises(InputError, match="mode: expected 'tent'"):
        upsample(np.zeros((3, 16)), subsplats, covered, "cubic")
    with pytest.raises(InputError, match="values"):
        upsample(np.zeros((3, 15)), subsplats, covered)
    with pytest.raises(InputError, match="covered"):
        upsample(np.zeros((3, 16)), subsplats, covered[:4])
