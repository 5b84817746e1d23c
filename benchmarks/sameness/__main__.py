"""Write or check a ledger: `python -m benchmarks.sameness (--write | --check) FILE [--only PREFIX]`."""

import argparse
import sys
import time
import traceback
import warnings
from pathlib import Path
from typing import NamedTuple

import numba

from benchmarks.sameness import ledger
from benchmarks.sameness.cases import Case, all_cases, gaps
from benchmarks.sameness.ledger import fault_of, hash_of, picture
from refgi.errors import RefgiWarning

THREADS = 2
SLOW = 3.0  # s


class Found(NamedTuple):
    """What all cases gave."""

    hashes: dict[str, str]
    faults: list[str]  # pictures that show little
    errors: list[str]


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.sameness", description=__doc__)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--write", type=Path, metavar="FILE", help="record the hash of every case")
    what.add_argument("--check", type=Path, metavar="FILE", help="compare every case with its record")
    parser.add_argument("--only", default="", metavar="PREFIX", help="only cases whose names start so: val/stage/")
    options = parser.parse_args()
    warnings.simplefilter("ignore", RefgiWarning)
    numba.set_num_threads(min(THREADS, numba.config.NUMBA_NUM_THREADS))
    cases = [case for case in all_cases() if case.name.startswith(options.only)]
    return _write(options.write, cases) if options.write else _check(options.check, cases, options.only)


def _write(file: Path, cases: list[Case]) -> int:
    if missing := gaps():
        print("\n".join(missing))
        return 1
    found = _run(cases)
    for line in (*found.faults, *_alike(cases, found.hashes)):
        print(f"warning: {line}")
    if found.errors:
        print(*found.errors, f"nothing written: {len(found.errors)} errors", sep="\n")
        return 1
    ledger.write(file, found.hashes)
    print(f"written: {file}, {len(found.hashes)} cases")
    return 0


def _check(file: Path, cases: list[Case], prefix: str) -> int:
    machine, recorded = ledger.read(file)
    for key, value in ledger.machine().items():
        if machine.get(key) != value:
            print(f"warning: recorded with {key} {machine.get(key)}, checked with {value}")
    found = _run(cases)
    recorded = {name: known for name, known in recorded.items() if name.startswith(prefix)}
    lines = [*found.errors, *ledger.differences(recorded, found.hashes)]
    print(*lines, f"{len(recorded)} cases recorded, {len(found.hashes)} computed, {len(lines)} not the same", sep="\n")
    return 1 if lines else 0


def _run(cases: list[Case]) -> Found:
    found, started = Found({}, [], []), time.perf_counter()
    for number, case in enumerate(cases, 1):
        begun = time.perf_counter()
        try:
            irradiance = picture(case)
        except Exception:
            found.errors.append(f"error: {case.name}: {traceback.format_exc(limit=-2)}")
            continue
        found.hashes[case.name] = hash_of(irradiance)
        if fault := fault_of(irradiance):
            found.faults.append(f"{case.name} {fault}")
        now = time.perf_counter()
        if now - begun > SLOW or number % 100 == 0 or number == len(cases):
            print(f"{number}/{len(cases)}  {now - started:.0f} s  {case.name}: {now - begun:.1f} s", flush=True)
    return found


def _alike(cases: list[Case], hashes: dict[str, str]) -> list[str]:
    """Return cases whose setting leaves the picture as it is: they would show no change of it."""
    return [f"{case.name} is as {other}" for case in cases for other in case.unlike
            if case.name in hashes and hashes[case.name] == hashes.get(other)]


if __name__ == "__main__":
    sys.exit(main())
