"""`refgi bench`: what it refuses, what it says, its exit codes."""

import json

import pytest
from click.testing import CliRunner

from refgi.cli.group import VerbGroup
from refgi.papers.catalogue import Entry, Paper
from refgi.papers.records import Bar, Figure, Ratios


def run(*arguments):
    return CliRunner().invoke(VerbGroup.refgi(), ["bench", *(str(a) for a in arguments)])


def works(bench):
    return Figure("Works.", (bench.scale.name,), ratios=(Ratios("speed", (Bar("slow", 1.0, 2.5),)),))


def fails(_bench):
    raise ValueError("on purpose")


@pytest.fixture(autouse=True)
def _two_figures(monkeypatch):
    entries = (Entry("fig1", "Figure 1", "Works", works), Entry("fig2", "Figure 2", "Fails", fails))
    monkeypatch.setattr(Paper, "load", lambda _: entries)


def test_a_run_that_works_exits_with_0_and_says_the_ratios(tmp_path):
    result = run("--paper", "sii", "--only", "fig1", "--quick", "--out", tmp_path)
    assert result.exit_code == 0
    assert "slow      1    2.5" in result.stdout
    assert f"open {tmp_path}/index.html" in result.stdout
    assert "quick run" in (tmp_path / "index.html").read_text()


def test_a_figure_that_fails_leaves_the_rest_and_exits_with_1(tmp_path):
    result = run("--paper", "sii", "--out", tmp_path, "--json")
    assert result.exit_code == 1
    assert "refgi: fig2 could not be made: ValueError: on purpose" in result.stderr
    told = json.loads(result.stdout)
    assert told["figures"]["fig1"]["ratios"][0]["bars"][0] == {"label": "slow", "here": 1.0, "paper": 2.5}
    assert told["scale"]["name"] == "full"
    assert json.loads((tmp_path / "results.json").read_text())["failures"] == told["failures"]


@pytest.mark.parametrize(("arguments", "word"), [
    (["--paper", "rsm"], "rsm"), (["--paper", "sii", "--only", "fig9"], "fig9"),
    (["--paper", "sii", "--only", ","], "none"),
])
def test_what_is_not_there_is_refused_before_anything_is_made(arguments, word, tmp_path):
    result = run(*arguments, "--out", tmp_path / "new")
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1
    assert word in result.stderr
    assert not (tmp_path / "new").exists()


def test_a_paper_and_a_folder_are_needed():
    assert run("--out", "x").exit_code == 2
    assert run("--paper", "sii").exit_code == 2
