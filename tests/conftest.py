"""What every test can ask for: the real scenes' folder, and a place to put the figure a feature's evidence gave."""

import gc
import os
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import hypothesis
import pytest
from xdist.scheduler import LoadFileScheduling

# the same examples on every run and no limit on time, which a compiling kernel would break
hypothesis.settings.register_profile("refgi", derandomize=True, deadline=None)
hypothesis.settings.load_profile("refgi")

ROOT = Path(__file__).parents[1]
os.environ.setdefault("OMP_WAIT_POLICY", "passive")  # several processes share the cores: waiting threads leave theirs
COLLECTED: pytest.StashKey[tuple[list[pytest.Item], set[int]]] = pytest.StashKey()  # tests, and those left out
# its first test makes the kit, for which the others of its folder would wait
MAKES_THE_KIT = "tests/vectors/test_forms.py"
# folders from both ends, so that two processes lower few kernels twice: whole methods in float64, in float32; files of
# the others, which lower few, stand between
FIRST = ("vectors", "wiring", "literal", "cluster", "sssil")
LAST = ("rsm", "truth", "pairs", "splat", "batch", "bench", "cli")
# what `make quick` runs: a minute with warm kernels
QUICK = (
    "tests/settings", "tests/image", "tests/scene/test_scenefile", "tests/compare", "tests/provenance",
    "tests/test_stages.py", "tests/test_draws.py", "tests/test_errors.py", "tests/test_docstrings.py",
    "tests/jit/test_kernel.py", "tests/cli/test_settings.py", "tests/cli/test_render.py",
    "tests/pairs/test_pair_sum.py", "tests/pairs/test_clamps.py", "tests/sssil/test_pattern.py",
    "tests/cluster/test_kmeans.py", "tests/cluster/test_rectangle.py", "tests/lights/test_warp.py")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--evidence", action="store_true", help="print feature id, test and measured figure")
    parser.addoption("--all", action="store_true", help="run the slow tests too")


def pytest_configure() -> None:
    with warnings.catch_warnings():  # third-party modules that warn on their first import
        warnings.simplefilter("ignore")
        import trimesh  # noqa: F401


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Return how many processes run tests, four at most: each collects all tests, and lowers kernels anew."""
    return min(4, max(2, os.cpu_count() or 1))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    items.sort(key=_turn)
    for item in items:
        if item.nodeid.startswith(QUICK):
            item.add_marker("quick")
    left_out = [item for item in items if _is_slow(item)]
    if not any("::" in argument for argument in config.args):
        _expect_slow_cases(items)
        config.stash[COLLECTED] = items.copy(), {id(item) for item in left_out}
    if left_out and not config.getoption("--all"):
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in left_out]


def pytest_collection_finish() -> None:
    """Spare the garbage collector what imports and collection made, and the small rounds."""
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


def _turn(item: pytest.Item) -> int:
    """Return when a test runs, by its folder."""
    if item.nodeid.startswith(MAKES_THE_KIT):
        return -1
    folder = (*item.nodeid.split("/"), "")[1]
    return FIRST.index(folder) if folder in FIRST else len(FIRST) + (1 + LAST.index(folder) if folder in LAST else 0)


class FromBothEnds(LoadFileScheduling):  # type: ignore[misc]
    """Files for processes, from the first and from the last on: a kernel is lowered anew in each that reaches it."""

    def _assign_work_unit(self, node: Any) -> None:
        if self.nodes.index(node) % 2:
            self.workqueue.move_to_end(next(reversed(self.workqueue)), last=False)
        super()._assign_work_unit(node)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> FromBothEnds | None:
    return FromBothEnds(config, log) if config.getvalue("dist") == "loadfile" else None


def _is_slow(item: pytest.Item) -> bool:
    """Return whether a test is marked slow, all of it or its case."""
    case = item.name.partition("[")[2][:-1]
    return any(not mark.args or case in mark.args for mark in item.iter_markers("slow"))


def _expect_slow_cases(items: list[pytest.Item]) -> None:
    """Refuse slow cases that their tests do not have."""
    marked = {f"{item.nodeid.partition('[')[0]}[{case}]" for item in items for mark in item.iter_markers("slow")
              for case in mark.args}
    if gone := marked - {item.nodeid for item in items}:
        raise pytest.UsageError(f"marked slow, but no case of its test: {', '.join(sorted(gone))}")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Put features where a report carries them from a worker to the process that prints."""
    item.user_properties += [("feature", feature) for mark in item.iter_markers("feature") for feature in mark.args]


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    if not config.getoption("--evidence"):
        return
    reports = [report for outcome in ("passed", "failed") for report in terminalreporter.getreports(outcome)]
    table = sorted(row for report in reports if report.when == "call" for row in _evidence_of(report))
    if table:
        terminalreporter.section("evidence")
        terminalreporter.write_line(features_built())
        for feature, test, figure in table:
            terminalreporter.write_line(f"{feature:8} {test}\n         {figure}")


def features_built() -> str:
    """Return how many features docs/features.md lists, and which of them are built in part or not."""
    page = (ROOT / "docs/features.md").read_text()
    rows = re.findall(r"^\| ([A-Z]{3}-\d\d) \|[^|]+\| (in part|not built)?", page, re.MULTILINE)
    short = [f"{sum(kind == how for _, kind in rows)} {how}: " + ", ".join(name for name, kind in rows if kind == how)
             for how in ("in part", "not built") if any(kind == how for _, kind in rows)]
    return ", ".join([f"Of {len(rows)} features {sum(not kind for _, kind in rows)} are built", *short])


def _evidence_of(report: pytest.TestReport) -> list[tuple[str, str, str]]:
    """Return a row for each feature whose evidence a test measured."""
    figure = "; ".join(str(text) for kind, text in report.user_properties if kind == "figure") or "-"
    figure = figure if report.passed else f"FAILED ({figure})"
    return [(str(feature), report.nodeid, figure) for kind, feature in report.user_properties if kind == "feature"]


@pytest.fixture
def evidence(request: pytest.FixtureRequest) -> Callable[[str], None]:
    """Return a function that keeps a measured figure for the evidence table."""
    return lambda figure: request.node.user_properties.append(("figure", figure))


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Return the folder of real scenes (REFGI_DATA), or skip: a user of the project has none."""
    folder = Path(os.environ.get("REFGI_DATA", ROOT / ".." / "shared" / "data")).resolve()
    if not folder.is_dir():
        pytest.skip("no real scenes here: set REFGI_DATA to their folder")
    return folder
