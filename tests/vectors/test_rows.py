"""Likely bugs as rows: each fits the literal text that it edits, and what is no row is refused."""

import ast
import inspect

import numpy as np
import pytest

from refgi.literal import pairs
from refgi.vectors import edits, rows

MODULES = rows.literal_modules()
KNOWN = ("numpy", "functools", "math", "typing", "collections.abc", "itertools")


@pytest.mark.parametrize("module", MODULES, ids=lambda one: one.__name__.rpartition(".")[2])
def test_each_row_edits_one_place_of_some_function(module):
    functions = [one for _, one in inspect.getmembers(module, inspect.isfunction) if one.__module__ == module.__name__]
    stale = [row.cause for row in rows.rows(module.__name__) if not any(fits(one, row) for one in functions)]
    assert not stale


def fits(function, row):
    """Return whether an edit matches once and leaves a program."""
    try:
        return edits.edited(function, row.edits) is not None
    except edits.StaleEditError:
        return False


@pytest.mark.parametrize("module", MODULES, ids=lambda one: one.__name__.rpartition(".")[2])
def test_literal_text_imports_numpy_alone(module):
    for node in ast.walk(ast.parse(inspect.getsource(module))):
        names = [node.module] if isinstance(node, ast.ImportFrom) else [
            one.name for one in node.names] if isinstance(node, ast.Import) else []
        assert all(name in KNOWN or name.startswith("refgi.literal") for name in names), names


def test_an_edit_changes_the_function_alone_that_it_is_asked_of():
    w, m = np.array([[0.0], [0.0], [1.0]]), np.array([[0.0], [0.0], [1.0]])
    doubled = edits.edited(pairs.lobe_intensity, (("(exponent + 1) / (2 * np.pi) /", "(exponent + 1) / np.pi /"),))
    right = pairs.lobe_intensity(w, m, m, np.array([7.0]))
    assert right == pytest.approx(8 / (2 * np.pi))  # a lobe along the normal lies above the surface as a whole
    assert doubled(w, m, m, np.array([7.0])) == pytest.approx(2 * right)
    assert pairs.lobe_intensity(w, m, m, np.array([7.0])) == pytest.approx(right)


@pytest.mark.parametrize("wrong", [(("no such text", "0"),), (("np", "0"),), (("r = np.sqrt(", "r = = np.sqrt("),)])
def test_an_edit_that_does_not_fit_once_or_leaves_no_program_is_refused(wrong):
    with pytest.raises(edits.StaleEditError, match=r"refgi\.literal\.pairs\.pair"):
        edits.edited(pairs.pair, wrong)


@pytest.mark.parametrize("line", ["a cause :: pair", "a cause :: pair :: no arrow", "a cause :: pair :: => new"])
def test_a_line_that_is_no_row_is_refused(line, monkeypatch):
    monkeypatch.setattr(rows.resources, "files", lambda _: Text(line))
    rows.rows.cache_clear()
    try:
        with pytest.raises(edits.StaleEditError, match=r"pairs\.bugs:1: expected"):
            rows.rows("refgi.literal.pairs")
    finally:
        rows.rows.cache_clear()


class Text:
    """A file with one line."""

    def __init__(self, line):
        self.line = line

    def joinpath(self, _):
        return self

    def read_text(self, _):
        return self.line
