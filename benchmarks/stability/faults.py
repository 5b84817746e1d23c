"""Faults of the machine: a full disk, a folder that cannot be written, two writers, a damaged cache, little memory.

Each command ends as it should or with exit code 2 and lines that begin with `refgi:`; what stands under a final name
is whole, and no unfinished file is left.
"""

import contextlib
import os
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

from benchmarks.stability.cache_faults import cold_starts, damaged
from benchmarks.stability.kills import VICTIMS, Stand, undisturbed
from benchmarks.stability.promise import Task, Tell
from benchmarks.stability.victim_host import Host
from refgi.stress.promises import Row

AGAIN = "python -m benchmarks stability --part faults --out out/stability"
DISK_KIB = {True: (64,), False: (4, 16, 32, 48, 64, 96, 128, 192, 256, 384, 512, 1024)}
MEMORY_MIB = {True: (8, 4096), False: (0, 1, 2, 4, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 512, 1024, 4096)}
WRITERS = 2
# Libraries are imported before the limit: OpenBLAS asks for memory without end where it is loaded and there is none.
MOST_LINES = 3  # of a refusal, warnings apart


def tasks(short: bool) -> list[Task]:
    """Return a task a fault; in short one command stands for all."""
    names = ["render"] if short else list(VICTIMS)
    found = [Task("cache", partial(damaged, short)), Task("starts", partial(cold_starts, short))]
    for name in names:
        found += [Task(f"disk-{name}", partial(_disk, name, short)),
                  Task(f"memory-{name}", partial(_memory, name, short))]
        if not short:
            found += [Task(f"closed-{name}", partial(_closed, name)), Task(f"writers-{name}", partial(_writers, name))]
    return found


def unclear(code: int, said: str, *, names: str = "") -> str:
    """Return what is wrong with how a command ended: done, or one clear line."""
    lines = [line for line in said.splitlines() if line and "warning" not in line]
    if code == 0:
        return ""
    if code != 2 or "Traceback" in said or "unexpected" in said:
        return f"exit {code}: {said[-300:]}"
    spoken = [line for line in lines if line.startswith("refgi: ") and not line.rstrip().endswith(("%", "done"))]
    if not 0 < len(spoken) <= MOST_LINES or (names and not any(names in line for line in spoken)):
        return f"not one clear line: {said[-300:]}"
    return ""


@contextlib.contextmanager
def small_disk(folder: Path, kib: int, *, closed: bool = False) -> Iterator[str]:
    """Mount a small disk, or one that is read-only, over a folder; yields what stands for it where that may not be.

    Yields "tmpfs", or "RLIMIT_FSIZE" or "permissions" for the caller to see to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={kib}k{',ro' * closed}", "refgi", str(folder)],
                             capture_output=True, check=False).returncode == 0
    if closed and not mounted:
        folder.chmod(0o555)
    try:
        yield "tmpfs" if mounted else "permissions" if closed else "RLIMIT_FSIZE"
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(folder)], capture_output=True, check=True)
        elif closed:
            folder.chmod(0o755)


def disk_faults(name: str, sizes: Iterable[int], folder: Path, patch: str = "") -> tuple[list[str], str]:
    """Run a command on small disks; return what is not as promised, and what the disk was."""
    faults, means = [], ""
    victim = VICTIMS[name]
    with Host(f"{victim.patch}\n{patch}") as host:
        for kib in sizes:
            stand = Stand(folder / f"{kib}", {})
            stand.renew()
            with small_disk(stand.out, kib) as means:
                limits = {"RLIMIT_FSIZE": kib << 10} if means == "RLIMIT_FSIZE" else {}
                code, said = host.run(victim.arguments, stand.folder, limits=limits)
                wrong = [unclear(code, said, names="out"), *(f"torn {file}" for file in stand.torn()),
                         *(f"left {part}" for part in stand.parts())]
                faults += [f"{kib} KiB: {one}" for one in wrong if one]
    return faults, means


def memory_faults(name: str, steps: Iterable[int], folder: Path, patch: str = "") -> list[str]:
    """Run a command with some MiB of memory beside those of the imported program; return what is not as promised."""
    faults = []
    victim = VICTIMS[name]
    with Host(f"{victim.patch}\n{patch}") as host:
        used = host.address_space()
        for mib in steps:
            stand = Stand(folder / f"{mib}", {})
            stand.renew()
            code, said = host.run(victim.arguments, stand.folder, limits={"RLIMIT_AS": used + (mib << 20)})
            wrong = [unclear(code, said), *(f"torn {file}" for file in stand.torn()),
                     *(f"left {part}" for part in stand.parts())]
            faults += [f"{mib} MiB: {one}" for one in wrong if one]
    return faults


def writers_faults(name: str, folder: Path, patch: str = "") -> list[str]:
    """Run a command twice at once in one folder; return what is not as promised."""
    victim = VICTIMS[name]
    patch = f"{victim.patch}\n{patch}"
    with contextlib.ExitStack() as stack:
        hosts = [stack.enter_context(Host(patch)) for _ in range(WRITERS)]
        stand = Stand(folder, {})
        whole = undisturbed(name, stand, hosts[0]).whole
        stand.renew()
        with ThreadPoolExecutor(WRITERS) as pool:
            ends = list(pool.map(lambda host: host.run(victim.arguments, stand.folder, said=f"said{id(host)}"), hosts))
        faults = [wrong for code, said in ends if (wrong := unclear(code, said))]
        faults += ["neither writer ended well"] if all(code for code, _ in ends) else []
        faults += [f"torn {file}" for file in stand.torn()] + [f"left {part}" for part in stand.parts()]
        now = stand.digests() if not faults else whole
        return faults + [f"other {file}" for file, content in whole.items() if now.get(file) != content]


def _disk(name: str, short: bool, tell: Tell) -> Iterable[Row]:
    with tempfile.TemporaryDirectory() as folder:
        faults, means = disk_faults(name, DISK_KIB[short], Path(folder))
    yield _row("full disk: done, or one clear line; no file torn or unfinished", name, f"{means} of "
               f"{DISK_KIB[short][0]} to {DISK_KIB[short][-1]} KiB", faults, len(DISK_KIB[short]), tell)


def _closed(name: str, tell: Tell) -> Iterable[Row]:
    faults = []
    with tempfile.TemporaryDirectory() as folder, Host(VICTIMS[name].patch) as host:
        stand = Stand(Path(folder) / "work", {})
        stand.renew()
        with small_disk(stand.out, 64, closed=True) as means:
            code, said = host.run(VICTIMS[name].arguments, stand.folder)
        faults += [wrong] if (wrong := unclear(code, said, names="out")) else []
        faults += [] if code == 2 else [f"exit {code}"]
    yield _row("read-only folder: one clear line", name, f"{means}, as user {os.getuid()}", faults, 1, tell)


def _memory(name: str, short: bool, tell: Tell) -> Iterable[Row]:
    with tempfile.TemporaryDirectory() as folder:
        faults = memory_faults(name, MEMORY_MIB[short], Path(folder))
    steps = MEMORY_MIB[short]
    yield _row("little memory: done, or one clear line; no file torn or unfinished", name,
               f"RLIMIT_AS {steps[0]} to {steps[-1]} MiB above program and libraries", faults, len(steps), tell)


def _writers(name: str, tell: Tell) -> Iterable[Row]:
    with tempfile.TemporaryDirectory() as folder:
        faults = writers_faults(name, Path(folder) / "work")
    yield _row("two writers of one folder: done, or one clear line; files as of one", name, "at once", faults, 1, tell)


def _row(promise: str, name: str, domain: str, faults: list[str], cases: int, tell: Tell) -> Row:
    tell("; ".join(faults)[:600] or f"{promise}: {name} as promised")
    return Row(part="faults", property=promise, subject=name, domain=domain, figure=len(faults), unit="breaches",
               limit=0, kind="exact", source="exit 0, or 2 with a line", cases=cases, reproduce=AGAIN,
               detail="; ".join(faults)[:1000])
