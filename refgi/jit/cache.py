"""Keep compiled kernels on disk, where every copy of the same code finds them.

One file holds one specialisation of one kernel. Its name says the kernel, the key of its code (`refgi.jit.key`) and a
hash of the argument types, and nothing about where the sources lie or when they were written. What is in it stands in
`refgi.jit.kernelfile`; one that is damaged, even inside machine code, counts as absent and is written anew.

Machine code of a file is run, so only what nobody else can have written is read: neither the folder nor a file may
belong to another user, or be writable by one.
"""

import atexit
import contextlib
import hashlib
import os
import platform
import tempfile
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from numba import types
from numba.core import sigutils as untyped_sigutils

from refgi.errors import RefgiWarning
from refgi.jit.kernelfile import FORMAT, packed, unpacked
from refgi.jit.key import code_key

FOLDER = "REFGI_CACHE_DIR"
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
        arguments, _ = sigutils.normalize_signature(signature)
        text = " ".join(part for argument in arguments for part in _type(argument))
        name = f"{self._function.__module__.rpartition('.')[2]}.{self._function.__name__}"
        mark = hashlib.sha256(FORMAT + text.encode()).hexdigest()[:16]
        return _usable(cache_root()) / f"{name}-{_code_key(self._function)}-{mark}.kernel"

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return a specialisation, or None where there is none that can be used."""
        path = self.path(signature)
        target.refresh()
        try:
            content = _own_bytes(path)
            return None if content is None else unpacked(content, self._function, signature, target)
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
