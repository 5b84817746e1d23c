"""A source file as a tree whose nodes know their place in the text, and the part of it that faults go into."""

import ast
import bisect
import io
import tokenize
from collections.abc import Iterator
from typing import NamedTuple

KERNELS = frozenset({"kernel", "by_type", "intrinsic", "register_jitable"})  # decorators of compiled code
# calls that check, warn or report; `setting` describes a field
LEFT_OUT = frozenset({"expect", "setting", "skip", "report_progress", "blame", "cast", "TypeVar", "ParamSpec"})
LEFT_OUT_STARTS = ("warn", "_warn", "expect_", "_expect")
LEFT_OUT_FUNCTIONS = frozenset({"check", "_check", "extra_bytes", "__post_init__", "__repr__", "__str__"})
LEFT_OUT_KEYWORDS = frozenset({"dtype", "strict", "stacklevel", "key", "file", "order", "name"})

Place = tuple[int, int]  # line from 1, column from 0, in characters


class Edit(NamedTuple):
    """Text that takes the place of a part of one line."""

    line: int
    start: int
    end: int
    text: str


class Scope(NamedTuple):
    """Where a node stands."""

    kernel: bool
    function: ast.FunctionDef | None
    owner: ast.ClassDef | None  # the class around


class Token(NamedTuple):
    """A word or sign of the text."""

    start: Place
    end: Place
    text: str


class Source:
    """A file's text, tree and tokens."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.lines = text.splitlines(keepends=True)
        self.tree = ast.parse(text)
        self.parents = {child: node for node in ast.walk(self.tree) for child in ast.iter_child_nodes(node)}
        spaces = (tokenize.NL, tokenize.NEWLINE, tokenize.COMMENT, tokenize.INDENT, tokenize.DEDENT)
        self.tokens = [Token(token.start, token.end, token.string)
                       for token in tokenize.generate_tokens(io.StringIO(text).readline) if token.type not in spaces]
        self._starts = [token.start for token in self.tokens]

    def start(self, node: ast.AST) -> Place:
        return self._place(node.lineno, node.col_offset)

    def end(self, node: ast.AST) -> Place:
        return self._place(node.end_lineno, node.end_col_offset)

    def _place(self, line: int, offset: int) -> Place:
        return line, len(self.lines[line - 1].encode()[:offset].decode())

    def between(self, start: Place, end: Place) -> str:
        """Return the text between two places of one line; empty where they are on two."""
        return self.lines[start[0] - 1][start[1] : end[1]] if start[0] == end[0] else ""

    def of(self, node: ast.AST) -> str:
        return self.between(self.start(node), self.end(node))

    def token_between(self, start: Place, end: Place, *texts: str) -> int | None:
        """Return the index of the first token with one of some texts between two places."""
        first, last = bisect.bisect_left(self._starts, start), bisect.bisect_left(self._starts, end)
        return next((index for index in range(first, last) if self.tokens[index].text in texts), None)

    def token_at(self, place: Place) -> int:
        """Return the index of the first token at or behind a place."""
        return bisect.bisect_left(self._starts, place)

    def replaced(self, start: Place, end: Place, text: str) -> Iterator[Edit]:
        """Yield the edit of a part of the text if it lies on one line."""
        if start[0] == end[0]:
            yield Edit(start[0], start[1], end[1], text)

    def nodes(self) -> Iterator[tuple[ast.AST, Scope]]:
        """Yield every node that a fault may go into: no docstrings, annotations, names, checks and warnings."""
        yield from _below(self.tree, Scope(False, None, None))


def _below(node: ast.AST, scope: Scope) -> Iterator[tuple[ast.AST, Scope]]:
    yield node, scope
    if isinstance(node, ast.ClassDef):
        scope = scope._replace(owner=node)
    elif isinstance(node, ast.FunctionDef):
        scope = Scope(scope.kernel or is_kernel(node), node, scope.owner)
    for child in _children(node):
        if not _is_left_out(child):
            yield from _below(child, scope)


def _children(node: ast.AST) -> Iterator[ast.AST]:
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        yield from node.body
    elif isinstance(node, ast.AnnAssign):
        yield from [node.target, *([node.value] if node.value else [])]
    elif isinstance(node, ast.Call) and called(node) == "isinstance":
        yield node.args[0]
    elif isinstance(node, ast.Module):
        yield from (child for child in node.body if not _is_alias(child))
    else:
        yield from ast.iter_child_nodes(node)


def _is_left_out(node: ast.AST) -> bool:
    if isinstance(node, ast.FunctionDef):
        return node.name in LEFT_OUT_FUNCTIONS or node.name.startswith(LEFT_OUT_STARTS)
    if isinstance(node, ast.Call):
        return called(node) in LEFT_OUT or called(node).startswith(LEFT_OUT_STARTS)
    if isinstance(node, ast.keyword):
        return node.arg in LEFT_OUT_KEYWORDS
    if isinstance(node, ast.If):
        return called(node.test) == "TYPE_CHECKING" or all(_is_left_out(step) for step in (*node.body, *node.orelse))
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Constant) or _is_left_out(node.value)
    return isinstance(node, ast.Raise | ast.Assert | ast.Import | ast.ImportFrom | ast.JoinedStr)


def _is_alias(node: ast.AST) -> bool:
    """Return whether a statement names a type: `Array = npt.NDArray[Any]`."""
    if not (isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)):
        return False
    name = node.targets[0].id.lstrip("_")
    return name[:1].isupper() and not name.isupper()


def is_kernel(function: ast.FunctionDef) -> bool:
    return any(called(decorator) in KERNELS for decorator in function.decorator_list)


def called(node: ast.AST) -> str:
    """Return the last word of a name, or of the name that is called: `maximum` of `np.maximum(a, b)`."""
    if isinstance(node, ast.Call):
        return called(node.func)
    return node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""
