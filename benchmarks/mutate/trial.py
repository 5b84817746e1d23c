"""The tests of a fault, and what became of them."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.mutate.programs import Ended, Programs
from benchmarks.mutate.scratch import Scratch

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
