"""What must have run and what may fail, as a port's continuous integration says it."""

from collections.abc import Iterable
from fnmatch import fnmatchcase
from pathlib import Path

from refgi.errors import InputError
from refgi.vectors.kit import Asked, Kit, fits
from refgi.vectors.manifest import StageVerdict
from refgi.vectors.words import did_you_mean


def lines_of(file: str) -> tuple[str, ...]:
    """Return the stages that a file of expected failures names: [CASE/]STAGE a line, # begins a remark.

    InputError if it cannot be read.
    """
    try:
        text = Path(file).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{file}: cannot be read: {error}", file=file) from error
    return tuple(line for one in text.splitlines() if (line := one.partition("#")[0].strip()))


def is_line_of(line: str, case: str, stage: str) -> bool:
    """Return whether a line of expected failures names a stage of a case; * and ? stand for any letters."""
    return fnmatchcase(f"{case}/{stage}" if "/" in line else stage, line)


def is_required(starts: Iterable[str], case: str, stage: str) -> bool:
    """Return whether a stage of a case must have run: by the start of CASE/STAGE or of the stage's name."""
    return any(f"{case}/{stage}".startswith(start) or fits(stage, (start,)) for start in starts)


def require_lines_known(kit: Kit, asked: Asked) -> None:
    """Refuse what names no stage of the whole kit: a line of expected failures that is stale, a start of none."""
    if not (asked.expect or asked.require):
        return
    known = [(case.id, step.name) for case in kit.cases(Asked()) for step in case.stages]
    names = {f"{case}/{stage}" for case, stage in known} | {stage for _, stage in known} | {case for case, _ in known}
    for line in asked.expect:
        if not any(is_line_of(line, *one) for one in known):
            raise InputError(f"--expect: expected [CASE/]STAGE, got {line!r}, which no stage has"
                             f"{did_you_mean(line, names)}")
    for start in asked.require:
        if not any(is_required((start,), *one) for one in known):
            raise InputError(f"--require: expected the start of a case's id or of a stage's name, got {start!r}"
                             f"{did_you_mean(start, names)}")


def passing_lines(lines: Iterable[str], verdicts: Iterable[StageVerdict]) -> tuple[str, ...]:
    """Return the lines of expected failures whose stages have run and none of which fails."""
    ran = [one for one in verdicts if one.verdict != "not-run"]
    named = {line: [one for one in ran if is_line_of(line, one.case, one.stage)] for line in lines}
    return tuple(line for line, own in named.items()
                 if own and not any(one.excused or one.verdict == "not-judged" for one in own))
