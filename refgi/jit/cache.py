"""Keep compiled kernels on disk, where every copy of the same code finds them.

One file holds one specialisation of one kernel. Its name says the kernel, the key of its code (`refgi.jit.key`) and a
hash of the argument types, and nothing about where the sources lie or when they were written. A file ends with
the SHA-256 of what comes before; one that is damaged, even inside machine code, counts as absent and is written anew.
"""

import atexit
import contextlib
import hashlib
import os
import pickle
import platform
import tempfile
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from numba import types
from numba.core import serialize as untyped_serialize
from numba.core import sigutils as untyped_sigutils
from numba.core.compiler import CompileResult

from refgi.errors import RefgiWarning
from refgi.jit.key import code_key

DIGEST = 32  # bytes of SHA-256

serialize: Any = untyped_serialize
sigutils: Any = untyped_sigutils


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


class KernelCache:
    """The specialisations of one kernel on disk, as Numba's dispatchers ask for them.

    Parameters
    ----------
    function : callable
        The kernel before it is compiled.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    @property
    def cache_path(self) -> str:
        """The folder."""
        return str(_usable(cache_root()))

    def path(self, signature: Any) -> Path:
        """Return the file of a specialisation."""
        arguments, _ = sigutils.normalize_signature(signature)
        text = " ".join(part for argument in arguments for part in _type(argument))
        name = f"{self._function.__module__.rpartition('.')[2]}.{self._function.__name__}"
        mark = hashlib.sha256(text.encode()).hexdigest()[:16]
        return _usable(cache_root()) / f"{name}-{_code_key(self._function)}-{mark}.kernel"

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return a specialisation, or None where there is none that can be used."""
        path = self.path(signature)
        target.refresh()
        try:
            return CompileResult._rebuild(target, *pickle.loads(_verified(path.read_bytes())))
        except FileNotFoundError:
            return None
        except Exception:  # damaged, or written by what this program no longer understands
            path.unlink(missing_ok=True)
            return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Write a specialisation, whole or not at all; one that holds addresses of this process stays in memory."""
        if compiled.library.has_dynamic_globals:
            return
        path = self.path(signature)
        content = serialize.dumps(compiled._reduce())
        temporary = None
        try:
            with tempfile.NamedTemporaryFile(dir=path.parent, prefix=".", delete=False) as file:
                temporary = Path(file.name)
                file.write(content + hashlib.sha256(content).digest())
            temporary.replace(path)
            temporary = None
        except OSError as error:
            warnings.warn(RefgiWarning(f"{path}: a compiled kernel cannot be kept ({error.strerror or error})"),
                          stacklevel=2)
        finally:
            if temporary is not None:
                with contextlib.suppress(OSError):
                    temporary.unlink(missing_ok=True)


def _verified(content: bytes) -> memoryview:
    """Return a file's content; a flipped bit of machine code would compute something else and say nothing of it."""
    entry = memoryview(content)[:-DIGEST]
    if hashlib.sha256(entry).digest() != content[-DIGEST:]:
        raise ValueError("damaged")
    return entry


def _type(kind: Any) -> Iterator[str]:
    """Describe an argument's type; named tuples by their fields, kernels by their code."""
    if isinstance(kind, types.Dispatcher):
        yield _code_key(kind.dispatcher.py_func)
    else:
        yield str(kind)
    if (named := getattr(kind, "instance_class", None)) is not None:
        yield f"{named.__module__} {named._fields}"
    if isinstance(kind, types.BaseTuple):
        items: Any = kind
        for item in items:
            yield from _type(item)


@cache
def _code_key(function: Callable[..., Any]) -> str:
    return code_key(function)


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
