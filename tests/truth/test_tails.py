"""The tail index of the truth's values: against closed forms, an exact fit, and scenes whose tails are known."""

import dataclasses
import math

import numpy as np
import pytest

from refgi import jit
from refgi.frame import Frame
from refgi.scene import load_scene
from refgi.truth import TruthResult, TruthSettings, trace_truth
from refgi.truth.result import add_pass, doubt_of_both, no_passes
from refgi.truth.tails import BINS, TRUSTED, count_tails, doubt_of, share_in_doubt, tail_index

SIZE = 48


def exact(values):
    """Return the tail index of PSIS by raw values (Vehtari et al. 2024)."""
    x = np.sort(values)
    count = math.ceil(min(len(x) / 5, 3 * math.sqrt(len(x))))
    return shape(x[-count:] - x[-count - 1])


def shape(excess):
    """Return the shape of a generalised Pareto distribution: Zhang and Stephens 2009, with the prior of PSIS."""
    count = len(excess)
    size = 30 + int(math.sqrt(count))
    theta = 1 / excess[-1] + (1 - np.sqrt(size / (np.arange(size) + 0.5))) / (3 * excess[int(count / 4 + 0.5) - 1])
    k = np.log1p(-np.outer(theta, excess)).mean(axis=1)
    likelihood = count * (np.log(-theta / k) - k - 1)
    weight = np.exp(likelihood - likelihood.max())
    k = np.log1p(-(theta * weight).sum() / weight.sum() * excess).mean()
    return (count * k + 5) / (count + 10)


def counted(values):
    """Return the counts of values that lie above passes of nothing, in one block."""
    tails, scale = np.zeros((1, BINS), np.int32), np.ones(())
    rows, mean = np.broadcast_to(values, (3, len(values))), np.zeros((3, len(values)))
    count_tails(tails, scale, np.zeros(len(values), np.int64), rows, mean, np.full(len(values), 2))
    return tails


INDICES = (0.0, 0.3, 0.5, 0.7, 1.0, 1.5)
ROOT_MEAN_SQUARE = {448: 0.08, 5000: 0.06, 50000: 0.05}  # of bins an eighth of an octave wide, against raw values


@pytest.mark.feature("REF-31")
@pytest.mark.parametrize("known", INDICES)
def test_bins_tell_the_index_of_known_tails(known, evidence):
    """Values of a Pareto distribution of exponent 1 / k have tail index k, those of an exponential one 0."""
    random, said = np.random.default_rng(8), []
    for count, tolerance in ROOT_MEAN_SQUARE.items():
        streams = [random.pareto(1 / known, count) + 1 if known else random.exponential(size=count) for _ in range(12)]
        found = np.array([tail_index(counted(one))[0] for one in streams])
        apart = found - [exact(one) for one in streams]
        assert np.sqrt(np.mean(apart**2)) < tolerance
        said.append(f"{found.mean():.2f} of {count} (exact fit {np.sqrt(np.mean(apart**2)):.2f} away)")
        prior = (5 - 10 * known) / (min(count / 5, 3 * math.sqrt(count)) + 10)  # what the prior of 0.5 in 10 adds
        assert found.mean() == pytest.approx(known + prior, abs=4 * (1 + known) / math.sqrt(12 * count / 50) + 0.05)
    evidence(f"k = {known}: {', '.join(said)}")


def test_the_shape_of_a_uniform_distribution_is_below_nothing():
    assert tail_index(counted(np.random.default_rng(1).random(5000)))[0] < -0.5  # k = -1, but a bin is all of its tail


@pytest.mark.feature("REF-31")
def test_each_value_counts_in_its_bin():
    values = np.array([2.0**-16, 0.999 * 2.0**-16, 0.3, 1.0, 1.124, 1.126, 1.99, 2.0, 16777215.0, 1e30, -3.0, np.inf])
    found = counted(values)[0]
    expected = np.zeros(BINS, int)
    edges = np.array([2.0**octave * (1 + part / 8) for octave in range(-16, 24) for part in range(8)])
    for value in values[:-1]:
        expected[np.count_nonzero(edges <= value)] += 1  # none below: the first bin
    assert np.array_equal(found, expected)
    assert found[0] == 2
    assert found[1] == 1
    assert found[-1] == 2


@pytest.mark.feature("REF-31")
def test_counts_are_of_deviations_over_the_first_light_block_by_block():
    moments, block = no_passes(5, 2), np.array([1, 0, 1])
    for values in ([6, 0, 0], [np.nan, 0, 3], [3, 9, 0], [12, 9, 6]):
        add_pass(moments, np.broadcast_to(np.append(values, [0, 0]), (3, 5)), block)
    assert moments.scale == 6  # median of the lit values of the first pass with light
    found = [{place: int(row[place]) for place in np.flatnonzero(row)} for row in moments.tails]
    one = 16 * 8 + 1  # bin of 1
    assert found[0] == {0: 1, one + 4: 1, one: 1}  # of the unit: 0, 1.5 (9 above 0) and 1 (9 above 3)
    # 0.5 (3 from 6, its second) and 1.25 (12 above 4.5); 0.5 (3 from 0), less, and 0.83 (6 above 1)
    assert found[1] == {0: 1, one - 8: 2, one + 2: 1, one - 8 + 5: 1}


@pytest.mark.feature("REF-31")
@pytest.mark.parametrize("alpha", [0.6, 1.4, 4.0])
def test_the_fit_is_that_of_as_many_values_in_the_middle_of_their_bins(alpha):
    tails = counted(np.random.default_rng(11).pareto(alpha, 900) + 1)
    edges = np.array([2.0**octave * (1 + part / 8) for octave in range(-16, 24) for part in range(8)] + [2.0**24])
    above = np.cumsum(tails[0, ::-1])[::-1]
    first = np.flatnonzero(above >= 3 * math.sqrt(900))[-1]
    middles = 0.5 * (edges[first - 1 : -1] + edges[first:]) - edges[first - 1]
    assert tail_index(tails)[0] == pytest.approx(shape(np.repeat(middles, tails[0, first:])), abs=1e-9)


@pytest.mark.feature("REF-31")
@pytest.mark.parametrize("burst", [0, 1, 5])
def test_of_two_passes_either_may_hold_the_burst(burst):
    values = np.random.default_rng(3).normal(10, 0.1, (8, 3, 320))
    values[burst, :, :40] += 1000 * np.random.default_rng(4).pareto(0.7, 40)
    moments = no_passes(320, 1)
    for one in values:
        add_pass(moments, one, np.zeros(320, np.int64))
    assert tail_index(moments.tails)[0] > TRUSTED
    plain = no_passes(320, 1)
    for one in np.delete(values, burst, axis=0):
        add_pass(plain, one, np.zeros(320, np.int64))
    assert tail_index(plain.tails)[0] < 0.3


def test_too_few_values_are_not_known():
    values = np.random.default_rng(2).pareto(1.0, 30)
    assert math.isnan(tail_index(counted(values[:24]))[0])
    assert not math.isnan(tail_index(counted(values[:25]))[0])
    assert math.isnan(tail_index(counted(np.append(np.ones(4), np.zeros(96))))[0])  # fewer than a tail differ at all
    assert math.isnan(tail_index(np.zeros((1, BINS), np.int32))[0])


def test_rows_are_fitted_apart():
    random = np.random.default_rng(5)
    rows = np.concatenate([counted(random.pareto(alpha, 700)) for alpha in (0.8, 3.0, 1.4, 9.0)])
    together = tail_index(rows)
    assert together.tolist() == [tail_index(row[None])[0] for row in rows]
    assert together[0] > together[2] > together[1] > together[3]
    with jit.threads(1):
        assert tail_index(rows).tolist() == together.tolist()


@pytest.fixture(scope="module")
def box():
    return Frame(load_scene("cornell_box"), width=SIZE, height=SIZE)


@pytest.mark.feature("REF-31")
def test_a_diffuse_box_is_trusted_after_any_number_of_passes(box, tmp_path, evidence):
    """Corners, edges of light and bright and dark walls are no tail; and checkpoints hold what it takes to go on."""
    said = []
    for passes in (2, 3, 4, 8, 16, 32, 64):
        found = trace_truth(box, TruthSettings(samples=24 * passes, checkpoint=tmp_path / "c"))
        known = found.block_tail_index[found.block_pixels > 0]
        heavy = float((known > TRUSTED).mean())
        said.append(f"{passes}: {found.tail_index:.2f}, blocks {heavy:.0%}")
        assert found.passes == passes
        assert found.tail_index < 0.4
        assert heavy <= 0.05
        assert found.blocks_in_doubt <= 0.05
        assert found.is_trusted
        assert found.doubt == ""
    straight = trace_truth(box, TruthSettings(samples=24 * 64))
    assert np.array_equal(found.block_tail_index, straight.block_tail_index, equal_nan=True)
    assert found.tail_index == straight.tail_index
    evidence(f"Cornell box, tail index of the picture by passes: {'; '.join(said)}")


@pytest.mark.feature("REF-31")
def test_corners_by_the_light_side_alone_are_not_trusted(evidence):
    """Near an edge its terms grow as 1 / r^2: the variance has no bound, and the spread of passes does not show it."""
    frame = Frame(load_scene("cornell_box"), width=64, height=64)
    light = TruthSettings(estimator="light", samples=16 * 8)
    runs = [trace_truth(frame, dataclasses.replace(light, seed=seed)) for seed in range(3)]
    both = trace_truth(frame, TruthSettings())
    alone = ", ".join(f"{one.tail_index:.2f}" for one in runs)
    evidence(f"light side alone: k = {alone}; combined {both.tail_index:.2f}")
    assert all(one.tail_index > TRUSTED for one in runs)
    assert all(one.is_trusted is False for one in runs)
    assert "the error is not to be trusted" in runs[0].error_statement
    assert f"tail index k = {runs[0].tail_index:.2f} > 0.7" in runs[0].error_statement
    assert both.is_trusted
    assert f"tail index k = {both.tail_index:.2f} (trusted up to 0.7)" in both.error_statement


@pytest.mark.feature("REF-31")
@pytest.mark.parametrize("passes", [2, 4, 8, 16])
def test_lobes_met_by_chance_are_not_trusted(passes, evidence):
    """Lobes of exponent 900 that cosine-distributed rays seldom meet: most blocks hold a burst or wait for one."""
    box = load_scene("cornell_box")
    glossy = [dataclasses.replace(one, diffuse=tuple(0.4 * c for c in one.diffuse), specular=(0.5,) * 3, exponent=900.0)
              for one in box.materials]
    frame = Frame(dataclasses.replace(box, materials=tuple(glossy)), width=64, height=64)
    found = trace_truth(frame, TruthSettings(estimator="hemisphere", samples=16 * passes))
    evidence(f"hemisphere, P = 900, {passes} passes: k = {found.tail_index:.2f}, {found.blocks_in_doubt:.0%} in doubt")
    assert found.blocks_in_doubt > 0.4
    assert found.is_trusted is False


@pytest.mark.feature("REF-31")
def test_an_untrusted_error_is_never_met():
    frame = Frame(load_scene("cornell_box"), width=64, height=64)
    light = TruthSettings(estimator="light", samples=16 * 6, target_error=0.5)
    assert trace_truth(frame, light).passes == 6
    assert trace_truth(frame, dataclasses.replace(light, estimator="combined", samples=24 * 6)).passes == 2


def result(index, blocks, mean=1.0):
    """Return a result of one row of blocks with given indices."""
    row, ones = np.ones((1, len(blocks))), np.ones((3, 8, 8))
    return TruthResult(ones, ones, np.full((8, 8), 24), np.full(3, 2.0), np.ones(3), 8, np.stack([mean * row] * 3),
                       np.stack([row] * 3), 64 * row.astype(int), 0, index, np.array([blocks]))


def test_what_is_said():
    uneven = result(0.3, [0.9, 0.1])._replace(block_pixels=np.array([[4, 64]]))
    assert uneven.blocks_in_doubt == pytest.approx(4 / 68)
    fine = result(0.31, [0.1, 0.8, 0.2, 0.3, math.nan])
    assert fine.blocks_in_doubt == pytest.approx(0.2)
    assert (fine.is_trusted, fine.doubt) == (True, "")
    assert fine.error_statement.endswith("; tail index k = 0.31 (trusted up to 0.7)")
    assert {key: fine.errors[key] for key in ("tail_index", "trusted")} == {"tail_index": 0.31, "trusted": True}
    heavy = result(0.92, [0.1] * 5)
    assert (heavy.is_trusted, heavy.errors["trusted"]) == (False, False)
    assert "not to be trusted: the largest contributions have tail index k = 0.92 > 0.7; more samples" in heavy.doubt
    assert heavy.error_statement.endswith(heavy.doubt)
    parts = result(0.3, [0.9, 0.8, 0.2, 0.3, 0.1])
    assert parts.is_trusted is False
    assert "40% of the light lies in blocks" in parts.doubt
    unknown = result(math.nan, [math.nan] * 5)
    assert (unknown.is_trusted, unknown.errors["tail_index"]) == (None, None)
    assert unknown.error_statement.endswith("; tail index not known, of too few values (trusted up to 0.7)")
    assert doubt_of(0.7, 0.2) == ""
    assert share_in_doubt(np.array([0.9]), np.zeros(1)) == 0
    assert doubt_of_both(fine, None) == doubt_of_both(fine, unknown) == ""
    assert doubt_of_both(fine, heavy) == f"lobes of receivers: {heavy.doubt}"
    assert doubt_of_both(heavy, fine) == heavy.doubt
