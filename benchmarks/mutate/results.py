"""What became of each fault: a line of JSON for each, so that a run goes on where it was interrupted."""

import hashlib
import json
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks.mutate.faults import Fault
from benchmarks.mutate.project import Project
from benchmarks.mutate.trial import CAUGHT, TIMEOUT, whole_lines

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
