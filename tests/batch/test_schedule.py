"""Chunks of jobs, and processes that do them: of which one dies, and which end with their parent."""

import json
import os
import subprocess
import sys
from concurrent.futures import Future
from multiprocessing import parent_process
from pathlib import Path
from types import SimpleNamespace

import pytest

from refgi.batch import schedule
from refgi.batch.jobs import Job, Shot, jobs_of
from refgi.batch.outcome import failed, is_done, read_outcome, write_outcome
from refgi.batch.plan import read_plan
from refgi.batch.schedule import (
    DIED,
    absolute,
    chunks_of,
    estimate,
    follow,
    run_in_processes,
    run_on_cluster,
    unfinished,
)
from refgi.batch.shared import Common
from refgi.batch.work import Chunk
from refgi.bench.grid import Choice
from refgi.errors import InputError
from refgi.splat import GatherSettings
from refgi.sssil.temporal import TemporalSettings
from refgi.truth import TruthSettings


class Deadly(Job):
    """A job that ends whatever process but the first is at it."""

    @property
    def label(self):
        if parent_process() is not None:
            os._exit(9)
        return "deadly"


def job(number, scene="box", kind=Job, **more):
    shot = Shot(scene, "none such", None, **more)
    return kind(f"{scene}{number}", shot, Choice("gather", (f"samples={number}",), GatherSettings()), (0,), "")


@pytest.fixture
def common(tmp_path):
    (tmp_path / "jobs").mkdir()
    return Common(tmp_path, tmp_path / "store", TruthSettings(), 32, 1)


def names(chunks):
    return [[one.name for one in chunk.jobs] for chunk in chunks]


BOX, HALL = [job(n) for n in range(5)], [job(n, "hall") for n in range(3)]


@pytest.mark.parametrize(("jobs", "workers", "expected"), [
    (BOX + HALL, 1, [["box0", "box1", "box2", "box3", "box4"], ["hall0", "hall1", "hall2"]]),
    (BOX + HALL, 2, [["box0", "box1", "box2", "box3", "box4"], ["hall0", "hall1", "hall2"]]),
    (BOX + HALL, 3, [["box0", "box2", "box4"], ["box1", "box3"], ["hall0", "hall2"], ["hall1"]]),
    (BOX, 2, [["box0", "box2", "box4"], ["box1", "box3"]]),
    (HALL, 9, [["hall0"], ["hall1"], ["hall2"]]),
    ([], 2, []),
])
def test_a_worker_keeps_to_a_frame_unless_there_are_too_few(common, jobs, workers, expected):
    chunks = chunks_of(jobs, common, workers)
    assert names(chunks) == expected
    assert all(chunk.common == common for chunk in chunks)


def test_frames_behind_a_temporal_filter_are_one_chunk(common):
    frames = [job(n, path="way.toml", frame=k, frames=2) for k in range(2) for n in range(2)]
    frames = [one if n % 2 else one._replace(temporal=TemporalSettings(), name=f"filtered{n // 2}")
              for n, one in enumerate(frames)]
    assert names(chunks_of(frames, common, 2)) == [["box1"], ["box1"], ["filtered0", "filtered1"]]


def test_what_is_left_of_chunks(common):
    chunks = chunks_of(BOX + HALL, common, 1)
    for one in (*BOX[1:3], *HALL):
        write_outcome(common.folder, failed(one, "x"))
    assert names(unfinished(chunks)) == [["box0", "box3", "box4"]]


def test_what_ends_a_chunk_is_replaced_or_raised(common):
    first, second, third = Future(), Future(), Future()
    chunks = chunks_of(BOX + HALL, common, 1)
    first.set_exception(KeyError("a"))
    second.set_result(3)
    third.set_result(1)
    seen, told, written = [], [], []

    def died(chunk, error):
        seen.append((chunk, error))
        return third

    follow([(chunks[0], first), (chunks[1], second)], lambda *what: told.append(what), lambda: written.append(1), died)
    assert [(chunk, str(error)) for chunk, error in seen] == [(chunks[0], "'a'")]
    assert told[-1] == ("8 of 8 jobs", 1.0)
    assert len(written) == 3
    with pytest.raises(KeyError):
        follow([(chunks[0], first)], lambda *_: None, lambda: None)


@pytest.mark.slow
def test_a_job_that_ends_its_process_takes_no_other_along(common):
    jobs = [job(0), job(1, kind=Deadly), job(2), job(3)]
    chunks = chunks_of(jobs, common, 2)
    assert names(chunks) == [["box0", "box2"], ["box1", "box3"]]
    written = []
    run_in_processes(chunks, 2, lambda *_: None, lambda: written.append(1))
    messages = [read_outcome(common.folder, one).message for one in jobs]
    assert messages[1] == DIED
    assert all("none such" in messages[n] for n in (0, 2, 3))
    assert written


@pytest.mark.slow
def test_what_cannot_be_written_ends_the_batch(common):
    (common.folder / "jobs").rmdir()
    with pytest.raises(InputError, match="cannot be written"):
        run_in_processes(chunks_of(BOX, common, 2), 2, lambda *_: None, lambda: None)


def test_chunks_in_this_process(common, monkeypatch):
    told, written = [], []

    def run(chunk, tell):
        tell(chunk.jobs[0].name, 0.5)
        return 1

    monkeypatch.setattr(schedule, "run_chunk", run)
    schedule.run_here(chunks_of(BOX + HALL, common, 1), lambda *what: told.append(what), lambda: written.append(1))
    assert told == [("box0", 0.5 * 5 / 8), ("hall0", (5 + 0.5 * 3) / 8)]
    assert written == [1, 1]
    assert not is_done(common.folder, BOX[0])


PLAN = """
[batch]
scenes = ["cornell_box"]
size = [200, 100]
rounds = 3
path = "way.toml"
frames = 2
truth = {samples = 48}
[sii]
lights = [16, 64]
[gather]
"""
PIXELS = 200 * 100


def test_time_grows_with_the_pixels_and_counts_every_run(tmp_path, monkeypatch):
    (tmp_path / "plan.toml").write_text(PLAN)
    (tmp_path / "way.toml").write_text("[[camera]]\nat = 0.0\neye = [0.278, 0.273, -0.8]\n")
    plan = read_plan(tmp_path / "plan.toml")
    clock = SimpleNamespace(now=0.0)

    def method(fixed, slope):
        def run(frame, _):
            clock.now += fixed + slope * frame.width * frame.height

        return SimpleNamespace(made=run)

    def refusing(*_):
        raise InputError("refused")

    jobs = jobs_of(plan)
    methods = {"sii": method(2.0, 1e-4), "gather": SimpleNamespace(made=refusing), "truth": method(0.5, 1e-3)}
    monkeypatch.setattr(schedule, "METHODS", methods)
    monkeypatch.setattr(schedule, "time", SimpleNamespace(perf_counter=lambda: clock.now))
    found = estimate(jobs, Common(tmp_path, tmp_path, plan.truth, 32), lambda *_: None)
    assert found.seconds == pytest.approx(2 * 2 * (3 + 1) * (2.0 + 1e-4 * PIXELS))  # frames, settings, runs
    assert found.truth_seconds == pytest.approx(2 * (0.5 + 1e-3 * PIXELS))


ROOMS = """
[batch]
scenes = ["room.json"]
size = [24, 18]
rounds = 1
rsm_resolution = 32
truth = {samples = 48}
[sii]
lights = [JOBS]
"""
JOBS = 16
# kills a worker as soon as some results are there; no process has FLIP, which would start one more for each picture
CLUSTER = """
import os, signal, sys, threading, time
sys.modules["flip_evaluator"] = None
from pathlib import Path
from distributed import LocalCluster
from refgi.cli.group import VerbGroup

def kill(cluster, done):
    while len(list(Path("out/jobs").glob("[!.]*.json"))) < done:
        time.sleep(0.02)
    os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)
    print("killed", flush=True)

if __name__ == "__main__":
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        threading.Thread(target=kill, args=(cluster, 4), daemon=True).start()
        VerbGroup.refgi().main(["batch", "plan.toml", "--out", "out", "--workers", "2", "--json",
                                "--executor", f"dask:{cluster.scheduler_address}"])
"""
ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_a_worker_killed_midway_loses_nothing(tmp_path):
    (tmp_path / "room.json").write_text((ROOT / "docs/examples/room.json").read_text())
    (tmp_path / "room.obj").write_text((ROOT / "docs/examples/room.obj").read_text())
    (tmp_path / "plan.toml").write_text(ROOMS.replace("JOBS", ", ".join(map(str, range(1, JOBS + 1)))))
    (tmp_path / "cluster.py").write_text(CLUSTER)
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run([sys.executable, "cluster.py"], cwd=tmp_path, env={**os.environ, "PYTHONPATH": paths},
                          capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    killed, _, said = done.stdout.partition("\n")
    assert killed == "killed"
    assert json.loads(said)["done_now"] == JOBS
    assert json.loads(said)["failures"] == {}
    outcomes = [json.loads(file.read_text()) for file in (tmp_path / "out" / "jobs").glob("[!.]*.json")]
    assert len(outcomes) == JOBS
    assert all(one["status"] == "done" for one in outcomes)


def test_folders_have_the_same_names_on_every_worker(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    chunk = absolute(Chunk((), Common(Path("out"), Path("store"), TruthSettings(), 32)))
    assert (chunk.common.folder, chunk.common.store) == (tmp_path / "out", tmp_path / "store")
    assert chunk.working_folder == str(tmp_path)


def test_without_dask_there_is_one_clear_error(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    common = Common(tmp_path, tmp_path, TruthSettings(), 32)
    with pytest.raises(InputError, match=r"refgi\[distributed\]") as error:
        run_on_cluster("tcp://127.0.0.1:1", [], common, lambda *_: None, lambda: None)
    assert error.value.key == "--executor"
