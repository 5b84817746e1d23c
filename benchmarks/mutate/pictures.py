"""The pictures that a fault may change: `python -m benchmarks.mutate.pictures FILE [--against KNOWN] [--first METHOD]`.

Every method as it is on every scene of the wiring's tests, all cases of these tests, and the ledger's cases on the
scene with a glossy vase in float64. Writes a hash of each, or with --against ends at the first that differs.
"""

import argparse
import importlib
import importlib.util
import json
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.mutate.project import DIFFERENT
from benchmarks.sameness.cases import DEFAULTS, all_cases
from benchmarks.sameness.ledger import hash_of
from benchmarks.sameness.ledger import picture as picture_of_ledger
from refgi.errors import RefgiWarning
from refgi.methods import METHODS
from refgi.settings import of
from refgi.splat import SiiSettings
from tests.wiring.cases import SCENES, Case

LEDGER = "/stage/float64/"  # in the names of its cases


class Picture(NamedTuple):
    name: str
    method: str
    make: Callable[[], Any]


def pictures(first: str = "") -> list[Picture]:
    """Return all pictures, those of one method before the others."""
    every = [*_as_they_are(), *_wiring(), *_lights(), *_ledger()]
    return sorted(every, key=lambda picture: picture.method != first)


def _as_they_are() -> Iterator[Picture]:
    for method in METHODS:
        for scene in SCENES:
            settings = of(METHODS[method].settings, **DEFAULTS.get(method, {}))
            yield _of_case(f"{method}/{scene}", method, Case({}, scene=scene), settings)


def _wiring() -> Iterator[Picture]:
    for method in METHODS:
        module = _module(f"tests.wiring.test_{method}")
        base = getattr(module, "BASE", {})
        for name, case in _cases(module, "CASES").items():
            yield _of_case(f"wiring/{method}/{name}", method, case, case.settings(METHODS[method].settings, base))


def _lights() -> Iterator[Picture]:
    """Yield cases of the pixel lights, as `sii` has them."""
    module = _module("tests.wiring.part_cases")
    for name, case in _cases(module, "LIGHT_CASES").items():
        lights = case.settings(type(SiiSettings().lights), module.LIGHT_BASE)
        yield _of_case(f"wiring/lights/{name}", "sii", case, SiiSettings(lights=lights))


def _ledger() -> Iterator[Picture]:
    for case in all_cases():
        if LEDGER in case.name:
            yield Picture(case.name, case.method, lambda case=case: picture_of_ledger(case))


def _module(name: str) -> Any:
    """Import a module; None where there is none."""
    return importlib.import_module(name) if importlib.util.find_spec(name) else None


def _cases(module: Any, name: str) -> Mapping[str, Case]:
    found: Mapping[str, Case] = getattr(module, name, {})
    return found


def _of_case(name: str, method: str, case: Case, settings: Any) -> Picture:
    return Picture(name, method, lambda: METHODS[method].compute(case.seen(), settings)[0])


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutate.pictures", description=__doc__)
    parser.add_argument("file", type=Path, help="where hashes are written; with --against the name that differs")
    parser.add_argument("--against", type=Path, metavar="KNOWN", help="hashes of earlier")
    parser.add_argument("--first", default="", metavar="METHOD", help="which pictures to begin with")
    options = parser.parse_args()
    warnings.simplefilter("ignore", RefgiWarning)
    known = json.loads(options.against.read_text()) if options.against else None
    hashes: dict[str, str] = {}
    for picture in pictures(options.first):
        hashes[picture.name] = hash_of(picture.make())
        if known is not None and hashes[picture.name] != known[picture.name]:
            options.file.write_text(picture.name)
            return DIFFERENT
    options.file.write_text(json.dumps(hashes, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
