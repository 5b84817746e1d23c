"""Every Numba option of the project, and where compiled kernels are kept.

Kernels are compiled with strict IEEE arithmetic: no fastmath, no contraction of multiply and add, division by zero
gives infinity instead of a branch. That costs little when pixels are the SIMD lanes, and it makes results equal to
the bit for every thread count and on every machine with the same arithmetic.

Numba keys its disk cache by the source file of a kernel alone, so a change in an *imported* kernel leaves a stale
caller behind. Here each kernel's cache folder is keyed by its module's source **and the sources of every refgi
module it imports, directly or not**, together with the versions of numba, llvmlite and NumPy and the CPU's features,
and by nothing else: every copy of the same sources finds the same kernels. A cache file that cannot be read is dropped
and rebuilt.
"""

import atexit
import hashlib
import importlib.util
import os
import platform
import re
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, overload

import llvmlite
import llvmlite.binding
import numba
import numpy as np
from numba.core.caching import _CacheLocator

from refgi.errors import RefgiWarning

P = ParamSpec("P")
R = TypeVar("R")

prange = numba.prange

# an absolute import statement; parsing the syntax instead would take half of the start-up time
IMPORT = re.compile(r"^[ \t]*(?:import ([\w.]+)|from ([\w.]+) import (\([^)]*\)|[^\n]*))", re.MULTILINE)


def cache_root() -> Path:
    """Return the folder of all compiled kernels.

    Returns
    -------
    Path
        `REFGI_CACHE_DIR`, else a folder of the platform's cache.
    """
    if named := os.environ.get("REFGI_CACHE_DIR"):
        return Path(named)
    base = os.environ.get("LOCALAPPDATA") if platform.system() == "Windows" else os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "refgi"


@overload
def kernel(function: Callable[P, R], /) -> Callable[P, R]: ...
@overload
def kernel(*, parallel: bool = ...) -> Callable[[Callable[P, R]], Callable[P, R]]: ...


def kernel(function: Callable[..., Any] | None = None, /, *, parallel: bool = False) -> Any:
    """Compile a function on arrays with the project's one set of Numba options.

    Parameters
    ----------
    function : callable
        The function; absent when options are given.
    parallel : bool
        Run its `prange` loops on all threads. Each output element must be owned by one iteration.

    Returns
    -------
    callable
        The compiled function, with the signature of `function`.
    """

    def compile_later(plain: Callable[P, R]) -> Callable[P, R]:
        with _cache_folder(plain.__module__):
            compiled = numba.njit(
                cache=True, fastmath=False, error_model="numpy", nogil=True, parallel=parallel, boundscheck=None
            )(plain)
        _mend_when_damaged(compiled)
        return compiled

    return compile_later if function is None else compile_later(function)


@contextmanager
def threads(count: int | None) -> Iterator[None]:
    """Run parallel kernels on `count` threads inside the block (None: leave as is).

    Parameters
    ----------
    count : int or None
        Threads, 1 to the number Numba started with.
    """
    before = numba.get_num_threads()
    try:
        if count is not None:
            numba.set_num_threads(count)
        yield
    finally:
        numba.set_num_threads(before)


class KeyedFolder(_CacheLocator):
    """Where Numba keeps a kernel: in the folder of its module's key, whatever the source's own folder and time.

    Parameters
    ----------
    function : callable
        The kernel before it is compiled.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        config: Any = numba.config
        self._folder, self._line = str(config.CACHE_DIR), function.__code__.co_firstlineno

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> "KeyedFolder":  # noqa: ARG003
        """Return the locator of a function."""
        return cls(py_func)

    def get_cache_path(self) -> str:
        """Return the folder."""
        return self._folder

    def get_source_stamp(self) -> str:
        """Return what marks a changed source: nothing, as the folder's name does."""
        return ""

    def get_disambiguator(self) -> str:
        """Return what tells functions of one name apart: the line."""
        return str(self._line)


@contextmanager
def _cache_folder(module: str) -> Iterator[None]:
    config: Any = numba.config
    before = config.CACHE_DIR, config.CACHE_LOCATOR_CLASSES
    config.CACHE_DIR = str(_usable(cache_root()) / _key(module))
    config.CACHE_LOCATOR_CLASSES = f"{__name__}.{KeyedFolder.__name__}"
    try:
        yield
    finally:
        config.CACHE_DIR, config.CACHE_LOCATOR_CLASSES = before


@cache
def _usable(folder: Path) -> Path:
    """Return the folder, or one that lasts as long as the process where that cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        warnings.warn(RefgiWarning(f"{folder}: compiled kernels cannot be kept ({error.strerror or error}): "
                                   "every start compiles again; REFGI_CACHE_DIR names another folder"), stacklevel=2)
        rescue = tempfile.TemporaryDirectory(prefix="refgi-")
        atexit.register(rescue.cleanup)
        return Path(rescue.name)


@cache
def _key(module: str) -> str:
    digest = hashlib.sha256(_platform_key().encode())
    for name in sorted(_sources_of(module)):
        digest.update(name.encode() + b"\0" + _source(name))
    return f"{module.rpartition('.')[2]}-{digest.hexdigest()[:16]}"


@cache
def _platform_key() -> str:
    features = llvmlite.binding.get_host_cpu_features().flatten()
    bounds = os.environ.get("NUMBA_BOUNDSCHECK", "")
    return f"{numba.__version__} {llvmlite.__version__} {np.__version__} {features} {bounds}"


@cache
def _source_path(module: str) -> Path | None:
    """Return where a module's source lies, by its name alone: asking the import system would import its parents."""
    package, *rest = module.split(".")
    spec = importlib.util.find_spec(package)
    if spec is None or spec.origin is None:
        return None
    base = Path(spec.origin).parent.joinpath(*rest) if spec.submodule_search_locations else Path(spec.origin)
    candidates = (base / "__init__.py", base.with_suffix(".py"))
    return next((path for path in candidates if path.is_file()), None)


@cache
def _source(module: str) -> bytes:
    """Return a module's source as it was when first asked for: what runs does not follow a file edited since."""
    path = _source_path(module)
    return path.read_bytes() if path else b""


def _sources_of(module: str) -> set[str]:
    """Return `module` and every module of its package that it imports, directly or not."""
    found: set[str] = set()
    pending = [module]
    while pending:
        name = pending.pop()
        if name not in found:
            found.add(name)
            pending += _imports(name, module.partition(".")[0])
    return found


@cache
def _imports(module: str, package: str) -> tuple[str, ...]:
    names = set()
    for plain, parent, members in IMPORT.findall(_source(module).decode()):
        names |= {plain or parent, *(f"{parent}.{member}" for member in re.findall(r"\w+", members) if parent)}
    return tuple(name for name in names if name.partition(".")[0] == package and _source_path(name))


def _mend_when_damaged(compiled: Any) -> None:
    """Make an unreadable cache file count as absent: Numba itself would fail on every later run."""
    stored = getattr(compiled, "_cache", None)
    if stored is None:  # NUMBA_DISABLE_JIT: the plain function
        return
    load = stored.load_overload

    def load_or_drop(signature: Any, target: Any) -> Any:
        try:
            return load(signature, target)
        except Exception:
            stored.flush()
            return None

    stored.load_overload = load_or_drop
