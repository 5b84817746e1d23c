"""A bench's files: the schema, tables that say what the JSON says, and the page."""

import csv
import io
import json
import math
from pathlib import Path

import pytest

import refgi.bench
from refgi.bench.folder import rows_of, write_results
from refgi.bench.report import said_of, write_page
from refgi.bench.results import Figures, Result, Run, SceneResult, schema_text
from refgi.image import is_from_refgi

FIGURES = Figures(rmse=0.5, low=0.4, high=0.6, bias=0.3, spread=0.4, noise=0.01)


def run(method, lights, seconds, rmse, in_equal_time=None, front=False):
    errors = {"truth": FIGURES.model_copy(update={"rmse": rmse})}
    return Run(method=method, changes=(f"lights={lights}",), settings={"lights": lights}, in_equal_time=in_equal_time,
               times=(3 * seconds, seconds, 0.5 * seconds), stages={"a": seconds}, errors=errors, front=front)


SCENE = SceneResult(
    scene="box <1>", width=8, height=6, covered=40, mean=2.0, truth="+-1 %", failures={"val: broken": "no & way"},
    runs=(run("sii", 16, 0.01, 0.5, front=True), run("sii", 64, 0.04, 0.3, 0.9), run("val", 16, 0.1, 0.4, 2.0),
          run("vpl", 16, 0.02, 0.45), run("vpl", 64, 0.2, 0.2, 1.5)),
    line=(run("truth", 1, 0.05, 0.25), run("truth", 2, 0.1, 0.2)))
RESULT = Result(environment={"versions": {"refgi": "1"}, "platform": "p", "cpu": "c", "threads": 2}, scenes=(SCENE,))


def test_the_repository_holds_the_schema():
    held = Path(refgi.bench.__file__).parent / "files" / "results.schema.json"
    assert json.loads(held.read_text()) == json.loads(schema_text())


def test_files_say_the_same(tmp_path):
    write_results(RESULT, tmp_path)
    assert Result.model_validate_json((tmp_path / "results.json").read_text()) == RESULT
    rows = list(csv.DictReader(io.StringIO((tmp_path / "results.csv").read_text())))
    assert len(rows) == len(list(rows_of(RESULT))) == 7
    assert (rows[1]["method"], float(rows[1]["seconds"]), float(rows[1]["rmse"])) == ("sii", 0.04, 0.3)
    assert rows[0]["against_truth_in_equal_time"] == ""
    text = (tmp_path / "results.md").read_text()
    times = [float(line.split("|")[3]) for line in text.splitlines() if line.startswith("| ") and "ms" not in line]
    assert times == sorted(times)
    assert len(times) == 7
    assert "val: broken gave no picture: no & way" in text


def test_tables_are_known_by_their_mark_and_no_others(tmp_path):
    write_results(RESULT, tmp_path)
    write_page(RESULT, tmp_path)
    assert all(map(is_from_refgi, tmp_path.iterdir()))
    for name, text in (("results.md", "# Notes on refgi\n"), ("results.md", "<!-- refgi is slow\n"),
                       ("results.csv", "mine,refgi\n1,2\n"), ("results.csv", "run of refgi\n"), ("results.md", "")):
        (tmp_path / name).write_text(text)
        assert not is_from_refgi(tmp_path / name), text


def test_the_median_is_the_middle_one():
    assert run("sii", 1, 1.0, 0.1).seconds == 1.0
    assert run("sii", 1, 1.0, 0.1).model_copy(update={"times": (1.0, 4.0)}).seconds == 2.5
    assert math.isnan(run("sii", 1, 1.0, None).rmse)


def test_what_the_curves_say():
    said = list(said_of(SCENE))
    assert [one.split()[0] for one in said] == ["vpl", "sii", "val"]
    assert said[0].endswith("from 20 ms on the path tracer is nearer in equal time.")
    assert said[1].endswith("no setting of it is beaten by the path tracer in equal time.")
    assert said[2].endswith("the path tracer is nearer in the time of each of its settings.")
    early = list(said_of(SCENE.model_copy(update={"runs": (run("sii", 16, 0.01, 0.5), run("sii", 64, 0.04, 0.3))})))
    assert early[0].endswith("each of its settings is done before the path tracer's first picture.")
    assert [one[-1] for one in said_of(SCENE.model_copy(update={"line": ()}))] == ["."] * 3


def test_nothing_known_is_no_number(tmp_path):
    unknown = Figures(rmse=None, low=None, high=None, bias=None, spread=None, noise=None)
    runs = (SCENE.runs[0].model_copy(update={"errors": {"truth": unknown}}),)
    result = RESULT.model_copy(update={"scenes": (SCENE.model_copy(update={"runs": runs, "line": ()}),)})
    write_results(result, tmp_path)
    write_page(result, tmp_path)
    assert "nan" not in (tmp_path / "results.md").read_text().lower()
    assert Result.model_validate_json((tmp_path / "results.json").read_text()) == result


@pytest.mark.parametrize("text", ['{"scenes": []}', '{"environment": {}, "scenes": [], "more": 1}'])
def test_what_the_schema_does_not_say_is_refused(text):
    with pytest.raises(ValueError, match="validation error"):
        Result.model_validate_json(text)
