"""`python -m benchmarks mutate`: put one-line faults into a scratch copy, one at a time; count those that tests catch.

Faults are drawn by a seed: kernels and wiring in turn, in each the operators in turn, in each operator by chance. A
fault runs the tests of its file's folder, those that import it and those of wiring, the fastest first, up to the first
that fails. What survives is caught by no test; where all pictures stay the same to the bit it changes none, and does
not count. A fault that cannot be imported, compiled or called is invalid, and another is drawn. Results are kept in
--out for as long as sources and tests are the same (of a caught fault: sources and the test that caught it), so that a
run goes on where it was interrupted. Exits with 1 if a fault survived that changes a picture.
"""

import argparse
import fcntl
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from contextlib import contextmanager
from functools import cache
from itertools import chain, islice
from pathlib import Path
from typing import Any

from benchmarks.mutate.faults import KINDS, Fault, all_faults, drawn, is_fault
from benchmarks.mutate.project import DIFFERENT, REFGI, Programs, Project, Scratch, remove_copies
from benchmarks.mutate.results import Result, Results, as_text, state_of, survivors
from benchmarks.mutate.selection import tests_of
from benchmarks.mutate.trial import INVALID, SAME, SURVIVED, Baseline, Run, run_pictures, run_tests
from refgi.cli.session import DONE, FAILED, INTERRUPTED, progress, say
from refgi.errors import InputError, RefgiError

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
        with _locked(self._folder), ThreadPoolExecutor(jobs) as pool:
            try:
                remove_copies(self._folder)
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
        outcome, by, seconds = SURVIVED, "", 0.0
        with scratch.with_fault(fault):
            if tests:
                run = self._tested(scratch, tests)
                (outcome, by), seconds = run.verdict(), run.seconds
            if outcome == SURVIVED:
                outcome, by, more = self._compared(fault, scratch)
                seconds += more
        return Result(fault, outcome, by, seconds)

    def _tested(self, scratch: Scratch, tests: Sequence[str]) -> Run:
        """Run tests with a fault; what a failing one says counts if it passes without, and time by what that takes."""
        while True:
            run = run_tests(scratch, self._programs, self._baseline.ordered(tests), self._baseline.limit(tests))
            failed = [failure.test.partition("::")[0] for failure in run.failures]
            judging = tests if run.code is None else [test for test in failed if test in tests]
            if not self._baseline.measure(judging, self._say) or run.code is not None:
                return run

    def _compared(self, fault: Fault, scratch: Scratch) -> tuple[str, str, float]:
        """Return whether a fault that no test noticed changes a picture, the first one that differs, and seconds."""
        limit = self._baseline.measure_pictures(self._say)
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


def main(arguments: Sequence[str], project: Project = REFGI) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks mutate", description=__doc__)
    parser.add_argument("--count", type=int, default=60, metavar="N", help="how many faults; 60 where absent")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="which faults")
    parser.add_argument("--path", action="append", default=[], help="folder or file of the sources; repeatable")
    parser.add_argument("--kind", choices=(*KINDS, "both"), default="both", help="code in kernels, code around them")
    parser.add_argument("--out", type=Path, default=Path("out/mutate"), help="folder of results and copies")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="faults at a time, each in a copy of its own")
    parser.add_argument("--again", action="store_true", help="forget earlier results")
    options = parser.parse_args(arguments)
    try:
        return _run(options, project)
    except RefgiError as error:
        parser.error(str(error))


def _run(options: argparse.Namespace, project: Project) -> int:
    paths = [_relative(path, project) for path in options.path]
    faults = [fault for fault in all_faults(project, paths) if options.kind in (fault.kind, "both")]
    if options.again:
        _forget(options.out)
    signal.signal(signal.SIGTERM, _interrupted)
    ended = DONE
    with progress() as tell:
        campaign = Campaign(project, options.out, drawn(faults, options.seed), options.count, tell)
        try:
            campaign.run(options.jobs)
        except KeyboardInterrupt:
            say("interrupted; the same command goes on from here")
            ended = INTERRUPTED
    print(as_text(campaign.results))
    return ended or (FAILED if survivors(campaign.results) else DONE)


def _relative(path: str, project: Project) -> str:
    """Return a path below the project's root, which must be of its package."""
    whole = (project.root / path).resolve()
    if not whole.exists() or not whole.is_relative_to(project.root / project.package):
        raise InputError(f"--path: expected a folder or file of {project.package}/, got {path!r}")
    return whole.relative_to(project.root).as_posix()


def _forget(folder: Path) -> None:
    """Remove what earlier runs left; compiled kernels are right for whatever sources they are of."""
    for name in ("results.jsonl", "baseline.json", "pictures.json"):
        (folder / name).unlink(missing_ok=True)


def _interrupted(*_: Any) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
