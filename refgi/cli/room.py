"""What the libraries would fail at when they are loaded is refused before.

That is a limit of address space (`ulimit -v`) too small for them: without room OpenBLAS asks for memory without end,
and LLVM and Embree end the process with no word of refgi's. And a number of threads that Numba cannot start.
"""

import os
import sys
from pathlib import Path

from refgi.errors import InputError, expect

COMPUTING = frozenset({"render", "sequence", "compare", "bench", "batch", "choose", "vectors", "explain", "warm"})
LIBRARIES = 600 << 20  # bytes: with NumPy, SciPy, LLVM, Embree and a small picture 650 MiB in all, some of it loaded
KERNELS = 64 << 20  # ... where the libraries are loaded; a small picture by sii takes 32 MiB

THREADS, MOST_THREADS = "NUMBA_NUM_THREADS", 4096  # a million end the process


def require_threads() -> None:
    """Refuse (InputError) a value of NUMBA_NUM_THREADS that Numba cannot read or start.

    It is no whole number, or too small or large.
    """
    asked = os.environ.get(THREADS)
    usable = asked is None or (asked.strip().isdecimal() and 1 <= int(asked[:20]) <= MOST_THREADS)
    expect(usable, THREADS, f"a whole number from 1 to {MOST_THREADS}", asked)


def require_room(verb: str) -> None:
    """Refuse (InputError) a verb that computes where the address space left is too small for what it loads."""
    left = _left()
    needed = KERNELS if "scipy.spatial" in sys.modules else LIBRARIES
    if verb in COMPUTING and left is not None and left < needed:
        raise InputError(f"out of memory: the limit of address space (ulimit -v) leaves {max(0, left) >> 20} MiB, "
                         f"{verb} needs {needed >> 20} or more")


def _left() -> int | None:
    """Return the bytes of address space below a limit; None where there is none or that cannot be told."""
    try:
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        pages = int(Path("/proc/self/statm").read_text().split()[0])
    except (ImportError, OSError, ValueError):
        return None
    return None if limit == resource.RLIM_INFINITY else limit - pages * resource.getpagesize()
