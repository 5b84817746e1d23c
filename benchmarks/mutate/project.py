"""What is mutated and judged by; scratch copies, the only places where a fault is ever written, and their programs."""

import compileall
import contextlib
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from py_compile import PycInvalidationMode
from typing import NamedTuple, Protocol

DIFFERENT = 3  # exit code of the pictures' program where one is not as before


class Project(NamedTuple):
    """A package, its tests and its pictures; paths are relative to `root`."""

    root: Path
    package: str
    tests: str
    wired: tuple[str, ...]  # folders whose code outside kernels is wiring; code in kernels counts everywhere
    wiring_tests: str  # a folder of the tests of wiring, one file or more a method
    methods: Mapping[str, str]  # folder or file of the sources: the method that it alone belongs to
    pictures: str  # module that writes a hash of every picture: `-m MODULE FILE [--against KNOWN] [--first METHOD]`
    judging: tuple[str, ...]  # folders and files that say which pictures there are

    def sources(self) -> list[str]:
        """Return the Python files of the package."""
        return sorted(path.relative_to(self.root).as_posix() for path in (self.root / self.package).rglob("*.py"))

    def method_of(self, file: str) -> str:
        """Return the one method that a file belongs to; empty where it is shared."""
        found = [part for part in self.methods if file == part or file.startswith(f"{part}/")]
        return self.methods[max(found, key=len)] if found else ""

    def is_wired(self, file: str) -> bool:
        """Return whether code of a file outside kernels is wiring."""
        return file.startswith(tuple(f"{folder}/" for folder in self.wired))


REFGI = Project(
    root=Path(__file__).parents[2],
    package="refgi",
    tests="tests",
    wired=tuple(f"refgi/{name}" for name in
                ("rsm", "lights", "pairs", "splat", "cluster", "sssil", "truth", "rays")),
    wiring_tests="tests/wiring",
    methods={"refgi/splat/sii": "sii", "refgi/splat/multires": "multires", "refgi/splat/gather": "gather",
             "refgi/cluster": "val", "refgi/sssil": "hssil", "refgi/sssil/temporal.py": "temporal",
             "refgi/sssil/temporal_filter.py": "temporal", "refgi/sssil/motion.py": "temporal",
             "refgi/truth": "truth", "refgi/truth/vpl.py": "vpl"},
    pictures="benchmarks.mutate.pictures",
    judging=("benchmarks/sameness", "benchmarks/mutate/pictures.py"),
)


LEFT = (".*", "__pycache__", "out", "_build", "*.egg-info")
PREFIX = "copy-"


class Edited(Protocol):
    """What is changed in one file."""

    @property
    def file(self) -> str: ...
    def put_into(self, text: str) -> str: ...


class Scratch:
    """A copy of a project; copies share compiled kernels, which are known by what they were compiled from.

    Compiled modules of the copy are told by their contents, not by their time: a fault may change no size and come
    within the same second.
    """

    def __init__(self, project: Project, folder: Path, kernels: Path) -> None:
        self.project, self.folder, self._kernels = project, Path(tempfile.mkdtemp(prefix=PREFIX, dir=folder)), kernels
        self.tree = self.folder / "tree"
        shutil.copytree(project.root, self.tree, ignore=_ignoring(folder))
        kernels.mkdir(parents=True, exist_ok=True)
        compileall.compile_dir(self.tree / project.package, quiet=2, invalidation_mode=PycInvalidationMode.CHECKED_HASH)

    @contextlib.contextmanager
    def with_fault(self, fault: Edited) -> Iterator[None]:
        """Put a fault into the copy while the block runs."""
        file = self.tree / fault.file
        whole = file.read_text()
        file.write_text(fault.put_into(whole))
        try:
            yield
        finally:
            file.write_text(whole)

    def environment(self) -> Mapping[str, str]:
        """Return the environment of programs that run in the copy."""
        return os.environ | {"PYTHONPATH": str(self.tree), "REFGI_CACHE_DIR": str(self._kernels),
                             "PYTHONDONTWRITEBYTECODE": "1"}

    def python(self, *arguments: str | Path) -> list[str]:
        """Return a command that runs Python without the folder it is called from on its path."""
        return [sys.executable, "-P", *map(str, arguments)]


def remove_copies(folder: Path) -> None:
    """Remove the copies that earlier runs left in a folder."""
    for copy in folder.glob(f"{PREFIX}*"):
        shutil.rmtree(copy, ignore_errors=True)


def _ignoring(folder: Path) -> "shutil._IgnoreFunction":  # type: ignore[name-defined]
    """Leave out what no test needs, and the folder of the copies should it lie within the project."""
    usual = shutil.ignore_patterns(*LEFT)
    return lambda where, names: usual(where, names) | {name for name in names
                                                       if folder.is_relative_to(Path(where, name).resolve())}


MEMORY = 12 << 30  # bytes of address space: a fault may ask for any size


class Ended(NamedTuple):
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
