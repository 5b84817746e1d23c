"""Start the processes that read spoiled files, and start them again behind the file that one of them died of."""

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from benchmarks.stability.file_child import SECONDS, Breach

ROOT = Path(__file__).parents[2]
CHILD = ["-m", "benchmarks.stability.file_child"]
IN_MEMORY = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None  # a disk takes longer than most readers
MOST_DEATHS = 200  # of one range of numbers: something else is wrong then


def read_in_children(name: str, seed: int | str, numbers: range, processes: int = 1) -> list[Breach]:
    """Read mutations (or bombs) of a format by number, in some processes, and return all breaches.

    Parameters
    ----------
    name : str
        Of the format.
    seed : int or str
        Of the mutations; `file_child.BOMB` for bombs.
    numbers : range
        Which.
    processes : int
        At once.

    Returns
    -------
    list of Breach
        In order of number.
    """
    step = -(-len(numbers) // processes)
    shares = [numbers[k : k + step] for k in range(0, len(numbers), step)]
    with ThreadPoolExecutor(processes) as pool:
        return [one for share in pool.map(lambda share: _share(name, str(seed), share), shares) for one in share]


def _share(name: str, seed: str, numbers: range) -> list[Breach]:
    found: list[Breach] = []
    first, deaths = numbers.start, 0
    while first < numbers.stop:
        with tempfile.TemporaryDirectory(prefix="refgi-files-", dir=IN_MEMORY) as folder:
            command = [sys.executable, *CHILD, name, folder, seed, str(first),
                       str(numbers.stop)]
            child = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
            progress = Path(folder) / "number"
            at = int(progress.read_text()) if progress.exists() else -1
        found += [Breach(*json.loads(line)) for line in child.stdout.splitlines()]
        if at < first or deaths > MOST_DEATHS:
            raise RuntimeError(f"{name}: files cannot be read at all: {child.stderr[-2000:]}")
        if at < numbers.stop:
            found.append(Breach(at, *_death(child.returncode, child.stderr)))
        deaths, first = deaths + 1, at + 1
    return found


def _death(code: int, said: str) -> tuple[str, str]:
    if code in (-signal.SIGALRM, -signal.SIGPROF):
        return "hang", f"more than {SECONDS} s"
    return "death", f"ended by {signal.Signals(-code).name}" if code < 0 else f"exit {code}: {said[-500:]}"


def kinds(breaches: Sequence[Breach]) -> str:
    """Return how many breaches there are of each kind."""
    counts: dict[str, int] = {}
    for breach in breaches:
        counts[breach.kind] = counts.get(breach.kind, 0) + 1
    return ", ".join(f"{count} {kind}" for kind, count in sorted(counts.items(), key=lambda item: -item[1]))
