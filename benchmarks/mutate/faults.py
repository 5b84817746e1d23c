"""All faults that there are, in an order drawn by a seed; and those in reading settings: defaults for what is set."""

import ast
import hashlib
import random
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.mutate import expressions
from benchmarks.mutate.project import Project
from benchmarks.mutate.source import Edit, Scope, Source, called

BASE = "Settings"


class Field(NamedTuple):
    """A field of a settings class."""

    default: str  # as source text; empty where it is no literal
    classes: frozenset[str]  # names of the types that its annotation allows


class SettingsTable:
    """The settings classes of a package: fields by class, as the sources declare them."""

    def __init__(self, trees: Iterable[ast.Module]) -> None:
        classes, self._aliases = {}, {}
        for tree in trees:
            for node in tree.body:
                if isinstance(node, ast.ClassDef):
                    classes[node.name] = node
                elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                    self._aliases[node.targets[0].id] = node.value
        self.classes = {name: self._fields(node, classes) for name, node in classes.items()
                        if _is_settings(name, classes)}

    def _fields(self, node: ast.ClassDef, classes: dict[str, ast.ClassDef]) -> dict[str, Field]:
        fields: dict[str, Field] = {}
        for base in node.bases:
            if called(base) in classes:
                fields |= self._fields(classes[called(base)], classes)
        for step in node.body:
            if isinstance(step, ast.AnnAssign) and isinstance(step.target, ast.Name) and step.value is not None:
                fields[step.target.id] = Field(_literal(step.value), frozenset(self._names(step.annotation)))
        return fields

    def _names(self, annotation: ast.AST | None) -> Iterator[str]:
        """Yield the names in an annotation, those of aliases resolved."""
        if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
            annotation = ast.parse(annotation.value, mode="eval")
        for node in ast.walk(annotation) if annotation is not None else ():
            if isinstance(node, ast.Name) and node.id in self._aliases:
                yield from (other.id for other in ast.walk(self._aliases[node.id]) if isinstance(other, ast.Name))
            elif isinstance(node, ast.Name):
                yield node.id

    def known(self, annotation: ast.AST | None) -> frozenset[str]:
        """Return the settings classes that an annotation names."""
        return frozenset(name for name in self._names(annotation) if name in self.classes)

    def owners(self, node: ast.AST, scope: Scope) -> frozenset[str]:
        """Return the settings classes that an expression may be of; none where it is something else."""
        if isinstance(node, ast.Attribute):
            kinds = (self.classes[owner][node.attr].classes for owner in self.owners(node.value, scope)
                     if node.attr in self.classes[owner])
            return frozenset().union(*kinds) & self.classes.keys()
        if not isinstance(node, ast.Name) or scope.function is None:
            return frozenset()
        if node.id == "self" and scope.owner is not None:
            return frozenset({scope.owner.name} & self.classes.keys())
        arguments = (*scope.function.args.args, *scope.function.args.kwonlyargs)
        for argument in arguments:
            if argument.arg == node.id:
                return self.known(argument.annotation)
        return self._assigned(node.id, scope)

    def _assigned(self, name: str, scope: Scope) -> frozenset[str]:
        """Return what a local name holds: `warp = settings.source.warp`."""
        for step in ast.walk(scope.function):
            if isinstance(step, ast.Assign) and called(step.targets[0]) == name and _root(step.value) not in ("", name):
                return self.owners(step.value, scope)
        return frozenset()

    def setting(self, source: Source, node: ast.AST, scope: Scope) -> Iterator[Edit]:
        """A setting read as its default, a part of the settings as one of defaults."""
        if not isinstance(node, ast.Attribute) or not isinstance(node.ctx, ast.Load):
            return
        fields = [self.classes[owner][node.attr] for owner in sorted(self.owners(node.value, scope))
                  if node.attr in self.classes[owner]]
        texts = {field.default for field in fields if field.default}
        asked = isinstance(parent := source.parents[node], ast.Call) and called(parent) == "isinstance"
        if any(field.classes & self.classes.keys() for field in fields) and source.of(node) and not asked:
            texts.add(f"type({source.of(node)})()")
        for text in sorted(texts):
            yield from source.replaced(source.start(node), source.end(node), text)


def _is_settings(name: str, classes: dict[str, ast.ClassDef]) -> bool:
    return name != BASE and name in classes and any(
        called(base) == BASE or _is_settings(called(base), classes) for base in classes[name].bases)


def _root(node: ast.AST) -> str:
    """Return the name at the start of `settings.source.warp`; empty for other expressions."""
    if isinstance(node, ast.Attribute):
        return called(node.value) if isinstance(node.value, ast.Name) else _root(node.value)
    return ""


def _literal(value: ast.expr) -> str:
    """Return a field's default where it can be written anywhere: a number, a name in quotes, None, an empty set."""
    if isinstance(value, ast.Call) and called(value) in ("setting", "field") and value.args:
        value = value.args[0]
    plain = value.operand if isinstance(value, ast.UnaryOp) else value
    empty = isinstance(value, ast.Call) and called(value) == "frozenset" and not value.args
    return ast.unparse(value) if isinstance(plain, ast.Constant) or empty else ""


KINDS = ("kernels", "wiring")
Operator = Callable[[Source, Any, Scope], Iterator[Edit]]
OPERATORS: dict[str, Operator] = {operator.__name__: operator for operator in (
    expressions.factor, expressions.sign, expressions.quotient, expressions.logic, expressions.comparison,
    expressions.extreme, expressions.constant, expressions.index, expressions.negation,
    expressions.keyword, expressions.statement)}  # and those of `_of_package`


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
    return {"setting": SettingsTable(trees).setting, "swap": expressions.Signatures(trees).swap}


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
