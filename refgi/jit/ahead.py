"""Compile kernels ahead, in as many processes as there are cores.

`signatures.txt` lists which specialisations the methods need at their defaults: a line holds a kernel, its argument
types as `refgi.jit.kernelfile` writes them, and what needs them. `python -m refgi.jit.ahead` compiles them for every
level of processors into the package itself, for a wheel to bring along.
"""

import importlib
import os
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

from refgi.jit.cache import BROUGHT, FOLDER, LEVELS, levels, target_of
from refgi.jit.kernelfile import types_of

FIRST = (("compare", "cornell_box"), ("vectors", "export", "--kit", "quick"))  # what a newcomer runs
LIST = Path(__file__).with_name("signatures.txt")

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
        return getattr(importlib.import_module(module), name), types_of(self.arguments, importlib.import_module)


def read_list(path: Path = LIST) -> list[Specialisation]:
    """Return the specialisations of a list file, in its order."""
    found = []
    for line in path.read_text(encoding="utf-8").splitlines():
        call, _, needed_by = line.rpartition("  ")
        name, _, arguments = call.partition("(")
        found.append(Specialisation(name, arguments.removesuffix(")"), frozenset(needed_by.split())))
    return found


def missing(wanted: Iterable[Specialisation]) -> list[Specialisation]:
    """Return those specialisations that are not on disk: what calls would have to compile first."""
    return [one for one in wanted if not _is_kept(one)]


def _is_kept(one: Specialisation) -> bool:
    """Return whether a specialisation is on disk, or cannot be made from this list any more."""
    try:
        kernel, arguments = one.find()
        kept: bool = kernel._cache.has(arguments)
    except (ImportError, AttributeError, TypeError, ValueError):
        return True
    return kept


def compile_ahead(
    wanted: Sequence[Specialisation], progress: Progress | None = None, processes: int | None = None
) -> None:
    """Compile specialisations and keep them on disk; those that are there cost next to nothing.

    `progress` is called with (what is done, share done); without `processes`, one a core works.
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
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def bring_along() -> None:
    """Compile for each level, into `BROUGHT`, anew: what the methods need in float32, and what `FIRST` does.

    What a command needs is found by running it, so for those levels alone that this processor has.
    """
    shutil.rmtree(BROUGHT, ignore_errors=True)
    for level in LEVELS:
        environment = os.environ | target_of(level) | {FOLDER: str(BROUGHT)}
        with tempfile.TemporaryDirectory() as folder:
            commands = [(*command, "--out", str(Path(folder, command[0]))) for command in FIRST]
            for command in [("warm",), *(commands if level in levels() else [])]:
                subprocess.run([sys.executable, "-m", "refgi", *command], check=True, env=environment)


if __name__ == "__main__":
    bring_along()
