"""Identify a kernel's code: a hash of its bytecode and of everything that the bytecode reaches.

Numba keys its disk cache by the source file of a kernel alone, so a change in an imported kernel leaves a stale caller
behind. Here the key covers the kernel's own bytecode and constants, the kernels it calls, the values of the globals it
reads, and versions and sources of what compiles it; comments, docstrings, line numbers and the rest of its module are
no part of it. Intrinsics, and overloads registered by `refgi.jit.by_type`, count with their code as well.
"""

import dis
import hashlib
import os
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import llvmlite.binding
import numba
import numpy as np

LIBRARIES = sys.stdlib_module_names | {"llvmlite", "numba", "numpy"}  # known by their versions
COMPILERS = ("dispatch.py", "bands.py", "launcher.py")  # of this package
# of the environment, where it is set: what Numba compiles for and how
TARGET = ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_ENABLE_AVX", "NUMBA_LOOP_VECTORIZE", "NUMBA_OPT",
          "NUMBA_SLP_VECTORIZE")
OVERLOADS = "__overloads__"  # attribute of a function that stands for others, by argument types
READS = frozenset({"LOAD_GLOBAL", "LOAD_NAME"})  # operations that read a global
EXACT = (bool, int, float, complex, str, bytes, type(None), type(...), np.generic, np.dtype)


def code_key(function: Callable[..., Any]) -> str:
    """Return the key of a kernel's code, 32 hexadecimal digits; `function` is the Python function that is compiled."""
    digest = hashlib.sha256(_platform().encode())
    for part in _function(function, set()):
        digest.update(part.encode() + b"\0")
    return digest.hexdigest()[:32]


@cache
def _platform() -> str:
    features = llvmlite.binding.get_host_cpu_features().flatten()
    bounds = os.environ.get("NUMBA_BOUNDSCHECK", "")
    target = "".join(f" {name}={os.environ[name]}" for name in TARGET if os.environ.get(name))
    ours = hashlib.sha256(b"".join(Path(__file__).with_name(name).read_bytes() for name in COMPILERS))
    return (f"{sys.version_info[:2]} {numba.__version__} {llvmlite.__version__} {np.__version__} {features} {bounds} "
            f"{ours.hexdigest()}{target}")


def _function(function: Callable[..., Any], known: set[int]) -> Iterator[str]:
    """Name a function, and describe it and what it reaches unless that was done before."""
    yield f"{function.__module__}.{function.__qualname__}"
    if id(function) in known:
        return
    known.add(id(function))
    yield from _code(function.__code__)
    yield from _value(function.__defaults__, known)
    for cell in function.__closure__ or ():
        yield from _value(cell.cell_contents, known)
    for name in _names(function.__code__, READS):
        if name in function.__globals__:
            yield name
            yield from _value(function.__globals__[name], known, _names(function.__code__))


def _code(code: CodeType) -> Iterator[str]:
    """Describe bytecode without its docstring and lines."""
    yield f"{code.co_code.hex()} {code.co_names} {code.co_varnames} {code.co_freevars} {code.co_cellvars}"
    yield f"{code.co_argcount} {code.co_kwonlyargcount} {code.co_flags}"
    documented = bool(code.co_consts) and isinstance(code.co_consts[0], str)
    for constant in code.co_consts[documented:]:
        if isinstance(constant, CodeType):
            yield from _code(constant)
        else:
            yield repr(constant)


def _names(code: CodeType, operations: frozenset[str] | None = None) -> list[str]:
    """Return the globals and attributes that code and the functions in it name, or those of some operations."""
    nested = (name for one in code.co_consts if isinstance(one, CodeType) for name in _names(one, operations))
    own = code.co_names if operations is None else (
        step.argval for step in dis.get_instructions(code) if step.opname in operations)
    return sorted({*own, *nested})


def _value(value: Any, known: set[int], names: list[str] | tuple[str, ...] = ()) -> Iterator[str]:
    """Describe the value of a global, of which a kernel uses the attributes `names`."""
    if isinstance(value, EXACT):
        yield f"{type(value).__name__} {value!r}"
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    elif isinstance(value, tuple | list | frozenset | dict):
        yield type(value).__name__
        items = value.items() if isinstance(value, dict) else value
        for item in sorted(items, key=repr) if isinstance(value, frozenset) else items:
            yield from _value(item, known)
    elif isinstance(value, ModuleType):
        yield value.__name__
        for name in () if _is_library(value.__name__) else names:
            if hasattr(value, name):
                yield from _value(getattr(value, name), known, names)
    elif (function := getattr(value, "py_func", None) or getattr(value, "_defn", None)) is not None:
        yield from _function(function, known)  # a kernel or an intrinsic
    elif isinstance(value, FunctionType) and not _is_library(value.__module__):
        yield from _function(value, known)
        yield from _value(getattr(value, OVERLOADS, ()), known)
    else:
        yield from _named(value)


def _named(value: Any) -> Iterator[str]:
    """Describe what a library knows by its name; classes of ours by their fields or their module's source."""
    home = value if callable(value) else type(value)
    module = getattr(home, "__module__", None) or ""
    yield f"{module}.{getattr(home, '__qualname__', type(value).__qualname__)} {getattr(value, '_fields', '')}"
    if not callable(value):
        yield str(value)
    if isinstance(value, type) and not (_is_library(module) or issubclass(value, tuple)):
        yield hashlib.sha256(Path(sys.modules[module].__file__ or "").read_bytes()).hexdigest()


def _is_library(module: str) -> bool:
    return module.partition(".")[0] in LIBRARIES
