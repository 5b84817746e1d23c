"""Single changes of a function's expressions and statements: those that programmers make by mistake."""

import ast
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

OTHER = {ast.Add: (ast.Sub,), ast.Sub: (ast.Add,), ast.Mult: (ast.Div,), ast.Div: (ast.Mult, ast.FloorDiv),
         ast.FloorDiv: (ast.Div,), ast.BitAnd: (ast.BitOr,), ast.BitOr: (ast.BitAnd,), ast.LShift: (ast.RShift,),
         ast.RShift: (ast.LShift,)}
COMPARED = (ast.Lt, ast.LtE, ast.Gt, ast.GtE)
EQUAL = (ast.Eq, ast.NotEq)
FAMILIES = (("cos", "sin", "tan"), ("arccos", "arcsin"), ("acos", "asin"), ("min", "max"), ("minimum", "maximum"),
            ("fmin", "fmax"), ("floor", "ceil", "rint", "trunc"), ("argmin", "argmax"), ("any", "all"),
            ("sum", "mean", "max"), ("sqrt", "square"), ("zeros", "ones"))
ALIKE = {name: tuple(dict.fromkeys(one for family in FAMILIES if name in family for one in family if one != name))
         for name in {name for family in FAMILIES for name in family}}
MODULES = ("np", "math", "numba")  # whose functions are no attributes of variables
LONGEST = 72  # characters of an expression that is told
FUNCTIONS = (ast.FunctionDef, ast.Lambda)
NOT_RUN: dict[type[ast.AST], tuple[str, ...]] = {  # fields of a node that a call of the function does not run
    ast.FunctionDef: ("args", "returns", "decorator_list", "type_params"), ast.Lambda: ("args",),
    ast.AnnAssign: ("annotation",)}


class Holder(NamedTuple):
    """What holds a node: a field of its parent, or a place in it."""

    parent: ast.AST
    field: str
    place: int | None


Holders = dict[ast.AST, Holder]


@dataclass(frozen=True, eq=False)
class Change:
    """One change: `other` in place of `node`."""

    root: Any  # the function
    node: ast.AST
    other: ast.AST
    holders: Holders  # of all nodes of the function
    is_name: bool  # of a variable, key or attribute, not of an operator, number or call

    @property
    def line(self) -> int:
        """Of the source."""
        return int(getattr(self.node, "lineno", 0))

    @property
    def said(self) -> str:
        """What is for what, for people: with as much of what is around as is short."""
        around = self.node
        while around in self.holders:
            above = self.holders[around].parent
            if not isinstance(above, ast.expr | ast.stmt) or isinstance(above, FUNCTIONS) or len(
                    ast.unparse(above)) > LONGEST:
                break
            around = above
        before = _text(around)
        self.put()
        after = _text(self.other if around is self.node else around)
        self.take_back()
        return f"`{after}` for `{before}`"

    def put(self) -> None:
        """Change the tree."""
        self._set(self.other)

    def take_back(self) -> None:
        """Change it back."""
        self._set(self.node)

    def _set(self, node: ast.AST) -> None:
        parent, field, place = self.holders[self.node]
        if place is None:
            setattr(parent, field, node)
        else:
            getattr(parent, field)[place] = node


def changes_of(function: ast.AST) -> list[Change]:
    """Return the changes of a function's body, each of which leaves a program, if not always one that runs.

    Functions within it have changes of their own.
    """
    holders = dict(_below(function))
    names, keys, attributes = _locals(function, holders), _keys(holders), _attributes(holders)
    found = []
    for node, holder in holders.items():
        for is_name, others in ((False, _others(node, holder.parent)),
                                (True, _substitutes(node, names, keys, attributes))):
            for other in others:
                if not hasattr(other, "lineno"):  # new, not a part of what was there
                    ast.fix_missing_locations(ast.copy_location(other, node))
                found.append(Change(function, node, other, holders, is_name))
    return found


def _text(node: ast.AST) -> str:
    text = " ".join(ast.unparse(node).split())
    return text if len(text) <= 2 * LONGEST else f"{text[:2 * LONGEST]} ..."


def _below(node: ast.AST) -> Iterator[tuple[ast.AST, Holder]]:
    """Yield every expression and statement of a function, and which field of what holds it."""
    for field, value in ast.iter_fields(node):
        if field in NOT_RUN.get(type(node), ()):
            continue
        for place, child in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if not isinstance(child, ast.AST) or isinstance(child, ast.expr_context | ast.arguments | ast.FunctionDef):
                continue
            if isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant):
                continue  # a docstring
            if isinstance(child, ast.expr | ast.stmt):
                yield child, Holder(node, field, place)
            if not isinstance(child, ast.Lambda):
                yield from _below(child)


def _others(node: ast.AST, parent: ast.AST) -> Iterator[ast.AST]:
    """Yield what may stand for a node whatever names there are."""
    if isinstance(node, ast.BinOp):
        yield from _operations(node)
    elif isinstance(node, ast.UnaryOp):
        yield node.operand
    elif isinstance(node, ast.Compare) and len(node.ops) == 1:
        yield from _comparisons(node)
    elif isinstance(node, ast.BoolOp):
        yield ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)
        for place in range(len(node.values)):
            rest = node.values[:place] + node.values[place + 1 :]
            yield rest[0] if len(rest) == 1 else ast.BoolOp(node.op, rest)
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield ast.Constant(not node.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        yield from map(ast.Constant, _numbers(node.value))
    elif isinstance(node, ast.Call):
        yield from _calls(node)
    elif isinstance(node, ast.IfExp):
        yield from (node.body, node.orelse)
    elif isinstance(node, ast.Subscript):
        if isinstance(node.slice, ast.Tuple):
            for place in range(len(node.slice.elts) - 1):
                yield ast.Subscript(node.value, ast.Tuple(_exchanged(node.slice.elts, place), ast.Load()), node.ctx)
    elif isinstance(node, ast.stmt):
        yield from _statements(node)
    if isinstance(node, ast.Tuple | ast.List) and isinstance(node.ctx, ast.Load):
        for place in range(len(node.elts) - 1):
            yield type(node)(_exchanged(node.elts, place), ast.Load())
    if isinstance(node, ast.Name | ast.Call | ast.Subscript | ast.Attribute) and _is_number(node, parent):
        yield ast.UnaryOp(ast.USub(), node)
        yield ast.BinOp(node, ast.Mult(), node)
        yield ast.BinOp(node, ast.Pow(), ast.Constant(0.5))
        yield ast.BinOp(ast.Constant(1.0), ast.Sub(), node)
    if isinstance(node, ast.BinOp) and isinstance(parent, ast.Assign | ast.Return):  # texel centres for corners
        yield ast.BinOp(node, ast.Sub(), ast.Constant(0.5))
        yield ast.BinOp(node, ast.Add(), ast.Constant(0.5))
    if isinstance(node, ast.Name | ast.BinOp) and _is_place(node, parent):
        yield ast.BinOp(node, ast.Add(), ast.Constant(1))
        yield ast.BinOp(node, ast.Sub(), ast.Constant(1))


def _operations(node: ast.BinOp) -> Iterator[ast.AST]:
    for operator in OTHER.get(type(node.op), ()):
        yield ast.BinOp(node.left, operator(), node.right)
    yield node.left
    if not isinstance(node.op, ast.Pow):
        yield node.right
    if isinstance(node.op, ast.Sub | ast.Div):
        yield ast.BinOp(node.right, node.op, node.left)


def _comparisons(node: ast.Compare) -> Iterator[ast.AST]:
    for kinds in (COMPARED, EQUAL):
        if isinstance(node.ops[0], kinds):
            for kind in kinds:
                if not isinstance(node.ops[0], kind):
                    yield ast.Compare(node.left, [kind()], node.comparators)
    yield from (ast.Constant(True), ast.Constant(False))


def _numbers(value: float) -> list[float]:
    """Return numbers that may stand for another."""
    if isinstance(value, int):
        return [one for one in dict.fromkeys((value + 1, value - 1, 0, 1, 2 * value, -value)) if one != value]
    return [one for one in dict.fromkeys((0.0, 1.0, 2 * value, value / 2, value + 1, value - 1, -value))
            if one != value]


def _calls(node: ast.Call) -> Iterator[ast.AST]:
    name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    for other in ALIKE.get(name, ()):
        func = (ast.Attribute(node.func.value, other, ast.Load()) if isinstance(node.func, ast.Attribute) else
                ast.Name(other, ast.Load()))
        yield ast.Call(func, node.args, node.keywords)
    if name in ALIKE["floor"] + ("floor",) and node.args:
        yield ast.Call(node.func, [ast.BinOp(node.args[0], ast.Add(), ast.Constant(0.5))], node.keywords)
    if name in ("maximum", "max") and [*map(ast.unparse, node.args[:-1])] == ["0"]:
        yield ast.Call(ast.Name("abs", ast.Load()), node.args[1:], [])
    yield from (one for one in node.args if not isinstance(one, ast.Starred))  # the call is left out
    if isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.expr):
        yield node.func.value  # a method is
    for place in range(len(node.args) - 1):
        yield ast.Call(node.func, _exchanged(node.args, place), node.keywords)
    for place in range(len(node.keywords)):
        yield ast.Call(node.func, node.args, node.keywords[:place] + node.keywords[place + 1 :])


def _statements(node: ast.stmt) -> Iterator[ast.AST]:
    if isinstance(node, ast.AugAssign):
        yield ast.Pass()
        yield ast.Assign([node.target], node.value)  # overwritten, not accumulated
        for operator in OTHER.get(type(node.op), ()):
            yield ast.AugAssign(node.target, operator(), node.value)
    elif isinstance(node, ast.Continue | ast.Break):
        yield ast.Pass()
    elif isinstance(node, ast.If):
        yield ast.If(ast.UnaryOp(ast.Not(), node.test), node.body, node.orelse)
        for always in (True, False):
            yield ast.If(ast.Constant(always), node.body, node.orelse)
    elif (isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Subscript)) or (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)):
        yield ast.Pass()


def _substitutes(
    node: ast.AST, names: dict[str, str], keys: list[str], attributes: dict[str, list[str]]
) -> Iterator[ast.AST]:
    """Yield other names of the same function, other keys and attributes that it uses."""
    if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id in names:
        yield from (ast.Name(other, ast.Load()) for other, use in names.items()
                    if other != node.id and use == names[node.id])
    elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value in keys:
        yield from (ast.Constant(other) for other in keys if other != node.value)
    elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load) and isinstance(node.value, ast.Name):
        yield from (ast.Attribute(node.value, other, ast.Load()) for other in attributes.get(node.value.id, ())
                    if other != node.attr)


def _exchanged(items: list[Any], place: int) -> list[Any]:
    return [*items[:place], items[place + 1], items[place], *items[place + 2 :]]


def _is_number(node: ast.AST, parent: ast.AST) -> bool:
    """Return whether a node stands where numbers are calculated with, and is read."""
    if not isinstance(getattr(node, "ctx", ast.Load()), ast.Load):
        return False
    return isinstance(parent, ast.BinOp | ast.Assign | ast.AugAssign | ast.Return | ast.Tuple) or (
        isinstance(parent, ast.Call) and node in parent.args)


def _is_place(node: ast.AST, parent: ast.AST) -> bool:
    """Return whether a node is an index or the end of a range, and is read."""
    if not isinstance(getattr(node, "ctx", ast.Load()), ast.Load):
        return False
    called = parent.func.id if isinstance(parent, ast.Call) and isinstance(parent.func, ast.Name) else ""
    return isinstance(parent, ast.Subscript | ast.Slice | ast.Tuple) or called in ("range", "prange", "min", "max")


def _locals(function: ast.AST, holders: Holders) -> dict[str, str]:
    """Return the names that a function gets or sets itself, and what they are used as: arrays, objects or values."""
    given = function.args if isinstance(function, FUNCTIONS) else None
    own = {one.arg for one in (*given.posonlyargs, *given.args, *given.kwonlyargs)} if given else set()
    own |= {node.id for node in holders if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    uses = dict.fromkeys(sorted(own), "value")
    for node, (parent, field, _) in holders.items():
        if isinstance(node, ast.Name) and node.id in uses:
            use = {(ast.Subscript, "value"): "array", (ast.Attribute, "value"): "object",
                   (ast.Call, "func"): "function"}.get((type(parent), field))
            uses[node.id] = use or uses[node.id]
    return uses


def _keys(nodes: Iterable[ast.AST]) -> list[str]:
    return list(dict.fromkeys(node.slice.value for node in nodes if isinstance(node, ast.Subscript)
                              and isinstance(node.slice, ast.Constant) and isinstance(node.slice.value, str)))


def _attributes(nodes: Iterable[ast.AST]) -> dict[str, list[str]]:
    """Return which attributes of each variable a function uses: not functions of modules."""
    found: dict[str, list[str]] = {}
    for node in nodes:
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id not in MODULES:
            own = found.setdefault(node.value.id, [])
            own += [node.attr] if node.attr not in own else []
    return found


