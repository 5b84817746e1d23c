"""Faults in expressions, calls and statements: factors, signs, constants, indices, arguments, steps left out."""

import ast
from collections.abc import Iterable, Iterator
from functools import cache
from itertools import pairwise

from benchmarks.mutate.source import Edit, Place, Scope, Source, called

LITERALS = (ast.List, ast.Tuple, ast.Dict, ast.JoinedStr)  # joined and repeated, not calculated with
SIGNS = {ast.Add: ("+", "-"), ast.Sub: ("-", "+")}
QUOTIENTS = {ast.Mult: ("*", "/"), ast.Div: ("/", "*")}
MASKS = {ast.BitAnd: ("&", "|"), ast.BitOr: ("|", "&")}
COMPARISONS = {ast.Lt: ("<", "<=", ">"), ast.LtE: ("<=", "<", ">="), ast.Gt: (">", ">=", "<"),
               ast.GtE: (">=", ">", "<="), ast.Eq: ("==", "!="), ast.NotEq: ("!=", "==")}
OPPOSITES = {one: other for pair in (
    ("max", "min"), ("maximum", "minimum"), ("fmax", "fmin"), ("argmax", "argmin"), ("floor", "ceil"), ("any", "all"),
    ("cos", "sin"), ("zeros", "ones"), ("zeros_like", "ones_like")) for one, other in (pair, pair[::-1])}
RANGES = ("range", "prange")
SHAPED = frozenset({"zeros", "ones", "empty", "full", "reshape", "transpose", "broadcast_to", "moveaxis", "swapaxes"})


def factor(source: Source, node: ast.AST, _: Scope) -> Iterator[Edit]:
    """A factor or divisor dropped: `a * b` -> `a`."""
    if not _calculates(node, ast.Mult, ast.Div):
        return
    operator = source.token_between(source.end(node.left), source.start(node.right), "*", "/")
    yield from source.replaced(source.tokens[operator - 1].end, source.end(node), "")
    if isinstance(node.op, ast.Mult):
        yield from source.replaced(source.start(node), source.tokens[operator + 1].start, "")


def sign(source: Source, node: ast.AST, _: Scope) -> Iterator[Edit]:
    """`+` for `-` and the reverse; a minus dropped."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        start = source.start(node)
        yield from source.replaced(start, (start[0], start[1] + 1), "")
    yield from _other_operator(source, node, SIGNS)


def quotient(source: Source, node: ast.AST, _: Scope) -> Iterator[Edit]:
    """`*` for `/` and the reverse."""
    if not _is_count(source, node):
        yield from _other_operator(source, node, QUOTIENTS)


def logic(source: Source, node: ast.AST, _: Scope) -> Iterator[Edit]:
    """`and` for `or` and the reverse, also of masks."""
    yield from _other_operator(source, node, MASKS)
    if isinstance(node, ast.BoolOp):
        word, other = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in pairwise(node.values):
            yield from _token_replaced(source, source.end(left), source.start(right), word, other)


def comparison(source: Source, node: ast.AST, _: Scope) -> Iterator[Edit]:
    """`<=` and `>` for `<`, and so on."""
    if not isinstance(node, ast.Compare):
        return
    for (left, right), operator in zip(pairwise((node.left, *node.comparators)), node.ops, strict=True):
        for other in COMPARISONS.get(type(operator), ())[1:]:
            yield from _token_replaced(source, source.end(left), source.start(right),
                                       COMPARISONS[type(operator)][0], other)


def extreme(source: Source, node: ast.AST, _: Scope) -> Iterator[Edit]:
    """`max` for `min` and other functions with an opposite."""
    if isinstance(node, ast.Call) and called(node) in OPPOSITES:
        end = source.end(node.func)
        yield from source.replaced((end[0], end[1] - len(called(node))), end, OPPOSITES[called(node)])


def constant(source: Source, node: ast.AST, _: Scope) -> Iterator[Edit]:
    """A number changed: 0.0 -> 1.0, others doubled, whole ones one more, in ranges one less; True for False."""
    parent = source.parents.get(node)
    if not isinstance(node, ast.Constant) or not isinstance(node.value, int | float):
        return
    if isinstance(parent, ast.Subscript) or isinstance(source.parents.get(parent), ast.Subscript):
        return  # an index
    if (isinstance(parent, ast.keyword) and parent.arg == "axis") or _is_shape(source, node):
        return
    if isinstance(node.value, bool):
        other = str(not node.value)
    elif isinstance(node.value, int):
        shorter = isinstance(parent, ast.Call) and called(parent) in RANGES and node.value > 0
        other = str(node.value - 1 if shorter else node.value + 1)  # a longer one would leave its array
    else:
        other = repr(2 * node.value) if node.value else "1.0"
    yield from source.replaced(source.start(node), source.end(node), other)


def index(source: Source, node: ast.AST, scope: Scope) -> Iterator[Edit]:
    """An index or the end of a range off by one."""
    if isinstance(node, ast.Subscript):
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        for part in parts:
            yield from _off_by_one(source, part, scope)
    elif isinstance(node, ast.Call) and called(node) in RANGES:
        stop = node.args[0 if len(node.args) == 1 else 1]
        if isinstance(stop, ast.Name | ast.Attribute | ast.Subscript | ast.Call):
            end = source.end(stop)
            yield from source.replaced(end, end, " - 1")


def negation(source: Source, node: ast.AST, _: Scope) -> Iterator[Edit]:
    """A condition negated."""
    tests = [node.test] if isinstance(node, ast.If | ast.IfExp) else getattr(node, "ifs", [])
    for test in tests:
        start, end = source.start(test), source.end(test)
        if isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not):
            yield from source.replaced(start, source.tokens[source.token_at(start) + 1].start, "")
        elif isinstance(test, ast.BoolOp | ast.IfExp | ast.NamedExpr):
            yield from source.replaced(start, end, f"not ({source.between(start, end)})")
        else:
            yield from source.replaced(start, start, "not ")


def _is_shape(source: Source, node: ast.AST) -> bool:
    """Return whether a number stands in the shape of an array."""
    parent = source.parents[node]
    while isinstance(parent, ast.Tuple | ast.UnaryOp):
        parent = source.parents[parent]
    return isinstance(parent, ast.Call) and called(parent) in SHAPED


def _is_count(source: Source, node: ast.AST) -> bool:
    """Return whether an expression is a part of an index, a range or a shape, where fractions are none."""
    while not isinstance(node, ast.stmt | ast.mod):
        node, child = source.parents[node], node
        if isinstance(node, ast.Subscript) and child is node.slice:
            return True
        if isinstance(node, ast.Call) and called(node) in SHAPED.union(RANGES):
            return True
    return False


def _off_by_one(source: Source, part: ast.expr, scope: Scope) -> Iterator[Edit]:
    start, end = source.start(part), source.end(part)
    if isinstance(part, ast.Constant) and type(part.value) is int:
        yield from source.replaced(start, end, str(part.value - 1 if part.value > 0 else 1))
    elif isinstance(part, ast.UnaryOp) and isinstance(part.operand, ast.Constant):
        yield from source.replaced(start, end, str(-part.operand.value - 1))
    elif isinstance(part, ast.Name) and part.id in _counters(scope.function):
        yield from source.replaced(end, end, " - 1")
    elif isinstance(part, ast.Slice):
        for bound in (part.lower, part.upper):
            if isinstance(bound, ast.Name | ast.Attribute):
                yield from source.replaced(source.end(bound), source.end(bound), " - 1")
            elif bound is not None:
                yield from _off_by_one(source, bound, scope)


@cache
def _counters(function: ast.FunctionDef | None) -> frozenset[str]:
    """Return the names that hold whole numbers in a function: of loops over ranges, and parameters."""
    if function is None:
        return frozenset()
    found = {argument.arg for argument in function.args.args
             if isinstance(argument.annotation, ast.Name) and argument.annotation.id == "int"}
    for node in ast.walk(function):
        if isinstance(node, ast.For | ast.comprehension) and called(node.iter) in (*RANGES, "enumerate"):
            target = node.target.elts[0] if isinstance(node.target, ast.Tuple) else node.target
            found |= {target.id} if isinstance(target, ast.Name) else set()
    return frozenset(found)


def _calculates(node: ast.AST, *operators: type[ast.operator]) -> bool:
    return isinstance(node, ast.BinOp) and isinstance(node.op, operators) and not any(
        isinstance(side, LITERALS) or (isinstance(side, ast.Constant) and isinstance(side.value, str))
        for side in (node.left, node.right))


def _other_operator(source: Source, node: ast.AST, signs: dict[type[ast.operator], tuple[str, str]]) -> Iterator[Edit]:
    if _calculates(node, *signs):
        one, other = signs[type(node.op)]
        yield from _token_replaced(source, source.end(node.left), source.start(node.right), one, other)
    elif isinstance(node, ast.AugAssign) and type(node.op) in signs and not isinstance(node.value, LITERALS):
        one, other = signs[type(node.op)]
        yield from _token_replaced(source, source.end(node.target), source.start(node.value), f"{one}=", f"{other}=")


def _token_replaced(source: Source, start: Place, end: Place, text: str, other: str) -> Iterator[Edit]:
    token = source.token_between(start, end, text)
    if token is not None:
        yield from source.replaced(source.tokens[token].start, source.tokens[token].end, other)


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
