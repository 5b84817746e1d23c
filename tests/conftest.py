"""What every test can ask for: the real scenes' folder, and a place to put the figure a feature's evidence gave."""

import os
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import hypothesis
import pytest

# the same examples on every run and no limit on time, which a compiling kernel would break
hypothesis.settings.register_profile("refgi", derandomize=True, deadline=None)
hypothesis.settings.load_profile("refgi")

ROOT = Path(__file__).parents[1]
FIGURES = pytest.StashKey[list[str]]()
_TABLE = pytest.StashKey[list[tuple[str, str, str]]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--evidence", action="store_true", help="print feature id, test and measured figure")
    parser.addoption("--all", action="store_true", help="run the slow tests too")


def pytest_configure(config: pytest.Config) -> None:
    with warnings.catch_warnings():  # third-party modules that warn on their first import
        warnings.simplefilter("ignore")
        import trimesh  # noqa: F401
    config.stash[_TABLE] = []


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption("--all"):
        slow = [item for item in items if item.get_closest_marker("slow")]
        if slow:
            config.hook.pytest_deselected(items=slow)
            items[:] = [item for item in items if not item.get_closest_marker("slow")]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    report = yield
    if report.when == "call":
        figure = "; ".join(item.stash.get(FIGURES, [])) or "-"
        for mark in item.iter_markers("feature"):
            for feature in mark.args:
                outcome = figure if report.passed else f"FAILED ({figure})"
                item.config.stash[_TABLE].append((feature, item.nodeid, outcome))
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    table = sorted(config.stash[_TABLE])
    if config.getoption("--evidence") and table:
        terminalreporter.section("evidence")
        for feature, test, figure in table:
            terminalreporter.write_line(f"{feature:8} {test}\n         {figure}")


@pytest.fixture
def evidence(request: pytest.FixtureRequest) -> Callable[[str], None]:
    """Return a function that keeps a measured figure for the evidence table."""
    return request.node.stash.setdefault(FIGURES, []).append


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Return the folder of real scenes (REFGI_DATA), or skip: a user of the project has none."""
    folder = Path(os.environ.get("REFGI_DATA", ROOT / ".." / "shared" / "data")).resolve()
    if not folder.is_dir():
        pytest.skip("no real scenes here: set REFGI_DATA to their folder")
    return folder


@pytest.fixture(scope="session")
def failure_dir() -> Path:
    """Return where a failed picture test leaves image, reference and error."""
    folder = ROOT / "out" / "failures"
    folder.mkdir(parents=True, exist_ok=True)
    return folder
