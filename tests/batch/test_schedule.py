"""Chunks of jobs, and processes that do them: of which one dies, and which end with their parent."""

import os
from concurrent.futures import Future
from multiprocessing import parent_process

import pytest

from refgi.batch import schedule
from refgi.batch.jobs import Job, Shot
from refgi.batch.outcome import failed, is_done, read_outcome, write_outcome
from refgi.batch.schedule import DIED, chunks_of, follow, run_in_processes, unfinished
from refgi.batch.shared import Common
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
