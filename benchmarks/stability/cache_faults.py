"""The kernel cache: a damaged file is never run, and starts that find it empty at once share it.

`python -m benchmarks.stability.cache_faults damage TIMES SEED` damages the file of a kernel of its own so many times,
mostly by one bit anywhere in it, and prints how many damages were taken for a kernel, with the first; `call` prints
what the kernel gives and how often it was found on disk.
"""

import json
import os
import random
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numba import types

from benchmarks.stability.promise import Tell
from refgi.jit import kernel
from refgi.jit.cache import LOCK
from refgi.stress.promises import Row

ROOT = Path(__file__).parents[2]
STARTS = {True: 2, False: 8}
DAMAGES = {True: 200, False: 10_000}
ARGUMENTS = (types.float64[:],)
VALUES = np.linspace(0.25, 8, 40)


@kernel
def weighted_sum(values):  # something with a loop, branches and constants
    total = 0.0
    for k in range(values.size):
        total += values[k] * 1.25 if k % 3 else -values[k] / 3.0
    return total


def main(arguments: list[str]) -> int:
    if arguments[0] == "call":
        result = weighted_sum(VALUES)
        print(json.dumps([result, sum(weighted_sum.stats.cache_hits.values())]))
        return 0
    weighted_sum.compile(ARGUMENTS)
    print(json.dumps(taken(int(arguments[1]), int(arguments[2]))))
    return 0


def expected() -> float:
    """Return what the kernel gives, by Python."""
    return float(weighted_sum.py_func(VALUES))


def taken(times: int, seed: int) -> tuple[int, str]:
    """Damage the kernel's file and return how often it was taken for a kernel, and the first such damage."""
    cache, target = weighted_sum._cache, weighted_sum.targetctx
    path, chance = cache.path(ARGUMENTS), random.Random(seed)
    sound = path.read_bytes()
    if cache.load_overload(ARGUMENTS, target) is None:
        raise RuntimeError("a sound file is not taken for a kernel")
    count, first = 0, ""
    for number in range(times):
        damaged, what = _damaged(sound, chance)
        path.write_bytes(damaged)
        if cache.load_overload(ARGUMENTS, target) is not None or path.exists():
            count, first = count + 1, first or f"{number}: {what}"
    return count, first


def _damaged(content: bytes, chance: random.Random) -> tuple[bytes, str]:
    place = chance.randrange(len(content))
    kind = chance.randrange(8)
    if kind == 0:
        return content[:place], f"cut at byte {place}"
    if kind == 1:
        zeros = bytes(min(4096, len(content) - place)) or b"\1"
        zeros = zeros if content[place : place + len(zeros)] != zeros else b"\1" * len(zeros)
        return content[:place] + zeros + content[place + len(zeros) :], f"zeros from byte {place}"
    if kind == 2:
        return content + b"\0" * 16, "16 bytes more"
    bit = chance.randrange(8)
    return content[:place] + bytes([content[place] ^ 1 << bit]) + content[place + 1 :], f"bit {bit} of byte {place}"


def child(folder: Path, *arguments: str, before: str = "") -> subprocess.Popen[str]:
    """Start a process whose kernels are kept in a folder, after some Python of ours."""
    code = f"import sys\n{before}\nfrom benchmarks.stability.cache_faults import main\nsys.exit(main(sys.argv[1:]))"
    environment = os.environ | {"REFGI_CACHE_DIR": str(folder), "PYTHONPATH": str(ROOT)}
    return subprocess.Popen([sys.executable, "-c", code, *arguments], cwd=ROOT, env=environment, text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def answer(process: subprocess.Popen[str]) -> list[float | str]:
    """Return what a process printed when it has ended."""
    said, complaint = process.communicate()
    if process.returncode:
        raise RuntimeError(f"exit {process.returncode}: {complaint[-500:]}")
    return list(json.loads(said))


def damaged(short: bool, tell: Tell, before: str = "") -> Iterable[Row]:
    """Yield the row of a kernel's file with flipped bits, cuts and zeros."""
    seed, times = 19, DAMAGES[short]
    with tempfile.TemporaryDirectory() as folder:
        try:
            taken, first = answer(child(Path(folder), "damage", str(times), str(seed), before=before))
        except RuntimeError as error:  # machine code that LLVM does not survive
            taken, first = 1.0, str(error)
    tell(f"{taken} of {times} taken for a kernel {first}")
    yield Row(part="faults", property="a damaged kernel is compiled anew", subject="kernel cache",
              domain="a bit, a cut or zeros anywhere, machine code included", figure=float(taken), unit="taken",
              limit=0, kind="exact", source="SHA-256 at its end", cases=times, seed=seed, detail=str(first),
              reproduce=f"python -m benchmarks.stability.cache_faults damage {times} {seed}")


def cold_starts(short: bool, tell: Tell, before: str = "") -> Iterable[Row]:
    """Yield the row of several starts that find the cache empty, and one more that finds it filled."""
    count = STARTS[short]
    faults = []
    with tempfile.TemporaryDirectory() as folder:
        processes = [child(Path(folder), "call", before=before) for _ in range(count)]
        results = [answer(process) for process in processes]
        result, hits = answer(child(Path(folder), "call", before=before))
        faults += [f"a start gave {one}" for one in [*(each[0] for each in results), result] if one != expected()]
        faults += [f"{made} starts compiled" for made in [count - sum(each[1] for each in results)] if made != 1]
        faults += ["the last start found no kernel"] if hits != 1 else []
        faults += [f"left {file.name}" for file in Path(folder).iterdir()
                   if file.suffix != ".kernel" and file.name != LOCK]
    tell("; ".join(faults) or f"{count} cold starts as promised")
    yield Row(part="faults", property="cold starts share an empty cache", subject="kernel cache",
              domain=f"{count} at once, and one after them", figure=len(faults), unit="breaches", limit=0, kind="exact",
              source="the value by Python; one file is left", cases=count + 1, detail="; ".join(faults)[:500],
              reproduce="python -m benchmarks stability --part faults --out out/stability")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
