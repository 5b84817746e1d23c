"""The list of subsplats: it tiles the screen, is refined where it must be, and is the published one."""

from types import SimpleNamespace

import numpy as np
import pytest

from refgi import Frame, load_scene
from refgi.error_target.grid import level_picture, level_shape, top_level
from refgi.jit import threads
from refgi.literal import multires as literal
from refgi.settings import of
from refgi.splat.multires.criteria import depth_ranges, discontinuities
from refgi.splat.multires.refine import refine
from refgi.splat.multires.settings import Criteria, MultiresSettings
from tests.splat.multires.choices import FakeBuffer, ids, only

RULES = ("off", "corner", "literal", "full8")
DISCS = 12
CURVED = 0.15  # a disc's edge is no straight line within the coarsest cells
NEAR = 0.1  # how far counts of other discs, drawn by another hand, may be off those of E-AMS-10


def flat(depth, covered=None):
    """Return a picture of surfaces that face the camera."""
    covered = np.ones(depth.shape, bool) if covered is None else covered
    normal = np.zeros((3, *depth.shape), np.float32)
    normal[2] = covered
    return FakeBuffer(np.where(covered, depth, np.inf).astype(np.float32), normal, covered)


def discs(size, seed=3):
    """Return discs at different depths in front of a wall."""
    rng = np.random.default_rng(seed)
    y, x = (np.mgrid[:size, :size] + 0.5) / size
    depth = np.full((size, size), 20.0)
    for k in range(DISCS):
        centre, radius = rng.uniform(0.1, 0.9, 2), rng.uniform(0.04, 0.12)
        depth[(x - centre[0]) ** 2 + (y - centre[1]) ** 2 < radius**2] = 2 + k
    return flat(depth)


def busy(shape, seed=5, share=0.8):
    """Return random patches of depth with holes, quiet on the left."""
    rng = np.random.default_rng(seed)
    depth = np.kron(rng.choice([1.0, 1.0, 1.0, 1.3], (-(-shape[0] // 3), -(-shape[1] // 3))), np.ones((3, 3)))
    depth[:, : shape[1] // 3] = 1
    covered = rng.random(shape) < share
    covered[: shape[0] // 2, : shape[1] // 2] = True
    return flat(depth[: shape[0], : shape[1]], covered)


def listed(subsplats):
    return list(zip(*(part.tolist() for part in subsplats[:3]), strict=True))


def times_covered(cells, shape):
    """Return how many subsplats cover each pixel."""
    times = np.zeros(shape, int)
    for level, i, j in cells:
        times[i << level : (i + 1) << level, j << level : (j + 1) << level] += 1
    return times


def by_levels(need, buffer, rule):
    """Return subsplats of each level by itself, as the demo: cells not refined where the cell around them is."""
    states = [np.where(buffer.covered, literal.KEPT, literal.EMPTY), *literal.states(need[1:], ids(buffer), rule)]
    return [(level, i, j) for level, cells in enumerate(states) for i, j in np.argwhere(cells == literal.KEPT).tolist()
            if level == len(states) - 1 or states[level + 1][i // 2, j // 2] == literal.REFINED]


def refined(buffer, top=None, **settings):
    chosen = of(MultiresSettings, **settings).subsplats
    top = top_level(*buffer.covered.shape, chosen.coarsest) if top is None else top
    discontinuous = discontinuities(buffer, chosen.criteria, top, chosen.finest)
    return refine(discontinuous, buffer.covered, chosen.criteria.diagonal, chosen.criteria.traversal)


@pytest.mark.feature("AMS-06", "AMS-09")
@pytest.mark.parametrize("shape", [(1, 1), (1, 13), (9, 1), (6, 5), (32, 32), (37, 53)])
@pytest.mark.parametrize("rule", RULES)
def test_subsplats_are_the_published_list(shape, rule):
    buffer = busy(shape)
    for finest in (0, 2):
        top = top_level(*shape, 4)
        need = discontinuities(buffer, Criteria(), top, finest)
        subsplats = refine(need, buffer.covered, rule)
        expected = literal.subsplats(ids(buffer), literal.states(need[1:], ids(buffer), rule), finest)
        for one, other in zip(subsplats[:4], expected, strict=True):
            np.testing.assert_array_equal(one, other)
        by_list = refine(need, buffer.covered, rule, "list")
        for one, other in zip((*subsplats[:4], *subsplats.leaf), (*by_list[:4], *by_list.leaf), strict=True):
            np.testing.assert_array_equal(one, other)
            assert one.dtype == other.dtype


@pytest.mark.feature("AMS-06")
@pytest.mark.parametrize("rule", RULES)
def test_subsplats_tile_the_surfaces(rule):
    buffer = busy((37, 53), share=0.3)
    subsplats = refined(buffer, diagonal=rule, coarsest=4)
    times = times_covered(listed(subsplats), buffer.covered.shape)
    assert (times[buffer.covered] == 1).all()
    assert times.max() == 1
    for level, leaf in enumerate(subsplats.leaf):
        assert leaf.shape == level_shape(*buffer.covered.shape, level)
        assert set(map(tuple, np.argwhere(leaf))) == {(i, j) for one, i, j in listed(subsplats) if one == level}
    assert subsplats.counts.sum() == len(subsplats.level)


@pytest.mark.feature("AMS-06")
def test_six_passes_from_16_cells_to_1024_pixels(evidence):
    buffer, counts = discs(1024), []
    for threshold in (0.02, 0.1, 0.5, 2.0, 8.0, 20.0):
        settings = of(MultiresSettings, **only("depth"), depth_threshold=threshold)
        subsplats = refined(buffer, depth_threshold=threshold, **only("depth"))
        counts.append(len(subsplats.level))
        assert subsplats.top == 6
        if threshold == 0.1:
            assert subsplats.leaf[0].any()
            assert subsplats.leaf[6].any()
            need = discontinuities(buffer, settings.subsplats.criteria, 6)
            assert not any((one & leaf).any() for one, leaf in zip(need, subsplats.leaf, strict=True))
            evidence(f"12 discs at 1024 x 1024: {subsplats.counts.tolist()} subsplats of levels 0 to 6, "
                     "none above its threshold but pixels")
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] == 256
    evidence(f"counts over thresholds 0.02 to 20: {counts}")


@pytest.mark.feature("AMS-07")
def test_edges_double_with_every_level_and_noise_quadruples(evidence):
    rng = np.random.default_rng(1)
    levels = np.arange(7)[::-1]
    for name, buffer in (("12 discs", discs(1024)), ("noise", flat(rng.uniform(1, 2, (1024, 1024))))):
        counts = [len(refined(buffer, diagonal="off", finest=finest).level) for finest in levels]
        split, growth = np.diff(counts) / 3, np.divide(counts[1:], counts[:-1])
        if name == "noise":
            assert (growth[:-1] == 4).all()
            assert growth[-1] > 3.9
        else:
            # edges run between pixels: a share 2^-l of them runs between the cells of level l, where no cell has them
            inside = 1 - 2.0 ** -levels[:-1]
            np.testing.assert_allclose(split[1:] / split[:-1], 2 * inside[1:] / inside[:-1], rtol=CURVED)
        evidence(f"{name}: {counts}, growth {', '.join(f'{one:.2f}' for one in growth)}")


@pytest.mark.feature("AMS-09")
def test_a_level_by_itself_gives_the_list_only_where_criteria_are_monotone(evidence):
    buffer = busy((64, 64))
    shares = {}
    for rule in RULES:
        need = discontinuities(buffer, Criteria(), 4)
        alone = by_levels(need, buffer, rule)
        times = times_covered(alone, buffer.covered.shape)
        shares[rule] = (times[buffer.covered] > 1).mean()
        if rule in ("off", "full8"):
            assert sorted(alone) == sorted(listed(refine(need, buffer.covered, rule)))
    assert shares["off"] == shares["full8"] == 0
    assert shares["literal"] > 0
    evidence("share of pixels covered more than once where each level is read by itself: "
             + ", ".join(f"{rule} {share:.1%}" for rule, share in shares.items()))


@pytest.mark.feature("AMS-09")
def test_thresholds_that_rise_with_the_level_break_a_level_by_itself(evidence):
    rng = np.random.default_rng(2)
    buffer, top = flat(1 + rng.random((64, 64)) * np.linspace(0, 0.5, 64)), 4

    mip = depth_ranges(buffer.depth, buffer.covered, top)
    need = tuple(high - low > 0.13 * level * low
                 for level, (low, high) in enumerate(zip(mip.low, mip.high, strict=True)))
    times = times_covered(by_levels(need, buffer, "off"), (64, 64))
    subsplats = refine(need, buffer.covered, "off")
    assert (times_covered(listed(subsplats), (64, 64)) == 1).all()
    by_list = literal.subsplats(ids(buffer), literal.states(need[1:], ids(buffer), "off"), 0)
    assert listed(subsplats) == list(zip(*by_list[:3], strict=True))
    share = (times > 1).mean()
    assert share > 0.5
    evidence(f"threshold 0.13 times the level, noise that grows from left to right: {share:.0%} of the pixels covered "
             "more than once where each level is read by itself, none in the list")


@pytest.mark.feature("AMS-12")
def test_what_the_rules_for_neighbours_cost(evidence):
    buffer = discs(1024)
    counts = {rule: len(refined(buffer, diagonal=rule).level) for rule in RULES}
    factor = {rule: counts[rule] / counts["off"] for rule in RULES}
    # E-AMS-10: factors of another drawing of 12 discs at this size
    for rule, known in (("corner", 1.4), ("literal", 3.4), ("full8", 3.8)):
        assert factor[rule] == pytest.approx(known, rel=NEAR)
    evidence(f"12 discs at 1024 x 1024: off {counts['off']}, " + ", ".join(
        f"{rule} x {factor[rule]:.2f}" for rule in RULES[1:]) + "; paper: + 2 to 3 % of time")


@pytest.mark.feature("AMS-12")
def test_an_edge_between_two_cells_is_found_with_a_rim(evidence):
    depth = np.ones((64, 64))
    depth[32:] = 2
    buffer = flat(depth)
    without, within = refined(buffer, diagonal="off", coarsest=4), refined(buffer, diagonal="off", coarsest=4, rim=1)
    assert without.counts.tolist() == [0, 0, 0, 0, 16]
    beside = np.repeat(np.arange(64)[:, None] // 2 == 15, 64, axis=1) | (np.arange(64)[:, None] // 2 == 16)
    picture = level_picture(within, edges=False)
    assert (picture[beside] == 1).all()
    busy_factor = [len(refined(discs(512), diagonal="off", rim=rim).level) for rim in (0, 1)]
    evidence(f"edge on the boundary of cells: {len(without.level)} subsplats and none split without a rim, "
             f"{len(within.level)} with one, pixels on both sides; 12 discs: x {busy_factor[1] / busy_factor[0]:.2f} "
             "(paper: up to + 40 % of time)")


@pytest.mark.feature("AMS-12")
def test_a_corner_is_refined_across_only_where_nothing_else_tells():
    need = [np.zeros((16 >> level, 16 >> level), bool) for level in range(3)]
    need[2][0, 0] = True
    covered = np.ones((16, 16), bool)

    def split(rule):
        return refine(tuple(need), covered, rule).leaf[2]

    assert np.argwhere(~split("off")).tolist() == [[0, 0]]
    assert np.argwhere(~split("corner")).tolist() == [[0, 0], [1, 1]]
    need[2][0, 1] = True
    assert np.argwhere(~split("corner")).tolist() == [[0, 0], [0, 1], [1, 2]]
    assert np.argwhere(~split("literal")).tolist() == [[0, 0], [0, 1], [1, 0], [1, 1], [1, 2]]
    assert np.argwhere(~split("full8")).tolist() == [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [1, 2]]
    covered[4:8, 8:12] = False  # nothing to see there
    assert np.argwhere(~split("corner")).tolist() == [[0, 0], [0, 1], [1, 2]]
    assert listed(refine(tuple(need), covered, "corner")).count((2, 1, 2)) == 0


def test_background_is_never_lit_and_thin_silhouettes_are():
    nothing = refined(flat(np.ones((33, 20)), np.zeros((33, 20), bool)))
    assert len(nothing.level) == 0
    assert nothing.pixel.dtype == np.int64
    line = np.zeros((100, 100), bool)
    line[np.arange(100), np.arange(100)] = True
    thin = refined(flat(np.ones((100, 100)), line))
    assert thin.counts.tolist() == [0, 0, 0, len(thin.level)]  # a silhouette against nothing is no discontinuity
    assert line.flat[thin.pixel].all()
    slanted = refined(flat(np.add.outer(np.arange(100), np.ones(100)), line))
    assert (times_covered(listed(slanted), line.shape)[line] == 1).all()


def test_the_list_is_the_same_for_any_number_of_threads():
    buffer = busy((203, 131))
    with threads(1):
        alone = refined(buffer)
    for one, other in zip((*alone[:4], *alone.leaf), (*(again := refined(buffer))[:4], *again.leaf), strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.feature("AMS-06")
def test_real_scenes_are_tiled(data_dir, evidence):
    for name in ("teapot", "quake_e1m1"):
        buffer = Frame(load_scene(data_dir / f"{name}.json"), width=150, height=101).gbuffer
        subsplats = refined(buffer)
        assert (times_covered(listed(subsplats), buffer.covered.shape)[buffer.covered] == 1).all()
        evidence(f"{name} at 150 x 101: {len(subsplats.level) / buffer.covered.sum():.1%} of the pixels")


def test_cells_of_a_level_picture_have_an_upper_and_a_left_edge():
    """By hand: one cell of 4 x 4 pixels and four of 2 x 2 beside it, in a list of three levels."""
    leaf = [np.zeros((4, 8), bool), np.array([[0, 0, 1, 1], [0, 0, 1, 1]], bool), np.array([[1, 0]], bool)]
    found = level_picture(SimpleNamespace(shape=(4, 8), leaf=leaf))
    cell = np.full((4, 4), 1 / 3)
    cell[0] *= 0.6
    cell[1:, 0] *= 0.6
    np.testing.assert_allclose(found, np.hstack([cell, np.full((4, 4), 2 / 3)]), rtol=1e-6)
