"""What `python -m benchmarks accuracy` writes, and what the repository holds of it."""

import math
from collections import Counter
from pathlib import Path

import pytest

from benchmarks.accuracy import BUILT_IN, LEVELS, REAL, cheapest_table, error_of, nearest_table
from refgi.bench.folder import read_result
from refgi.bench.results import Figures, Run

ROOT = Path(__file__).parents[2]
HELD = ROOT / "benchmarks" / "results"


@pytest.fixture(scope="module")
def held():
    return read_result(HELD / "results.json")


def run(method, seconds, rmse, noise=0.0):
    figures = Figures(rmse=rmse, low=None, high=None, bias=None, spread=None, noise=noise)
    return Run(method=method, changes=(f"n={seconds:g}",), settings={}, times=(seconds,), stages={},
               errors={"truth": figures})


@pytest.mark.slow
def test_the_truth_s_noise_is_taken_out():
    assert error_of(run("sii", 1, 0.5, 0.3)) == pytest.approx(0.4)
    assert error_of(run("sii", 1, 0.2, 0.3)) == 0
    assert error_of(run("sii", 1, None)) == math.inf


def test_the_cheapest_meets_the_error_in_the_least_time(held):
    runs = (run("sii", 0.1, 0.2), run("sii", 0.2, 0.09), run("val", 0.15, 0.08), run("val", 9, 0.001))
    scene = held.scenes[0].model_copy(update={"scene": "made", "runs": runs, "line": (run("truth", 0.12, 0.025),)})
    rows = cheapest_table([scene]).splitlines()[2:]
    assert [row.split(" | ")[2].split(":")[0] for row in rows] == ["sii, n=0.1"] + ["path tracer, n=0.12"] * 2 + [
        "val, n=9"]
    assert [row.split(" | ")[3].split(":")[0] for row in rows] == ["sii, n=0.1", "val, n=0.15", "val, n=9", "val, n=9"]
    assert nearest_table([scene]).splitlines()[2] == "| made | 9 % in 200 ms | 0.1 % in 9000 ms |"


@pytest.mark.slow
def test_what_the_path_tracer_has_not_come_to_is_told_by_the_root_of_time(held):
    scene = held.scenes[0].model_copy(update={"scene": "made", "runs": (run("sii", 0.1, 0.4),), "line": (
        run("truth", 0.1, 0.2), run("truth", 2.0, math.hypot(0.06, 0.01), 0.01))})
    rows = cheapest_table([scene]).splitlines()[2:]
    assert [row.split(" | ")[2] for row in rows] == [
        "path tracer, n=0.1: 100 ms", "path tracer, n=2: 2000 ms", "path tracer, some 8 s", "path tracer, some 72 s"]
    assert [row.split(" | ")[3] for row in rows] == ["- |"] * 4


def test_the_tables_are_those_of_the_results(held):
    assert (HELD / "cheapest.md").read_text() == cheapest_table(held.scenes)
    assert (HELD / "nearest.md").read_text() == nearest_table(held.scenes)
    assert len(cheapest_table(held.scenes).splitlines()) == 2 + len((*BUILT_IN, *REAL)) * len(LEVELS)


@pytest.mark.slow
def test_each_curve_has_ten_settings_and_its_knee_is_split(held):
    assert [scene.scene for scene in held.scenes] == [*BUILT_IN, *REAL]
    for scene in held.scenes:
        counts = Counter(one.method for one in scene.runs)
        assert min(counts.values()) >= 10, scene.scene
        assert {split.method for split in scene.splits if split.knee} == set(counts), scene.scene
        assert set(scene.cold) == set(counts)
        for split in scene.splits:
            assert sum(part.share for part in split.parts) == pytest.approx(1, abs=1e-6)
            assert sum(part.mean for part in split.parts) == pytest.approx(split.mean, abs=1e-9)
        assert (HELD / "plots" / f"{scene.scene}.svg").is_file()
        assert (HELD / "plots" / f"{scene.scene}_split.svg").is_file()
