"""Jobs done: figures are those of a bench, buffers and truths are shared, errors are results."""

import contextlib
import dataclasses
import importlib

import numpy as np
import pytest

from refgi import stages
from refgi.batch import work
from refgi.batch.jobs import jobs_of
from refgi.batch.outcome import is_done, read_outcome, read_outcomes, result_of
from refgi.batch.plan import read_plan
from refgi.batch.shared import Common, digest_of, hashes_of
from refgi.batch.work import Chunk, forget, run_chunk
from refgi.bench import measure
from refgi.bench.measure import bench_scene
from refgi.compare.metrics import Flip
from refgi.errors import InputError
from refgi.frame import Frame
from refgi.image import read_exr
from refgi.scene import load_scene
from refgi.scene.path import scenes_along
from refgi.scene.pathfile import read_path
from refgi.sssil import HssilSettings
from refgi.sssil.temporal import Sequence, TemporalSettings
from refgi.stages import observe, stage
from refgi.truth import TruthSettings
from tests.batch.made import PLAN as SMALL_PLAN
from tests.batch.made import run_of

pytestmark = pytest.mark.filterwarnings("ignore::refgi.errors.RefgiWarning")

PLAN = SMALL_PLAN + "[vpl]\nlights = 16\n"


def planned(tmp_path, text=PLAN):
    (tmp_path / "plan.toml").write_text(text)
    return read_plan(tmp_path / "plan.toml")


def common_of(tmp_path, plan, out="out"):
    (tmp_path / out / "jobs").mkdir(parents=True, exist_ok=True)
    return Common(tmp_path / out, tmp_path / "store", plan.truth, plan.rsm_resolution)


def done(jobs, common):
    forget()
    return run_chunk(Chunk(tuple(jobs), common, "."))


@contextlib.contextmanager
def counted(monkeypatch):
    """Collect the logs of all that is observed."""
    observe, logs = stages.observe, []

    @contextlib.contextmanager
    def observing(**options):
        with observe(**options) as log:
            logs.append(log)
            yield log

    with monkeypatch.context() as patch:
        patch.setattr(stages, "observe", observing)
        yield lambda name: sum(log.status(name).count("ran") for log in logs)


def test_figures_are_those_of_a_bench(tmp_path):
    plan = planned(tmp_path, PLAN.replace("[16, 64]", "16").replace("[hssil]", ""))
    jobs, common = jobs_of(plan), common_of(tmp_path, plan)
    assert done(jobs, common) == 3
    got = result_of(common.folder, jobs, read_outcomes(common.folder, jobs)).scenes[0]
    expected = bench_scene(load_scene("cornell_box"), plan.grid, rounds=2, truth=plan.truth, width=24, height=18,
                           **common.options)
    assert (got.scene, got.width, got.height, got.covered, got.mean, got.truth) == (
        "cornell_box", 24, 18, expected.covered, expected.mean, expected.truth)
    for one, other in zip((*got.runs, *got.line), (*expected.runs, *expected.line), strict=True):
        assert (one.method, one.changes) == (other.method, other.changes)
        assert {**one.settings, "seed": 0} == {**other.settings, "seed": 0}
        assert one.errors == other.errors
        assert (one.flip, one.ssim, one.relmse) == (other.flip, other.ssim, other.relmse)
        assert len(one.times) == 2
        assert set(one.stages) >= {"rsm.gbuffer"}
        assert min(one.times) > 0
        assert 0 < sum(one.stages.values()) <= one.times[0] * (1 + 1e-9)
    assert done(jobs, common) == 0


@pytest.mark.parametrize("runs", [10, pytest.param(100, marks=pytest.mark.slow)])
def test_all_runs_of_a_scene_share_truth_and_buffers(tmp_path, monkeypatch, evidence, runs):
    """Judging and writing pictures are left out: they take most of the time and share nothing."""
    text = PLAN.replace("rounds = 2", "rounds = 1").replace("[hssil]", "")
    text = text.replace("[16, 64]", str(list(range(1, runs - 1))))
    monkeypatch.setattr(work, "judged", lambda choice, *_: run_of(choice.method, choice.changes))
    monkeypatch.setattr(work, "write_exr", lambda *_: None)
    plan = planned(tmp_path, text)
    jobs, common = jobs_of(plan), common_of(tmp_path, plan)
    assert len(jobs) == runs
    with counted(monkeypatch) as ran:
        assert done(jobs, common) == runs
    stop = 2  # the path tracer stopped early, warm and timed, is a truth of its own
    counts = {name: ran(name) for name in ("rsm.gbuffer", "rsm.reflective_shadow_map", "rays.build")}
    assert counts == dict.fromkeys(counts, 1)
    assert ran("truth.accumulate") == 2 + stop  # with visibility and without
    assert ran("pairs.sum") > 1.5 * (runs - 2)  # nothing else is shared
    evidence(f"{runs} runs: G-buffer {counts['rsm.gbuffer']}, RSM {counts['rsm.reflective_shadow_map']}, "
             f"Embree {counts['rays.build']}, truths {ran('truth.accumulate') - stop}")


def test_another_batch_spends_nothing_on_the_truth(tmp_path, monkeypatch):
    plan = planned(tmp_path)
    jobs = jobs_of(plan)[:1]
    passes = []
    tracing = importlib.import_module("refgi.truth.truth")
    monkeypatch.setattr(tracing, "one_pass", counting(tracing.one_pass, passes))
    assert done(jobs, common_of(tmp_path, plan)) == 1
    assert len(passes) == 4  # two of each truth
    assert done(jobs, common_of(tmp_path, plan, "other")) == 1
    assert len(passes) == 4
    folders = [tmp_path / name / "pictures/cornell_box/truth.exr" for name in ("out", "other")]
    first, second = (read_exr(file)[0] for file in folders)
    assert all(np.array_equal(first[name], second[name]) for name in first)


def counting(function, calls):
    def call(*arguments):
        calls.append(arguments)
        return function(*arguments)

    return call


def test_pictures_and_what_they_say(tmp_path):
    plan = planned(tmp_path)
    jobs, common = jobs_of(plan)[:1], common_of(tmp_path, plan)
    done(jobs, common)
    frame = Frame(load_scene("cornell_box"), width=24, height=18, **common.options)
    from refgi.splat import SiiSettings, sii

    light = sii(frame, jobs[0].choice.settings)
    assert isinstance(jobs[0].choice.settings, SiiSettings)
    planes, record = read_exr(common.folder / jobs[0].picture)
    radiance = frame.radiance(light)
    for channel, plane, shown in zip("RGB", light, radiance, strict=True):
        assert np.array_equal(planes[f"irradiance.{channel}"], plane)
        assert np.array_equal(planes[channel], shown)
    assert (record["method"], record["settings"]["lights.count"], record["scene"]["camera"]["width"]) == ("sii", 16, 24)
    assert sorted(file.name for file in (common.folder / "pictures/cornell_box").iterdir()) == [
        "ids.exr", f"sii_{jobs[0].name}.exr", "truth.exr", "truth_unoccluded.exr"]
    truth, _ = read_exr(common.folder / "pictures/cornell_box/truth.exr")
    assert {"variance.R", "irradiance.G", "B", "samples"} <= set(truth)
    ids, _ = read_exr(common.folder / "pictures/cornell_box/ids.exr")
    assert np.array_equal(ids["face"], frame.gbuffer.triangle_id.astype(np.uint32))


def test_digests_do_not_depend_on_who_made_the_buffers(tmp_path):
    plan = planned(tmp_path)
    jobs, common = jobs_of(plan), common_of(tmp_path, plan)
    done(jobs, common)
    hashes = [read_outcome(common.folder, job).run.hashes for job in jobs]
    assert "rsm.gbuffer" in dict(hashes[1])
    assert hashes[0] != hashes[1]
    backwards = common_of(tmp_path, plan, "backwards")
    done(jobs[::-1], backwards)
    assert [read_outcome(backwards.folder, job).run.hashes for job in jobs] == hashes


def test_errors_of_a_job_are_its_result_and_stop_no_other(tmp_path, monkeypatch):
    plan = planned(tmp_path)
    jobs, common = jobs_of(plan)[:3], common_of(tmp_path, plan)
    timed = work._timed

    def refusing(job, *rest):
        if job is jobs[0]:
            raise InputError("refused here")
        if job is jobs[1]:
            raise ZeroDivisionError("a fault\nof two lines")
        return timed(job, *rest)

    monkeypatch.setattr(work, "_timed", refusing)
    assert done(jobs, common) == 3
    outcomes = [read_outcome(common.folder, job) for job in jobs]
    assert [(one.status, one.message) for one in outcomes] == [
        ("failed", "refused here"), ("failed", "ZeroDivisionError: a fault of two lines"), ("done", "")]
    result = result_of(common.folder, jobs, read_outcomes(common.folder, jobs))
    assert result.scenes[0].failures == {"sii: lights=16": "refused here",
                                         "sii: lights=64": "ZeroDivisionError: a fault of two lines"}
    assert [run.method for run in result.scenes[0].runs] == ["hssil"]


def test_a_scene_that_cannot_be_seen_or_is_another_by_now_fails_its_jobs(tmp_path):
    plan = planned(tmp_path)
    job, common = jobs_of(plan)[0], common_of(tmp_path, plan)
    done([job._replace(scene_key="another")], common)
    assert "when the batch began" in read_outcome(common.folder, job).message
    result = result_of(common.folder, [job], read_outcomes(common.folder, [job]))
    assert result.scenes[0].runs == ()
    assert list(result.scenes[0].failures) == ["sii: lights=16"]


def test_a_damaged_result_is_none(tmp_path):
    plan = planned(tmp_path)
    job, common = jobs_of(plan)[0], common_of(tmp_path, plan)
    for text in ("", "{", "{}"):
        (common.folder / "jobs" / f"{job.name}.json").write_text(text)
        assert read_outcome(common.folder, job) is None
        assert is_done(common.folder, job)


PATH = """
[[camera]]
at = 0.0
eye = [0.278, 0.273, -0.8]
[[camera]]
at = 1.0
eye = [0.3, 0.273, -0.8]
"""


def test_a_temporal_filter_goes_on_from_frame_to_frame_also_in_another_process(tmp_path):
    (tmp_path / "way.toml").write_text(PATH)
    text = PLAN.replace("rounds = 2", 'rounds = 1\npath = "way.toml"\nframes = 3\ntemporal = {weight = 0.7}')
    plan = planned(tmp_path, text.replace("[sii]\nlights = [16, 64]\n", "").replace("[vpl]\nlights = 16\n", ""))
    jobs, common = jobs_of(plan), common_of(tmp_path, plan)
    way = [job for job in jobs if job.choice.method == "hssil"]
    done(way[:2], common)
    done(way[:1], common_of(tmp_path, plan, "other"))  # after which this process knows another frame, as any might
    done(way[2:], common)
    scene = load_scene("cornell_box").with_camera(width=24, height=18)
    steps = list(Sequence(scenes_along(scene, read_path(tmp_path / "way.toml", scene)[0], 3), HssilSettings(),
                          TemporalSettings(weight=0.7), **common.options))
    for job, step in zip(way, steps, strict=True):
        planes, record = read_exr(common.folder / job.picture)
        assert np.array_equal(np.stack([planes[f"irradiance.{c}"] for c in "RGB"]), step.irradiance)
        assert record["frame"] == job.shot.frame
        assert record["temporal"]["weight"] == 0.7
    result = result_of(common.folder, jobs, read_outcomes(common.folder, jobs))
    assert [scene.scene for scene in result.scenes] == ["cornell_box@0", "cornell_box@1", "cornell_box@2"]
    path, = result.paths
    assert (path.scene, path.method, path.frames) == ("cornell_box", "hssil", 3)
    assert steps[2].irradiance.any()
    assert path.flicker > path.noise > 0
    truths = [read_exr(common.folder / f"pictures/cornell_box@{k}/truth.exr")[0] for k in range(3)]
    right = np.array([[one[f"irradiance.{c}"] for c in "RGB"] for one in truths], float)
    errors, light = np.array([step.irradiance for step in steps]) - right, right[:, 0] > 0
    pairs = [(k, light[k] & light[k - 1]) for k in (1, 2)]
    squares = np.concatenate([((errors[k] - errors[k - 1])[:, both] ** 2).ravel() for k, both in pairs])
    mean = np.concatenate([right[k][:, both].ravel() for k, both in pairs]).mean()
    assert path.flicker == pytest.approx(np.sqrt(squares.mean()) / mean, rel=1e-3)
    assert path.lag is None  # the light rests
    assert isinstance(plan.truth, TruthSettings)
    done(jobs, common)
    (common.folder / "jobs" / f"{way[1].name}.json").unlink()
    assert result_of(common.folder, jobs, read_outcomes(common.folder, jobs)).paths == ()


def test_without_the_frame_before_there_is_no_filtered_frame(tmp_path):
    (tmp_path / "way.toml").write_text(PATH)
    plan = planned(tmp_path, PLAN.replace("rounds = 2", 'path = "way.toml"\nframes = 2\ntemporal = {}'))
    job = [job for job in jobs_of(plan) if job.choice.method == "hssil"][1]
    common = common_of(tmp_path, plan)
    work._left.clear()
    done([job], common)
    assert "a picture of the frame before" in read_outcome(common.folder, job).message


@pytest.fixture(autouse=True)
def let_go():
    yield
    forget()


@pytest.fixture(autouse=True)
def no_flip(monkeypatch):
    """FLIP starts a process for each picture."""
    monkeypatch.setattr(measure, "flip", lambda *_: Flip(0.25))


@dataclasses.dataclass
class Pair:
    left: object
    right: object


@stage("test_digest.inner")
def inner(value):
    return value + 1


@stage("test_digest.outer")
def outer(value):
    return inner(value) * inner(value + 1)


@stage("test_digest.last")
def last(value):
    return np.full(3, value)


def test_a_digest_is_of_all_that_a_value_holds():
    a = np.arange(6, dtype=np.float32)
    values = [a, a.reshape(2, 3), a.astype(np.float64), a + np.float32(1e-6), (a,), [a], (a, a), None, 1, 1.0, True,
              "1", {"a": 1}, {"b": 1}, {"a": 2}, Pair(1, 2), Pair(2, 1), {"a": a}, np.float32(1),
              (1, (2, 3)), ((1, 2), 3)]
    assert len({digest_of(value) for value in values}) == len(values)
    assert digest_of(a[::-1]) == digest_of(a[::-1].copy())
    assert digest_of({"a": 1, "b": 2}) == digest_of({"b": 2, "a": 1})


def test_stages_come_in_the_order_in_which_they_end():
    with observe(record=True) as log:
        outer(2)
        last(5)
    assert hashes_of(log, {}) == (
        ("test_digest.inner", digest_of(3)), ("test_digest.inner", digest_of(4)), ("test_digest.outer", digest_of(12)),
        ("test_digest.last", digest_of(np.full(3, 5))))


def test_a_shared_buffer_counts_alike_whether_it_ran_or_not():
    with observe(record=True) as log:
        last(1)
        outer(2)
        outer(3)
        last(5)
    buffers = {"test_digest.outer": ["first", "second"]}
    assert hashes_of(log, buffers) == (
        ("test_digest.last", digest_of(np.full(3, 1))), ("test_digest.outer", "first"), ("test_digest.outer", "second"),
        ("test_digest.last", digest_of(np.full(3, 5))))
    assert buffers == {"test_digest.outer": ["first", "second"]}
