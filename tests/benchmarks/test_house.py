"""Counts of lines, arguments and circles, of sources counted by hand."""

import ast
from pathlib import Path

from benchmarks.house import ROOT, circles, functions, imports, weight

SOURCE = '''"""A module,
of two lines."""

import math  # a remark

# a comment alone
def area(r):
    """One line."""
    return (math.pi
            * r**2)


'''


def test_lines_are_counted_by_kind():
    assert weight(SOURCE) == (12, 4, 3, 1, 4)


LATE = ("refgi.vectors.",)  # whose stages import their steps late


def test_arguments_and_kernels_are_counted():
    tree = ast.parse("@kernel\ndef f(a, b, /, c, *, d): ...\n@click.option('--x')\ndef g(a): ...\n"
                     "class A:\n  def h(self): ...")
    assert list(functions(Path("m.py"), tree)) == [("m.f", 4, True), ("m.h", 1, False)]


def test_circles_are_the_sets_that_import_each_other_round():
    arrows = {"a": {"b"}, "b": {"c"}, "c": {"a", "d"}, "d": set(), "e": {"f", "a"}, "f": {"e"}}
    assert circles(arrows) == [{"a", "b", "c"}, {"e", "f"}]


def test_nothing_imports_itself_round_when_it_is_imported():
    sources = {path: ast.parse(path.read_text("utf-8")) for path in (ROOT / "refgi").rglob("*.py")}
    assert circles(imports(sources, late=False)) == []
    arrows = imports(sources, late=True)
    assert "refgi.jit" in arrows["refgi.rsm.buffers.extent"]
    round_about = {name for one in circles(arrows) for name in one}
    assert not [name for name in round_about if not name.startswith(LATE)]  # nor inside functions, nor for types
