"""From the shell: help, the first picture with an empty kernel cache, the second start, and what an edit recompiles."""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from benchmarks.harness import Row

ROOT = Path(__file__).parents[1]
PICTURE = ["render", "cornell_box", "--method", "sii", "--size", "512x512", "--out"]


def rows(quick: bool) -> Iterator[Row]:
    runs = 3 if quick else 5
    yield Row("refgi --help", _median(runs, lambda: _seconds(ROOT, ["--help"])), "s", "<= 0.3")
    numba = _median(runs, lambda: _timed([sys.executable, "-c", "import numba"], None))
    yield Row("bare import of numba", numba, "s")
    with tempfile.TemporaryDirectory() as folder:
        second = _median(runs, lambda: _seconds(ROOT, [*PICTURE, f"{folder}/a.exr", "--force"], f"{folder}/cache"))
        yield Row("second start", second, "s")
        yield Row("second start above import of numba", second - numba, "s", "<= 1.5")
        yield Row("kernels compiled after an edit of scene/material.py", _compiled_after_edit(folder), "kernels",
                  "<= 0")
        yield Row("first picture, empty cache", _seconds(ROOT, [*PICTURE, f"{folder}/b.exr"], f"{folder}/cold"), "s")


def _compiled_after_edit(folder: str) -> int:
    """Return how many kernels a copy of the sources compiles when its materials are another file."""
    copy = Path(folder) / "copy"
    shutil.copytree(ROOT / "refgi", copy / "refgi", ignore=shutil.ignore_patterns("__pycache__"))
    material = copy / "refgi" / "scene" / "material.py"
    material.write_text(material.read_text() + "\n\nEDITED = True\n")
    before = len(list(Path(f"{folder}/cache").iterdir()))
    _seconds(copy, [*PICTURE, f"{folder}/edited.exr"], f"{folder}/cache")
    return len(list(Path(f"{folder}/cache").iterdir())) - before


def _seconds(sources: Path, arguments: list[str], cache: str = "") -> float:
    environment = os.environ | {"PYTHONPATH": str(sources)} | ({"REFGI_CACHE_DIR": cache} if cache else {})
    return _timed([sys.executable, "-m", "refgi", *arguments], environment, sources)


def _timed(command: list[str], environment: dict[str, str] | None, folder: Path | None = None) -> float:
    started = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True, env=environment, cwd=folder)
    return time.perf_counter() - started


def _median(runs: int, measure: Callable[[], float]) -> float:
    return sorted(measure() for _ in range(runs))[runs // 2]
