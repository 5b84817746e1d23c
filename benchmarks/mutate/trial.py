"""The tests of a fault, what became of it, and what tests and pictures are without one."""

import json
import threading
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.mutate.project import Ended, Programs, Project, Scratch
from refgi.errors import InputError
from refgi.image import write_text

CHILD = Path(__file__).with_name("child.py")
# exceptions that say that there is no program: one that a compiler refuses is no fault that tests could miss
NO_PROGRAM = frozenset({"numba.core.errors.NumbaError", "builtins.SyntaxError", "builtins.NameError",
                        "builtins.ImportError"})
NO_CALL = ("required positional argument", "required keyword-only argument", "unexpected keyword argument",
           "positional arguments but")
CAUGHT, TIMEOUT, SURVIVED, SAME, INVALID = "caught", "timeout", "survived", "same pictures", "invalid"


class Failure(NamedTuple):
    """An exception in a test, or while its file was imported."""

    test: str
    kinds: tuple[str, ...]  # class and bases
    message: str
    ran: bool  # whether it came from a test

    @property
    def is_invalid(self) -> bool:
        """Whether it says that there is no program to test."""
        no_call = "builtins.TypeError" in self.kinds and any(text in self.message for text in NO_CALL)
        return not self.ran or no_call or bool(NO_PROGRAM.intersection(self.kinds))


class Run(NamedTuple):
    """One run of some tests."""

    code: int | None
    seconds: float
    tests: dict[str, float]  # seconds of each
    failures: list[Failure]

    def verdict(self) -> tuple[str, str]:
        """Return what the tests make of a fault, and which test says so."""
        last = next(reversed(self.tests), "")
        if self.code is None:
            return TIMEOUT, last
        if self.failures:
            first = self.failures[0]
            return (INVALID if first.is_invalid else CAUGHT), first.test
        if self.code < 0:  # a signal
            return CAUGHT, last
        return (SURVIVED, "") if self.code == 0 else (INVALID, f"pytest ended with {self.code}")


def run_tests(scratch: Scratch, programs: Programs, tests: Sequence[str], limit: float | None = None,
              first: bool = True) -> Run:
    """Run test files of a copy in their order, up to the first failure or all, for `limit` seconds at most.

    Doctests come last, as in the suite: pytest's own import of a source file puts a subpackage in place of the function
    of its name that the package exports.
    """
    tests = sorted(tests, key=lambda test: test.startswith(f"{scratch.project.package}/"))
    report, said = scratch.folder / "report.jsonl", scratch.folder / "pytest.txt"
    report.unlink(missing_ok=True)
    command = scratch.python(CHILD, scratch.project.package, report, "-q", "-p", "no:cacheprovider",
                             *(["-x"] if first else []), *tests)
    ended = programs.run(command, scratch.tree, scratch.environment(), said, limit)
    lines = [json.loads(line) for line in whole_lines(report)]
    if not lines and ended.code:
        lines = [{"failed": "pytest", "kinds": ["no report"], "message": said.read_text()[-400:], "ran": False}]
    seconds: dict[str, float] = {}
    for line in lines:
        if "test" in line:
            seconds[line["test"]] = seconds.get(line["test"], 0.0) + line["seconds"]
    failures = [Failure(line["failed"], tuple(line["kinds"]), line["message"], line["ran"])
                for line in lines if "failed" in line]
    return Run(ended.code, ended.seconds, seconds, failures)


def run_pictures(scratch: Scratch, programs: Programs, file: Path, *arguments: str | Path,
                 limit: float | None = None) -> Ended:
    """Write the hashes of all pictures of a copy, by one thread: several of two jobs would wait for each other."""
    command = scratch.python("-m", scratch.project.pictures, file, *arguments)
    one_thread = {**scratch.environment(), "NUMBA_NUM_THREADS": "1"}
    return programs.run(command, scratch.tree, one_thread, scratch.folder / "pictures.txt", limit)


def whole_lines(file: Path) -> list[str]:
    """Return the lines of a file but for a last one that a kill cut short."""
    if not file.is_file():
        return []
    return [line for line in file.read_text(encoding="utf-8").splitlines(keepends=True) if line.endswith("\n")]


# a fault may take this many times as long as no fault, and as long as it takes to compile its kernels
TIMES, COMPILING = 4.0, 120.0  # s
PER_BYTE = 3e-3  # s that a test file may take whose time is not known


class Baseline:
    """Measured once for given sources and tests, in a copy without a fault, and kept in a file.

    Test files are run without a fault once one of them has failed with one, or all have taken too long.
    """

    def __init__(self, project: Project, folder: Path, programs: Programs, state: str) -> None:
        self._project, self._folder, self._programs, self._state = project, folder, programs, state
        self._file, self.pictures = folder / "baseline.json", folder / "pictures.json"
        self._scratch: Scratch | None = None
        self._lock = threading.Lock()
        known = json.loads(self._file.read_text()) if self._file.is_file() else {}
        known = known if known.get("state") == state else {}
        self._seconds: dict[str, float] = known.get("seconds", {})
        self._seconds_of_pictures: float | None = known.get("pictures")

    @property
    def kernels(self) -> Path:
        """The folder of compiled kernels, told by their content."""
        return self._folder / "kernels"

    def measure(self, tests: Iterable[str], tell: Callable[[str], None] = lambda _: None) -> bool:
        """Run those test files that have not been run without a fault, and say whether there were any.

        Raises `InputError` if one fails.
        """
        with self._lock:
            if missing := sorted(set(tests) - self._seconds.keys()):
                tell(f"{len(missing)} test files without a fault")
                self._run(missing)
            return bool(missing)

    def ordered(self, tests: Sequence[str]) -> list[str]:
        """Return test files, the fastest first."""
        return sorted(tests, key=self._time)

    def limit(self, tests: Sequence[str]) -> float:
        """Return how many seconds a fault may take over some test files."""
        return COMPILING + TIMES * sum(map(self._time, tests))

    def _time(self, test: str) -> float:
        return self._seconds.get(test, PER_BYTE * (self._project.root / test).stat().st_size)

    def measure_pictures(self, tell: Callable[[str], None] = lambda _: None) -> float:
        """Hash all pictures unless that was done, and return how many seconds a fault may take over them."""
        with self._lock:
            if self._seconds_of_pictures is None:
                tell("pictures without a fault")
                for _ in range(2):  # the second time with warm kernels
                    ended = run_pictures(self._copy(), self._programs, self.pictures)
                    if ended.code != 0:
                        raise InputError(f"pictures fail without a fault: {self._copy().folder}/pictures.txt")
                self._seconds_of_pictures = ended.seconds
                self._write()
        return COMPILING + TIMES * self._seconds_of_pictures

    def _run(self, tests: Sequence[str]) -> None:
        scratch = self._copy()
        run = run_tests(scratch, self._programs, tests, first=False)
        if run.code != 0:
            failed = ", ".join(failure.test for failure in run.failures[:5]) or f"pytest ended with {run.code}"
            raise InputError(f"tests fail without a fault: {failed}; {scratch.folder}/pytest.txt tells more")
        self._seconds |= dict.fromkeys(tests, 0.0)
        for test, seconds in run.tests.items():
            self._seconds[test.partition("::")[0]] += seconds
        self._write()

    def _copy(self) -> Scratch:
        if self._scratch is None:
            self._scratch = Scratch(self._project, self._folder, self.kernels)
        return self._scratch

    def _write(self) -> None:
        content = {"state": self._state, "seconds": self._seconds, "pictures": self._seconds_of_pictures}
        write_text(self._file, json.dumps(content, indent=1) + "\n")
