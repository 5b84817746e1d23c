"""The key of a kernel's code, and the processor that kernels are compiled for."""

import json
import os
import shutil
import subprocess
import sys
import textwrap
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from types import ModuleType

import llvmlite.binding
import pytest

import refgi
from refgi.jit import has_wide_registers
from refgi.jit.cache import code_key
from refgi.jit.dispatch import Kernel

BASE = """
    import math
    import numpy as np
    from typing import NamedTuple
    from refgi.jit import kernel
    from refgi.elementary import exp2

    SIZE = 4
    TABLE = np.array([1.0, 2.0])
    UNUSED = 1

    class Point(NamedTuple):
        x: float
        y: float

    @kernel
    def inner(x):
        return x + SIZE

    @kernel
    def outer(x, y=1.0):
        \"\"\"Say something.\"\"\"
        if x == "name":
            return TABLE[0]
        return exp2(math.sqrt(inner(x))) + Point(x, y).x
    """
SAME = {
    "docstring": ("Say something.", "Say another thing."),
    "comment": ("return x + SIZE", "return x + SIZE  # why"),
    "line": ("@kernel\n    def outer", "\n\n    @kernel\n    def outer"),
    "unused": ("UNUSED = 1", "UNUSED = 2"),
}
CHANGED = {
    "code": ("TABLE[0]", "TABLE[1]"),
    "callee": ("x + SIZE", "x - SIZE"),
    "constant of a callee": ("SIZE = 4", "SIZE = 5"),
    "table": ("[1.0, 2.0]", "[1.0, 3.0]"),
    "string": ('"name"', '"other"'),
    "default": ("y=1.0", "y=2.0"),
    "fields": ("x: float\n        y: float", "y: float\n        x: float"),
    "function of a library": ("math.sqrt", "math.cbrt"),
    "type of a constant": ("SIZE = 4", "SIZE = 4.0"),
}


def key(text: str, name: str = "outer") -> str:
    module = ModuleType("refgi_key_test")
    exec(textwrap.dedent(text), module.__dict__)
    return code_key(module.__dict__[name].py_func)


@pytest.mark.parametrize("change", SAME)
def test_what_changes_nothing_keeps_the_key(change):
    old, new = SAME[change]
    assert old in BASE
    assert key(BASE) == key(BASE.replace(old, new))


@pytest.mark.parametrize("change", CHANGED)
def test_what_changes_code_changes_the_key(change):
    old, new = CHANGED[change]
    assert old in BASE
    assert key(BASE) != key(BASE.replace(old, new))


CALLED = {  # old text, new text, whether the key is another one, program
    "a plain function": ("2 * x", "3 * x", True, """
        from numba.extending import register_jitable
        from refgi.jit import kernel

        @register_jitable
        def helper(x):
            return 2 * x

        @kernel
        def outer(x):
            return helper(x)
        """),
    "what an overload chooses": ("x + 1", "x + 2", True, """
        from refgi.jit import by_type, kernel

        @kernel
        def one(x):
            return x + 1

        KERNELS = {"one": one}

        def chosen(x):
            return x

        @by_type(chosen)
        def choose(x):
            function = KERNELS["one"]
            return lambda x: function(x)

        @kernel
        def outer(x):
            return chosen(x)
        """),
    "an intrinsic": (", 7)", ", 8)", True, """
        from numba import types
        from numba.extending import intrinsic
        from refgi.jit import kernel

        @intrinsic
        def constant(typing):
            return types.int64(), lambda context, builder, signature, values: context.get_constant(types.int64, 7)

        @kernel
        def outer():
            return constant()
        """),
    "a global with an attribute's name": ("object()", "None", False, """
        import numpy as np
        from refgi.jit import kernel

        zeros = object()  # a place in memory that is another one in each process

        @kernel
        def outer(n):
            return np.zeros(n)
        """),
}


@pytest.mark.parametrize("name", CALLED)
def test_what_is_called_counts_with_its_code(name):
    old, new, is_other, text = CALLED[name]
    assert old in text
    assert (key(text) != key(text.replace(old, new))) == is_other


@cache
def kernels() -> dict[str, str]:
    modules = [import_module(name) for _, name, _ in walk_packages(refgi.__path__, "refgi.")
               if not name.startswith(("refgi.cli", "refgi.__main__"))]
    found = {id(value): value for module in modules for value in vars(module).values() if isinstance(value, Kernel)}
    return {f"{value.py_func.__module__}.{value.py_func.__name__}": code_key(value.py_func)
            for value in found.values()}


def test_every_kernel_has_a_key_of_its_own():
    keys = kernels()
    assert len(keys) > 300
    assert len(set(keys.values())) == len(keys)


def test_every_process_has_the_same_keys_and_editing_materials_changes_none(tmp_path: Path):
    """Of the same sources but for a file that no kernel reaches, in another place, strings hashed otherwise."""
    copy = tmp_path / "refgi"
    shutil.copytree(Path(refgi.__file__).parent, copy, ignore=shutil.ignore_patterns("__pycache__"))
    code = Path(__file__).read_text()
    (tmp_path / "keys.py").write_text(code + "\n\nprint(json.dumps(kernels()))\n")
    material = copy / "scene" / "material.py"
    material.write_text(material.read_text() + "NEW = 1\n\n\ndef new():\n    return NEW\n")
    done = subprocess.run([sys.executable, "keys.py"], cwd=tmp_path, capture_output=True, text=True, check=True,
                          env=os.environ | {"PYTHONHASHSEED": "7", "PYTHONPATH": str(tmp_path)})
    assert json.loads(done.stdout) == kernels()


@pytest.mark.parametrize("name", ["NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_LOOP_VECTORIZE", "NUMBA_OPT"])
def test_what_numba_compiles_for_changes_the_key(monkeypatch, name):
    """A kernel of another target would have other code under the same name."""
    from refgi.jit.cache import _platform

    monkeypatch.delenv(name, raising=False)
    plain = _platform.__wrapped__()
    monkeypatch.setenv(name, "1")
    assert _platform.__wrapped__() != plain


def test_what_compiles_changes_the_key(monkeypatch):
    from refgi.jit import cache

    plain = cache._platform.__wrapped__()
    monkeypatch.setattr(cache, "COMPILERS", cache.COMPILERS[:-1])
    assert cache._platform.__wrapped__() != plain


def test_the_processor_changes_the_key_but_that_of_a_level(monkeypatch):
    """Kernels of a wheel are found on any processor that has their level, those made here on one like this."""
    from refgi.jit.cache import LEVELS, NAMED, _platform

    for name in NAMED:
        monkeypatch.delenv(name, raising=False)
    here = {level: _platform.__wrapped__(level) for level in ("", *LEVELS)}
    monkeypatch.setattr(llvmlite.binding, "get_host_cpu_features", lambda: llvmlite.binding.FeatureMap(sse2=True))
    there = {level: _platform.__wrapped__(level) for level in here}
    assert [level for level in here if here[level] == there[level]] == list(LEVELS)
    assert len(set(here.values())) == len(here)


@pytest.mark.parametrize(("name", "features", "wide"), [
    (None, "+sse2,+avx512f", True), (None, "+avx2,-avx512f", False), ("skylake-avx512", None, False),
    ("skylake-avx512", "+avx2,+avx512f", True), ("x86-64", None, False)])
def test_the_target_that_is_named_counts(monkeypatch, name, features, wide):
    for key, value in (("NUMBA_CPU_NAME", name), ("NUMBA_CPU_FEATURES", features)):
        monkeypatch.delenv(key, raising=False)
        if value is not None:
            monkeypatch.setenv(key, value)
    assert has_wide_registers() is wide


@pytest.mark.parametrize("name", [None, "host"])
def test_else_the_processor_does(monkeypatch, name):
    monkeypatch.delenv("NUMBA_CPU_FEATURES", raising=False)
    monkeypatch.delenv("NUMBA_CPU_NAME", raising=False)
    if name:
        monkeypatch.setenv("NUMBA_CPU_NAME", name)
    for has in (True, False):
        monkeypatch.setattr(llvmlite.binding, "get_host_cpu_features", lambda has=has: {"avx512f": has})
        assert has_wide_registers() is has


SCALE = """
from numba import float32
from refgi.jit import kernel

@kernel
def scale(a, b):
    for i in range(a.size):
        b[i] *= a[i]

scale.compile((float32[::1], float32[::1]))
print("".join(scale.inspect_asm().values()))
"""


def test_registers_of_512_bits_are_used_where_llvm_would_take_half(tmp_path):
    (tmp_path / "scale.py").write_text(SCALE)
    target = {"NUMBA_CPU_NAME": "skylake-avx512", "NUMBA_CPU_FEATURES": "", "REFGI_CACHE_DIR": str(tmp_path / "cache")}
    run = subprocess.run([sys.executable, tmp_path / "scale.py"], env=os.environ | target, check=True,
                         capture_output=True, text=True)
    assert "zmm" in run.stdout
