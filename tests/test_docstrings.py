"""Property test of docstrings: the public interface and every stage describe all that goes in and comes out.

numpydoc checks sections where there are any; kernels and functions inside the package may do without.
"""

import ast
from pathlib import Path

import refgi

ROOT = Path(refgi.__file__).parent


def functions(tree):
    return [node for node in tree.body if isinstance(node, ast.FunctionDef)]


def has(function, decorator):
    return any(ast.unparse(one).partition("(")[0] == decorator for one in function.decorator_list)


def exported(tree):
    found = [node.value for node in tree.body
             if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"]
    return set(ast.literal_eval(found[0])) if found else set()


def lacks(function):
    """Return the sections that a function ought to have and has not."""
    text, arguments = ast.get_docstring(function) or "", function.args
    wanted = [("Parameters",)] if arguments.args or arguments.kwonlyargs or arguments.vararg else []
    if function.returns is not None and ast.unparse(function.returns) != "None":
        wanted.append(("Returns", "Yields"))
    return [names[0] for names in wanted if not any(f"\n{name}\n{'-' * len(name)}\n" in text for name in names)]


def test_public_functions_and_stages_are_documented_in_full():
    trees = {path: ast.parse(path.read_text()) for path in ROOT.rglob("*.py")
             if path.parent.name != "jit"}  # typed overloads, no interface of renderers
    faults, count = [], 0
    for path, tree in trees.items():
        names = exported(tree)
        for folder in path.parents[: len(path.relative_to(ROOT).parts)]:
            if folder / "__init__.py" in trees:
                names |= exported(trees[folder / "__init__.py"])
        for function in functions(tree):
            public = function.name in names and not function.name.startswith("_") and not has(function, "kernel")
            if public or has(function, "stage"):
                count += 1
                faults += [f"{path.relative_to(ROOT)}: {function.name}: {section}" for section in lacks(function)]
    assert count > 100
    assert not faults
