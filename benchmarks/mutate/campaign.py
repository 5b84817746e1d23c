"""Go through faults: tests first, and pictures of those that no test notices."""

import fcntl
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from contextlib import contextmanager
from functools import cache
from itertools import chain, islice
from pathlib import Path

from benchmarks.mutate.baseline import Baseline
from benchmarks.mutate.faults import Fault, is_fault
from benchmarks.mutate.programs import Programs
from benchmarks.mutate.project import DIFFERENT, Project
from benchmarks.mutate.results import Result, Results, state_of
from benchmarks.mutate.scratch import Scratch, remove_copies
from benchmarks.mutate.selection import tests_of
from benchmarks.mutate.trial import INVALID, SAME, SURVIVED, run_pictures, run_tests
from refgi.errors import InputError

Tell = Callable[[str, float], None]


class Campaign:
    """The first faults of an order, invalid ones not counted; files and copies are in a folder."""

    def __init__(self, project: Project, folder: Path, faults: Sequence[Fault], count: int, tell: Tell) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        state = state_of(project)
        self._project, self._folder, self._count, self._tell = project, folder.resolve(), count, tell
        self._programs = Programs()
        self._known = Results(folder / "results.jsonl", state)
        self._baseline = Baseline(project, self._folder, self._programs, f"{state.sources} {state.tests}")
        self._tests_of = cache(lambda file: tests_of(project, file))
        self._lock = threading.Lock()
        programs = (fault for fault in faults if is_fault((project.root / fault.file).read_text(), fault))
        self._ahead = list(islice(programs, count))
        self._order: Iterator[Fault] = chain(self._ahead, programs)
        self._open = count  # faults still to be taken
        self.results: list[Result] = []

    def run(self, jobs: int = 1) -> None:
        """Fill `results`, in no order, with what became of each fault; `jobs` of them at once."""
        unknown = [fault for fault in self._ahead if self._known.of(fault) is None]
        with _locked(self._folder), ThreadPoolExecutor(jobs) as pool:
            try:
                remove_copies(self._folder)
                self._baseline.measure((test for fault in unknown for test in self._tests_of(fault.file)), self._say)
                workers = [pool.submit(self._work) for _ in range(jobs)]
                for worker in wait(workers, return_when=FIRST_EXCEPTION).done:
                    worker.result()
            except BaseException:
                self._programs.stop()
                raise

    def _work(self) -> None:
        scratch = None
        while (fault := self._take()) is not None:
            result = self._known.of(fault)
            if result is None:
                scratch = scratch or Scratch(self._project, self._folder, self._baseline.kernels)
                result = self._judged(fault, scratch)
                self._known.add(result)
            with self._lock:
                self.results.append(result)
                self._open += result.outcome == INVALID

    def _take(self) -> Fault | None:
        with self._lock:
            if self._open == 0 or (fault := next(self._order, None)) is None:
                return None
            self._open -= 1
            done = sum(result.outcome != INVALID for result in self.results)
            self._tell(f"{done} of {self._count}, {fault.file}:{fault.line} {fault.operator}", done / self._count)
            return fault

    def _judged(self, fault: Fault, scratch: Scratch) -> Result:
        tests = self._tests_of(fault.file)
        self._baseline.measure(tests, self._say)
        outcome, by, seconds = SURVIVED, "", 0.0
        with scratch.with_fault(fault):
            if tests:
                run = run_tests(scratch, self._programs, self._baseline.ordered(tests), self._baseline.limit(tests))
                (outcome, by), seconds = run.verdict(), run.seconds
            if outcome == SURVIVED:
                outcome, by, more = self._compared(fault, scratch)
                seconds += more
        return Result(fault, outcome, by, seconds)

    def _compared(self, fault: Fault, scratch: Scratch) -> tuple[str, str, float]:
        """Return whether a fault that no test noticed changes a picture, the first one that differs, and seconds."""
        limit = self._baseline.measure_pictures(self._say)
        scratch.share_kernels()
        file = scratch.folder / "pictures.json"
        ended = run_pictures(scratch, self._programs, file, "--against", self._baseline.pictures,
                             "--first", self._project.method_of(fault.file), limit=limit)
        if ended.code == 0:
            return SAME, "", ended.seconds
        if ended.code == DIFFERENT:
            return SURVIVED, file.read_text(), ended.seconds
        how = "take too long" if ended.code is None else f"end with exit code {ended.code}"
        return SURVIVED, f"that the pictures {how}", ended.seconds

    def _say(self, what: str) -> None:
        self._tell(what, 0.0)


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Keep other runs out of a folder while the block runs; a kill lets them in."""
    with (folder / "lock").open("w") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise InputError(f"--out: another run uses {folder}") from error
        yield
