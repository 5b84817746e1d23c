"""Results of a run, kept in a file, and as text: the score, and every survivor with its line."""

import hashlib
import json
import statistics
import threading
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.mutate.faults import KINDS, Fault
from benchmarks.mutate.project import Project
from benchmarks.mutate.trial import CAUGHT, INVALID, SAME, SURVIVED, TIMEOUT, whole_lines
from refgi.cli.session import table

CODE = ("*.py", "*.txt", "*.json")


class Result(NamedTuple):
    """What the tests made of a fault."""

    fault: Fault
    outcome: str
    by: str  # the test, or the picture
    seconds: float


class State(NamedTuple):
    """Hashes of what results depend on."""

    root: Path
    sources: str
    tests: str

    def of(self, result: Result) -> str:
        """Return the hash that a result holds for: a fault that was caught stays so while that test is the same."""
        file = result.by.partition("::")[0]
        if result.outcome in (CAUGHT, TIMEOUT) and (self.root / file).is_file():
            return f"{self.sources} {hash_of(self.root, [self.root / file])}"
        return f"{self.sources} {self.tests}"


def state_of(project: Project) -> State:
    """Hash the sources, and the tests with what says which pictures there are."""
    sources, tests = (hash_of(project.root, _files(project.root / folder for folder in folders))
                      for folders in ((project.package,), (project.tests, *project.judging)))
    return State(project.root, sources, tests)


def hash_of(root: Path, files: Iterable[Path]) -> str:
    digest = hashlib.sha256()
    for file in files:
        digest.update(f"{file.relative_to(root)}\n{hashlib.sha256(file.read_bytes()).hexdigest()}\n".encode())
    return digest.hexdigest()[:16]


def _files(folders: Iterable[Path]) -> Iterator[Path]:
    for folder in folders:
        yield from [folder] if folder.is_file() else sorted(file for code in CODE for file in folder.rglob(code))


class Results:
    """The results in a file, those that hold for the sources and tests at hand."""

    def __init__(self, file: Path, state: State) -> None:
        self._file, self._state = file, state
        self._lock = threading.Lock()
        self._known: dict[str, Result] = {}
        for line in whole_lines(file):
            content = json.loads(line)
            result = Result(Fault(**content["fault"]), content["outcome"], content["by"], content["seconds"])
            if state.of(result) == content["state"]:
                self._known[result.fault.id] = result
        if file.is_file() and not file.read_bytes().endswith(b"\n"):  # what a kill cut short
            file.write_text("".join(whole_lines(file)), encoding="utf-8")

    def of(self, fault: Fault) -> Result | None:
        """Return what became of a fault, None where that is not known."""
        return self._known.get(fault.id)

    def add(self, result: Result) -> None:
        """Append a result to the file."""
        content = {"id": result.fault.id, "state": self._state.of(result)} | result._asdict() | {
            "fault": result.fault._asdict()}
        with self._lock, self._file.open("a", encoding="utf-8") as stream:
            stream.write(json.dumps(content) + "\n")


HEAD = ("faults", "tried", "caught", "by time", "survived", "same pictures", "invalid", "score")


def as_text(results: Sequence[Result]) -> str:
    """Return the score by kind, then survivors that change a picture, then those that change none."""
    blocks = [_scores(results)]
    for outcome, title in ((SURVIVED, "Survivors"), (SAME, "Survivors that change no picture")):
        found = sorted(result for result in results if result.outcome == outcome)
        if found:
            blocks.append("\n\n".join([f"{title}: {len(found)}", *map(diff, found)]))
    if times := [result.seconds for result in results if result.outcome != INVALID]:
        blocks.append(f"{statistics.mean(times):.0f} s a fault, median {statistics.median(times):.0f} s, longest "
                      f"{max(times):.0f} s")
    return "\n\n".join(blocks)


def diff(result: Result) -> str:
    """Return the changed line of a survivor, and the picture that shows it."""
    fault = result.fault
    shown = f"; shows in {result.by}" if result.by else ""
    where = f" in {fault.function}" if fault.function else ""
    return (f"{fault.file}:{fault.line}{where}, {fault.operator} ({fault.id}){shown}\n"
            f"- {fault.before.strip()}\n+ {fault.after.strip()}")


def survivors(results: Sequence[Result]) -> int:
    """Return how many faults change a picture and no test."""
    return sum(result.outcome == SURVIVED for result in results)


def _scores(results: Sequence[Result]) -> str:
    rows: list[tuple[str, ...]] = [HEAD]
    for kind in KINDS:
        some = [result.outcome for result in results if result.fault.kind == kind]
        caught, late, survived, same, invalid = (some.count(outcome)
                                                 for outcome in (CAUGHT, TIMEOUT, SURVIVED, SAME, INVALID))
        judged = caught + late + survived
        if some:
            score = f"{caught + late} of {judged}"
            rows.append((kind, *map(str, (len(some) - invalid, caught, late, survived, same, invalid)), score))
    return table(rows, right=frozenset(range(1, 8)))
