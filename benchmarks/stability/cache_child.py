"""A kernel of its own in a cache folder of its own: damage its file, or call it as one of several cold starts.

`python -m benchmarks.stability.cache_child damage TIMES SEED` damages the kernel's file so many times, mostly by one
bit anywhere in it, and prints how many damages were taken for a kernel, with the first; `call` prints what it gives and
how often it was found on disk.
"""

import json
import random
import sys

import numpy as np
from numba import types

from refgi.jit import kernel

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


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
