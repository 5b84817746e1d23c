"""A batch killed at random moments, as `python -m benchmarks kill-batch` does it more often."""

import os
import time

import pytest

from benchmarks.kill_batch import killed
from refgi.batch.outcome import SECONDS_OF_A_LEFTOVER, remove_leftovers

WORKERS = 2


@pytest.mark.slow
def test_no_finished_job_is_lost_and_no_file_torn(tmp_path, evidence):
    tally = killed(tmp_path, times=3, workers=WORKERS, longest=1.0, jobs=60)
    evidence(f"{tally.kills} kills: {tally.lost} results lost, {tally.torn} files torn, at most {tally.most_repeated} "
             f"jobs repeated by {WORKERS} workers")
    assert tally.finished > 0
    assert (tally.lost, tally.torn, tally.stray) == (0, 0, 0)
    assert tally.most_repeated <= WORKERS


def test_what_killed_processes_leave_is_removed_once_it_is_old(tmp_path):
    files = [tmp_path / name for name in (
        "jobs/.a.1234.part.json", "pictures/box/.b.5678.part.exr", "store/truths/c/d.truthxyz.part", "jobs/a.json",
        "pictures/box/.c.1.part.exr")]
    for file in files:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("x")
        old = time.time() - SECONDS_OF_A_LEFTOVER - 10
        os.utime(file, (old, old))
    os.utime(files[-1])
    remove_leftovers(tmp_path)
    assert [file for file in files if file.exists()] == files[3:]
