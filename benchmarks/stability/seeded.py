"""Put faults of precision into a copy of the sources and count those that a row of the stability run shows.

`python -m benchmarks.stability.seeded [--first N] [--every N] [--form short|full] --out DIR`. The faults, one line
each, stand in precision_faults.toml, written by someone who had not seen the run. Each is tried part by part until a
row fails that does not fail without it. What was found stands in DIR/seeded.json; an interrupted run goes on.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

from refgi.stress.rows import read_rows

ROOT = Path(__file__).parents[2]
FAULTS = Path(__file__).with_name("precision_faults.toml")
PARTS = ("kernels", "pictures", "rays", "sameness", "files", "faults", "kills")
SECONDS = 1200  # for one part
NOT_COPIED = (".git", ".venv", "out", "docs", "tests", "__pycache__")


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stability.seeded", description=__doc__)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--form", choices=("short", "full"), default="short")
    parser.add_argument("--part", action="append", choices=PARTS, help="repeatable; all where absent")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args(arguments)
    faults: list[dict[str, str]] = tomllib.loads(FAULTS.read_text())["fault"]
    kept = options.out / "seeded.json"
    found: dict[str, Any] = json.loads(kept.read_text()) if kept.exists() else {}
    options.out.mkdir(parents=True, exist_ok=True)
    tree = options.out.resolve() / "tree"
    shutil.rmtree(tree, ignore_errors=True)
    shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(*NOT_COPIED))
    parts = options.part or PARTS
    for fault in [None, *faults[options.first :: options.every]]:
        name = fault["name"] if fault else "without a fault"
        if name not in found:
            found[name] = tried(tree, fault, parts, options.form, found.get("without a fault", {}).get("failed", []))
            kept.write_text(json.dumps(found, indent=1) + "\n")
        print(f"{name}: {found[name]['said']}", flush=True)
    caught = [one["caught"] for name, one in found.items() if name != "without a fault"]
    print(f"{sum(caught)} of {len(caught)} faults are shown")
    return 0


def tried(tree: Path, fault: dict[str, str] | None, parts: tuple[str, ...], form: str,
          known: list[str]) -> dict[str, Any]:
    """Return what the run says with a fault; every part without one, else those up to the first that shows it."""
    if fault:
        file = tree / fault["path"]
        text = file.read_text()
        if text.count(fault["old"]) != 1:
            return {"caught": False, "failed": [], "said": "no longer applies"}
        file.write_text(text.replace(fault["old"], fault["new"]))
    failed: list[str] = []
    try:
        for part in parts:
            failed += [row for row in failed_rows(tree, part, form) if row not in known]
            if fault and failed:
                break
    finally:
        if fault:
            file.write_text(text)
    return {"caught": bool(failed), "failed": failed, "said": failed[0] if failed else "no row shows it"}


def failed_rows(tree: Path, part: str, form: str) -> list[str]:
    """Return the rows that a part breaks; what ends it otherwise counts as one."""
    out = tree.parent / "made"
    shutil.rmtree(out, ignore_errors=True)
    command = [sys.executable, "-m", "benchmarks", "stability", "--part", part, "--out", str(out)]
    command += ["--short"] if form == "short" else []
    try:
        done = subprocess.run(command, cwd=tree, env={**os.environ, "PYTHONPATH": str(tree)}, capture_output=True,
                              text=True, timeout=SECONDS, check=False)
    except subprocess.TimeoutExpired:
        return [f"{part}: not done in {SECONDS} s"]
    if not (out / "stability.json").exists():
        return [f"{part}: {(done.stderr.strip().splitlines() or ['ended'])[-1][:200]}"]
    return [f"{row.part}: {row.property}, {row.subject} {row.scene}".rstrip()
            for row in read_rows(out / "stability.json").failed]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
