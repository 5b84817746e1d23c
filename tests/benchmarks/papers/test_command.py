"""`python -m benchmarks paper`: what it refuses, what it says, its exit codes."""

import json
import re
import shlex
import sys
from pathlib import Path

import pytest

from benchmarks import __main__ as benchmarks
from benchmarks.papers.records import Bar, Entry, Figure, Paper, Ratios
from refgi.image import is_from_refgi

ROOT = Path(__file__).parents[3]


@pytest.fixture
def run(monkeypatch, capsys):
    """Return a function that runs the command and gives its exit code, stdout and stderr."""

    def once(*arguments):
        monkeypatch.setattr(sys, "argv", ["benchmarks", "paper", *(str(a) for a in arguments)])
        try:
            code = benchmarks.main()
        except SystemExit as ended:
            code = ended.code
        return code, *capsys.readouterr()

    return once


def works(bench):
    return Figure((bench.scale.name,), ratios=(Ratios("speed", (Bar("slow", 1.0, 2.5),)),))


def fails(_bench):
    raise ValueError("on purpose")


@pytest.fixture
def _two_figures(monkeypatch):
    entries = (Entry("fig1", "Figure 1", "Works", "Works.", works),
               Entry("fig2", "Figure 2", "Fails", "Fails.", fails))
    monkeypatch.setattr(Paper, "load", lambda _: entries)


@pytest.mark.slow
@pytest.mark.usefixtures("_two_figures")
def test_a_run_that_works_exits_with_0_and_says_the_ratios(run, tmp_path):
    code, out, _ = run("sii", "--only", "fig1", "--quick", "--out", tmp_path)
    assert code == 0
    assert "slow      1    2.5" in out
    assert f"open {tmp_path}/index.html" in out
    assert "quick run" in (tmp_path / "index.html").read_text()


@pytest.mark.usefixtures("_two_figures")
def test_a_figure_that_fails_leaves_the_rest_and_exits_with_1(run, tmp_path):
    code, _, err = run("sii", "--out", tmp_path)
    assert code == 1
    assert "refgi: fig2 could not be made: ValueError: on purpose" in err
    record = json.loads((tmp_path / "results.json").read_text())
    assert record["figures"]["fig1"]["ratios"][0]["bars"][0] == {"label": "slow", "here": 1.0, "paper": 2.5}
    assert record["scale"]["name"] == "full"
    assert list(record["failures"]) == ["fig2"]


@pytest.mark.slow
@pytest.mark.usefixtures("_two_figures")
@pytest.mark.parametrize(("arguments", "word"), [
    (["rsm"], "rsm"), (["sii", "--only", "fig9"], "fig9"), (["sii", "--only", ","], "none"),
    (["sii", "--threads", 0], "--threads"),
])
def test_what_is_not_there_is_refused_before_anything_is_made(run, arguments, word, tmp_path):
    code, out, err = run(*arguments, "--out", tmp_path / "new")
    assert code == 2
    assert out == ""
    assert word in err.splitlines()[-1]
    assert not (tmp_path / "new").exists()


@pytest.mark.slow
def test_a_paper_and_a_folder_are_needed(run):
    assert run("--out", "x")[0] == 2
    assert run("sii")[0] == 2


@pytest.mark.slow
def test_files_of_other_programs_are_spared(run, tmp_path):
    (tmp_path / "table1_other.png").write_text("precious")
    arguments = ["sii", "--only", "table1", "--quick", "--out"]
    for place, words in ((tmp_path, ("table1_other.png", "--force")), (tmp_path / "a" / "b", ("--parents",))):
        code, out, err = run(*arguments, place)
        assert (code, out) == (2, "")
        assert all(word in err for word in words)
    assert (tmp_path / "table1_other.png").read_text() == "precious"
    assert not (tmp_path / "a").exists()


@pytest.mark.slow
def test_the_readmes_example_runs_as_printed(run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    line, = re.findall(r"^python -m benchmarks paper (.*)$", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE)
    arguments = shlex.split(line, comments=True)
    assert run(*arguments, "--quick")[0] == 0
    files = list(Path(arguments[arguments.index("--out") + 1]).iterdir())
    assert files
    assert all(map(is_from_refgi, files))
