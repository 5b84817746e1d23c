"""Weight of the sources: files, lines of code and of words, arguments, circles of imports, rooms that `frame` enters.

Nothing is timed and nothing is imported: the sources are read.
"""

import ast
import io
import tokenize
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks.harness import Row

ROOT = Path(__file__).parents[1]
TREES = {"refgi": (320, 58_000), "tests": (None, 48_000), "benchmarks": (None, 13_000)}  # most files and lines
MANY = 12  # arguments from which a function has too many
ROOMS = 15  # functions of a method that may be handed the frame
METHODS = {"sii": "splat/sii", "multires": "splat/multires", "gather": "splat/gather", "val": "cluster",
           "hssil": "sssil", "truth": "truth"}  # where each lives


class Weight(NamedTuple):
    """Lines of a file by kind."""

    all: int
    code: int
    docstring: int
    comment: int
    blank: int


def rows(quick: bool) -> Iterator[Row]:  # noqa: ARG001 as every topic's
    for tree, (files, lines) in TREES.items():
        found = sorted((ROOT / tree).rglob("*.py"))
        weights = [weight(path.read_text("utf-8")) for path in found]
        yield Row(f"{tree}: files", len(found), "", f"<= {files}" if files else "")
        for name in Weight._fields:
            total = sum(getattr(one, name) for one in weights)
            yield Row(f"{tree}: lines{'' if name == 'all' else f' of {name}'}", total, "",
                      f"<= {lines}" if name == "all" else "")
    sources = {path: ast.parse(path.read_text("utf-8")) for path in sorted((ROOT / "refgi").rglob("*.py"))}
    many = [(name, kernel) for path, tree in sources.items() for name, count, kernel in functions(path, tree)
            if count > MANY]
    yield Row(f"functions of more than {MANY} arguments", len(many), "", "<= 5", ", ".join(name for name, _ in many))
    yield Row("of these kernels", sum(kernel for _, kernel in many), "", "<= 0")
    for late in (False, True):
        found = circles(imports(sources, late))
        yield Row(f"circles of imports{', those inside functions or for types too' if late else ''}", len(found), "",
                  "<= 0", "; ".join(f"{len(one)} of {min(one, key=len)}" for one in found))
    for method, place in METHODS.items():
        entered = sum("frame" in _arguments(node) for path, tree in sources.items()
                      if path.is_relative_to(ROOT / "refgi" / place) for node in _functions(tree))
        yield Row(f"functions of {method} that are handed the frame", entered, "", f"<= {ROOMS}")


def weight(text: str) -> Weight:
    """Return how many lines of a source are code, docstring, comment alone, and blank."""
    docstring, comment, code = set[int](), set[int](), set[int]()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and ast.get_docstring(
                node, clean=False) is not None:
            docstring |= set(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        lines = set(range(token.start[0], token.end[0] + 1))
        if token.type == tokenize.COMMENT:
            comment |= lines
        elif token.string.strip() and token.type != tokenize.ENDMARKER:
            code |= lines
    code -= docstring
    total = len(text.splitlines())
    return Weight(total, len(code), len(docstring), len(comment - code - docstring),
                  total - len(code | docstring | comment))


def functions(path: Path, tree: ast.Module) -> Iterator[tuple[str, int, bool]]:
    """Yield each function's name, how many arguments it has, and whether it is a kernel; commands have options."""
    for node in _functions(tree):
        marks = [ast.unparse(one) for one in node.decorator_list]
        if not any("click" in one or ".command" in one for one in marks):
            yield (f"{path.stem}.{node.name}", len(_arguments(node)), any(one.startswith("kernel") for one in marks))


def _functions(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    return (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))


def _arguments(node: ast.FunctionDef) -> list[str]:
    return [one.arg for one in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]


def imports(sources: dict[Path, ast.Module], late: bool) -> dict[str, set[str]]:
    """Return which modules each module imports when it is imported; `late`: or inside a function, or for types."""
    names = {_module(path): tree for path, tree in sources.items()}
    return {name: {_nearest(one, names) for one in _imported(ast.walk(tree) if late else tree.body)} - {name, ""}
            for name, tree in names.items()}


def _module(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def _imported(body: Iterable[ast.AST]) -> Iterator[str]:
    for node in body:
        if isinstance(node, ast.Import):
            yield from (one.name for one in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{one.name}" for one in node.names)
        elif isinstance(node, ast.Try):
            yield from _imported(node.body)


def _nearest(name: str, names: dict[str, ast.Module]) -> str:
    """Return the module that a name is, or that it is defined in; "" outside."""
    while name and name not in names:
        name = name.rpartition(".")[0]
    return name


def circles(arrows: dict[str, set[str]]) -> list[set[str]]:
    """Return the sets of modules that import each other round, the largest first (Tarjan's components)."""
    index, low, stack, found = dict[str, int](), dict[str, int](), list[str](), list[set[str]]()

    def visit(name: str) -> None:
        index[name] = low[name] = len(index)
        stack.append(name)
        for other in arrows[name]:
            if other not in index:
                visit(other)
            if other in stack:
                low[name] = min(low[name], low[other])
        if low[name] == index[name]:
            component = set(stack[stack.index(name):])
            del stack[stack.index(name):]
            if len(component) > 1:
                found.append(component)

    for name in arrows:
        if name not in index:
            visit(name)
    return sorted(found, key=len, reverse=True)
