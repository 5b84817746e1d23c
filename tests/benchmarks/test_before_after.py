"""What `python -m benchmarks before-after` says of two results."""

import pytest

from benchmarks.before_after import fronts_plot, main, ratio_table
from refgi.bench.folder import write_results
from refgi.bench.results import Figures, Result, Run, SceneResult
from tests.batch.made import MACHINE


def run(method, setting, seconds, rmse):
    figures = Figures(rmse=rmse, low=None, high=None, bias=None, spread=None, noise=None)
    return Run(method=method, changes=(setting,), settings={}, times=(seconds,), stages={}, errors={"truth": figures})


def scene(name, runs, line=()):
    return SceneResult(scene=name, width=8, height=8, covered=64, mean=1.0, truth="known", runs=tuple(runs),
                       line=tuple(line), failures={})


BEFORE = scene("box", [run("sii", "lights=1", 0.1, 0.5), run("sii", "lights=2", 0.4, 0.2),
                       run("sii", "lights=3", 0.2, 0.1), run("val", "lights=9", 1.0, 0.1)],
               [run("truth", "passes=2", 1.0, 0.3)])
AFTER = scene("box", [run("sii", "lights=1", 0.05, 0.5), run("sii", "lights=2", 0.1, 0.2),
                      run("sii", "lights=3", 0.16, 0.11), run("val", "lights=8", 0.1, 0.05)],
              [run("truth", "passes=2", 1.5, 0.3)])


def test_ratios_compare_the_same_settings_alone():
    rows = ratio_table([BEFORE], [AFTER, scene("other", AFTER.runs)]).splitlines()[2:]
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
