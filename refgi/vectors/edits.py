"""Edits of source text: `old` stands in it exactly once and gives way to `new`. Functions of refgi.literal, edited.

One language for likely bugs (`rows`), the search for causes (`search`) and the faults that benchmarks put into ports
and into refgi itself.
"""

import ast
import functools
import inspect
import types
from collections.abc import Callable, Iterator, Mapping
from typing import Any

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
    for one, text in _reached(parts).items():
        try:
            exec(compile(text, one.__code__.co_filename, "exec"), scope)
        except SyntaxError as error:
            raise StaleEditError(f"{_name(one)}: {what}: no program is left: {error}") from error
    return scope[function.__name__]  # type: ignore[no-any-return]


def _reached(parts: Mapping[Function, str | ast.Module]) -> dict[Function, str | ast.Module]:
    """Return the texts that differ, and of functions that call those; others stay as they are, caches too."""
    reached = {one for one, text in parts.items() if text != code_of(one)}
    while above := {one for one in parts if one not in reached and not reached.isdisjoint(_literal_names(one))}:
        reached |= above
    return {one: text for one, text in parts.items() if one in reached}


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


def _literal_names(function: Function) -> Iterator[Function]:
    """Yield the functions of refgi.literal that a function names."""
    for node in ast.walk(ast.parse(code_of(function))):
        known = function.__globals__.get(node.id) if isinstance(node, ast.Name) else None
        value = inspect.unwrap(known) if callable(known) else known  # of functools.cache
        if isinstance(value, Function) and value.__module__.startswith(PACKAGE):
            yield value
        if isinstance(known, types.ModuleType) and known.__name__.startswith(PACKAGE):
            raise StaleEditError(f"{_name(function)}: expected names of functions, got {known.__name__}")


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
