"""`refgi stress`: files, what is said, exit codes."""

import json
import shlex

import pytest
from click.testing import CliRunner

import refgi.methods
from refgi.cli.group import VerbGroup
from refgi.stress.promises import read_rows
from tests.cli.command import runner

ONE = ("--methods", "hssil", "--change", "flux x 2^27", "--size", "16x12")
run = runner("stress")


def test_files_and_table(tmp_path):
    done = run("cornell_box", *ONE, "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == ["index.html", "stability.json"]
    assert "| flux x 2^27 | hssil | cornell_box |" in done.stdout
    assert "All 2 promises are kept on this scene." in done.stdout
    rows = read_rows(tmp_path / "out" / "stability.json").rows
    assert [row.subject for row in rows] == ["visible surfaces", "hssil"]
    assert rows[1].reproduce == ("refgi stress cornell_box --methods hssil --change 'flux x 2^27' --size 16x12 "
                                 "--out out")
    page = (tmp_path / "out" / "index.html").read_text()
    assert "data:image/png;base64," in page
    assert "http" not in page.replace("http://www.w3.org", "")


def test_json_says_what_is_not_asked(tmp_path):
    done = run("cornell_box", "--methods", "hssil", "--change", "cropped", "--size", "16x12", "--json", "--out",
               tmp_path / "out")
    content = json.loads(done.stdout)
    assert content["rows"] == []
    assert content["silent"] == [{"method": "hssil", "change": "cropped",
                                  "why": "it looks at the picture around a pixel"}]


def test_a_broken_promise_is_an_exit_code(tmp_path, monkeypatch):
    render = refgi.methods.render

    def rendered(*arguments, **options):
        made = render(*arguments, **options)
        return made._replace(irradiance=made.irradiance + made.irradiance.dtype.type(1e-3))

    monkeypatch.setattr(refgi.methods, "render", rendered)
    done = run("cornell_box", *ONE, "--out", tmp_path / "out")
    assert done.exit_code == 1
    assert "broken: hssil, flux x 2^27: 192 pixels, limit 0" in done.stderr
    assert "1 of 2 promises is broken on this scene." in done.stdout
    assert 'class="failure"' in (tmp_path / "out" / "index.html").read_text()


@pytest.mark.parametrize("wrong", [("--change", "melted"), ("--methods", "radiosity"), ("--size", "0x4")])
def test_wrong_options_write_nothing(tmp_path, wrong):
    done = run("cornell_box", *wrong, "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert not (tmp_path / "out").exists()


def test_what_is_seen_is_part_of_the_line_that_does_it_again(tmp_path):
    seen = ("--eye", "0.278,0.273,-0.7", "--vfov-deg", "45", "--light", "point:position=0.2,0.4,0.2:intensity=1")
    done = run("cornell_box", *ONE, *seen, "--out", tmp_path / "out")
    assert done.exit_code == 0, done.output
    line = read_rows(tmp_path / "out" / "stability.json").rows[1].reproduce
    words = shlex.split(line)
    again = CliRunner().invoke(VerbGroup.refgi(), [*words[1:-1], str(tmp_path / "again")])
    assert again.exit_code == 0, again.output
    rows = [read_rows(tmp_path / name / "stability.json").rows[1] for name in ("out", "again")]
    assert rows[0].model_copy(update={"seconds": 0}) == rows[1].model_copy(update={"seconds": 0})
    assert "--light=point:position=0.2,0.4,0.2:intensity=1" in words


def test_what_does_not_fit_is_refused_first(tmp_path):
    done = run("cornell_box", "--size", "30000x30000", "--out", tmp_path / "out")
    assert done.exit_code == 2
    assert "memory" in done.stderr
    assert not (tmp_path / "out").exists()
