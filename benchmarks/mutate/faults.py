"""All faults that there are, in an order drawn by a seed."""

import ast
import hashlib
import random
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.mutate import calls, expressions
from benchmarks.mutate.defaults import SettingsTable
from benchmarks.mutate.project import Project
from benchmarks.mutate.source import Edit, Scope, Source

KINDS = ("kernels", "wiring")
Operator = Callable[[Source, Any, Scope], Iterator[Edit]]
OPERATORS: dict[str, Operator] = {operator.__name__: operator for operator in (
    expressions.factor, expressions.sign, expressions.quotient, expressions.logic, expressions.comparison,
    expressions.extreme, expressions.constant, expressions.index, expressions.negation,
    calls.keyword, calls.statement)}  # and those of `_of_package`


class Fault(NamedTuple):
    """One changed line."""

    file: str
    line: int
    function: str  # the name of the innermost one; empty outside of functions
    kind: str
    operator: str
    before: str  # the line, with its end
    after: str

    @property
    def id(self) -> str:
        """Ten digits that tell it from every other of the same sources."""
        return hashlib.sha256(f"{self.file}:{self.line}:{self.after}".encode()).hexdigest()[:10]

    def put_into(self, text: str) -> str:
        """Return the text of its file with the line changed."""
        lines = text.splitlines(keepends=True)
        if lines[self.line - 1] != self.before:
            raise ValueError(f"{self.file}:{self.line} is not the line of the fault")
        return "".join([*lines[: self.line - 1], self.after, *lines[self.line :]])


def all_faults(project: Project, paths: Sequence[str] = ()) -> list[Fault]:
    """Return every fault by file and line: under some paths, or in all kernels and the wiring of methods."""
    operators = OPERATORS | _of_package(tuple(project.root / file for file in project.sources()))
    files = [file for file in project.sources() if _is_below(file, paths)]
    found = chain.from_iterable(_in_file(project.root, file, operators) for file in files)
    return sorted(fault for fault in found if paths or fault.kind == "kernels" or project.is_wired(fault.file))


def drawn(faults: Sequence[Fault], seed: int) -> list[Fault]:
    """Return faults in the order of a seed.

    The kinds take turns, and in each kind the operators, in a shuffled order; those of one operator are shuffled.
    """
    orders = []
    for kind in KINDS:
        of_operator: dict[str, list[Fault]] = {}
        for fault in faults:
            if fault.kind == kind:
                of_operator.setdefault(fault.operator, []).append(fault)
        shuffled = [_shuffled(of_operator[name], seed) for name in _shuffled(sorted(of_operator), seed)]
        orders.append(list(_in_turn(shuffled)))
    return list(_in_turn(orders))


def _shuffled(items: Sequence[Any], seed: int) -> list[Any]:
    order = list(items)
    random.Random(seed).shuffle(order)
    return order


def _in_turn(orders: Sequence[Sequence[Any]]) -> Iterator[Any]:
    return (item for some in zip_longest(*orders) for item in some if item is not None)


def is_fault(text: str, fault: Fault) -> bool:
    """Return whether a changed text is a program, and another one; one that Python warns of is none."""
    changed = fault.put_into(text)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            compile(changed, fault.file, "exec")
        except (SyntaxError, Warning):
            return False
    return ast.dump(ast.parse(changed)) != ast.dump(ast.parse(text))


def _is_below(file: str, paths: Sequence[str]) -> bool:
    return not paths or any(file == path or file.startswith(f"{path.rstrip('/')}/") for path in paths)


@cache
def _of_package(files: tuple[Path, ...]) -> dict[str, Operator]:
    """Return the operators that know classes and functions of the whole package."""
    trees = [ast.parse(file.read_text()) for file in files]
    return {"setting": SettingsTable(trees).setting, "swap": calls.Signatures(trees).swap}


def _in_file(root: Path, file: str, operators: dict[str, Operator]) -> Iterator[Fault]:
    source, seen = Source((root / file).read_text()), set()
    for node, scope in source.nodes():
        for name, operator in operators.items():
            for edit in operator(source, node, scope):
                fault = _fault(source, file, name, scope, edit)
                if fault.after != fault.before and (fault.line, fault.after) not in seen:
                    seen.add((fault.line, fault.after))
                    yield fault


def _fault(source: Source, file: str, operator: str, scope: Scope, edit: Edit) -> Fault:
    before = source.lines[edit.line - 1]
    after = f"{before[: edit.start]}{edit.text}{before[edit.end :]}"
    kind = "kernels" if scope.kernel else "wiring"
    return Fault(file, edit.line, scope.function.name if scope.function else "", kind, operator, before, after)
