"""Run pytest in a scratch copy: `python -P child.py PACKAGE REPORT ARGUMENT ...`.

The report has lines of JSON: of each test when it starts and what time it takes, of each exception its classes. The
package must be that of the folder at hand; this file imports nothing of the project, whose copy it runs.
"""

import importlib.util
import json
import sys
from pathlib import Path
from typing import Any

import pytest

ANOTHER_COPY = 70  # exit code


class Reporter:
    """A plugin that writes the report."""

    def __init__(self, file: Path) -> None:
        self._stream = file.open("w", encoding="utf-8")

    def _write(self, **line: Any) -> None:
        self._stream.write(json.dumps(line) + "\n")
        self._stream.flush()

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        self._write(test=nodeid, seconds=0.0)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self._write(test=report.nodeid, seconds=report.duration)

    def pytest_exception_interact(self, node: pytest.Item, call: pytest.CallInfo[Any]) -> None:
        if call.excinfo is None:
            return
        error = call.excinfo.value
        while isinstance(error, BaseExceptionGroup):  # of several examples of Hypothesis
            error = error.exceptions[0]
        kinds = [f"{kind.__module__}.{kind.__qualname__}" for kind in type(error).__mro__]
        self._write(failed=node.nodeid, kinds=kinds, message=str(error)[:400], ran=isinstance(node, pytest.Item))


def main() -> int:
    package, report, *arguments = sys.argv[1:]
    try:
        spec = importlib.util.find_spec(package)
    except Exception:
        spec = None
    if spec is None or spec.origin is None or not Path(spec.origin).is_relative_to(Path.cwd()):
        print(f"{package} is not that of {Path.cwd()}")
        return ANOTHER_COPY
    return int(pytest.main(arguments, plugins=[Reporter(Path(report))]))


if __name__ == "__main__":
    sys.exit(main())
