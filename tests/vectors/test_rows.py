"""Likely bugs as rows: each fits the literal text that it edits, and what is no row is refused."""

import ast
import dataclasses
import importlib
import inspect
from pathlib import Path

import numpy as np
import pytest

from refgi import literal
from refgi.literal import pairs
from refgi.vectors import rows
from refgi.vectors.forms import lights as forms
from refgi.vectors.spec import outputs_of
from tests.vectors.made import made, stage_of

MODULES = tuple(importlib.import_module(f"refgi.literal.{file.stem}")
                for file in sorted(Path(literal.__file__).parent.glob("*.bugs")))
KNOWN = ("numpy", "functools", "math", "typing", "collections.abc", "itertools")


@pytest.mark.parametrize("module", MODULES, ids=lambda one: one.__name__.rpartition(".")[2])
def test_each_row_edits_one_place_of_some_function(module):
    functions = [one for _, one in inspect.getmembers(module, inspect.isfunction) if one.__module__ == module.__name__]
    stale = [row.cause for row in rows.rows(module.__name__) if not any(fits(one, row) for one in functions)]
    assert not stale


def fits(function, row):
    """Return whether an edit matches once and leaves a program."""
    try:
        return rows.edited(function, row.edits) is not None
    except rows.StaleEditError:
        return False


@pytest.mark.parametrize("module", MODULES, ids=lambda one: one.__name__.rpartition(".")[2])
def test_literal_text_imports_numpy_alone(module):
    for node in ast.walk(ast.parse(inspect.getsource(module))):
        names = [node.module] if isinstance(node, ast.ImportFrom) else [
            one.name for one in node.names] if isinstance(node, ast.Import) else []
        assert all(name in KNOWN or name.startswith("refgi.literal") for name in names), names


def test_an_edit_changes_the_function_alone_that_it_is_asked_of():
    w, m = np.array([[0.0], [0.0], [1.0]]), np.array([[0.0], [0.0], [1.0]])
    doubled = rows.edited(pairs.lobe_intensity, (("(exponent + 1) / (2 * np.pi) /", "(exponent + 1) / np.pi /"),))
    right = pairs.lobe_intensity(w, m, m, np.array([7.0]))
    assert right == pytest.approx(8 / (2 * np.pi))  # a lobe along the normal lies above the surface as a whole
    assert doubled(w, m, m, np.array([7.0])) == pytest.approx(2 * right)
    assert pairs.lobe_intensity(w, m, m, np.array([7.0])) == pytest.approx(right)


@pytest.mark.parametrize("wrong", [(("no such text", "0"),), (("np", "0"),), (("r = np.sqrt(", "r = = np.sqrt("),)])
def test_an_edit_that_does_not_fit_once_or_leaves_no_program_is_refused(wrong):
    with pytest.raises(rows.StaleEditError, match=r"refgi\.literal\.pairs\.pair"):
        rows.edited(pairs.pair, wrong)


def test_text_that_stands_twice_in_one_function_is_not_edited():
    with pytest.raises(rows.StaleEditError, match="got 2"):
        rows.edited(pairs.lobe_share, (("(high - low)", "1"),))


def test_a_stage_has_the_rows_of_the_lists_that_it_names_alone():
    form = rows.Form(pairs.irradiance, {}, ("sum",))
    known = rows.rows("refgi.literal.pairs")
    assert [bug.cause for bug in form.bugs("pair", "irradiance")] == [
        row.cause for row in known if row.list in ("pair", "irradiance")]
    assert len(form.bugs("pair")) < sum(row.list.startswith("pair") for row in known)


def test_a_form_hands_on_what_its_fields_say():
    form = rows.Form(lambda one, several, none, scale: (scale * one, several[1], none is None), {
        "one": "a", "several": ("a", "b"), "none": None}, ("x", "y", "z"), {"scale": 3.0}, kept={"w": "b"})
    arrays = {"a": np.full(2, 0.1, np.float32), "b": np.arange(2)}
    made = form(arrays, np.float32)
    assert made["x"] == pytest.approx(0.3)
    assert made["x"].dtype == np.float32
    assert made["z"] is True
    assert (made["y"] is arrays["b"], made["w"] is arrays["b"]) == (True, True)
    double = dataclasses.replace(form, double=True, adapt={"one": np.negative})(arrays, np.float32)
    assert double["x"].dtype == np.float64
    assert double["x"] == pytest.approx(-0.3)
    assert double["y"].dtype == arrays["b"].dtype


@pytest.mark.parametrize("line", ["a cause :: pair", "a cause :: pair :: no arrow", "a cause :: pair :: => new"])
def test_a_line_that_is_no_row_is_refused(line, monkeypatch):
    monkeypatch.setattr(rows.resources, "files", lambda _: Text(line))
    rows.rows.cache_clear()
    try:
        with pytest.raises(rows.StaleEditError, match=r"pairs\.bugs:1: expected"):
            rows.rows("refgi.literal.pairs")
    finally:
        rows.rows.cache_clear()


class Text:
    def __init__(self, line):
        self.line = line

    def joinpath(self, _):
        return self

    def read_text(self, _):
        return self.line


@pytest.mark.parametrize(("kind", "opened", "wrong"), [
    ("peak", 0.0, {"exponent P, as printed": 1 + 7.0}),
    ("openness", 0.25, {"exponent P, as printed": 0.75 * 8, "O in place of 1 - O": 0.25 * 5, "no floor": 0.75 * 5}),
    ("openness", 1.0, {"exponent P, as printed": 0.05 * 8, "O in place of 1 - O": 5.0, "no floor": 0.0})])
def test_misprints_of_importance_are_rows_of_its_kinds(kind, opened, wrong):
    """A texel of flux 1 and a lobe of flux 1 and P = 7, whose peak is (P + 1) / 2 = 4 times a diffuse light's."""
    arrays = {"flux": np.ones((3, 1, 1)), "lobe_flux": np.ones((3, 1, 1)), "lobe_exponent": np.full((1, 1), 7.0),
              "openness": np.full((1, 1), opened) if kind == "openness" else None}
    described = forms.FORMS["lights.importance"](
        {**arrays, "kind": kind, "floor": 0.05, "defensive": 0.0, "as_printed": False})
    known = {name: one for name, one in arrays.items() if one is not None}
    right = 5 * (max(0.05, 1 - opened) if kind == "openness" else 1)
    assert described.form(known, float)[""] == pytest.approx(right)
    wrongly = {bug.cause: bug.run(known, float)[""] for _, one in described.lists for bug in described.form.bugs(one)}
    assert len(wrongly) == len(wrong)
    for said, expected in wrong.items():
        (got,) = [value for cause, value in wrongly.items() if said in cause]
        assert got == pytest.approx(expected), said


@pytest.mark.parametrize("stage", ["rsm.reflected_flux0", "pairs.sum", "lights.warp0"])
def test_what_rows_share_changes_none_of_them(stage):
    """All rows of a stage, whatever their literal functions share: to the bit what each makes by itself."""
    known, step = made("sii-warp-a")[1], stage_of("sii-warp-a", stage)
    runs = {bug.cause: bug.run for bug in step.bugs}
    alone = {cause: outputs_of(step, known, np.float64, run) for cause, run in runs.items()}
    with rows.sharing():
        for cause, run in [*runs.items(), *reversed(runs.items())]:
            for name, array in outputs_of(step, known, np.float64, run).items():
                np.testing.assert_array_equal(array, alone[cause][name], err_msg=f"{cause}: {name}")


def test_shared_are_copies_of_equal_arguments_results_alone():
    calls = []

    def total(values, factor=1, how=None):
        calls.append((factor, how))
        return values * factor, [values.sum()]

    shared, values = rows._shared(total), np.arange(6.0).reshape(2, 3)
    shared(values)
    shared(values)
    assert len(calls) == 2  # outside of `sharing`
    with rows.sharing():
        first, rest = shared(values)
        first += 1
        rest.clear()
        again, rest = shared(values.copy())
        again += 1
        assert len(calls) == 3
        np.testing.assert_array_equal(shared(values)[0], values)
        assert rest == [15.0]
        others = (values + 1, values.astype(np.float32), values.T, np.asfortranarray(values), values.reshape(3, 2))
        for count, other in enumerate(others, 4):
            np.testing.assert_array_equal(shared(other)[0], other)
            assert len(calls) == count
        for count, other in enumerate(({"factor": 2}, {"factor": 2.0}, {"how": "2"}, {"how": object()}), 9):
            shared(values, **other)
            assert len(calls) == count
        shared(values, how=object())  # of no known kind
        assert len(calls) == 13
    with rows.sharing():
        shared(values)
        assert len(calls) == 14


def test_no_more_is_shared_than_there_is_room_for(monkeypatch):
    calls = []

    def doubled(values):
        calls.append(values[0])
        return 2 * values

    monkeypatch.setattr(rows._Results, "room", 100)  # bytes: of two arrays of 40 of argument and result, one
    shared = rows._shared(doubled)
    with rows.sharing():
        for first in (1.0, 2.0, 1.0, 2.0, 2.0):
            np.testing.assert_array_equal(shared(np.full(5, first)), np.full(5, 2 * first))
    assert calls == [1.0, 2.0, 2.0, 2.0]
