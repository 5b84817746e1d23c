"""Score the checker of the conformance kit: one-line bugs are put into ports, one at a time, and must be named.

`benchmarks/kit_bugs/*.toml` lists them, written by someone who had not seen the checker: file, text, replacement, the
stages in which the bug first shows, and words that a good diagnosis holds. A bug counts as found where the first wrong
stage is one of those, and its cause as named where one of the three causes told of that stage, over all cases, holds
one of the words.
"""

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console
from rich.table import Table

from refgi.testing import kit_folder
from refgi.vectors.check import ALL_WITHIN, Asked, Kit, check_output
from refgi.vectors.rows import StaleEditError, replaced
from refgi.vectors.search import searched
from refgi.vectors.spec import kind_of

ROOT = Path(__file__).parents[1]
BUGS = Path(__file__).with_name("kit_bugs")
PORTS = ROOT / "examples" / "ports"
SOURCES = {"c": PORTS / "c", "c_fresh": PORTS / "c", "c_blind": PORTS / "c", "glsl": PORTS / "glsl"}
LONGEST = 300.0  # s for one run of a port


class Score(NamedTuple):
    """What became of one bug."""

    port: str
    number: int
    what: str
    state: str  # "found", "elsewhere", "silent", "does not build", "does not run"
    named: bool | None  # None where the list holds no words: its causes are for a reader to judge
    first: str
    causes: tuple[str, ...]


def main(arguments: list[str]) -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks kit-score", description=__doc__)
    parser.add_argument("--port", dest="ports", action="append", choices=[*SOURCES], help="repeatable; all if none")
    parser.add_argument("--out", type=Path, help="folder for kit_score.json")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--every", type=int, default=1, help="score each so many-th bug alone")
    parser.add_argument("--first", type=int, default=0, help="and begin with that one")
    parser.add_argument("--search", type=float, default=0.0, metavar="SECONDS",
                        help="search the literal text for the change where fewer than three causes are known")
    parser.add_argument("--bugs", type=lambda text: {int(one) for one in text.split(",")}, help="score these alone")
    options = parser.parse_args(arguments)
    console, scores = Console(), []
    for port in options.ports or SOURCES:
        every = list(enumerate(tomllib.loads((BUGS / f"{port}.toml").read_text(encoding="utf-8"))["bug"]))
        bugs = [bug for bug in every[options.first :: options.every] if not options.bugs or bug[0] in options.bugs]
        with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(options.jobs) as pool:
            right = _copied(SOURCES[port], Path(folder))
            state = _without_bugs(port, right, Path(folder) / "out")
            if state:
                console.print(f"{port}: left out, {state}")
                continue
            for score in pool.map(lambda one, port=port, right=right: _score(
                    port, right, *one, seconds=options.search), bugs):
                scores.append(score)
                if score.state != "found" or not score.named:
                    console.print(f"{port} {score.number}: {score.state}, first {score.first or 'none'}; {score.what}; "
                                  f"told: {'; '.join(score.causes) or 'nothing'}", highlight=False)
    console.print(_table(scores))
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        (options.out / "kit_score.json").write_text(json.dumps([one._asdict() for one in scores], indent=1) + "\n")
    return 0


def _without_bugs(port: str, source: Path, out: Path) -> str:
    """Build and run a port; return why it cannot be scored, or nothing."""
    said = _build(port, source, "") or _run(port, source, out)
    if said:
        return said
    result = check_output(Kit(kit_folder()), out, Asked())
    return "" if result.exit_code == ALL_WITHIN else f"it is wrong without a bug: {result.first}"


def _score(port: str, right: Path, number: int, bug: dict[str, Any], *, seconds: float = 0.0) -> Score:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        source = _copied(right, folder)
        file = source / bug["file"]
        try:
            file.write_text(replaced(file.read_text(encoding="utf-8"), bug["old"], bug["new"]), encoding="utf-8")
        except StaleEditError as error:
            return Score(port, number, bug["what"], "does not build", False, str(error), ())
        said = _build(port, source, bug["file"])
        if said:
            return Score(port, number, bug["what"], "does not build", False, said, ())
        said = _run(port, source, folder / "out", _cases_with(bug["stages"]))
        if said:  # a crash is seen without a checker
            return Score(port, number, bug["what"], "does not run", False, said, ())
        return _judged(port, number, bug, folder / "out", seconds)


def _judged(port: str, number: int, bug: dict[str, Any], out: Path, seconds: float) -> Score:
    kit = Kit(kit_folder())
    result = check_output(kit, out, Asked())
    if seconds:
        result = searched(kit, out, Asked(), result, seconds=seconds)
    if result.first is None:
        return Score(port, number, bug["what"], "silent", False, "", ())
    where = {kind_of(stage) for stage in bug["stages"]}
    state = "found" if kind_of(result.first[1]) in where else "elsewhere"
    causes = tuple(cause.cause for one in result.findings[:1] for cause in one.causes)
    found = any(word.lower() in cause.lower() for word in bug["words"] for cause in causes)
    named = found if bug["words"] else None
    return Score(port, number, bug["what"], state, named, "/".join(result.first), causes)


def _copied(source: Path, folder: Path) -> Path:
    target = folder / source.name
    shutil.copytree(source, target, ignore=shutil.ignore_patterns("__pycache__"))
    return target


def _build(port: str, source: Path, changed: str) -> str:
    """Compile what has changed, all where that is no single unit."""
    if not port.startswith("c"):
        return ""
    units = [changed] if changed.endswith(".c") else [file.name for file in sorted(source.glob("*.c"))]
    compile_ = ["cc", "-O2", "-std=c99", "-w", "-ffp-contract=off", "-c", *units]
    return _said(compile_, source) or _said(["cc", "-o", "port", *(
        file.name for file in sorted(source.glob("*.o"))), "-lm"], source)


def _cases_with(stages: list[str]) -> list[str]:
    """Return the cases in which some of these stages run: a bug elsewhere is not looked for."""
    kinds = {kind_of(stage) for stage in stages}
    return [case.id for case in Kit(kit_folder()).cases(Asked()) if kinds & {kind_of(one.name) for one in case.stages}]


def _run(port: str, source: Path, out: Path, cases: Iterable[str] = ()) -> str:
    kit = str(kit_folder())
    out.mkdir(exist_ok=True)
    in_c = [str(source / "port"), kit, str(out), *cases]
    in_glsl = [sys.executable, str(source / "run.py"), kit, str(out), *cases]
    return _said(in_glsl if port == "glsl" else in_c, source)


def _said(command: list[str], folder: Path) -> str:
    """Run a command and return why it failed, or nothing."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder, timeout=LONGEST)
    except (OSError, subprocess.TimeoutExpired) as error:
        return str(error)
    return "" if done.returncode == 0 else (done.stderr.strip().splitlines() or ["no output"])[-1]


def _counts(scores: list[Score]) -> Iterator[tuple[str, list[Score]]]:
    for port in SOURCES:
        own = [one for one in scores if one.port == port]
        if own:
            yield port, own
    yield "all", scores


def _table(scores: list[Score]) -> Table:
    table = Table("port", "bugs that run", "first wrong stage named", "cause among three", "silent", box=None)
    for port, own in _counts(scores):
        ran = [one for one in own if not one.state.startswith("does not")]
        found = sum(one.state == "found" for one in ran)
        named = sum(bool(one.named) for one in ran)
        count = max(1, len(ran))
        said = "to be read" if any(one.named is None for one in ran) else f"{named} ({named / count:.0%})"
        table.add_row(port, str(len(ran)), f"{found} ({found / count:.0%})", said,
                      str(sum(one.state == "silent" for one in ran)))
    return table
