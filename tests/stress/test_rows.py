"""Rows of promises as data and table."""

import json
import math
from pathlib import Path

import pytest

import refgi.stress
from refgi.stress.promises import Row, Stability, markdown, over_scenes, read_rows, schema_text, strain, write_rows


def row(figure=1.0, limit=2.0, **other):
    known = {"part": "pictures", "property": "moved", "subject": "sii", "scene": "box", "domain": "16 x 12",
             "unit": "ULP", "kind": "derived", "source": "a | b", "cases": 10, "reproduce": "refgi stress box"}
    return Row(figure=figure, limit=limit, **{**known, **other})


def test_what_passes():
    assert row().passed
    assert row(2.0).passed
    assert not row(2.1).passed
    assert not row(math.nan).passed
    assert not row(0.1, 0.0).passed
    assert row(0.0, 0.0).passed


def test_strain():
    assert strain(row(1.0)) == 0.5
    assert strain(row(math.nan)) == strain(row(1.0, 0.0)) == math.inf
    assert strain(row(0.0, 0.0)) == 0


def test_there_and_back(tmp_path: Path):
    kept = Stability(environment={"threads": 2}, rows=(row(), row(math.inf), row(1.0, math.inf)))
    write_rows(kept, tmp_path / "stability.json")
    text = (tmp_path / "stability.json").read_text()
    assert "Infinity" not in text
    assert "NaN" not in text
    back = read_rows(tmp_path / "stability.json")
    assert back.rows[0] == kept.rows[0]
    assert [one.passed for one in back.rows] == [True, False, True]
    assert [one.figure for one in back.failed] == [pytest.approx(math.nan, nan_ok=True)]


def test_the_table_says_what_failed():
    text = markdown([row(), row(3.0)])
    assert text.count("\n") == 4
    assert "| 1 ULP | 2 | derived: a \\| b | 10 |" in text
    assert "**FAIL** 3 ULP" in text


def test_scenes_of_one_promise_are_joined():
    joined = list(over_scenes([row(), row(1.5, scene="hall"), row(0.1, scene="ring"), row(subject="val")]))
    assert [(one.subject, one.figure, one.scene, one.cases) for one in joined] == [
        ("sii", 1.5, "3 scenes; worst hall", 30), ("val", 1.0, "box", 10)]


def test_the_schema_is_that_of_the_code():
    text = (Path(refgi.stress.__file__).parent / "files" / "stability.schema.json").read_text()
    assert text == schema_text()
    assert "figure" in json.loads(text)["$defs"]["Row"]["properties"]
