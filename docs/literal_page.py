"""Write docs/literal.md and docs/equations.md: `python docs/literal_page.py`.

The first has every function of refgi/literal, what it says, and the tests that know it from elsewhere, from docstrings
and from the names that tests in tests/literal use; the second every printed equation with its functions.
"""

import ast
import inspect
import re
import tomllib
from functools import cache
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import Any

import refgi.literal

PAGE, TESTS = Path(__file__).with_name("literal.md"), Path(__file__).parents[1] / "tests" / "literal"
EQUATIONS, ROWS = PAGE.with_name("equations.md"), PAGE.with_name("equations.toml")
SHOWN = 2  # tests by name
HEAD = """# The papers as plain NumPy

`refgi/literal` holds each equation once as what it says: a function a stage, arrays and named numbers in, arrays
out. Kernels, which say how it is fast, never import it; the kit's expected values are the kernels'. It is read in one
sitting, in this order, and runs in a debugger: `from refgi.literal.pairs import irradiance`. Beside each file lie the
likely bugs of its stages as rows, `cause :: list :: old => new :: paper`, each an edit of one line ([](vectors.md)).

Who would contradict it: kernels must agree with it (`tests/vectors/test_forms.py`), and functions are held by tests
that are neither a kernel nor a copy, by closed forms, printed numbers, cases counted by hand, quadrature or rays
(`tests/literal`); those that reach a function are named beside it, `-` where none does. The ports to C and GLSL
(`examples/ports`) know neither. Where it casts nothing it runs with 64 significant bits and with 50 digits as well, and
is then what the rounding of kernels is measured against ([](precision.md)).

`refgi render SCENE --size 64x48 --engine literal` makes a picture with it in place of the kernels of direct light, sums
over pixel lights, rectangles of area lights, and the blur and upsampling of levels, and says how long each took.

This page is made by `python docs/literal_page.py`.
"""

PAPERS = {"SII": "Splatting Indirect Illumination (2006)", "AMS": "Adaptive multiresolution splatting (2009)",
          "VAL": "Clustered visibility (2009)", "HSS": "Hierarchical screen-space indirect illumination (2009)"}
EQUATIONS_HEAD = """# Equations

Each equation of the four papers once: as printed, as refgi has it where that is another form ([why](errata.md)), the
lines that say it in plain NumPy, the kernel that computes it, and tests that know the lines from elsewhere
(`tests/literal`). [](literal.md) lists all functions of `refgi/literal`; steps of the papers without an equation stand
in the tables of the methods' pages. Symbols are the papers' own.

This page is made by `python docs/literal_page.py` from `docs/equations.toml`.
"""


def page() -> str:
    lines = [HEAD]
    for name in order():
        module = import_module(f"refgi.literal.{name}")
        lines += [f"## {name}", "", summary(module), "", f"`refgi/literal/{name}.py`", "",
                  "| function | what | tests |", "|---|---|---|"]
        lines += [f"| `{one.__name__}` | {summary(one)} | {some_of(tests)} |" for one, tests in functions(name)]
        lines.append("")
    return "\n".join(lines)


def equations_page() -> str:
    rows = tomllib.loads(ROWS.read_text(encoding="utf-8"))["equation"]
    lines = [EQUATIONS_HEAD]
    for short, title in PAPERS.items():
        lines += [f"## {title}", "", *(line for row in rows if row["name"].startswith(short) for line in equation(row))]
    return "\n".join(lines)


def equation(row: dict[str, Any]) -> list[str]:
    said = [f"In print, {row['what']}:", "", f"$${row['printed']}$$", "",
            *(["Here:", "", f"$${row['here']}$$", ""] if "here" in row else [])]
    tests = {test: None for one in row["literal"] for test in tests_of_function(one)}
    facts = {"kernel": ", ".join(f"`{one}`" for one in row["kernel"]), "tests": some_of(list(tests)),
             "gaps and misprints": ", ".join(f"[{one}](errata.md)" for one in row.get("errata", ()))}
    shown = [line for module, name in (one.split(".") for one in row["literal"])
             for line in ("```{literalinclude} ../refgi/literal/" + f"{module}.py", f":pyobject: {name}",
                          ":class: narrow", "```", "")]
    return [f"### {row['name']}", "", *said, *shown, *(f"- {name}: {fact}" for name, fact in facts.items() if fact), ""]


def tests_of_function(name: str) -> list[str]:
    """Return the tests that reach a literal function, by its module and name."""
    module, _, function = name.partition(".")
    return next(tests for one, tests in functions(module) if one.__name__ == function)


def some_of(tests: list[str]) -> str:
    """Return the names of the first tests and how many more there are."""
    shown = [f"`{one}`" for one in tests[:SHOWN]]
    return ", ".join([*shown, *([f"{len(tests) - SHOWN} more"] if len(tests) > SHOWN else [])]) or "-"


def order() -> list[str]:
    """Return the modules in the order of the package's docstring, which names all of them."""
    there = {file.stem for file in Path(refgi.literal.__file__).parent.glob("*.py")} - {"__init__"}
    named = [one for one in re.findall(r"`(\w+)`", refgi.literal.__doc__ or "") if one in there]
    return [*dict.fromkeys(named), *sorted(there - set(named))]


@cache
def functions(name: str) -> list[tuple[FunctionType, list[str]]]:
    """Return the functions of a module in their order, each with the tests that reach it."""
    module = import_module(f"refgi.literal.{name}")
    own = [one for one in map(inspect.unwrap, filter(callable, vars(module).values()))
           if isinstance(one, FunctionType) and one.__module__ == module.__name__]
    calls = {one.__name__: names_in(ast.parse(inspect.getsource(one))) for one in own}
    direct = {test: used for file in sorted(TESTS.glob("test_*.py")) for test, used in tests_of(file, name).items()}
    return [(one, sorted(test for test, used in direct.items() if one.__name__ in reached(used, calls)))
            for one in own]


def reached(names: set[str], calls: dict[str, set[str]]) -> set[str]:
    """Return names and what the functions of that name call in the same module."""
    found, left = set(), set(names)
    while left:
        one = left.pop()
        if one not in found:
            found.add(one)
            left |= calls.get(one, set()) & calls.keys()
    return found


def tests_of(file: Path, module: str) -> dict[str, set[str]]:
    """Return what each test of a file uses of a literal module, by the test's name."""
    tree = parsed(file)
    known = {alias.asname or alias.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)
             for alias in node.names if node.module == f"refgi.literal.{module}" or (
                 node.module == "refgi.literal" and alias.name == module)}
    defined = {node.name: names_in(node) for node in tree.body if isinstance(node, ast.FunctionDef)}
    found = {}
    for name, used in defined.items():
        if name.startswith("test") and known:
            inner = used.union(*(defined.get(one, set()) for one in reached(used, defined)))  # by its helpers too
            found[f"{file.stem}::{name}"] = inner if inner & known else set()
    return found


@cache
def parsed(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


@cache
def names_in(node: ast.AST) -> set[str]:
    """Return names and attributes that a piece of code uses."""
    return {one.id for one in ast.walk(node) if isinstance(one, ast.Name)} | {
        one.attr for one in ast.walk(node) if isinstance(one, ast.Attribute)}


def summary(thing: object) -> str:
    """Return the first line of a docstring, safe in a table."""
    return (inspect.getdoc(thing) or "").split("\n\n")[0].replace("\n", " ").replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    EQUATIONS.write_text(equations_page(), encoding="utf-8")
