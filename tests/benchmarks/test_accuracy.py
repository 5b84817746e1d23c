"""What `python -m benchmarks accuracy` writes and the repository holds of it; two results against each other."""

import math
from collections import Counter
from pathlib import Path

import pytest

from benchmarks.accuracy import BUILT_IN, LEVELS, REAL, cheapest_table, error_of, nearest_table
from benchmarks.before_after import fronts_plot, main, ratio_table
from refgi.bench.folder import read_result, write_results
from refgi.bench.results import Figures, Result, Run, SceneResult
from tests.batch.made import MACHINE

ROOT = Path(__file__).parents[2]
HELD = ROOT / "benchmarks" / "results"


@pytest.fixture(scope="module")
def held():
    return read_result(HELD / "results.json")


def run(method, seconds, rmse, noise=0.0, setting=None):
    figures = Figures(rmse=rmse, low=None, high=None, bias=None, spread=None, noise=noise)
    return Run(method=method, changes=(setting or f"n={seconds:g}",), settings={}, times=(seconds,), stages={},
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


def scene_of(name, runs, line=()):
    return SceneResult(scene=name, width=8, height=8, covered=64, mean=1.0, truth="known", runs=tuple(runs),
                       line=tuple(line), failures={})


BEFORE = scene_of("box", [run("sii", 0.1, 0.5, setting="lights=1"), run("sii", 0.4, 0.2, setting="lights=2"),
                          run("sii", 0.2, 0.1, setting="lights=3"), run("val", 1.0, 0.1, setting="lights=9")],
                  [run("truth", 1.0, 0.3, setting="passes=2")])
AFTER = scene_of("box", [run("sii", 0.05, 0.5, setting="lights=1"), run("sii", 0.1, 0.2, setting="lights=2"),
                         run("sii", 0.16, 0.11, setting="lights=3"), run("val", 0.1, 0.05, setting="lights=8")],
                 [run("truth", 1.5, 0.3, setting="passes=2")])


def test_ratios_compare_the_same_settings_alone():
    rows = ratio_table([BEFORE], [AFTER, scene_of("other", AFTER.runs)]).splitlines()[2:]
    assert rows == ["| box | sii | 3 | 0.50 | 0.25 to 0.80 | 10 % |",
                    "| box | path tracer | 1 | 1.50 | 1.50 to 1.50 | 0 % |"]


@pytest.mark.slow
def test_the_plot_has_both_fronts_and_the_path_tracer():
    svg = fronts_plot(BEFORE, AFTER)
    assert all(f">{name}<" in svg for name in ("before", "after", "path tracer"))


@pytest.mark.slow
def test_folders_of_scenes_are_read_and_drawn(tmp_path):
    for name, found in (("before", BEFORE), ("after", AFTER)):
        folder = tmp_path / name / "box"
        folder.mkdir(parents=True)
        write_results(Result(environment=MACHINE, scenes=(found,)), folder)
    assert main([str(tmp_path / "before"), str(tmp_path / "after"), "--out", str(tmp_path / "out")]) == 0
    assert (tmp_path / "out" / "ratios.md").read_text().count("| box |") == 2
    assert (tmp_path / "out" / "box.svg").read_text().startswith("<svg")
