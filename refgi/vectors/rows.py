"""Likely bugs as rows of text, each an edit of the literal form of a stage: `cause :: list :: old => new :: paper`.

Edits are one language for likely bugs (`rows`), the search for causes (`search`) and the faults that benchmarks put
into ports and into refgi itself.

Rows lie beside the file that they edit, `refgi/literal/*.bugs`. `old` stands exactly once, in one line, in the function
of a form or in those of refgi.literal that it calls, docstrings apart; several edits are joined by ` ;; `. `list` names
the rows that a stage has, by custom the function and what it needs: `pair`, `pair/glossy`. `paper` may be left out.
Empty lines and those that begin with `#` are passed over. `new` may name `arrays`, all that the stage reads, for bugs
that take a wrong one.
"""

import ast
import dataclasses
import functools
import inspect
import types
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from importlib import resources
from typing import Any, NamedTuple

import numpy as np

from refgi.types import Array
from refgi.vectors.spec import Arrays, Bug, Run

PACKAGE = "refgi.literal"
Edits = tuple[tuple[str, str], ...]
Function = types.FunctionType


class StaleEditError(ValueError):
    """An edit that does not fit the text."""


def replaced(text: str, old: str, new: str, what: str = "edit") -> str:
    """Return a text with one edit; StaleEditError if `old` does not stand in it exactly once."""
    if text.count(old) != 1:
        raise StaleEditError(f"{what}: expected one match of {old!r}, got {text.count(old)}")
    return text.replace(old, new)


@functools.cache
def edited(function: Callable[..., Any], edits: Edits, what: str = "edit") -> Callable[..., Any]:
    """Return a literal function with edits in its text or in that of the literal functions that it calls.

    StaleEditError if an edit does not match exactly once, or leaves no program.
    """
    parts = {one: code_of(one) for one in called_by(function)}
    for old, new in edits:
        matches = [one for one, text in parts.items() if old in text] or [called_by(function)[0]]
        if len(matches) > 1:
            raise StaleEditError(f"{_name(function)}: {what}: {old!r} stands in {', '.join(map(_name, matches))}")
        parts[matches[0]] = replaced(parts[matches[0]], old, new, f"{_name(function)}: {what}")
    return compiled(function, parts, what)


def compiled(
    function: Callable[..., Any], parts: Mapping[Function, str | ast.Module], what: str = "edit"
) -> Callable[..., Any]:
    """Return a function anew from the texts, or trees, of itself and of those that it calls.

    StaleEditError if one is no program.
    """
    scope: dict[str, Any] = {}
    for one in parts:
        for name, value in one.__globals__.items():
            if scope.setdefault(name, value) is not value and name in one.__code__.co_names:
                raise StaleEditError(f"{what}: two functions that {_name(function)} runs know another {name}")
    reached = _reached(called_by(function)[0], parts)
    scope |= {one.__name__: _shared(one) for one in parts if one not in reached and scope.get(one.__name__) is one}
    for one, text in reached.items():
        program = _known_program if isinstance(text, str) else _program
        try:
            exec(program(text, one.__code__.co_filename), scope)
        except SyntaxError as error:
            raise StaleEditError(f"{_name(one)}: {what}: no program is left: {error}") from error
    return scope[function.__name__]  # type: ignore[no-any-return]


def _program(text: str | ast.Module, file: str) -> types.CodeType:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)  # of a change, such as a number that is called
        return compile(text, file, "exec")


_known_program = functools.cache(_program)


def _reached(function: Function, parts: Mapping[Function, str | ast.Module]) -> dict[Function, str | ast.Module]:
    """Return the texts of a function, of those that differ, and of functions that call those; others keep caches."""
    reached = {one for one, text in parts.items() if text != code_of(one)} | {function}
    while above := {one for one in parts if one not in reached and not reached.isdisjoint(_literal_names(one))}:
        reached |= above
    return {one: text for one, text in parts.items() if one in reached}


MOST_SHARED = 1 << 29  # bytes of arguments and results: a picture for each of many triangles would fill any memory


class _Results(dict[Any, Any]):
    room = MOST_SHARED  # bytes that are left


_results: ContextVar[_Results | None] = ContextVar("refgi_literal_results", default=None)


@contextmanager
def sharing() -> Iterator[None]:
    """Let edited functions inside the block share what unedited ones that they call return for equal arguments."""
    token = _results.set(_Results())
    try:
        yield
    finally:
        _results.reset(token)


@functools.cache
def _shared(function: Function) -> Callable[..., Any]:
    """Return a function that gives copies of what it returned before, inside `sharing`."""
    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        results = _results.get()
        given = None if results is None else _key((args, sorted(kwargs.items())))
        if results is None or given is None:
            return function(*args, **kwargs)
        if (key := (function, given)) in results:
            return _copied(results[key])
        made = function(*args, **kwargs)
        if (size := _size((args, tuple(kwargs.values()), made))) <= results.room:
            results[key], results.room = _copied(made), results.room - size
        return made

    return call


def _key(value: Any) -> Any:
    """Return what equal values share, of arrays with how they lie in memory; None of what is of no known kind."""
    if isinstance(value, np.ndarray):
        return (value.dtype, value.shape, value.strides, value.tobytes()) if value.dtype.kind in "fiub" else None
    if isinstance(value, list | tuple):
        parts = tuple(map(_key, value))
        return None if None in parts else (type(value), parts)
    known = value is None or isinstance(value, bool | int | float | str | np.generic)
    return (type(value), repr(value)) if known else None


def _size(value: Any) -> int:
    return sum(map(_size, value)) if isinstance(value, list | tuple) else getattr(value, "nbytes", 0)


def _copied(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.copy(order="K")
    return type(value)(map(_copied, value)) if type(value) in (list, tuple) else value


@functools.cache
def called_by(function: Any) -> tuple[Function, ...]:
    """Return a literal function and those of refgi.literal that it calls, each once."""
    found: dict[Function, None] = {}

    def visit(one: Function) -> None:
        if one not in found:
            found[one] = None
            for below in _literal_names(one):
                visit(below)

    visit(function)
    return tuple(found)


@functools.cache
def _literal_names(function: Function) -> tuple[Function, ...]:
    found = []
    for node in ast.walk(ast.parse(code_of(function))):
        known = function.__globals__.get(node.id) if isinstance(node, ast.Name) else None
        value = inspect.unwrap(known) if callable(known) else known  # of functools.cache
        if isinstance(value, Function) and value.__module__.startswith(PACKAGE):
            found.append(value)
        if isinstance(known, types.ModuleType) and known.__name__.startswith(PACKAGE):
            raise StaleEditError(f"{_name(function)}: expected names of functions, got {known.__name__}")
    return tuple(found)


@functools.cache
def code_of(function: Function) -> str:
    """Return the text of a function without its docstring, each line where it stands in its file."""
    lines, first = inspect.getsourcelines(function)
    node = ast.parse("".join(lines)).body[0]
    assert isinstance(node, ast.FunctionDef)
    if ast.get_docstring(node) is not None:
        said = node.body[0]
        for number in range(said.lineno - 1, said.end_lineno or said.lineno):
            lines[number] = "\n"
    return "\n" * (first - 1) + "".join(lines)


def _name(function: Callable[..., Any]) -> str:
    return f"{function.__module__}.{function.__name__}"


class Row(NamedTuple):
    """A likely bug."""

    cause: str
    list: str
    edits: Edits
    paper: str


@dataclass(frozen=True)
class Form:
    """The literal form of a stage: which function, what it reads and writes. Runs as the stage does."""

    function: Callable[..., Any]
    reads: Mapping[str, Any]  # parameter: array, or a tuple of several, such as those of all maps; None: there is none
    writes: tuple[str, ...]  # in the order in which the function returns them
    numbers: Mapping[str, Any] = field(default_factory=dict)  # its other arguments
    adapt: Mapping[str, Callable[[Array], Array]] = field(default_factory=dict)  # what parameters are made of arrays
    kept: Mapping[str, str] = field(default_factory=dict)  # what it writes that is what it reads
    double: bool = False  # in float64 whatever it reads, as refgi does where digits cancel

    def __call__(self, arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG002 in the type of the arrays
        """Return what the stage writes."""
        return self.by(self.function, arrays)

    def by(self, function: Callable[..., Any], arrays: Arrays) -> Arrays:
        """Return what the stage writes with another function, such as an edited one."""
        if self.double:
            arrays = {name: one.astype(np.float64) if one.dtype.kind == "f" else one for name, one in arrays.items()}
        read = {name: _read(arrays, array) for name, array in self.reads.items()}
        read |= {name: adapt(read[name]) for name, adapt in self.adapt.items() if name in read}
        made = function(**read, **self.numbers)
        made = dict(zip(self.writes, made if isinstance(made, list | tuple) else (made,), strict=True))
        return made | {name: arrays[array] for name, array in self.kept.items()}

    def sharing(self) -> "Form":
        """Return the form with a function that shares what those that it calls return."""
        return dataclasses.replace(self, function=edited(self.function, ()))

    def named(self, reads: Mapping[str, str], writes: Mapping[str, str]) -> "Form":
        """Return the form by the names that a case has for its arrays."""
        return dataclasses.replace(self, reads={key: _renamed(reads, leaf) for key, leaf in self.reads.items()},
                                   writes=tuple(writes.get(leaf, leaf) for leaf in self.writes),
                                   kept={writes[leaf]: reads[read] for leaf, read in self.kept.items()})

    def bugs(self, *lists: str, of: str = "") -> tuple[Bug, ...]:
        """Return the likely bugs of some lists, in the order of the file; `of`: a literal module that it calls."""
        module = f"{PACKAGE}.{of}" if of else self.function.__module__
        return tuple(Bug(row.cause, _lazily(self, row), row.paper) for row in rows(module) if row.list in lists)


def _renamed(reads: Mapping[str, str], leaf: Any) -> Any:
    return tuple(_renamed(reads, one) for one in leaf) if isinstance(leaf, tuple) else None if leaf is None else (
        reads[leaf])


def _read(arrays: Arrays, name: Any) -> Any:
    return None if name is None else arrays[name] if isinstance(name, str) else tuple(
        _read(arrays, one) for one in name)


def _lazily(form: Form, row: Row) -> Run:
    """Return what a stage runs with a bug; the text is edited when it first runs."""
    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001 in the type of the arrays
        wrong = edited(form.function, row.edits, row.cause)
        wrong.__globals__["arrays"] = arrays
        with np.errstate(all="ignore"):  # a bug may divide by 0
            return form.by(wrong, arrays)

    return run


@functools.cache
def rows(module: str) -> tuple[Row, ...]:
    """Return the rows beside a module of refgi.literal.

    StaleEditError if a line is no row, or two of a list have one cause.
    """
    name = module.removeprefix(f"{PACKAGE}.")
    file = f"{name}.bugs"
    found: dict[tuple[str, str], Row] = {}
    for number, line in enumerate(resources.files(PACKAGE).joinpath(file).read_text("utf-8").splitlines(), 1):
        if line.strip() and not line.startswith("#"):
            row = _row(line, f"{file}:{number}")
            if found.setdefault((row.list, row.cause), row) is not row:
                raise StaleEditError(f"{file}:{number}: {row.cause!r} stands twice in the list {row.list}")
    return tuple(found.values())


def _row(line: str, where: str) -> Row:
    parts = [part.strip() for part in line.split(" :: ")]
    if len(parts) not in (3, 4):
        raise StaleEditError(f"{where}: expected cause :: list :: old => new :: paper, got {line!r}")
    edits = [tuple(side.strip() for side in edit.split("=>", 1)) for edit in parts[2].split(" ;; ")]
    if any(len(edit) != 2 or not edit[0] for edit in edits):
        raise StaleEditError(f"{where}: expected old => new, got {parts[2]!r}")
    return Row(parts[0], parts[1], tuple((edit[0], edit[1]) for edit in edits), parts[3] if len(parts) == 4 else "")
