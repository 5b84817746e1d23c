"""Which tests belong to a file of the sources: `python -m benchmarks.mutate.selection FILE`, or `make test-for`."""

import ast
import sys
from functools import cache
from pathlib import Path, PurePosixPath

from benchmarks.mutate.project import REFGI, Project

DOCTEST = ">>> "


def tests_of(project: Project, file: str) -> list[str]:
    """Return the test files of a source file: its doctests, its mirror, those that import it, and the wiring's."""
    wiring = _test_files(project, project.wiring_tests)
    others = [test for test in _test_files(project, project.tests) if test not in wiring]
    doctests = [file] if DOCTEST in (project.root / file).read_text() else []
    found = [test for test in others if _mirrors(project, file, test) or _imports(project, file, test)]
    return [*doctests, *found, *(test for test in wiring if _is_of_method(project, file, test))]


def _test_files(project: Project, folder: str) -> list[str]:
    return sorted(path.relative_to(project.root).as_posix() for path in (project.root / folder).rglob("test_*.py"))


def _mirrors(project: Project, file: str, test: str) -> bool:
    """Return whether a test stands in the folder of a source file's tests or one above, or below has its name."""
    top = PurePosixPath(project.tests)
    package = PurePosixPath(file).parent.relative_to(project.package)
    at = PurePosixPath(test).parent.relative_to(top)
    if at.parts and package.is_relative_to(at):
        return True
    return _names(PurePosixPath(file).stem, test) and at.parts[:1] == package.parts[:1]


def _names(word: str, test: str) -> bool:
    """Return whether a test file's name has a word, which may have underscores, as a whole."""
    return f"_{word}_" in f"{PurePosixPath(test).stem.removeprefix('test')}_"


def _imports(project: Project, file: str, test: str) -> bool:
    """Return whether a test imports a module, or from a package above it a name that the module defines."""
    module = file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    defined = _defined(project.root / file)
    for of, names in _imported(project.root / test):
        above = module.startswith(f"{of}.")
        if of == module or (above and (names & defined or module.removeprefix(f"{of}.") in names)):
            return True
    return False


@cache
def _imported(test: Path) -> tuple[tuple[str, frozenset[str]], ...]:
    """Return the modules that a test file imports, and the names from each."""
    found = []
    for node in ast.walk(ast.parse(test.read_text())):
        if isinstance(node, ast.Import):
            found += [(alias.name, frozenset()) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            found.append((node.module, frozenset(alias.name for alias in node.names)))
    return tuple(found)


@cache
def _defined(file: Path) -> frozenset[str]:
    """Return the functions and classes that a module defines."""
    return frozenset(node.name for node in ast.parse(file.read_text()).body
                     if isinstance(node, ast.FunctionDef | ast.ClassDef))


def _is_of_method(project: Project, file: str, test: str) -> bool:
    """Return whether a test of wiring is about the file's method, or either is about several."""
    method = project.method_of(file)
    methods = {name for name in project.methods.values() if _names(name, test)}
    return not method or not methods or method in methods


if __name__ == "__main__":
    print(*(test for file in sys.argv[1:] for test in tests_of(REFGI, file)))
