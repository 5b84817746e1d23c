"""List the specialisations that the methods need at their defaults: `python -m benchmarks.signatures`.

Renders a small picture by every method in float32 and float64 and writes what was called from Python to
refgi/jit/signatures.txt, those with the largest code first.
"""

import gc
import subprocess
import sys
import warnings
from pathlib import Path

from refgi.jit import Kernel
from refgi.jit.ahead import LIST, Specialisation
from refgi.jit.kernelfile import text_of
from refgi.stages import standing_for

DTYPES = ("float32", "float64")
SCENE = "cornell_box"


def called(method: str, dtype: str) -> dict[str, int]:
    """Return the kernels that a method calls, with their argument types, and the size of each one's file."""
    from refgi.methods import render

    warnings.simplefilter("ignore")
    with standing_for(512 * 512):
        render(SCENE, method, width=32, height=24, dtype=dtype, rsm_resolution=32)
    found = {}
    for kernel in [thing for thing in gc.get_objects() if isinstance(thing, Kernel)]:
        name = f"{kernel.py_func.__module__}.{kernel.py_func.__name__}"
        for arguments in kernel.overloads:
            size = kernel._cache.path(arguments).stat().st_size
            found[f"{name}({', '.join(map(text_of, arguments))})"] = size
    return found


def main() -> int:
    from refgi.methods import METHODS

    if len(sys.argv) == 3:
        print("\n".join(f"{size}\t{call}" for call, size in called(*sys.argv[1:]).items()))
        return 0
    needed: dict[str, set[str]] = {}
    sizes: dict[str, int] = {}
    for method in METHODS:
        for dtype in DTYPES:
            run = [sys.executable, "-m", "benchmarks.signatures", method, dtype]
            lines = subprocess.run(run, check=True, capture_output=True, text=True).stdout.splitlines()
            for line in lines:
                size, call = line.split("\t")
                sizes[call] = int(size)
                needed.setdefault(call, set()).add(f"{method}/{dtype}")
            print(f"{method} {dtype}: {len(lines)} specialisations")
    lines = []
    for call in sorted(sizes, key=lambda call: (-sizes[call], call)):
        name, _, arguments = call.partition("(")
        lines.append(str(Specialisation(name, arguments.removesuffix(")"), frozenset(needed[call]))))
    Path(LIST).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
