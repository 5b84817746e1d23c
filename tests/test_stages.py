"""Property tests of @stage: a stage is its function; observed, it is logged, reused and skipped with reasons."""

import dataclasses
from typing import NamedTuple

import numpy as np
import pytest

from refgi import stages


@dataclasses.dataclass(frozen=True)
class Options:
    count: int = 1
    weights: tuple[float, ...] = (0.5, 0.5)


@stages.stage("test.double")
def double(values, options=Options()):
    stages.report_progress(0.5)
    return 2 * options.count * values


@stages.stage("test.outer")
def outer(values):
    return double(values) + 1


def test_a_stage_is_its_function():
    assert double(3) == 6
    assert double.stage_name == "test.double"


def test_log_has_order_depth_and_time():
    with stages.observe() as log:
        outer(np.ones(3))
    assert [(run.name, run.depth, run.status) for run in log.runs] == [
        ("test.outer", 0, "ran"), ("test.double", 1, "ran")]
    assert log.seconds("test.outer") >= log.seconds("test.double") > 0
    assert all(run.inputs is None and run.output is None for run in log.runs)


def test_recording_keeps_inputs_and_output():
    values = np.arange(3.0)
    with stages.observe(record=True) as log:
        result = double(values, options=Options())
    assert list(log.runs[0].inputs) == ["values", "options"]
    assert log.runs[0].inputs["values"] is values
    assert log.runs[0].output is result


def doubled_in_steps(values):
    return {"": double(values), "other": values}


@stages.stage("test.whole", steps=doubled_in_steps)
def whole(values):
    double(values)
    return 2 * values


def test_steps_run_where_asked_for_and_take_the_place_of_what_ran_inside():
    with stages.observe(record=True) as log:
        whole(np.ones(2))
    assert [(run.name, run.depth) for run in log.runs] == [("test.whole", 0), ("test.double", 1)]
    assert log.runs[0].steps is None
    with stages.observe(record=True, steps=True) as log:
        made = whole(np.ones(2))
    assert [(run.name, run.depth) for run in log.runs] == [("test.whole", 0), ("test.double", 1)]
    assert made.tolist() == log.runs[0].steps[""].tolist() == log.runs[1].output.tolist() == [2, 2]
    with stages.observe(steps=True) as log:
        whole(np.ones(2))
    assert log.runs[0].steps is None


class Lazy:
    def __init__(self):
        self.made = 0

    def recorded(self):
        self.made += 1
        return {"values": double(np.ones(2))}


@stages.stage("test.lazy")
def lazy(buffers, count=3):  # noqa: ARG001
    return buffers[0]


def test_recording_resolves_lazy_buffers_without_logging_that():
    buffer = Lazy()
    with stages.observe() as log:
        lazy((buffer,))
    assert buffer.made == 0
    with stages.observe(record=True) as log:
        lazy((buffer,))
    assert [run.name for run in log.runs] == ["test.lazy"]
    assert log.runs[0].inputs["count"] == 3
    assert log.runs[0].inputs["buffers"][0]["values"].tolist() == log.runs[0].output["values"].tolist() == [2, 2]


def test_a_name_is_that_of_one_stage():
    with pytest.raises(ValueError, match=r"stage 'test\.double': .*other of .* has the name of double of"):
        @stages.stage("test.double")
        def other(values):
            return values


def test_skip_is_logged_where_it_happens():
    stages.skip("test.none", "nobody listens")
    with stages.observe() as log:
        stages.skip("test.lobes", "no glossy material")
    assert (log.runs[0].status, log.runs[0].reason) == ("skipped", "no glossy material")


def test_progress_names_the_stage():
    seen = []
    with stages.observe(progress=lambda name, fraction: seen.append((name, fraction))):
        outer(1)
    assert seen == [("test.outer", 0.0), ("test.double", 0.0), ("test.double", 0.5), ("test.double", 1.0),
                    ("test.outer", 1.0)]


BIG = np.zeros(stages.SMALL_ARRAY + 1)


@pytest.mark.parametrize(
    ("first", "second", "reused"),
    [
        ((BIG,), (BIG,), True),  # the same object
        ((BIG,), (BIG.copy(),), False),  # a large copy is not compared element by element
        ((np.ones(3),), (np.ones(3),), True),  # a small equal value
        ((np.ones(3),), (np.zeros(3),), False),
        ((np.ones(3),), (np.ones(3, np.float32),), False),  # equal values of another type give another result
        ((np.ones(3), Options(2)), (np.ones(3), Options(2)), True),
        ((np.ones(3), Options(2)), (np.ones(3), Options(3)), False),
        ((1,), (1.0,), False),
        ((True,), (1,), False),
        ((float("nan"),), (float("nan"),), False),
    ],
)
def test_results_are_reused_when_inputs_are_the_same(first, second, reused):
    memory = stages.Memory()
    with stages.observe(memory=memory):
        one = double(*first)
    with stages.observe(memory=memory) as log:
        two = double(*second)
    assert log.status("test.double") == ["reused" if reused else "ran"]
    if isinstance(one, np.ndarray):
        assert (one is two) == reused


def test_reuse_gives_the_same_bits_as_a_fresh_run():
    values = np.random.default_rng(1).random(10_000)
    with stages.observe(memory=stages.Memory()):
        first, second = outer(values), outer(values)
    np.testing.assert_array_equal(second, outer(values))
    assert second is first


def test_memory_forgets_the_oldest():
    memory = stages.Memory()
    with stages.observe(memory=memory) as log:
        for value in range(stages.KEPT_RESULTS + 1):
            double(value)
        double(0)
        double(stages.KEPT_RESULTS)
    assert log.status("test.double")[-2:] == ["ran", "reused"]


def test_a_new_frame_forgets_what_the_last_one_did_not_use():
    memory = stages.Memory()
    with stages.observe() as log:
        for values in ((1, 2), (2, 3), (1, 2)):
            with stages.reusing(memory):
                for value in values:
                    double(value)
    assert log.status("test.double") == ["ran", "ran", "reused", "ran", "ran", "reused"]


def test_reusing_leaves_the_log_as_it_was():
    own, memory = stages.Memory(), stages.Memory()
    with stages.observe(memory=own) as log:
        double(5)
        with stages.reusing(memory):
            double(5)
        with pytest.raises(ValueError, match="no"), stages.reusing(memory):
            raise ValueError("no")
        with stages.reusing(None):
            double(5)
        assert log.memory is own
    with stages.reusing(memory):
        double(6)
        double(6)
    with stages.observe() as after, stages.reusing(memory):
        double(6)
    assert log.status("test.double") == ["ran", "ran", "reused"]
    assert after.status("test.double") == ["reused"]


def test_a_stage_that_is_not_kept_runs_again():
    fresh = stages.stage("test.fresh", kept=False)(lambda value: value + 1)
    with stages.observe(memory=stages.Memory()) as log:
        assert fresh(1) == fresh(1) == 2
    assert log.status("test.fresh") == ["ran", "ran"]


class Made(NamedTuple):
    """What a stage may return."""

    here: np.ndarray
    there: dict[str, np.ndarray]


def test_bytes_are_those_of_the_arrays_that_stages_make_each_once():
    """Closed form: a stage within another, views, lists, and what a memory gives back again count nothing more."""
    @stages.stage("test.inner_array")
    def inner(count):
        return np.zeros(count, np.float32)

    @stages.stage("test.outer_arrays")
    def outer(count):
        held = inner(count)
        return Made(held[: count // 2], {"own": np.zeros((3, count), np.float64)}), [held.reshape(2, -1)], "text"

    with stages.observe(counting=True) as log:
        outer(100)
    assert log.counts["bytes"] == 100 * 4 + 300 * 8
    with stages.observe(counting=True, memory=stages.Memory()) as log:
        kept = [outer(100), outer(100), outer(10)]
    assert log.counts["bytes"] == (100 + 10) * (4 + 3 * 8)
    assert len(kept) == 3
    with stages.observe(counting=True) as log:
        for _ in range(5):
            inner(1000)  # one after the other at the same address, as may be
    assert log.counts["bytes"] == 5 * 4000


def test_an_error_leaves_the_log_usable():
    @stages.stage("test.fails")
    def fails():
        raise ValueError("no")

    with stages.observe() as log:
        with pytest.raises(ValueError, match="no"):
            fails()
        double(1)
    assert [(run.name, run.depth) for run in log.runs] == [("test.double", 0)]
