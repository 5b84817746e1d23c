"""What tests and pictures are without a fault: that they pass, how long they take, and their hashes."""

import json
import threading
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

from benchmarks.mutate.programs import Programs
from benchmarks.mutate.project import Project
from benchmarks.mutate.scratch import Scratch
from benchmarks.mutate.trial import run_pictures, run_tests
from refgi.errors import InputError
from refgi.image import write_text

# a fault may take this many times as long as no fault, and as long as it takes to compile its kernels
TIMES, COMPILING = 4.0, 120.0  # s


class Baseline:
    """Measured once for given sources and tests, in a copy without a fault, and kept in a file."""

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
        """The folder of compiled kernels of the sources without a fault."""
        return self._folder / "kernels"

    def measure(self, tests: Iterable[str], tell: Callable[[str], None] = lambda _: None) -> None:
        """Run those test files that have not been run without a fault; raise `InputError` if one fails."""
        with self._lock:
            if missing := sorted(set(tests) - self._seconds.keys()):
                tell(f"{len(missing)} test files without a fault")
                self._run(missing)

    def ordered(self, tests: Sequence[str]) -> list[str]:
        """Return test files, the fastest first."""
        return sorted(tests, key=lambda test: self._seconds[test])

    def limit(self, tests: Sequence[str]) -> float:
        """Return how many seconds a fault may take over some test files."""
        return COMPILING + TIMES * sum(self._seconds[test] for test in tests)

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
        before = scratch.compiled()
        run = run_tests(scratch, self._programs, tests, first=False)
        if run.code == 0 and scratch.compiled() > before:  # again without compiling
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
            self._scratch = Scratch(self._project, self._folder, self.kernels, shared=True)
        return self._scratch

    def _write(self) -> None:
        content = {"state": self._state, "seconds": self._seconds, "pictures": self._seconds_of_pictures}
        write_text(self._file, json.dumps(content, indent=1) + "\n")
