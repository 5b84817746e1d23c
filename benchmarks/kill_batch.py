"""Kill a batch at random moments and count what is lost: `python -m benchmarks kill-batch --times 50 --workers 2`.

Every time the batch goes on in the same folder and is killed (SIGKILL to its first process, which its workers have to
notice) at a random moment after a first new result, each fifth time from its start on. Then every file must be whole,
every result that was there must be there unchanged, and of the jobs that were begun at most one a worker may be without
a result. A batch that is finished begins anew; at the end the last one is finished undisturbed.
"""

import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from refgi.image import read_exr
from refgi.truth.checkpoint import DIGEST, FIRST_LINE

JOBS = 400
PLAN = """
[batch]
scenes = ["cornell_box"]
size = [24, 18]
rounds = 1
rsm_resolution = 32
truth.samples = 48
[sii]
lights = """
# FLIP would take most of the time, in a process of its own; who begins a job says so in a file
LAUNCHER = """
import sys
sys.modules["flip_evaluator"] = None
from refgi.batch import work
outcome_of = work.outcome_of
def noted(job, *rest):
    with open(sys.argv[-1], "a") as file:
        file.write(job.name + "\\n")
    return outcome_of(job, *rest)
work.outcome_of = noted
if __name__ == "__main__":
    from refgi.cli.group import VerbGroup
    VerbGroup.refgi().main(sys.argv[1:-1])
"""
SECONDS_TO_END = 60.0  # for workers whose parent is gone, which may be at importing what they need
SECONDS_TO_BEGIN = 120.0


class Tally(NamedTuple):
    """What came of some kills."""

    kills: int
    finished: int  # results when the last kill came
    lost: int
    torn: int
    repeated: int  # jobs begun again
    most_repeated: int  # after one kill
    stray: int  # kills that workers outlived


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks kill-batch", description=__doc__)
    parser.add_argument("--times", type=int, default=50)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--longest", type=float, default=4.0, help="seconds until a kill, at most")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        tally = killed(Path(folder), options.times, options.workers, options.longest, options.seed)
    print(json.dumps(tally._asdict()))
    return int(tally.lost + tally.torn + tally.stray > 0 or tally.most_repeated > options.workers)


def killed(folder: Path, times: int, workers: int, longest: float, seed: int = 0, jobs: int = JOBS) -> Tally:
    """Kill a batch of some jobs some times, and let it end."""
    (folder / "plan.toml").write_text(f"{PLAN}{list(range(1, jobs + 1))}\n")
    (folder / "launcher.py").write_text(LAUNCHER)
    command = [sys.executable, "launcher.py", "batch", "plan.toml", "--out", "out", "--workers", str(workers), "begun"]
    quietly = {"cwd": folder, "env": {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
               "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    moments, kept = random.Random(seed), dict[str, str]()
    finished = lost = torn = repeated = most = stray = 0
    for number in range(times):
        if len(kept) == jobs:
            finished, repeated, kept = finished + jobs, repeated + len(_begun(folder)) - jobs, {}
            shutil.rmtree(folder / "out")
            (folder / "begun").unlink()
        begun = len(_begun(folder))
        process = subprocess.Popen(command, **quietly, start_new_session=True)
        if number % 5:
            _wait_for(lambda: len(_results(folder)) > len(kept) or process.poll() is not None)  # noqa: B023
        time.sleep(moments.uniform(0.0, longest))
        process.kill()
        process.wait()
        stray += not _ended(process.pid)
        now = _results(folder)
        lost += sum(now.get(name) != digest for name, digest in kept.items())
        torn += sum(not is_whole(file) for file in _files(folder))
        most = max(most, sum(name not in now for name in _begun(folder)[begun:]))
        kept = now
        print(f"{len(kept)} of {jobs} results, {lost} lost, {torn} torn", file=sys.stderr, flush=True)
    subprocess.run(command, **quietly, check=True)
    done = _results(folder)
    lost += jobs - len(done) + sum(done.get(name) != digest for name, digest in kept.items())
    torn += sum(not is_whole(file) for file in _files(folder))
    return Tally(times, finished + len(kept), lost, torn, repeated + len(_begun(folder)) - jobs, most, stray)


def _wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + SECONDS_TO_BEGIN
    while not condition() and time.monotonic() < end:
        time.sleep(0.01)


def _begun(folder: Path) -> list[str]:
    file = folder / "begun"
    return file.read_text().split() if file.exists() else []


def _results(folder: Path) -> dict[str, str]:
    files = [file for file in (folder / "out" / "jobs").glob("*.json") if not file.name.startswith(".")]
    return {file.stem: hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def _files(folder: Path) -> list[Path]:
    """Return files under their final names."""
    return [file for file in (folder / "out").rglob("*") if file.is_file() and ".part" not in file.name]


def is_whole(file: Path) -> bool:
    """Return whether a file of refgi has all that was written to it."""
    try:
        if file.suffix == ".json":
            json.loads(file.read_text())
        elif file.suffix == ".exr":
            read_exr(file)
        elif file.suffix == ".png":
            return file.read_bytes()[-8:-4] == b"IEND"
        elif file.suffix == ".html":
            return file.read_text().rstrip().endswith("</html>")
        elif file.suffix == ".truth":
            content = file.read_bytes().removeprefix(FIRST_LINE)
            digest = hashlib.sha256(content[:DIGEST] + content[2 * DIGEST:]).digest()
            return digest == content[DIGEST:2 * DIGEST]
        return file.stat().st_size > 0
    except Exception as error:
        print(f"{file}: {error}", file=sys.stderr)
        return False


def _ended(group: int) -> bool:
    """Return whether all processes of a group end soon; kill those that do not."""
    end = time.monotonic() + SECONDS_TO_END
    while time.monotonic() < end:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return True
        time.sleep(0.05)
    os.killpg(group, signal.SIGKILL)
    return False
