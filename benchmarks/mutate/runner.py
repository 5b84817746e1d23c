"""`python -m benchmarks mutate`: put one-line faults into a scratch copy, one at a time; count those that tests catch.

Faults are drawn by a seed: kernels and wiring in turn, in each the operators in turn, in each operator by chance. A
fault runs the tests of its file's folder, those that import it and those of wiring, the fastest first, up to the first
that fails. What survives is caught by no test; where all pictures stay the same to the bit it changes none, and does
not count. A fault that cannot be imported, compiled or called is invalid, and another is drawn. Results are kept in
--out for as long as sources and tests are the same (of a caught fault: sources and the test that caught it), so that a
run goes on where it was interrupted. Exits with 1 if a fault survived that changes a picture.
"""

import argparse
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.mutate.campaign import Campaign
from benchmarks.mutate.faults import KINDS, all_faults, drawn
from benchmarks.mutate.project import REFGI, Project
from benchmarks.mutate.report import as_text, survivors
from refgi.cli.session import DONE, FAILED, INTERRUPTED, progress, say
from refgi.errors import InputError, RefgiError


def main(arguments: Sequence[str], project: Project = REFGI) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks mutate", description=__doc__)
    parser.add_argument("--count", type=int, default=60, metavar="N", help="how many faults; 60 where absent")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="which faults")
    parser.add_argument("--path", action="append", default=[], help="folder or file of the sources; repeatable")
    parser.add_argument("--kind", choices=(*KINDS, "both"), default="both", help="code in kernels, code around them")
    parser.add_argument("--out", type=Path, default=Path("out/mutate"), help="folder of results and copies")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="faults at a time, each in a copy of its own")
    parser.add_argument("--again", action="store_true", help="forget earlier results")
    options = parser.parse_args(arguments)
    try:
        return _run(options, project)
    except RefgiError as error:
        parser.error(str(error))


def _run(options: argparse.Namespace, project: Project) -> int:
    paths = [_relative(path, project) for path in options.path]
    faults = [fault for fault in all_faults(project, paths) if options.kind in (fault.kind, "both")]
    if options.again:
        _forget(options.out)
    signal.signal(signal.SIGTERM, _interrupted)
    ended = DONE
    with progress() as tell:
        campaign = Campaign(project, options.out, drawn(faults, options.seed), options.count, tell)
        try:
            campaign.run(options.jobs)
        except KeyboardInterrupt:
            say("interrupted; the same command goes on from here")
            ended = INTERRUPTED
    print(as_text(campaign.results))
    return ended or (FAILED if survivors(campaign.results) else DONE)


def _relative(path: str, project: Project) -> str:
    """Return a path below the project's root, which must be of its package."""
    whole = (project.root / path).resolve()
    if not whole.exists() or not whole.is_relative_to(project.root / project.package):
        raise InputError(f"--path: expected a folder or file of {project.package}/, got {path!r}")
    return whole.relative_to(project.root).as_posix()


def _forget(folder: Path) -> None:
    """Remove what earlier runs left; compiled kernels are right for whatever sources they are of."""
    for name in ("results.jsonl", "baseline.json", "pictures.json"):
        (folder / name).unlink(missing_ok=True)


def _interrupted(*_: Any) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
