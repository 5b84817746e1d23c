"""Keep compiled kernels on disk, where every copy of the same code finds them, by a hash of that code.

Numba keys its disk cache by the source file of a kernel alone, so a change in an imported kernel leaves a stale caller
behind. Here the key covers the kernel's own bytecode and constants, the kernels it calls, the values of the globals it
reads, and versions and sources of what compiles it; comments, docstrings, line numbers and the rest of its module are
no part of it. Intrinsics, and overloads registered by `refgi.jit.by_type`, count with their code as well.

Of processes that want the same kernel at once one compiles it, and the others wait: they lock a byte of a file, `LOCK`.

One file holds one specialisation of one kernel. Its name says the kernel, the key of its code (`code_key`) and a hash
of the argument types, and nothing about where the sources lie or when they were written. What is in it stands in
`refgi.jit.kernelfile`; one that is damaged, even inside machine code, counts as absent and is written anew.

A wheel may bring kernels along, in `BROUGHT`. They are compiled for a level of the x86-64 psABI, of which the
processor's best is taken; they compute the same bits, since arithmetic is strict.

Machine code of a file is run, so only what nobody else can have written is read: neither the folder nor a file may
belong to another user, or be writable by one.
"""

import atexit
import contextlib
import dis
import hashlib
import os
import platform
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import llvmlite.binding
import numba
import numpy as np
from numba import types
from numba.core import sigutils as untyped_sigutils

from refgi.errors import RefgiWarning
from refgi.jit.kernelfile import FORMAT, packed, unpacked

LIBRARIES = sys.stdlib_module_names | {"llvmlite", "numba", "numpy"}  # known by their versions
COMPILERS = ("dispatch.py", "bands.py", "launcher.py")  # of this package
# of the environment, where it is set: what Numba compiles for and how
NAMED = ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES")
TARGET = (*NAMED, "NUMBA_ENABLE_AVX", "NUMBA_LOOP_VECTORIZE", "NUMBA_OPT", "NUMBA_SLP_VECTORIZE")
V3 = "avx avx2 bmi bmi2 cx16 f16c fma lzcnt movbe popcnt sahf sse4.2"
LEVELS = {"x86-64-v4": f"{V3} avx512f avx512bw avx512cd avx512dq avx512vl", "x86-64-v3": V3}  # features; the best first
BROUGHT = Path(__file__).with_name("brought")  # kernels of a wheel
OVERLOADS = "__overloads__"  # attribute of a function that stands for others, by argument types
READS = frozenset({"LOAD_GLOBAL", "LOAD_NAME"})  # operations that read a global
EXACT = (bool, int, float, complex, str, bytes, type(None), type(...), np.generic, np.dtype)


def code_key(function: Callable[..., Any], level: str = "") -> str:
    """Return the key of a kernel's code, 32 hexadecimal digits; `function` is the Python function that is compiled.

    `level`: of `LEVELS`, what it is compiled for; by default what Numba compiles for here.
    """
    return hashlib.sha256(f"{_platform(level)} {_reached(function)}".encode()).hexdigest()[:32]


@cache
def _reached(function: Callable[..., Any]) -> str:
    """Return a digest of a kernel's code and of what it reaches."""
    digest = hashlib.sha256()
    for part in _function(function, set()):
        digest.update(part.encode() + b"\0")
    return digest.hexdigest()


@cache
def _platform(level: str = "") -> str:
    chosen = {name: os.environ[name] for name in TARGET if os.environ.get(name)} | target_of(level)
    if not all(name in chosen for name in NAMED):
        chosen["host"] = llvmlite.binding.get_host_cpu_features().flatten()
    bounds = os.environ.get("NUMBA_BOUNDSCHECK", "")
    ours = hashlib.sha256(b"".join(Path(__file__).with_name(name).read_bytes() for name in COMPILERS))
    return (f"{sys.version_info[:2]} {sys.platform} {platform.machine()} {numba.__version__} {llvmlite.__version__} "
            f"{np.__version__} {bounds} {ours.hexdigest()} {sorted(chosen.items())}")


def target_of(level: str) -> dict[str, str]:
    """Return the environment in which Numba compiles for a level; of no level an empty one."""
    return {} if not level else {
        "NUMBA_CPU_NAME": level, "NUMBA_CPU_FEATURES": ",".join(f"+{name}" for name in LEVELS[level].split())}


@cache
def levels() -> list[str]:
    """Return the levels that the processor has, the best first."""
    features = llvmlite.binding.get_host_cpu_features()
    return [level for level, needed in LEVELS.items() if all(features.get(name) for name in needed.split())]


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


FOLDER = "REFGI_CACHE_DIR"
LOCK = ".lock"  # empty; a specialisation has one byte of it, by the hash of its name
ANOTHER_CAN_WRITE = 0o022  # bits of a mode: group and others

sigutils: Any = untyped_sigutils


def cache_root() -> Path:
    """Return the folder of all compiled kernels.

    Returns
    -------
    Path
        `REFGI_CACHE_DIR`, else a folder of the platform's cache.
    """
    if named := os.environ.get(FOLDER):
        return Path(named)
    base = os.environ.get("LOCALAPPDATA") if platform.system() == "Windows" else os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "refgi"


class KernelCache:
    """The specialisations on disk of one kernel, given as a Python function, as Numba's dispatchers ask for them."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    @property
    def cache_path(self) -> str:
        """The folder."""
        return str(_usable(cache_root()))

    def path(self, signature: Any) -> Path:
        """Return the file of a specialisation."""
        return _usable(cache_root()) / self._name(signature)

    def brought(self, signature: Any) -> Path | None:
        """Return the file of a specialisation that came with the package, None where none is for this target."""
        if not BROUGHT.is_dir() or any(os.environ.get(name) for name in NAMED):
            return None
        paths = (BROUGHT / self._name(signature, level) for level in levels())
        return next((path for path in paths if path.exists()), None)

    def has(self, signature: Any) -> bool:
        """Return whether there is a file of a specialisation."""
        return self.path(signature).exists() or self.brought(signature) is not None

    def _name(self, signature: Any, level: str = "") -> str:
        arguments, _ = sigutils.normalize_signature(signature)
        text = " ".join(part for argument in arguments for part in _type(argument))
        name = f"{self._function.__module__.rpartition('.')[2]}.{self._function.__name__}"
        mark = hashlib.sha256(FORMAT + text.encode()).hexdigest()[:16]
        return f"{name}-{code_key(self._function, level)}-{mark}.kernel"

    @contextlib.contextmanager
    def made_by_one(self, signature: Any) -> Iterator[None]:
        """Let one process at a time make a specialisation; others wait, and then find it on the disk."""
        path = self.path(signature)
        if self.has(signature) or (lock := _lock(path.parent)) is None:
            yield
            return
        byte = int.from_bytes(hashlib.sha256(path.name.encode()).digest()[:6])
        lock(True, byte)
        try:
            yield
        finally:
            lock(False, byte)

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return a specialisation, or None where there is none that can be used."""
        path = self.path(signature)
        target.refresh()
        try:
            content = _own_bytes(path)
            return None if content is None else unpacked(content, self._function, signature, target)
        except FileNotFoundError:
            pass
        except Exception:  # damaged, or written by what this program no longer understands
            path.unlink(missing_ok=True)
        if (brought := self.brought(signature)) is not None:
            with contextlib.suppress(Exception):  # damaged; it is as trusted as the sources beside it
                return unpacked(brought.read_bytes(), self._function, signature, target)
        return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Write a specialisation, whole or not at all; one that holds addresses of this process stays in memory."""
        if compiled.library.has_dynamic_globals:
            return
        path = self.path(signature)
        temporary = None
        try:
            content = packed(compiled)
            with tempfile.NamedTemporaryFile(dir=path.parent, prefix=".", delete=False) as file:  # mode 0600
                temporary = Path(file.name)
                file.write(content)
            temporary.replace(path)
            temporary = None
        except (OSError, TypeError) as error:
            why = getattr(error, "strerror", None) or error
            warnings.warn(RefgiWarning(f"{path}: a compiled kernel cannot be kept ({why})"), stacklevel=2)
        finally:
            if temporary is not None:
                with contextlib.suppress(OSError):
                    temporary.unlink(missing_ok=True)


@cache
def _lock(folder: Path) -> Callable[[bool, int], None] | None:
    """Return what locks and unlocks a byte of the folder's lock file, None where there are no such locks."""
    try:
        import fcntl

        file = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT, 0o600)  # open as long as the process: closing unlocks
    except (ImportError, OSError):
        return None

    def call(taken: bool, byte: int) -> None:
        with contextlib.suppress(OSError):  # without a lock both make it, and the second file takes the place
            fcntl.lockf(file, fcntl.LOCK_EX if taken else fcntl.LOCK_UN, 1, byte)

    return call


def _own_bytes(path: Path) -> bytes | None:
    """Return a file's content, or None and say so where another user can have written it."""
    with path.open("rb") as file:
        if why := _stranger(os.fstat(file.fileno())):
            warnings.warn(RefgiWarning(f"{path}: {why}: this compiled kernel is not run but made anew"), stacklevel=2)
            return None
        return file.read()


def _stranger(status: os.stat_result) -> str:
    """Return why a file or folder may hold what another user wrote; empty where it cannot."""
    user = getattr(os, "geteuid", lambda: None)()
    if user is None:  # no owners and modes as POSIX has them
        return ""
    if status.st_uid != user:
        return "it belongs to another user"
    return "other users can write to it" if status.st_mode & ANOTHER_CAN_WRITE else ""


def _type(kind: Any) -> Iterator[str]:
    """Describe an argument's type; named tuples by their fields, kernels by their code."""
    if isinstance(kind, types.Dispatcher):
        yield _reached(kind.dispatcher.py_func)
    else:
        yield str(kind)
    if (named := getattr(kind, "instance_class", None)) is not None:
        yield f"{named.__module__} {named._fields}"
    if isinstance(kind, types.BaseTuple):
        items: Any = kind
        for item in items:
            yield from _type(item)


@cache
def _usable(folder: Path) -> Path:
    """Return the folder, or one that lasts as long as the process where that cannot be written or trusted."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        why = _stranger(folder.stat())
        if not why:
            with tempfile.TemporaryFile(dir=folder):
                return folder
    except OSError as error:
        why = error.strerror or str(error)
    warnings.warn(RefgiWarning(f"{folder}: compiled kernels cannot be kept ({why}): every start compiles again; "
                               f"{FOLDER} names another folder"), stacklevel=2)
    rescue = tempfile.TemporaryDirectory(prefix="refgi-")
    atexit.register(rescue.cleanup)
    os.environ[FOLDER] = rescue.name  # for processes that compile ahead
    return Path(rescue.name)
