"""Faults in reading settings: the default in place of what is set."""

import ast
from collections.abc import Iterable, Iterator
from typing import NamedTuple

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
