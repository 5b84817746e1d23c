"""A bench of one scene: pictures, seeds and references are those of the methods run by hand."""

import math
import time
import warnings

import numpy as np
import pytest

from refgi.bench import measure
from refgi.bench.error import error_of
from refgi.bench.grid import Grid
from refgi.bench.measure import REFERENCE_SEED, bench_scene, load_kernels, small_frame, with_seed, works_of
from refgi.errors import InputError, RefgiWarning
from refgi.frame import Frame
from refgi.methods import METHODS
from refgi.scene import load_scene
from refgi.stages import observe
from refgi.truth import TruthSettings, trace_truth
from tests.bench.conftest import GRID, ROUNDS, SIZE, choice

pytestmark = pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")


def test_no_time_has_compiling_in_it(box):
    """The small picture that loads a method's kernels runs what the picture that is timed runs."""
    with observe() as log:
        load_kernels(small_frame(box, SIZE), choice("val", lights=64), 300 * 300)
    assert "error_target.error_driven" in {run.name for run in log.runs if run.status == "ran"}


def picture_of(frame, choice, seed):
    return METHODS[choice.method].function(frame, with_seed(choice.settings, seed))


def test_errors_are_those_of_the_method_run_by_hand_with_each_seed(box, bench):
    frame = Frame(box, **SIZE)
    for number, judges in ((0, ("truth", "unoccluded")), (2, ("truth",))):
        one, run = GRID.choices[number], bench.runs[number]
        assert (run.method, run.changes) == (one.method, one.changes)
        pictures = [picture_of(frame, one, seed) for seed in range(ROUNDS)]
        assert not np.array_equal(*pictures)
        assert set(run.errors) == set(judges)
        for name in judges:
            truth = trace_truth(frame, TruthSettings(samples=96, seed=REFERENCE_SEED, visibility=name == "truth"))
            expected = error_of(pictures, truth.mean, truth.variance_of_mean, frame.gbuffer.covered)
            assert list(run.errors[name].model_dump(exclude={"in_doubt"}).values()) == pytest.approx(list(expected))


@pytest.mark.slow
def test_a_method_of_the_screen_is_judged_by_what_the_camera_sees_as_well(box):
    """Each reference is the truth with the method's own limits, traced by hand; with rays it knows what blocks."""
    grid = Grid((choice("hssil", samples=64), choice("hssil", samples=64, visibility="rays")), ())
    found = bench_scene(box, grid, rounds=1, truth=TruthSettings(samples=96), **SIZE)
    frame = Frame(box, **SIZE)
    limits = {"truth": {}, "unoccluded": {"visibility": False}, "seen": {"emitters": "visible"},
              "seen_unoccluded": {"visibility": False, "emitters": "visible"}}
    for one, run, names in zip(grid.choices, found.runs, (("truth", "unoccluded", "seen_unoccluded"),
                                                          ("truth", "seen")), strict=True):
        assert list(run.errors) == list(names)
        for name in names:
            truth = trace_truth(frame, TruthSettings(samples=96, seed=REFERENCE_SEED, **limits[name]))
            expected = error_of([picture_of(frame, one, 0)], truth.mean, truth.variance_of_mean, frame.gbuffer.covered)
            assert run.errors[name].rmse == pytest.approx(expected.rmse), name
    blind, knowing = found.runs
    assert blind.own_limits == blind.errors["seen_unoccluded"].rmse < blind.rmse
    assert knowing.own_limits == knowing.errors["seen"].rmse < knowing.rmse


def test_the_path_tracer_comes_nearer_and_has_no_bias(bench):
    two, four = bench.line
    assert (two.changes, four.changes) == (("samples=48",), ("samples=96",))
    known = [one.errors["truth"] for one in bench.line]
    assert known[1].spread == pytest.approx(known[0].spread / math.sqrt(2), rel=0.3)
    for one in known:
        assert one.bias**2 < 0.2 * (one.spread**2 + one.noise**2)
        assert one.rmse == pytest.approx(math.hypot(one.spread, one.noise), rel=0.2)


@pytest.mark.slow
def test_the_path_tracer_s_line_estimates_what_the_reference_does(box, tmp_path):
    """Its own settings reach both, and no stop reads what the reference has left in a file."""
    found = bench_scene(box, GRID._replace(choices=GRID.choices[2:3]), rounds=1, truth=TruthSettings(
        samples=96, bounces=2, checkpoint=tmp_path / "sums", target_error=0.5), **SIZE)
    frame, stop = Frame(box, **SIZE), found.line[1]
    assert (stop.settings["bounces"], stop.settings["samples"]) == (2, 96)
    assert stop.settings["checkpoint"] is stop.settings["target_error"] is None
    truth = trace_truth(frame, TruthSettings(samples=96, bounces=2, seed=REFERENCE_SEED, target_error=0.5))
    picture = trace_truth(frame, TruthSettings(samples=96, bounces=2)).mean.astype(frame.dtype)
    expected = error_of([picture], truth.mean, truth.variance_of_mean, frame.gbuffer.covered)
    assert stop.errors["truth"].rmse == pytest.approx(expected.rmse)


def test_a_checkpoint_file_serves_both_references(box, tmp_path):
    bench_scene(box, Grid(GRID.choices[:1], ()), rounds=1, truth=TruthSettings(
        samples=48, checkpoint=tmp_path / "sums"), **SIZE)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["sums", "sums.unoccluded"]


def test_times_stages_and_places(bench):
    for run in (*bench.runs, *bench.line):
        assert len(run.times) == ROUNDS
        assert 0 < sum(run.stages.values()) <= run.times[0]
    assert "rsm.gbuffer" in bench.runs[0].stages
    assert any(run.front for run in bench.runs)
    assert [run.work.pairs % bench.covered for run in bench.runs[:3]] == [0, 0, 0]
    assert 7 < bench.runs[1].work.pairs / bench.runs[0].work.pairs < 9
    assert bench.runs[2].work.rays > 0 == bench.runs[0].work.rays
    assert bench.line[1].work.rays > 1.5 * bench.line[0].work.rays > 0
    assert bench.cold == {}
    assert bench.failures == {}
    assert (bench.width, bench.height, bench.covered) == (40, 36, int(Frame(load_scene(
        "cornell_box"), **SIZE).gbuffer.covered.sum()))


def test_a_seed_reaches_every_method_that_has_one():
    for name, method in METHODS.items():
        settings = with_seed(method.settings(), 7)
        assert type(settings) is method.settings
        if name != "gather" or settings != method.settings():
            assert settings != method.settings(), name
        assert with_seed(settings, 7) == settings


def test_what_gives_no_picture_stops_nothing_else(box):
    grid = Grid((choice("sii", lights=32), choice("val", **{"maps.resolution": 64, "lights": 16})), ())
    timed = measure.timed

    def refusing(frame, method, settings):
        if method == "val":
            raise InputError("refused here")
        return timed(frame, method, settings)

    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings():
        warnings.simplefilter("ignore", RefgiWarning)
        patch.setattr(measure, "timed", refusing)
        found = bench_scene(box, grid, rounds=1, truth=TruthSettings(samples=48), **SIZE)
    assert [run.method for run in found.runs] == ["sii"]
    assert found.failures == {"val: maps.resolution=64, lights=16": "refused here"}
    assert found.left_out == {}
    assert found.runs[0].errors["truth"].spread is None
    assert found.runs[0].in_equal_time is None  # no line


def with_budget(box, monkeypatch, expected, budget=1e3):
    """Return what a bench of `GRID` finds whose choices are expected to take some time, and the order of its runs."""
    order, real = [], measure.timed

    def timed(frame, method, settings):
        order.append(settings)
        return real(frame, method, settings)

    monkeypatch.setattr(measure, "_expected", lambda *_: dict(expected))
    monkeypatch.setattr(measure, "timed", timed)
    found = bench_scene(box, GRID, rounds=2, truth=TruthSettings(samples=48), budget=budget, **SIZE)
    return found, order


def test_a_budget_runs_the_cheapest_first_and_names_what_does_not_fit(box, monkeypatch):
    found, order = with_budget(box, monkeypatch, {0: 30.0, 1: 20.0, 2: 1e4, 3: 10.0, 4: 5.0})
    assert order[1:4] == [with_seed(GRID.choices[number].settings, 0) for number in (3, 1, 0)]
    assert isinstance(order[0], TruthSettings)
    assert [run.changes for run in found.runs] == [GRID.choices[number].changes for number in (0, 1, 3)]
    assert [len(run.times) for run in (*found.runs, *found.line)] == [2] * 4
    assert found.left_out == {"vpl: lights=32": "some 1e+04 s a run", "truth: samples=96": "no time to load it"}
    assert all(run.work is not None for run in found.runs)
    assert found.failures == {}


def test_a_budget_that_is_over_leaves_all_out(box):
    found = bench_scene(box, GRID, rounds=2, truth=TruthSettings(samples=48), budget=1e-3, **SIZE)
    assert (found.runs, found.line, found.failures) == ((), (), {})
    assert len(found.left_out) == len(GRID.choices) + len(GRID.passes)
    assert found.left_out_said == ["6 settings: no time to load it"]
    left_out = {f"sii: lights={one}": f"some {one // 2} s a run" for one in range(16)}
    many = found.model_copy(update={"left_out": left_out})
    assert many.left_out_said == [*(f"2 settings: some {one} s a run" for one in range(6)),
                                  "4 more, which results.json names"]


def test_later_rounds_are_left_out_where_time_is_up(box, monkeypatch):
    """Nothing fits any more once the first round is done."""
    real = works_of

    def late(*arguments):
        monkeypatch.setattr(measure, "_fits", lambda *_: False)
        return real(*arguments)

    monkeypatch.setattr(measure, "works_of", late)
    found = bench_scene(box, GRID, rounds=3, truth=TruthSettings(samples=48), budget=1e3, **SIZE)
    assert [len(run.times) for run in (*found.runs, *found.line)] == [1] * 6
    assert set(found.left_out.values()) == {"2 of 3 runs"}


def test_what_a_run_takes_is_expected_by_a_small_picture_where_time_ends(box, monkeypatch):
    size = {**SIZE, "width": 192, "height": 192}
    choices = [choice("sii", lights=32), choice("vpl", lights=512)]
    takes = measure._expected(box, choices, size, lambda *_: None, time.perf_counter() + 1e3)
    assert takes[1] > 5 * takes[0] > 0
    assert measure._expected(box, choices, size, lambda *_: None, math.inf) == {0: 0.0, 1: 0.0}
    assert measure._expected(box, choices, size, lambda *_: None, 0.0) == {}
    monkeypatch.setattr(measure, "load_kernels", lambda *_: time.sleep(0.1))
    large = {**SIZE, "width": 960, "height": 96}  # ten times the small picture
    assert 1.0 <= measure._expected(box, choices[:1], large, lambda *_: None, time.perf_counter() + 1e3)[0] < 5.0


def test_time_for_judging_is_kept(box, monkeypatch):
    """Judging that takes all of the budget leaves no run."""
    monkeypatch.setattr(measure, "_judging", lambda *_: 1e4)
    found, order = with_budget(box, monkeypatch, dict.fromkeys(range(6), 1.0))
    assert (found.runs, order) == ((), [])
    monkeypatch.setattr(measure, "_judging", lambda *_: 400.0)
    found, order = with_budget(box, monkeypatch, dict.fromkeys(range(6), 1.0))
    assert len(found.runs) == 2
    assert len(found.left_out) == 4


def test_a_method_s_first_run_corrects_what_its_others_are_expected_to_take(box, monkeypatch):
    """Both of `sii` are expected to take longer than they do; the second would not fit otherwise."""
    found, _ = with_budget(box, monkeypatch, {0: 20.0, 1: 2e3, 2: 2e3, 3: 10.0})
    assert [run.method for run in found.runs] == ["sii", "sii", "gather"]
    assert found.left_out["vpl: lights=32"] == "some 2e+03 s a run"
