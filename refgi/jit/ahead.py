"""Compile kernels ahead, in as many processes as there are cores.

`signatures.txt` lists which specialisations the methods need at their defaults: a line holds a kernel, its argument
types and what needs them. Types are written as expressions: `float32[:, ::1]`, `(int64, none)`,
`named('package.module.Class', float32, ...)` for a named tuple, `omitted(1.0)` for a default value.
"""

import importlib
import os
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

from numba import types

LIST = Path(__file__).with_name("signatures.txt")
LAYOUTS = {"C": (":", "::1"), "F": ("::1", ":"), "A": (":", ":")}  # first and last axis as Numba writes them

Progress = Callable[[str, float], None]


class Specialisation(NamedTuple):
    """A kernel and the types of its arguments."""

    kernel: str  # module and name
    arguments: str
    needed_by: frozenset[str]  # such as "sii/float32"

    def __str__(self) -> str:
        return f"{self.kernel}({self.arguments})  {' '.join(sorted(self.needed_by))}"

    def find(self) -> tuple[Any, tuple[Any, ...]]:
        """Return the kernel and the argument types."""
        module, _, name = self.kernel.rpartition(".")
        return getattr(importlib.import_module(module), name), types_of(self.arguments)


def read_list(path: Path = LIST) -> list[Specialisation]:
    """Return what a list holds.

    Parameters
    ----------
    path : Path
        The list.

    Returns
    -------
    list of Specialisation
        In the list's order.
    """
    found = []
    for line in path.read_text(encoding="utf-8").splitlines():
        call, _, needed_by = line.rpartition("  ")
        name, _, arguments = call.partition("(")
        found.append(Specialisation(name, arguments.removesuffix(")"), frozenset(needed_by.split())))
    return found


def missing(wanted: Iterable[Specialisation]) -> list[Specialisation]:
    """Return those of some specialisations that are not on disk.

    Parameters
    ----------
    wanted : iterable of Specialisation
        What will be called.

    Returns
    -------
    list of Specialisation
        What calls would have to compile first.
    """
    return [one for one in wanted if not _is_kept(one)]


def _is_kept(one: Specialisation) -> bool:
    """Return whether a specialisation is on disk, or cannot be made from this list any more."""
    try:
        kernel, arguments = one.find()
        kept: bool = kernel._cache.path(arguments).exists()
    except (ImportError, AttributeError, TypeError, NameError):
        return True
    return kept


def compile_ahead(
    wanted: Sequence[Specialisation], progress: Progress | None = None, processes: int | None = None
) -> None:
    """Compile specialisations and keep them on disk.

    Parameters
    ----------
    wanted : sequence of Specialisation
        What to compile; those that are on disk cost next to nothing.
    progress : callable, optional
        Called with (what is done, share done).
    processes : int, optional
        How many work at a time; one a core where absent.
    """
    groups: dict[str, list[Specialisation]] = defaultdict(list)
    for one in wanted:  # kernels of a module share callees, which each process lowers for itself
        groups[one.kernel.rpartition(".")[0]].append(one)
    text, done = f"compiling {len(wanted)} kernels", 0
    with ProcessPoolExecutor(min(processes or cores(), max(len(groups), 1)), get_context("spawn")) as pool:
        for future in as_completed([pool.submit(_compile, group) for group in groups.values()]):
            done += future.result()
            if progress is not None:
                progress(text, done / len(wanted))


def _compile(group: Sequence[Specialisation]) -> int:
    for one in group:
        kernel, arguments = one.find()
        kernel.compile(arguments)
    return len(group)


def cores() -> int:
    """Return how many cores this process may use.

    Returns
    -------
    int
        1 or more.
    """
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def text_of(kind: Any) -> str:
    """Write an argument type as an expression.

    Parameters
    ----------
    kind : numba type
        The type.

    Returns
    -------
    str
        What `types_of` reads.

    Raises
    ------
    TypeError
        If there is no expression for it.
    """
    if isinstance(kind, types.Array):
        first, last = LAYOUTS[kind.layout]
        axes = [last] if kind.ndim == 1 else [first, *[":"] * (kind.ndim - 2), last]
        plain = f"{text_of(kind.dtype)}[{', '.join(axes)}]"
        return plain if kind.mutable else f"readonly({plain})"
    if isinstance(kind, types.BaseTuple):
        items: Any = kind
        parts = [text_of(item) for item in items]
        if (named := getattr(kind, "instance_class", None)) is not None:
            return f"named({', '.join([repr(f'{named.__module__}.{named.__qualname__}'), *parts])})"
        return f"({', '.join(parts)},)"
    if isinstance(kind, types.Omitted):
        return f"omitted({kind.value!r})"
    if isinstance(kind, types.Number | types.Boolean | types.NoneType):
        return "boolean" if kind == types.boolean else str(kind)
    raise TypeError(f"{kind}: no expression for this type")


def types_of(text: str) -> tuple[Any, ...]:
    """Read argument types.

    Parameters
    ----------
    text : str
        Expressions of types with commas between them.

    Returns
    -------
    tuple of numba types
        The types.
    """
    known = {name: getattr(types, name) for name in dir(types)} | {
        "named": _named, "omitted": types.Omitted, "readonly": lambda kind: kind.copy(readonly=True)}
    return tuple(map(_with_tuples, eval(f"({text},)" if text else "()", {"__builtins__": {}}, known)))


def _named(name: str, *kinds: Any) -> Any:
    module, _, qualname = name.rpartition(".")
    fields = tuple(map(_with_tuples, kinds))
    owner = getattr(importlib.import_module(module), qualname)
    return types.BaseTuple.from_types(fields, owner)


def _with_tuples(kind: Any) -> Any:
    return types.BaseTuple.from_types(tuple(map(_with_tuples, kind))) if isinstance(kind, tuple) else kind
