"""Put faults of precision into a copy of the sources and count those that a row of the stability run shows.

`python -m benchmarks.stability.seeded [--first N] [--every N] [--form short|full] --out DIR`. The faults, one line
each, stand in precision_faults.toml, written by someone who had not seen the run. Each is tried by the task in which it
showed before, then part by part, until a row fails that does not fail without it. What was found stands in
DIR/seeded.json; an interrupted run goes on.
"""

import argparse
import json
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.mutate.project import REFGI, Scratch, remove_copies
from benchmarks.stability.runner import PARTS
from refgi.stress.promises import read_rows
from refgi.vectors.rows import replaced

FAULTS = Path(__file__).with_name("precision_faults.toml")
ORDER = sorted(PARTS, key=["kernels", "pictures", "rays", "sameness", "files", "faults", "kills"].index)
SECONDS = 1200  # for one part


class PrecisionFault(NamedTuple):
    """One changed line."""

    name: str
    file: str
    old: str
    new: str
    about: str  # where it shows
    shown_by: str = ""  # PART/TASK in which it showed before

    def put_into(self, text: str) -> str:
        """Return the text of its file with the line changed."""
        return replaced(text, self.old, self.new, f"{self.name}, {self.file}")


def faults() -> list[PrecisionFault]:
    return [PrecisionFault(**one) for one in tomllib.loads(FAULTS.read_text())["fault"]]


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stability.seeded", description=__doc__)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--name", action="append", default=[], help="repeatable; a part of a fault's name")
    parser.add_argument("--form", choices=("short", "full"), default="short")
    parser.add_argument("--part", action="append", choices=PARTS, help="repeatable; all where absent")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args(arguments)
    kept = options.out / "seeded.json"
    found: dict[str, Any] = json.loads(kept.read_text()) if kept.exists() else {}
    options.out.mkdir(parents=True, exist_ok=True)
    remove_copies(options.out)
    trial = Trial(options.out.resolve(), options.form, tuple(options.part or ORDER))
    chosen = [fault for fault in faults()[options.first :: options.every]
              if not options.name or any(part in fault.name for part in options.name)]
    for fault in chosen:
        if not found.get(fault.name, {}).get("shown"):
            found[fault.name] = trial.tried(fault)
            kept.write_text(json.dumps(found, indent=1) + "\n")
        print(f"{fault.name}: {found[fault.name]['said']}", flush=True)
    print(f"{sum(one['shown'] for one in found.values())} of {len(found)} faults are shown")
    return 0


class Trial:
    """Runs in copies of the sources, one without faults."""

    def __init__(self, folder: Path, form: str, parts: Sequence[str]) -> None:
        self._sound = Scratch(REFGI, folder, folder / "kernels", shared=True)
        self._faulty = Scratch(REFGI, folder, folder / "kernels")
        self._form, self._parts = form, parts
        self._known: dict[tuple[str, str], list[str]] = {}  # rows that fail without a fault

    def tried(self, fault: PrecisionFault) -> dict[str, Any]:
        """Return what the runs say with a fault, up to the first that shows it."""
        for part, task in self._runs(fault):
            known = self._without(part, task)
            with self._faulty.with_fault(fault):
                failed = [row for row in self._failed(self._faulty, part, task) if row not in known]
            if failed:
                return {"shown": True, "part": part, "failed": failed, "said": failed[0]}
        return {"shown": False, "part": "", "failed": [], "said": "no row shows it"}

    def _runs(self, fault: PrecisionFault) -> Iterator[tuple[str, str]]:
        part, _, task = fault.shown_by.partition("/")
        if part in self._parts:
            yield part, task
        yield from ((part, "") for part in self._parts)

    def _without(self, part: str, task: str) -> list[str]:
        if (part, task) not in self._known:
            self._known[part, task] = self._failed(self._sound, part, task)
        return self._known[part, task]

    def _failed(self, copy: Scratch, part: str, task: str) -> list[str]:
        """Return the rows that a part or one task of it breaks in a copy; what ends it otherwise counts as one."""
        out = copy.folder / "made"
        shutil.rmtree(out, ignore_errors=True)
        command = copy.python("-m", "benchmarks", "stability", "--part", part, "--out", out)
        command += ["--task", task] if task else []
        command += ["--short"] if self._form == "short" else []
        try:
            done = subprocess.run(command, cwd=copy.tree, env=copy.environment(),
                                  capture_output=True, text=True, timeout=SECONDS, check=False)
        except subprocess.TimeoutExpired:
            return [f"{part}: not done in {SECONDS} s"]
        if not (out / "stability.json").exists():
            return [f"{part}: {(done.stderr.strip().splitlines() or ['ended'])[-1][:200]}"]
        return [f"{row.part}: {row.property}, {row.subject} {row.scene}".rstrip()
                for row in read_rows(out / "stability.json").failed]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
