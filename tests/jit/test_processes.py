"""Kernels in other processes and threads: forked, spawned, or beside each other where a threading layer takes one."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = """
import multiprocessing, sys, threading
from concurrent.futures import ThreadPoolExecutor
import numba
import refgi
from refgi.jit import thread_count

METHODS = ["sii", "hssil"]

def bits(method):
    return refgi.render("cornell_box", method, width=24, height=24).irradiance.tobytes()

def child(method):
    one = bits(method)
    with ThreadPoolExecutor(2) as threads:  # which are told of Numba's threads anew
        numba.set_num_threads(numba.config.NUMBA_NUM_THREADS)
        return [one, *threads.map(bits, [method, method])], thread_count()

if __name__ == "__main__":
    if "late" not in sys.argv:
        right = {name: bits(name) for name in METHODS}
    if sys.argv[1] == "threads":
        with ThreadPoolExecutor(4) as threads:
            found = list(threads.map(bits, METHODS * 6))
        assert found == [right[name] for name in METHODS * 6]
    else:
        with multiprocessing.get_context(sys.argv[1]).Pool(2) as pool:
            found = pool.map_async(child, METHODS).get(240)
        if "late" in sys.argv:
            right = {name: bits(name) for name in METHODS}
        assert [one for one, _ in found] == [[right[name]] * 3 for name in METHODS]
        print({count for _, count in found})
    print(numba.threading_layer())
"""


def run(tmp_path: Path, *arguments: str, **environment: str) -> list[str]:
    file = tmp_path / "script.py"
    file.write_text(SCRIPT)
    done = subprocess.run([sys.executable, "-W", "ignore", str(file), *arguments], cwd=ROOT, timeout=400,
                          env=os.environ | {"PYTHONPATH": str(ROOT), "NUMBA_NUM_THREADS": "2"} | environment,
                          capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="a platform without fork")
@pytest.mark.parametrize("layer", ["omp", "workqueue"])
def test_a_forked_process_renders_the_same_on_one_thread(tmp_path, layer):
    assert run(tmp_path, "fork", NUMBA_THREADING_LAYER=layer) == ["{1}", layer]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="a platform without fork")
def test_a_process_forked_before_the_first_picture_has_threads_of_its_own(tmp_path):
    assert run(tmp_path, "fork", "late", NUMBA_THREADING_LAYER="workqueue") == ["{2}", "workqueue"]


@pytest.mark.parametrize("layer", ["omp", "workqueue"])
def test_threads_render_at_once(tmp_path, layer):
    assert run(tmp_path, "threads", NUMBA_THREADING_LAYER=layer) == [layer]


NESTED = """
import threading
import numpy as np
from refgi.jit import kernel, prange, threads

@kernel(parallel=True)
def rows(seen):
    for i in prange(len(seen)):
        total = 0.0
        for k in range(20000):
            total += np.sqrt(k + i)
        seen[i] = total

def one(seen):
    rows(seen)

if __name__ == "__main__":
    right = np.zeros(64)
    with threads(1):
        rows(right)
    for _ in range(20):
        found = [np.zeros(64) for _ in range(6)]
        ran = [threading.Thread(target=one, args=(seen,)) for seen in found]
        [thread.start() for thread in ran]
        [thread.join() for thread in ran]
        assert all((seen == right).all() for seen in found)
"""


def test_a_layer_for_one_caller_is_never_called_by_two(tmp_path):
    file = tmp_path / "nested.py"
    file.write_text(NESTED)
    done = subprocess.run([sys.executable, str(file)], timeout=200, capture_output=True, text=True, check=False,
                          env=os.environ | {"PYTHONPATH": str(ROOT), "NUMBA_THREADING_LAYER": "workqueue",
                                            "NUMBA_NUM_THREADS": "2"})
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(("name", "value", "said"), [
    ("NUMBA_NUM_THREADS", "0", "NUMBA_NUM_THREADS: expected a whole number from 1 to 4096, got '0'"),
    pytest.param("NUMBA_NUM_THREADS", "two", "NUMBA_NUM_THREADS: expected a whole number from 1 to 4096, got 'two'",
                 marks=pytest.mark.slow),
    ("NUMBA_NUM_THREADS", "9" * 5000, "NUMBA_NUM_THREADS: expected a whole number from 1 to 4096, got '999"),
    ("NUMBA_THREADING_LAYER", "fast", "expected a threading layer that is installed, got 'fast': The threading layer"),
    pytest.param("NUMBA_THREADING_LAYER_PRIORITY", "omp", "expected a threading layer that is installed, got 'default'"
                 ": THREADING", marks=pytest.mark.slow),
])
def test_threads_that_numba_cannot_start_are_one_line(tmp_path, name, value, said):
    done = subprocess.run([sys.executable, "-m", "refgi", "render", "cornell_box", "--size", "8x8", "--out",
                           str(tmp_path / "a.exr")], env=os.environ | {"PYTHONPATH": str(ROOT), name: value}, cwd=ROOT,
                          capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert said in done.stderr


@pytest.mark.skipif(sys.platform != "linux", reason="Numba brings GNU's OpenMP, whose setting it is, on Linux alone")
@pytest.mark.parametrize(("asked", "spins"), [({}, "3000"), ({"GOMP_SPINCOUNT": "7"}, "7"),
                                              ({"OMP_WAIT_POLICY": "passive"}, "0")])
def test_threads_soon_sleep_between_loops_unless_asked_otherwise(asked, spins):
    """OpenMP says what it was told when it is loaded, on its standard error."""
    environment = {key: value for key, value in os.environ.items() if key not in ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT")}
    environment |= {"OMP_DISPLAY_ENV": "verbose", "PYTHONPATH": str(ROOT), "NUMBA_THREADING_LAYER": "omp", **asked}
    code = "from refgi.jit.launcher import start_threads; start_threads()"
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert f"GOMP_SPINCOUNT = '{spins}'" in done.stderr
