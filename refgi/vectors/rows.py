"""Likely bugs as rows of text, each an edit of the literal form of a stage: `cause :: list :: old => new :: paper`.

Rows lie beside the file that they edit, `refgi/literal/*.bugs`. `old` stands exactly once, in one line, in the function
of a form or in those of refgi.literal that it calls, docstrings apart; several edits are joined by ` ;; `. `list` names
the rows that a stage has, by custom the function and what it needs: `pair`, `pair/glossy`. `paper` may be left out.
Empty lines and those that begin with `#` are passed over.
"""

import ast
import functools
import inspect
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib import import_module, resources
from typing import Any, NamedTuple

import numpy as np

from refgi.vectors.spec import Arrays, Bug, Run

PACKAGE = "refgi.literal"
Edits = tuple[tuple[str, str], ...]


class Row(NamedTuple):
    """A likely bug."""

    cause: str
    list: str
    edits: Edits
    paper: str


class StaleRowError(ValueError):
    """A row that does not fit the text that it edits."""


@dataclass(frozen=True)
class Form:
    """The literal form of a stage: which function, what it reads and writes."""

    function: Callable[..., Any]
    reads: Mapping[str, str | tuple[str, ...]]  # parameter: array; or several, such as those of all maps
    writes: tuple[str, ...]  # in the order in which the function returns them
    numbers: Mapping[str, Any] = field(default_factory=dict)  # its other arguments

    def run(self, function: Callable[..., Any] | None = None) -> Run:
        """Return what a stage runs: this form, or with another function in its place."""
        called = function or self.function

        def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 literal forms compute in the type of arrays
            reads = {name: arrays[array] if isinstance(array, str) else [arrays[one] for one in array]
                     for name, array in self.reads.items()}
            made = called(**reads, **self.numbers)
            return dict(zip(self.writes, made if len(self.writes) > 1 else (made,), strict=True))

        return run

    def bugs(self, *lists: str, of: str = "") -> tuple[Bug, ...]:
        """Return the likely bugs of some lists, in the order of the file; `of`: a literal module that it calls."""
        module = f"{PACKAGE}.{of}" if of else self.function.__module__
        return tuple(Bug(row.cause, _lazily(self, row), row.paper) for row in rows(module) if row.list in lists)


def _lazily(form: Form, row: Row) -> Run:
    """Return what a stage runs with a bug; the text is edited when it first runs."""
    @functools.cache
    def made() -> Run:
        return form.run(edited(form.function, row.edits, row.cause))

    def run(arrays: Arrays, real: Any) -> Arrays:
        with np.errstate(all="ignore"):  # a bug may divide by 0
            return made()(arrays, real)

    return run


@functools.cache
def rows(module: str) -> tuple[Row, ...]:
    """Return the rows beside a module of refgi.literal.

    Raises
    ------
    StaleRowError
        If a line is no row, or two of a list have one cause.
    """
    name = module.removeprefix(f"{PACKAGE}.")
    file = f"{name}.bugs"
    found: dict[tuple[str, str], Row] = {}
    for number, line in enumerate(resources.files(PACKAGE).joinpath(file).read_text("utf-8").splitlines(), 1):
        if line.strip() and not line.startswith("#"):
            row = _row(line, f"{file}:{number}")
            if found.setdefault((row.list, row.cause), row) is not row:
                raise StaleRowError(f"{file}:{number}: {row.cause!r} stands twice in the list {row.list}")
    return tuple(found.values())


def _row(line: str, where: str) -> Row:
    parts = [part.strip() for part in line.split(" :: ")]
    if len(parts) not in (3, 4):
        raise StaleRowError(f"{where}: expected cause :: list :: old => new :: paper, got {line!r}")
    edits = [tuple(side.strip() for side in edit.split("=>", 1)) for edit in parts[2].split(" ;; ")]
    if any(len(edit) != 2 or not edit[0] for edit in edits):
        raise StaleRowError(f"{where}: expected old => new, got {parts[2]!r}")
    return Row(parts[0], parts[1], tuple((edit[0], edit[1]) for edit in edits), parts[3] if len(parts) == 4 else "")


def edited(function: Callable[..., Any], edits: Edits, what: str = "edit") -> Callable[..., Any]:
    """Return a literal function with edits in its text or in that of the literal functions that it calls.

    Raises
    ------
    StaleRowError
        If an edit does not match exactly once, or leaves no program.
    """
    parts = {one: _code(one) for one in _called(function)}
    for old, new in edits:
        matches = [one for one, text in parts.items() for _ in range(text.count(old))]
        if len(matches) != 1:
            raise StaleRowError(f"{function.__module__}.{function.__name__}: {what}: expected one match of {old!r}, "
                           f"got {len(matches)}")
        parts[matches[0]] = parts[matches[0]].replace(old, new)
    return _compiled(function, parts, what)


def _compiled(
    function: Callable[..., Any], parts: Mapping[types.FunctionType, str], what: str
) -> Callable[..., Any]:
    """Return a function anew from the texts of itself and of those that it calls."""
    scope: dict[str, Any] = {}
    for one in parts:
        for name, value in one.__globals__.items():
            if scope.setdefault(name, value) is not value and name in one.__code__.co_names:
                raise StaleRowError(f"{what}: two functions that {function.__name__} runs know another {name}")
    for one, text in parts.items():
        try:
            exec(compile(text, inspect.getsourcefile(one) or "literal", "exec"), scope)
        except SyntaxError as error:
            raise StaleRowError(f"{one.__module__}.{one.__name__}: {what}: no program is left: {error}") from error
    return scope[function.__name__]  # type: ignore[no-any-return]


@functools.cache
def _called(function: Any) -> tuple[types.FunctionType, ...]:
    """Return a literal function and those of refgi.literal that it calls, each once."""
    found: dict[types.FunctionType, None] = {}

    def visit(one: types.FunctionType) -> None:
        if one not in found:
            found[one] = None
            for below in _literal_names(one):
                visit(below)

    visit(function)
    return tuple(found)


def _literal_names(function: types.FunctionType) -> Iterator[types.FunctionType]:
    """Yield the functions of refgi.literal that a function names."""
    for node in ast.walk(ast.parse(_code(function))):
        value: Any = None
        if isinstance(node, ast.Name):
            value = function.__globals__.get(node.id)
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            module = function.__globals__.get(node.value.id)
            if isinstance(module, types.ModuleType) and module.__name__.startswith(PACKAGE):
                raise StaleRowError(f"{function.__module__}: expected names of functions, "
                                    f"got {module.__name__}")
        if isinstance(value, types.FunctionType) and value.__module__.startswith(PACKAGE):
            yield value


@functools.cache
def _code(function: types.FunctionType) -> str:
    """Return the text of a function without its docstring."""
    text = inspect.getsource(function)
    node = ast.parse(text).body[0]
    assert isinstance(node, ast.FunctionDef)
    if ast.get_docstring(node) is not None:
        lines, said = text.splitlines(keepends=True), node.body[0]
        text = "".join(lines[: said.lineno - 1] + lines[said.end_lineno :])
    return text


def literal_modules() -> tuple[types.ModuleType, ...]:
    """Return the modules of refgi.literal that have rows."""
    names = sorted(file.name.removesuffix(".bugs") for file in resources.files(PACKAGE).iterdir()
                   if file.name.endswith(".bugs"))
    return tuple(import_module(f"{PACKAGE}.{name}") for name in names)
