"""Files: whatever bytes a file has, it is read or refused in lines that name it, in bounded time and memory.

A mutation is a sound file changed at random (`benchmarks.stability.file_formats`); a bomb asks for more than it holds
(`benchmarks.stability.bombs`). They are read in processes of their own, so that a crash or a hang is one breach.
"""

from collections.abc import Iterable, Sequence
from functools import partial

from benchmarks.stability import promise, written_promises
from benchmarks.stability.bombs import BOMBS
from benchmarks.stability.file_child import BOMB, MEMORY, SECONDS, Breach, kinds, read_in_children
from benchmarks.stability.file_formats import FORMATS
from benchmarks.stability.promise import Task, Tell
from refgi.stress.promises import Row

SEED = 19
MUTATIONS = {True: 200, False: 100_000}  # of each format, in the short form and in full
# readers that take more than 2 ms a file
SLOW = {"plan": 40_000, "grid": 40_000, "obj": 50_000, "mtl": 50_000}
PROCESSES = 2
PROMISE = "read, or refused in lines that name the file, 2 KB in all; no other exception, warning, hang or death"
LIMITS = f"{SECONDS} s of processor time and {MEMORY >> 20} MiB a file"


def tasks(short: bool) -> list[Task]:
    """Return a task a format and a promise of what is written, and in full one for the bombs of each format."""
    mutated = [Task(name, partial(_mutated, name, short)) for name in FORMATS]
    mutated += promise.promise_tasks(written_promises.PROMISES, "files", short)
    return mutated if short else mutated + [Task(f"{name}-bombs", partial(_bombs, name)) for name in BOMBS]


def _mutated(name: str, short: bool, tell: Tell) -> Iterable[Row]:
    count = MUTATIONS[short] if short else SLOW.get(name, MUTATIONS[short])
    found = read_in_children(name, SEED, range(count), processes=1 if short else PROCESSES)
    tell(f"{count:,} files, {kinds(found) or 'no breach'}")
    yield row("mutated files are read or refused", name, found, count, SEED)


def _bombs(name: str, tell: Tell) -> Iterable[Row]:
    found = read_in_children(name, BOMB, range(len(BOMBS[name])))
    said = [f"{list(BOMBS[name])[breach.number]}: {breach.kind}" for breach in found]
    tell(f"{len(BOMBS[name])} bombs, {', '.join(said) or 'no breach'}")
    yield row("files that ask for too much are read or refused", name, found, len(BOMBS[name]), None)


def row(promise: str, name: str, found: Sequence[Breach], count: int, seed: int | None) -> Row:
    """Return the row of some files of a format, of which so many broke the promise."""
    worst = found[0] if found else Breach(0, "", "")
    detail = f"{kinds(found)}; {worst.number}: {worst.text}"[:1000] if found else ""
    again = f"python -m benchmarks.stability.again files {name}{'' if seed is not None else '-bombs'} {worst.number}"
    return Row(part="files", property=promise, subject=name, domain=LIMITS, figure=len(found), unit="breaches", limit=0,
               kind="exact", source=PROMISE, cases=count, seed=seed, reproduce=again, detail=detail)


def again(name: str, seed: int, case: int) -> str:
    """Return one case of a promise of what is written."""
    known = {one.name: one for one in written_promises.PROMISES}
    if name not in known:
        raise ValueError(f"expected one of {', '.join(known)}, got {name}")
    return promise.again(known[name], seed, case)
