"""From the shell: help, cold start with an empty kernel cache, second start."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator

from benchmarks.harness import Row

REFGI = [sys.executable, "-m", "refgi"]
RENDER = [*REFGI, "render", "cornell_box", "--method", "sii", "--size", "512x512", "--out"]


def rows(quick: bool) -> Iterator[Row]:
    runs = 3 if quick else 5
    yield Row("refgi --help", _median(runs, [*REFGI, "--help"]), "s", "<= 0.3")
    numba = _median(runs, [sys.executable, "-c", "import numba"])
    yield Row("bare import of numba", numba, "s")
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"REFGI_CACHE_DIR": f"{folder}/cache"}
        render = [*RENDER, f"{folder}/picture.exr"]
        yield Row("cold start to first picture", _seconds(render, environment), "s", "<= 40",
                  "cornell_box, 512x512, sii, empty cache")
        second = sorted(_seconds(render, environment) for _ in range(runs))[runs // 2]
        yield Row("second start", second, "s")
        yield Row("second start above import of numba", second - numba, "s", "<= 1.5")


def _median(runs: int, command: list[str]) -> float:
    return sorted(_seconds(command) for _ in range(runs))[runs // 2]


def _seconds(command: list[str], environment: dict[str, str] | None = None) -> float:
    started = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True, env=environment)
    return time.perf_counter() - started
