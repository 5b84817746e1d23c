"""Faults in calls and statements: an argument dropped or exchanged, a step left out."""

import ast
from collections.abc import Iterable, Iterator
from itertools import pairwise

from benchmarks.mutate.source import Edit, Scope, Source, called

# calls in any order, or of arguments of different kinds: shapes, dtypes
NOT_SWAPPED = frozenset({
    "min", "max", "minimum", "maximum", "fmin", "fmax", "hypot", "dot", "zip", "isinstance", "getattr", "type", "array",
    "asarray", "ascontiguousarray", "astype", "empty", "zeros", "ones", "full", "full_like", "reshape", "broadcast_to",
    "transpose", "stack", "concatenate"})
SIMPLE = (ast.Name, ast.Attribute, ast.Subscript, ast.Constant, ast.Call, ast.UnaryOp, ast.BinOp)


def keyword(source: Source, node: ast.AST, _: Scope) -> Iterator[Edit]:
    """A keyword argument dropped."""
    if not isinstance(node, ast.keyword) or node.arg is None or not isinstance(source.parents[node], ast.Call):
        return
    start, end = source.start(node), source.end(node)
    first, behind = source.token_at(start), source.token_at(end)
    before, after = source.tokens[first - 1], source.tokens[behind]
    if before.text == "," and before.start[0] == end[0]:
        start = source.tokens[first - 2].end if source.tokens[first - 2].end[0] == end[0] else before.start
    elif after.text == "," and after.end[0] == start[0]:
        following = source.tokens[behind + 1].start
        end = following if following[0] == start[0] else after.end
    yield from source.replaced(start, end, "")


def statement(source: Source, node: ast.AST, _: Scope) -> Iterator[Edit]:
    """A `continue`, an augmented assignment or a call for its effect dropped."""
    effect = isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
    if isinstance(node, ast.Continue | ast.AugAssign) or effect:
        yield from source.replaced(source.start(node), source.end(node), "pass")


class Signatures:
    """The types of parameters of a package's functions and named tuples, by name."""

    def __init__(self, trees: Iterable[ast.Module]) -> None:
        self._kinds: dict[str, set[tuple[str, ...]]] = {}
        for tree in trees:
            for node in ast.walk(tree):
                if isinstance(node, ast.FunctionDef):
                    hints = [argument.annotation for argument in node.args.args if argument.arg != "self"]
                elif isinstance(node, ast.ClassDef):
                    hints = [step.annotation for step in node.body if isinstance(step, ast.AnnAssign)]
                else:
                    continue
                self._kinds.setdefault(node.name, set()).add(tuple("" if hint is None else ast.unparse(hint)
                                                                   for hint in hints))

    def swap(self, source: Source, node: ast.AST, _: Scope) -> Iterator[Edit]:
        """Two neighbouring positional arguments of one type exchanged."""
        if not isinstance(node, ast.Call) or called(node) in NOT_SWAPPED:
            return
        for place, (one, other) in enumerate(pairwise(node.args)):
            texts = source.of(one), source.of(other)
            plain = isinstance(one, SIMPLE) and isinstance(other, SIMPLE) and all(texts) and texts[0] != texts[1]
            beside = source.between(source.end(one), source.start(other)) == ", "
            if plain and beside and self._alike(called(node), place):
                yield from source.replaced(source.start(one), source.end(other), ", ".join(reversed(texts)))

    def _alike(self, name: str, place: int) -> bool:
        """Return whether a parameter has the type of the next; so it is taken to be where none is known."""
        return all(len(kinds) <= place + 1 or kinds[place] == kinds[place + 1] for kinds in self._kinds.get(name, ()))
