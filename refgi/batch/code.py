"""Which sources a method's pictures depend on: the modules that its imports reach, name by name.

`from refgi.scene import Scene` reaches the module that defines `Scene` and not whatever else the package's `__init__`
imports. Imports inside functions count, those for type checkers do not, comments and docstrings change nothing.
"""

import ast
import functools
import hashlib
import os
import subprocess
from collections.abc import Iterable, Iterator
from importlib.metadata import entry_points
from importlib.util import find_spec, resolve_name
from pathlib import Path
from typing import NamedTuple

import refgi
from refgi.errors import InputError
from refgi.methods import BUILT_IN, GROUP

# what every result depends on beside its method: the buffers, the truth and what judges
SHARED = ("refgi.frame:Frame", "refgi.truth:trace_truth", "refgi.bench.error:error_of", "refgi.compare.outcome:measure",
          "refgi.compare.metrics:flip")
RUNNERS = ("refgi.bench.measure", "refgi.batch.work")  # by themselves: what else they import changes no result
BLOCKS = ("body", "orelse", "finalbody", "handlers", "cases")  # fields that hold statements


class Import(NamedTuple):
    """One name that a module imports."""

    module: str
    name: str | None  # None: the module itself
    bound: str  # what the importing module calls it


class Source(NamedTuple):
    """What matters of a source file."""

    digest: str
    imports: tuple[Import, ...]


def code_key(*places: str, alone: tuple[str, ...] = ()) -> str:
    """Return a digest of all sources that objects reach, and of modules `alone` without what they import."""
    modules = sorted({*alone}.union(*(reached(place) for place in places)))
    text = "\n".join(f"{module} {_source(file_of(module)).digest}" for module in modules)
    return hashlib.sha256(text.encode()).hexdigest()


@functools.cache
def reached(place: str) -> frozenset[str]:
    """Return the modules that an object, "module:name", reaches by imports, in its own package and in refgi."""
    module, _, name = place.partition(":")
    packages = {"refgi", module.partition(".")[0]}
    found: set[str] = set()
    waiting = [_home(module, name or None)]
    while waiting:
        one = waiting.pop()
        if one in found or one.partition(".")[0] not in packages:
            continue
        found.add(one)
        waiting += [_home(entry.module, entry.name) for entry in _imports_of(one)
                    if entry.module.partition(".")[0] in packages]
    return frozenset(found)


def place_of(method: str) -> str:
    """Return where a method is declared, as "module:name"."""
    return BUILT_IN[method] if method in BUILT_IN else entry_points(group=GROUP)[method].value


def source_digest(text: bytes) -> str:
    """Return a digest, in hexadecimal digits, of a Python source without its comments and docstrings."""
    return _digest(ast.parse(text))


def _digest(tree: ast.Module) -> str:
    """Return a digest of a syntax tree, which loses its docstrings."""
    for node in _statements(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and ast.get_docstring(
                node, clean=False) is not None:
            node.body = node.body[1:]
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest()


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a tree and all statements in it, but for those that type checkers alone see."""
    yield node
    typing = isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING")
    for block in BLOCKS[1:] if typing else BLOCKS:
        for child in getattr(node, block, ()):
            yield from _statements(child)


def _home(module: str, name: str | None) -> str:
    """Return the module that defines a name: a submodule, or what a package's `__init__` takes it from."""
    if name is None:
        return module
    if _is_module(f"{module}.{name}"):
        return f"{module}.{name}"
    if file_of(module).name == "__init__.py":
        for entry in _imports_of(module):
            if entry.bound == name and entry.module != module and _is_module(entry.module):
                return _home(entry.module, entry.name)
    return module


@functools.cache
def _source(file: Path) -> Source:
    tree = ast.parse(file.read_bytes())
    return Source(_digest(tree), tuple(entry for node in _statements(tree) for entry in _imports(node)))


def _imports_of(module: str) -> list[Import]:
    """Return what a module imports, by absolute names."""
    file = file_of(module)
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    return [entry._replace(module=resolve_name(entry.module, package)) for entry in _source(file).imports]


def _imports(node: ast.AST) -> Iterator[Import]:
    """Yield what a statement imports."""
    if isinstance(node, ast.Import):
        yield from (Import(alias.name, None, alias.asname or alias.name) for alias in node.names)
    if isinstance(node, ast.ImportFrom):
        module = "." * node.level + (node.module or "")
        yield from (Import(module, alias.name, alias.asname or alias.name) for alias in node.names)


def _is_module(name: str) -> bool:
    return _found(name) is not None


def file_of(module: str) -> Path:
    """Return the source file of a module of refgi or of a method."""
    file = _found(module)
    assert file is not None, module
    return file


@functools.cache
def _found(module: str) -> Path | None:
    """Return a module's source file, without importing any module."""
    top, *rest = module.split(".")
    spec = find_spec(top)
    if spec is None or spec.origin is None:
        return None
    base = Path(spec.origin)
    if not rest:
        return base
    place = base.parent.joinpath(*rest)
    files = (place / "__init__.py", place.with_suffix(".py"))
    return next((file for file in files if file.is_file()), None)


PACKAGE = Path(refgi.__file__).parent


def changed_methods(methods: Iterable[str], commit: str) -> dict[str, list[str]]:
    """Return by method which modules of those that it reaches changed since a commit; methods without are left out."""
    changed = _changed_files(commit)
    found = {}
    for method in methods:
        modules = set(RUNNERS).union(*(reached(place) for place in (*SHARED, place_of(method))))
        own = sorted(module for module in modules if file_of(module).resolve() in changed)
        if own:
            found[method] = own
    return found


def _changed_files(commit: str) -> set[Path]:
    """Return files of the package whose code is not that of a commit."""
    root = Path(_git(PACKAGE, "rev-parse", "--show-toplevel").strip())
    _git(root, "rev-parse", "--verify", "--quiet", f"{commit}^{{commit}}")
    named = _git(root, "diff", "--name-only", "-z", commit, "--", str(PACKAGE))
    files = [name for name in named.split("\0") if name.endswith(".py")]  # one that imports a new file is among them
    return {(root / name).resolve() for name in files if _differs(root, name, commit)}


def _differs(root: Path, name: str, commit: str) -> bool:
    file = root / name
    try:
        before = _git(root, "show", f"{commit}:{name}")
    except InputError:
        return True  # a new file
    return not file.exists() or source_digest(file.read_bytes()) != source_digest(before.encode())


def _git(folder: Path, *arguments: str) -> str:
    quiet = {key: value for key, value in os.environ.items() if not key.startswith("GIT_")}
    try:
        return subprocess.run(["git", *arguments], cwd=folder, env=quiet, capture_output=True, text=True,
                              check=True).stdout
    except (OSError, subprocess.CalledProcessError) as error:
        said = " ".join((getattr(error, "stderr", "") or str(error)).split())
        raise InputError(f"--since: git {' '.join(arguments)}: {said or 'no such commit'}", key="--since") from error
