"""Read spoiled files in a process of its own, under a limit of memory and an alarm, and say each breach.

`python -m benchmarks.stability.file_child NAME FOLDER SEED FIRST END` reads the mutations FIRST to END of a format, or
with the seed `bomb` its bombs of these numbers, and writes one JSON line a breach. The number at work stands in
FOLDER/number, so that `read_in_children` knows which file it died of, and starts the next behind that.
"""

import importlib
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.stability.file_formats import BESIDE, FORMATS, Format, mutated

SECONDS = 10  # of processor time for one file, whatever else the machine does
PATIENCE = 120  # s by the clock, for a reader that waits for something
MEMORY = 1 << 30  # bytes beside those of a process that has read a sound file
MOST_BYTES = 2048  # of a refusal
BOMB = "bomb"
ROOT = Path(__file__).parents[2]
CHILD = ["-m", "benchmarks.stability.file_child"]
IN_MEMORY = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None  # a disk takes longer than most readers
MOST_DEATHS = 200  # of one range of numbers: something else is wrong then


class Breach(NamedTuple):
    """A file of which something was broken that is promised of all files."""

    number: int
    kind: str
    text: str


def main(arguments: list[str]) -> int:
    name, place, seed, first, end = arguments
    if ":" in name:  # a format from elsewhere, module:attribute
        module, _, attribute = name.partition(":")
        form: Format = getattr(importlib.import_module(module), attribute)
    else:
        form = FORMATS[name]
    for breach in read_all(form, name, Path(place), seed, range(int(first), int(end))):
        print(json.dumps(breach), flush=True)
    return 0


def read_all(form: Format, name: str, folder: Path, seed: str, numbers: range) -> Iterator[Breach]:
    """Read files by number and yield each breach; the process may die of one."""
    for beside, content in BESIDE.items():
        (folder / beside).write_bytes(content)
    path, make = folder / form.file, maker(form, name, seed)
    path.write_bytes(form.seeds()[0])
    form.read(path)
    limit_memory(MEMORY)
    noise = os.open(folder / "noise", os.O_RDWR | os.O_CREAT | os.O_TRUNC)
    os.dup2(noise, 2)
    for ending in (signal.SIGALRM, signal.SIGPROF):
        signal.signal(ending, signal.SIG_DFL)  # ends the process, whatever code it is in
    progress = os.open(folder / "number", os.O_RDWR | os.O_CREAT)
    for number in numbers:
        os.pwrite(progress, b"%12d" % number, 0)
        make(number, path)
        signal.alarm(PATIENCE)
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        found = breach_of(form, path)
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.alarm(0)
        if not found and (size := os.fstat(noise).st_size):
            found = "noise", os.pread(noise, min(size, 300), 0).decode(errors="replace")
        if os.fstat(noise).st_size:
            os.ftruncate(noise, 0)
            os.lseek(noise, 0, os.SEEK_SET)
        if found:
            yield Breach(number, found[0], found[1][:600])
    os.pwrite(progress, b"%12d" % numbers.stop, 0)


def maker(form: Format, name: str, seed: str) -> Callable[[int, Path], Any]:
    """Return what writes a file by its number."""
    if seed == BOMB:
        from benchmarks.stability.bombs import BOMBS

        made = list(BOMBS[name].values())
        return lambda number, path: made[number](path)
    seeds = form.seeds()
    return lambda number, path: path.write_bytes(
        mutated(seeds[number % len(seeds)], np.random.default_rng([int(seed), number])))


def breach_of(form: Format, path: Path) -> tuple[str, str] | None:
    """Read a file and return what is broken of the promise, as kind and text."""
    from refgi.errors import InputError, RefgiWarning

    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            form.read(path)
        except InputError as error:
            if found := unclear(str(error), {form.file, form.named} - {""}):
                return found, str(error)
        except BaseException as error:
            return type(error).__name__, f"{type(error).__name__}: {error}"
    for one in told:
        if not issubclass(one.category, RefgiWarning):
            return one.category.__name__, str(one.message)
        if len(str(one.message).encode()) > MOST_BYTES:
            return "long warning", str(one.message)
    return None


def unclear(text: str, files: set[str]) -> str:
    """Return what a refusal lacks: a file in each line, at most 2 KB in all, and text that can be printed."""
    try:
        size = len(text.encode())
    except UnicodeEncodeError:
        return "not printable"
    if size > MOST_BYTES:
        return "long"
    lines = text.splitlines()
    more = lines[-1].startswith("... and ") if lines else False
    named = all(any(file in line for file in files) for line in lines[: len(lines) - more])
    return "" if lines and named else "unnamed"


def limit_memory(more: int) -> None:
    """Let this process have so many bytes more than it has."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + more
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def read_in_children(name: str, seed: int | str, numbers: range, processes: int = 1) -> list[Breach]:
    """Read mutations of a format by number, of the seed `BOMB` its bombs, in some processes; return all breaches."""
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
    counts = Counter(breach.kind for breach in breaches)
    return ", ".join(f"{count} {kind}" for kind, count in counts.most_common())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
