"""Programs that run in a copy: within a time, within some memory, and none left behind."""

import contextlib
import os
import resource
import signal
import subprocess
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

MEMORY = 12 << 30  # bytes of address space: a fault may ask for any size


class Ended(NamedTuple):
    """How a program ended."""

    code: int | None  # negative: a signal; None: it took too long
    seconds: float


class Programs:
    """The programs that run at the moment."""

    def __init__(self) -> None:
        self._running: set[subprocess.Popen[bytes]] = set()
        self._lock = threading.Lock()
        self.stopped = False

    def run(self, command: Sequence[str], folder: Path, environment: Mapping[str, str], said: Path,
            limit: float | None) -> Ended:
        """Run a command with its words in a file, for `limit` seconds at most."""
        started = time.monotonic()
        with said.open("wb") as stream, self._lock:
            if self.stopped:
                raise KeyboardInterrupt
            process = subprocess.Popen(command, cwd=folder, env=dict(environment), stdout=stream,
                                       stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, start_new_session=True)
            self._running.add(process)
        if hasattr(resource, "prlimit"):
            resource.prlimit(process.pid, resource.RLIMIT_AS, (MEMORY, MEMORY))
        try:
            code = process.wait(limit)
        except subprocess.TimeoutExpired:
            _kill(process)
            code = None
        with self._lock:
            self._running.discard(process)
        if self.stopped:
            raise KeyboardInterrupt
        return Ended(code, time.monotonic() - started)

    def stop(self) -> None:
        """End every program; none starts any more."""
        with self._lock:
            self.stopped = True
            running = list(self._running)
        for process in running:
            _kill(process)


def _kill(process: subprocess.Popen[bytes]) -> None:
    """End a program and what it started; it leads a process group of its own."""
    if process.poll() is None:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
