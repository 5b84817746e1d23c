"""A process that has imported refgi and runs its commands in forks, so that a victim is at work at once.

`python -m benchmarks.stability.victim_host` reads a JSON object a line: arguments of the command, working folder, file
for what it says, and environment; it answers with the process's number, and when that has ended with its status.
"""

import contextlib
import importlib
import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

ROOT = Path(__file__).parents[2]
PATIENCE = 120.0  # s
POLL = 1e-4  # s; a file is written for a millisecond or longer, as it is flushed to the disk
MODULES = ["refgi.cli.render", "refgi.cli.sequence", "refgi.cli.judge", "refgi.cli.view",
           "refgi.cli.short", "refgi.compare", "refgi.methods", "refgi.truth.truth",
           "refgi.splat.sii", "refgi.rays", "refgi.scene.builtin", "refgi.provenance.frames", "pydantic", "OpenEXR",
           "scipy.spatial", "scipy.optimize", "scipy.ndimage", "scipy.stats", "trimesh"]


class Host:
    """Start commands in a host's forks, one at a time; `patch` is Python that it runs first, such as a fault."""

    def __init__(self, patch: str = "") -> None:
        self._process = subprocess.Popen([sys.executable, "-m", "benchmarks.stability.victim_host", patch], cwd=ROOT,
                                         stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()

    def run(self, arguments: Sequence[str], folder: Path, *, end: signal.Signals | None = None, after: float = 0.0,
            at_file: int = 0, limits: Mapping[str, int] | None = None, said: str = "said") -> tuple[int, str]:
        """Run a command and return its exit code, negative for a signal, and what it said, to the file `said`.

        The signal `end` comes `after` seconds after it has begun to heed signals, or at the unfinished file `at_file`
        that is seen, counted from 1.
        """
        process, place = self._start(arguments, folder, limits or {}, said)
        if end is not None:
            if at_file:
                written_files(process, folder, at_file)
            else:
                time.sleep(after)
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, end)
        return self._ended(place)

    def timed(self, arguments: Sequence[str], folder: Path) -> tuple[int, str, float, int]:
        """Run a command to its end; also return its seconds since it heeded signals, and how many files were seen."""
        process, place = self._start(arguments, folder, {}, "said")
        begin = time.monotonic()
        files = written_files(process, folder)
        seconds = time.monotonic() - begin
        return *self._ended(place), seconds, files

    def address_space(self) -> int:
        """Return the bytes that a fork has from its start."""
        self._ask("")
        pages = int(Path(f"/proc/{self._process.pid}/statm").read_text().split()[0])
        return pages * resource.getpagesize()

    def _start(self, arguments: Sequence[str], folder: Path, limits: Mapping[str, int], said: str) -> tuple[int, Path]:
        """Start a command; return its process once it heeds signals, and the file for what it says."""
        place = folder.with_name(f"{folder.name}.{said}")
        asked = {"arguments": list(arguments), "folder": str(folder), "said": str(place), "limits": dict(limits)}
        process = int(self._ask(json.dumps(asked)))
        _wait_for_handler(process)
        return process, place

    def _ended(self, place: Path) -> tuple[int, str]:
        """Wait until the command has ended; return its exit code and what it said."""
        return int(self._ask("")), place.read_text(errors="replace")

    def _ask(self, line: str) -> str:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(line + "\n")
        self._process.stdin.flush()
        return self._process.stdout.readline()


def _wait_for_handler(process: int) -> None:
    """Wait until a process handles SIGTERM by itself, or has ended."""
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        try:
            lines = Path(f"/proc/{process}/status").read_text().splitlines()
        except OSError:
            return
        caught = next((int(line.split()[1], 16) for line in lines if line.startswith("SigCgt")), 0)
        if caught >> (signal.SIGTERM - 1) & 1 or any(line.startswith("State:\tZ") for line in lines):
            return
        time.sleep(0.001)


def written_files(process: int, folder: Path, most: int = 1 << 30) -> int:
    """Wait until so many unfinished files were seen in a folder, or a process has ended; return how many were."""
    seen: set[str] = set()
    state = Path(f"/proc/{process}/stat")
    while len(seen) < most and state.read_text().rpartition(")")[2].split()[0] != "Z":
        for place, _, files in os.walk(folder):
            seen.update(f"{place}/{name}" for name in files if ".part" in name)
        time.sleep(POLL)
    return len(seen)


def command(arguments: Sequence[str]) -> None:
    """Run refgi."""
    from refgi.cli import main

    main(arguments)


def serve() -> None:
    """Run what is asked for until nothing more is."""
    for module in MODULES:
        importlib.import_module(module)
    for line in _lines():
        if not line.strip():  # asked whether it is ready
            print(flush=True)
            continue
        asked = json.loads(line)
        process = os.fork()
        if not process:
            _become(asked)
        print(process, flush=True)
        next(_lines())
        _, status = os.waitpid(process, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)


def _lines() -> Iterator[str]:
    while line := sys.stdin.readline():
        yield line


def _become(asked: dict[str, Any]) -> None:
    """Be the command, and end."""
    said = os.open(asked["said"], os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
    os.dup2(said, 1)
    os.dup2(said, 2)
    os.chdir(asked["folder"])
    for name, most in asked["limits"].items():
        if name == "RLIMIT_FSIZE":
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # as an error of the write, not a signal
        resource.setrlimit(getattr(resource, name), (most, most))
    code = 1
    try:
        command(asked["arguments"])
    except SystemExit as end:
        code = int(end.code or 0)
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    exec(sys.argv[1])  # may put others in the place of `command` and `MODULES`
    serve()
