"""A batch on a real cluster of two worker processes, one of which is killed while it works."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from refgi.batch.schedule import absolute, run_on_cluster
from refgi.batch.shared import Common
from refgi.batch.work import Chunk
from refgi.errors import InputError
from refgi.truth import TruthSettings

PLAN = """
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
    (tmp_path / "plan.toml").write_text(PLAN.replace("JOBS", ", ".join(map(str, range(1, JOBS + 1)))))
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
