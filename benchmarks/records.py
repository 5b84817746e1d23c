"""What was measured and stands in files, and whether it is of today's code: `python -m benchmarks records [NAME ...]`.

Lists the records with the commit, the day and the processor that they were made with; one is stale where the code that
it rests on is another now: its syntax trees without docstrings. `--make` makes those again that are stale, one after
the other, and stamps each as it ends, so that a run that was interrupted goes on with the next.
"""

import argparse
import ast
import datetime
import hashlib
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import llvmlite.binding
from rich.console import Console
from rich.table import Table

from refgi.image import write_text

ROOT = Path(__file__).parent.parent
STAMPS = Path("benchmarks/results/stamps.json")
AROUND = ("cli", "literal", "vectors", "batch", "stress", "testing.py", "__main__.py", "bench")  # of no picture or time
JUDGED = AROUND[:-1]  # of what `bench` measures


class Record(NamedTuple):
    """Files that commands make."""

    commands: tuple[tuple[str, ...], ...]  # arguments of Python, one after the other
    read_by: str
    sources: tuple[str, ...] = ("refgi/**/*.py",)  # patterns
    around: tuple[str, ...] = AROUND  # of refgi what it does not rest on


class Stamp(NamedTuple):
    """How a record was made."""

    commit: str
    day: str
    processor: str
    digest: str


PAPERS = "sii", "multires", "val", "hssil"
RECORDS = {
    "accuracy": Record((("-m", "benchmarks", "accuracy", "--out", "benchmarks/results"),), "docs/accuracy.md",
                       around=JUDGED),
    "frames": Record((("-m", "benchmarks", "frames", "modes", "scaling", "--out", "out/frames"),
                      ("-m", "benchmarks.frames_page", "out/frames")), "docs/frames.md",
                     ("refgi/**/*.py", *(f"benchmarks/{name}.py" for name in ("frames", "modes", "scaling")))),
    "papers": Record((*(("-m", "benchmarks", "paper", name, "--parents", "--out", f"out/papers/{name}")
                        for name in PAPERS),
                      ("docs/papers_page.py", *(f"out/papers/{name}/results.json" for name in PAPERS))),
                     "docs/papers.md", ("refgi/**/*.py", "benchmarks/papers/**/*.py"), JUDGED),
    "gallery": Record((("docs/gallery_page.py",),), "docs/gallery.md", ("refgi/**/*.py", "docs/gallery_page.py")),
    "stability": Record((("-m", "benchmarks", "stability", "--out", "out/stability", "--page", "docs/precision.md"),),
                        "docs/precision.md", ("refgi/**/*.py", "benchmarks/stability/*.py"), around=()),
    "sameness": Record((("-m", "benchmarks.sameness", "--write", "benchmarks/sameness/ledger.json"),),
                       "CONTRIBUTING.md", ("refgi/**/*.py", "benchmarks/sameness/*.py")),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks records", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(RECORDS)}; all if none")
    parser.add_argument("--make", action="store_true", help="make again what is stale")
    options = parser.parse_args(arguments)
    if unknown := set(options.names) - set(RECORDS):
        parser.error(f"no record named {', '.join(sorted(unknown))}; there are {', '.join(RECORDS)}")
    wanted = {name: RECORDS[name] for name in options.names or RECORDS}
    failed = make(ROOT, wanted) if options.make else []
    Console().print(table(ROOT, wanted))
    return bool(failed)


def make(root: Path, records: Mapping[str, Record]) -> list[str]:
    """Make what is stale and stamp it; return the names of what failed."""
    failed = []
    for name, record in records.items():
        now = digest(root, record)
        if (known := stamps(root).get(name)) is not None and known.digest == now:
            continue
        if any(subprocess.run([sys.executable, *command], cwd=root, check=False).returncode
               for command in record.commands):
            failed.append(name)
            continue
        found = Stamp(_commit(root), datetime.date.today().isoformat(), llvmlite.binding.get_host_cpu_name(), now)
        write_text(root / STAMPS, json.dumps({key: stamp._asdict() for key, stamp in
                                              (stamps(root) | {name: found}).items()}, indent=1) + "\n")
    return failed


def table(root: Path, records: Mapping[str, Record]) -> Table:
    result = Table("record", "read by", "made", "state", title="measured records")
    known = stamps(root)
    for name, record in records.items():
        stamp = known.get(name)
        made = "no stamp" if stamp is None else f"{stamp.day} at {stamp.commit} on {stamp.processor}"
        fresh = stamp is not None and stamp.digest == digest(root, record)
        result.add_row(name, record.read_by, made, "fresh" if fresh else "stale")
    return result


def stamps(root: Path) -> dict[str, Stamp]:
    path = root / STAMPS
    return {name: Stamp(**stamp) for name, stamp in json.loads(path.read_text()).items()} if path.exists() else {}


def digest(root: Path, record: Record) -> str:
    """Return a digest of the sources that a record rests on; comments and docstrings are no part of it."""
    found = hashlib.sha256()
    around = [root / "refgi" / name for name in record.around]
    for path in sorted({path for pattern in record.sources for path in root.glob(pattern)}):
        if any(path.is_relative_to(one) for one in around):
            continue
        found.update(f"{path.relative_to(root)}\0{_code_of(path.read_text())}\0".encode())
    return found.hexdigest()[:16]


@cache  # records share most of their sources
def _code_of(text: str) -> str:
    """Return the syntax tree of a source without docstrings."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        documented = isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        if documented and ast.get_docstring(node, clean=False) is not None:
            del node.body[0]
    return ast.dump(tree)


def _commit(root: Path) -> str:
    """Return the commit, with a + where files differ from it."""
    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, check=False).stdout.strip()

    return (git("rev-parse", "--short", "HEAD") or "no repository") + ("+" if git("diff", "--name-only") else "")
