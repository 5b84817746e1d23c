"""What is spared, masked elements and outliers, and arrays that are not judged since too much of them is."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from refgi.errors import RefgiWarning
from refgi.testing import assert_stage_close
from refgi.vectors.bounds import ROUNDING, SAFETY, _bound
from refgi.vectors.check import ALL_WITHIN, OUT
from refgi.vectors.judge import judge
from refgi.vectors.manifest import Tolerance
from refgi.vectors.port import Few
from refgi.vectors.report import github, report, write_junit
from tests.vectors.port import Port

PICTURE, PAIRS, SEARCH, LEVEL = "sssil.upsample1", "pairs.pairs", "cluster.search.pending", "sssil.first_level.position"
T2 = {"": "T2"}


def judged(off, masked=None, *, limit=0.1, tolerance=None, few=None):
    """Return the verdict on 100 elements of 1, some of which are `off`; all but `tolerance` in isolated mode."""
    expected = np.ones(100, np.float32)
    limits = np.where(np.zeros(100, bool) if masked is None else masked, 0.0, limit)
    return judge("a", expected, expected + off, "T1", limits, masked, tolerance, few)


def at(*places, value=1.0):
    return np.where(np.isin(np.arange(100), places), value, 0.0)


@pytest.fixture
def unsure(kit, tmp_path):
    """A port of which one array is not judged in half floats, and how many elements that array spares."""
    port = Port(kit, "pairs-diffuse", tmp_path)
    masked = kit.extra(port.case, port.case.arrays[PAIRS].half.masked)
    port.write(PAIRS, np.where(masked, port.arrays[PAIRS] + 1e6, port.arrays[PAIRS]))
    return port, masked


@pytest.mark.parametrize("case", ["pairs-diffuse", "pairs-glossy"])
def test_chained_half_floats_are_judged_no_more_narrowly_than_isolated_ones(kit, tmp_path, case):
    port = Port(kit, case, tmp_path)
    half, right = port.case.arrays[PAIRS].half, port.arrays[PAIRS].astype(float)
    port.write(PAIRS, (right + 0.9 * half.relative * (np.abs(right) + half.large)).astype(np.float32))
    for chained in (False, True):
        assert {one.verdict for one in port.check(tiers=T2, chained=chained).stages} <= {"within", "not-judged"}


def test_a_chained_bound_holds_the_isolated_one():
    """An element that rounding of its own stage moves by 0.3, of an array that a chain moves by 0.1."""
    tolerance = Tolerance(relative=0.1, large=0.0, outliers=0.0)
    one = judged(at(3, value=0.3), limit=0.3, tolerance=tolerance)
    assert (one.verdict.verdict, one.limit.min()) == ("within", pytest.approx(np.hypot(0.1, 0.3)))
    assert judged(at(3, value=0.4), limit=0.3, tolerance=tolerance).verdict.verdict == "out"


@pytest.mark.parametrize("asked", [{}, {"chained": True}, {"tiers": T2}, {"tiers": {"": "T2B"}}])
def test_masked_elements_are_spared_in_every_mode_and_tier(kit, tmp_path, asked):
    port = Port(kit, "hssil-pole", tmp_path)
    masked = kit.extra(port.case, port.case.arrays[PICTURE].masked)
    port.write(PICTURE, np.where(masked, 100 + port.arrays[PICTURE], port.arrays[PICTURE]))
    (verdict,) = [one.arrays[0] for one in port.check(**asked).stages if one.stage == PICTURE]
    assert 0 < masked.sum() < 0.05 * masked.size
    assert (verdict.verdict, verdict.masked) == ("within", masked.sum())
    assert verdict.said == f"{masked.sum()} of {masked.size} elements spared"
    assert port.check(**asked).not_judged == 0


def test_a_chain_has_masks_of_its_own(kit, tmp_path):
    """Texels of a level whose nearest pixel is a matter of the rounding of all that was before."""
    port = Port(kit, "hssil-pole", tmp_path)
    masked = kit.extra(port.case, port.case.arrays[LEVEL].chained.masked)
    assert 0 < masked.sum() < 0.05 * masked.size
    port.write(LEVEL, np.where(masked, 100 + port.arrays[LEVEL], port.arrays[LEVEL]))
    for chained, verdict in ((True, "within"), (False, "out")):
        (found,) = [one for stage in port.check(chained=chained).stages for one in stage.arrays if one.name == LEVEL]
        assert found.verdict == verdict


def test_an_array_of_which_more_is_spared_than_can_be_judged_is_not_judged(unsure):
    """In half floats nearly 3 in 10 pairs of a light and a receiver are too near to a decision."""
    port, masked = unsure
    assert 0.05 < masked.mean() < 0.5
    right = port.arrays[PAIRS]
    result = port.check(tiers=T2)
    assert (result.verdict, result.exit_code, result.not_judged) == ("not-judged", ALL_WITHIN, 1)
    (verdict,) = [one.arrays[0] for one in result.stages if one.verdict == "not-judged"]
    assert verdict.said == f"{masked.sum()} of {right.size} elements spared: more than can be judged by rounding"
    port.write(PAIRS, np.where(masked, right, right + 1e6))
    assert port.check(tiers=T2).exit_code == OUT
    port.write(PAIRS, np.zeros_like(right))
    assert port.check(tiers=T2).exit_code == OUT


@pytest.mark.parametrize(("more", "verdict"), [(4, "within"), (5, "not-judged")])
def test_masks_and_outliers_of_less_than_5_percent_together_are_spared(more, verdict):
    masked = at(0, 1, 2) > 0
    tolerance = Tolerance(relative=0.1, large=0.0, outliers=0.5)
    for allowed in ({"tolerance": tolerance}, {"few": Few(np.zeros(100), 0.5)}):
        found = judged(at(*range(more)), masked, **allowed).verdict
        assert (found.verdict, found.masked, found.outside) == (verdict, 3, more - 3), allowed
        assert judged(at(*range(3, 60)), masked, **allowed).verdict.verdict == "out", allowed


def test_an_element_that_no_run_moves_has_the_usual_change():
    """Three of four are moved by 1e-6 of themselves, one by a hundredth of that; a 0 stays one."""
    expected = np.array([1.0, 2.0, 4.0, 4.0, 0.0])
    moved = expected * (1 + np.array([1e-6, 1e-6, 1e-6, 1e-8, 0]))
    limit = _bound(expected, [moved], 0.0).limit
    assert limit[:4] == pytest.approx(SAFETY * (1e-6 + ROUNDING) * expected[:4], rel=1e-3)
    assert limit[4] < 1e-37


def test_few_bits_widen_every_bound():
    tolerance = Tolerance(relative=0.1, large=0.0, outliers=0.0)
    for allowed in ({}, {"tolerance": tolerance}):
        off = at(3, value=0.15)
        assert judged(off, **allowed).verdict.verdict == "out"
        assert judged(off, few=Few(np.full(100, 0.1), 0.0), **allowed).verdict.verdict == "within"


def test_the_worst_element_is_none_that_is_masked():
    """A masked element's bound is 0: it would be the worst by any measure."""
    masked = at(7) > 0
    found = judged(at(7) + at(9, value=0.05), masked).verdict
    assert (found.verdict, found.element, found.bound) == ("within", (9,), pytest.approx(0.1))
    assert found.worst == pytest.approx(0.5, rel=1e-5)
    found = judged(at(7, value=np.nan) + at(9, value=0.2), masked).verdict
    assert (found.verdict, found.element, found.outside, found.masked) == ("out", (9,), 1, 1)
    found = judged(at(*range(100)), np.ones(100, bool)).verdict
    assert (found.verdict, found.element, found.worst) == ("not-judged", None, None)


def test_a_reader_of_few_bits_is_not_judged_where_its_decisions_are_many(kit, tmp_path):
    """R11G11B10F moves inputs by 32 roundings of half floats: 32 times as many elements may be decided otherwise."""
    port = Port(kit, "val-pcss", tmp_path)
    masked = kit.extra(port.case, port.case.arrays[SEARCH].half.masked)
    assert masked.mean() > 0.05
    port.write(SEARCH, masked ^ port.arrays[SEARCH])
    for tier, verdict in (("T1", "out"), ("R11G11B10F", "not-judged")):
        stages = port.check(tiers={"rsm.surface.position": tier}).stages
        (found,) = [one for stage in stages for one in stage.arrays if one.name == SEARCH]
        assert found.verdict == verdict, tier


GATHERED, BLURRED = "sssil.gather_samples1", "sssil.blur1"


@pytest.fixture
def doubtful(kit, tmp_path):
    """A port of a chain with an array that is not judged, as all that is off is spared, and a wrong one after it."""
    port = Port(kit, "hssil-pole", tmp_path)
    step = next(one for one in port.case.stages if GATHERED in one.reads and one.writes == (BLURRED,))
    spared = kit.extra(port.case, port.case.arrays[GATHERED].chained.masked)
    port.write(GATHERED, np.where(spared, 100 + port.arrays[GATHERED], port.arrays[GATHERED]))
    port.write(step.writes[0], 2 * port.arrays[step.writes[0]])
    return port


def test_a_stage_that_reads_what_is_not_judged_is_not_blamed(doubtful):
    """Neither it nor what is made from it, but a stage beside; it is where nothing else is wrong."""
    alone = doubtful.check(chained=True)
    assert alone.exit_code == OUT
    stages = {one.stage: one for one in alone.stages}
    assert stages[GATHERED].verdict == "not-judged"
    assert alone.first == ("hssil-pole", BLURRED)
    said = f"made from inputs in doubt: not judged are {GATHERED}"
    assert said in report(alone)
    beside = "sssil.first_level"
    doubtful.write(f"{beside}.area", 2 * doubtful.arrays[f"{beside}.area"])
    result = doubtful.check(chained=True)
    assert result.first == ("hssil-pole", beside)
    assert [one.stage for one in result.findings] == [beside]


def test_an_isolated_stage_has_read_the_kit_s_inputs_and_is_blamed(doubtful):
    assert "in doubt" not in report(doubtful.check())


def test_reports_say_the_share_of_arrays_that_are_not_judged(unsure, tmp_path):
    port, masked = unsure
    result = port.check(tiers=T2)
    assert "1 not-judged" in report(result)
    assert f"not judged: 1 of {len(port.arrays)} arrays ({1 / len(port.arrays):.1%}), first pairs-diffuse/{PAIRS}: " \
           f"{masked.sum()} of {masked.size} elements spared" in report(result)
    said = github(result)
    assert "::warning title=refgi%3A not judged::" in said
    assert "::error" not in said
    write_junit(str(tmp_path / "junit.xml"), result)
    suite, = ElementTree.parse(tmp_path / "junit.xml").getroot()
    assert (suite.get("failures"), suite.get("errors"), suite.get("skipped")) == ("0", "0", "1")
    test, = [one for one in suite if one.find("skipped") is not None]
    assert (test.get("name"), test.find("skipped").get("message")) == ("pairs.pairs", "not judged")
    assert f"{masked.sum()} of {masked.size} elements spared" in test.find("skipped").text


def test_an_expected_failure_that_is_not_judged_has_not_passed(unsure):
    port, _ = unsure
    assert port.check(tiers=T2, expect=("pairs.pairs",)).passing == ()
    port.write(PAIRS, port.arrays[PAIRS])
    assert port.check(tiers=T2, expect=("pairs.pairs",)).passing == ("pairs.pairs",)


def test_an_assertion_on_what_is_not_judged_warns(unsure):
    port, _ = unsure
    wrong = np.load(Path(port.folder) / "pairs-diffuse" / f"{PAIRS}.npy")
    with pytest.warns(RefgiWarning, match=r"pairs-diffuse/pairs\.pairs: not judged: "):
        assert_stage_close(wrong, "pairs-diffuse", PAIRS, tier="T2", kit=port.kit)
