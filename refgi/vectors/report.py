"""What a check says: in words, over all cases, as JUnit XML, what was expected."""

from collections.abc import Callable, Iterable
from fnmatch import fnmatchcase
from pathlib import Path
from xml.etree import ElementTree

from refgi.errors import InputError, nearest, printable
from refgi.texts import annotation, table
from refgi.vectors.kit import Asked, Kit, fits
from refgi.vectors.manifest import ArrayVerdict, BugEntry, Cause, CommonCause, Finding, Result, StageVerdict
from refgi.vectors.spec import kind_of


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a hint at the nearest name, or nothing where none is near."""
    near = nearest(name, known)
    return f"; did you mean {near!r}?" if near else ""


def story(stage: StageVerdict) -> list[str]:
    """Return what is wrong with a stage of one case, line by line: arrays, worst elements, causes."""
    return [f"{stage.case}: {stage.stage} is {stage.verdict}", *_faults(stage),
            *(_likely(one, f"{one.share:.0%} of what differs" if one.share else "") for one in stage.causes)]


def stories(result: Result) -> list[list[str]]:
    """Return what is wrong with each kind of stage over all cases, line by line; its faults in the first case."""
    verdicts = {(one.case, one.stage): one for one in result.stages}
    return [[f"{one.stage} is wrong in {one.wrong} of {one.ran}, first {one.first[1]} of {one.first[0]}",
             *_faults(verdicts[one.first]),
             *(_likely(cause, f"explains {cause.explained} of {cause.tried}" if cause.explained else "")
               for cause in one.causes)]
            for one in result.findings]


def _faults(stage: StageVerdict) -> list[str]:
    return [f"  {fault(one)}" for one in stage.arrays if one.verdict in ("out", "invalid", "not-judged")]


def _likely(cause: Cause | CommonCause, fit: str) -> str:
    paper = f"; {cause.paper}" if cause.paper else ""
    return f"  likely: {cause.cause} ({fit}{paper})" if fit else f"  {cause.cause}"


def fault(array: ArrayVerdict) -> str:
    """Return what is wrong with an array: its worst element with both values, or why it cannot be compared."""
    if array.verdict in ("invalid", "not-judged"):
        return f"{array.name}: {array.said}"
    place = ", ".join(map(str, array.element or ()))
    values = " and ".join(f"{'NaN or infinity' if value is None else f'{value:.9g}'} {word}" for value, word in (
        (array.expected, "expected"), (array.got, "here")))
    said = f" ({array.said})" if array.said else ""
    bound = "" if array.bound is None else f", bound {array.bound:.2g}"
    count = "1 element" if array.outside == 1 else f"{array.outside} elements"
    return f"{array.name}[{place}]: {values}{bound}; {count} out{said}"


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


CAUSES = 3  # that are told
DIRTY = "made from wrong inputs"


def findings(
    verdicts: Iterable[StageVerdict], tried: Callable[[StageVerdict], dict[str, BugEntry]]
) -> tuple[Finding, ...]:
    """Return one finding a kind of stage that is wrong by itself, in the order in which they are met.

    Those made from wrong inputs are not blamed. `tried` gives the likely bugs of a verdict's stage that its case can
    tell, by their causes: causes go by the share of wrong verdicts that they explain, of those that could know them. A
    wrong wiring that half of these refute is not told; one that fits a handful of elements stands behind others.
    """
    ran: dict[str, int] = {}
    wrong: dict[str, list[StageVerdict]] = {}
    for one in verdicts:
        kind = kind_of(one.stage)
        ran[kind] = ran.get(kind, 0) + (one.verdict != "not-run")
        if one.verdict in ("out", "invalid") and one.upstream != "dirty":
            wrong.setdefault(kind, []).append(one)
    return tuple(Finding(stage=kind, first=(own[0].case, own[0].stage), wrong=len(own), ran=ran[kind],
                         causes=_common(own, [tried(one) for one in own])) for kind, own in wrong.items())


def _common(wrong: list[StageVerdict], tried: list[dict[str, BugEntry]]) -> tuple[CommonCause, ...]:
    """Return the causes that explain most, the best fit first where they explain as much."""
    fits: dict[str, list[Cause]] = {}
    for one in wrong:
        for cause in one.causes:
            if cause.share > 0:
                fits.setdefault(cause.cause, []).append(cause)
    likely = {cause: bug for known in tried for cause, bug in known.items()}
    told = []
    for name, own in fits.items():
        knowing = len(wrong) if name not in likely else len(own) + sum(
            name in known and all(cause.cause != name for cause in one.causes)
            for one, known in zip(wrong, tried, strict=True))
        share = round(sum(one.share for one in own) / len(own), 3)
        common = CommonCause(cause=name, paper=own[0].paper, explained=len(own), tried=knowing)
        bug = likely.get(name)
        if bug is None or not bug.wired or 2 * len(own) > knowing:
            told.append((bug is not None and bug.by_chance, -weight(common) * share**2, -share, common))
    remarks = [one.cause for one in wrong[0].causes if not one.share] or ["no known cause fits"]
    best = [one for *_, one in sorted(told, key=lambda one: one[:3])]
    return tuple(best or [CommonCause(cause=one, explained=0, tried=len(wrong)) for one in remarks])[:CAUSES]


def weight(cause: CommonCause) -> float:
    """Return how much speaks for a cause: the share of verdicts that it explains, the less the fewer could know it."""
    return cause.explained**2 / (cause.tried * (cause.tried + 1))


KINDS = ("exact", "within", "not-judged", "out", "invalid")


def report(result: Result) -> str:
    """Return what people read: one line a stage that ran, then what is wrong, by kinds of stages."""
    ran = [one for one in result.stages if one.verdict != "not-run"]
    rows = [("case", "stage", "verdict", "worst / bound", "")]
    rows += [(one.case, one.stage, one.verdict, _largest(one), _remark(one)) for one in ran]
    lines = [table(rows)] if ran else []
    for one in stories(result):
        lines += ["", *one]
    read = {array.read: f"{one.case}/{array.name}" for one in reversed(ran) for array in one.arrays if array.read}
    for said, first in reversed(read.items()):
        count = sum(array.read == said for one in ran for array in one.arrays)
        lines.append(f"{'' if count == 1 else f'{count} arrays, such as '}{first}: {said}")
    lines += ["", *(f"unknown: {one}" for one in result.unknown)] if result.unknown else []
    if not ran:
        lines.append("nothing to check: OUTPUT/<case>/<array>.npy is where arrays are looked for")
    lines += ["", *counts(result)]
    return "\n".join(lines)


def counts(result: Result) -> list[str]:
    """Return how many stages are what, what has not run, and what the port's author expected otherwise."""
    tally = {kind: sum(one.verdict == kind for one in result.stages) for kind in KINDS}
    ran, idle = sum(tally.values()), sum(one.verdict == "not-run" for one in result.stages)
    excused = sum(bool(one.excused) for one in result.stages)
    lines = [f"{result.mode}: {', '.join(f'{count} {kind}' for kind, count in tally.items() if count) or 'none'}"
             + (f"; {excused} of them expected to fail" if excused else "")]
    if idle:
        cases = {one.case for one in result.stages}
        begun = {one.case for one in result.stages if one.verdict != "not-run"}
        lines.append(f"a part alone: {idle} of {ran + idle} stages not run, {len(cases - begun)} of {len(cases)} cases "
                     "without any; --require NAME makes them count")
    if result.not_judged:
        arrays = [(one.case, array) for one in result.stages for array in one.arrays if array.verdict != "not-run"]
        case, first = next(one for one in arrays if one[1].verdict == "not-judged")
        lines.append(f"not judged: {result.not_judged} of {len(arrays)} arrays "
                     f"({result.not_judged / len(arrays):.1%}), first {case}/{first.name}: {first.said}")
    if result.left:
        lines.append(f"stopped at the first wrong stage: {result.left} stages not looked at")
    if result.missing:
        more = f" and {len(result.missing) - 5} more" if len(result.missing) > 5 else ""
        lines.append(f"required and not run: {', '.join(result.missing[:5])}{more}")
    lines += [f"expected to fail and does not: {line}" for line in result.passing]
    if result.first is not None:
        lines.append(f"first wrong stage: {result.first[1]} of {result.first[0]}")
    return lines


def github(result: Result) -> str:
    """Return annotations of GitHub Actions: one a kind of stage that is wrong, one of what has not run; then counts."""
    lines = [annotation(f"refgi: {one[0]}", "\n".join(one[1:])) for one in stories(result)]
    if result.missing:
        lines.append(annotation("refgi: required and not run", "\n".join(result.missing)))
    lines += [annotation("refgi: expected to fail and does not", line, "warning") for line in result.passing]
    lines += [annotation("refgi: not judged", "\n".join(story(one)), "warning") for one in result.stages
              if one.verdict == "not-judged"]
    return "\n".join([*lines, *counts(result)])


def write_junit(file: str, result: Result) -> None:
    """Write a check as JUnit XML: a suite for each case, a test for each stage; InputError if it cannot be written.

    What does not count is skipped: expected failures, what is not judged, stages made from wrong inputs, what has not
    run unless it must.
    """
    names = {f"{one.case}/{one.stage}" for one in result.stages}
    required = names if all(one.verdict == "not-run" for one in result.stages) else {*result.missing}
    root = ElementTree.Element("testsuites", name=f"refgi {result.kit} kit, {result.mode}")
    for case in dict.fromkeys(one.case for one in result.stages):
        tests = [_test(one, required) for one in result.stages if one.case == case]
        kinds = {"failures": "failure", "errors": "error", "skipped": "skipped"}
        found = {key: str(sum(test.find(tag) is not None for test in tests)) for key, tag in kinds.items()}
        suite = ElementTree.SubElement(root, "testsuite", {"name": case, "tests": str(len(tests))} | found)
        suite.extend(tests)
    ElementTree.indent(root)
    try:
        Path(file).write_bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n")
    except OSError as error:
        raise InputError(f"{file}: cannot be written: {error.strerror}", file=file) from error


def _test(stage: StageVerdict, required: set[str]) -> ElementTree.Element:
    test = ElementTree.Element("testcase", classname=stage.case, name=stage.stage)
    if stage.verdict in ("exact", "within"):
        return test
    if stage.verdict == "not-run":
        tag, said = "error" if f"{stage.case}/{stage.stage}" in required else "skipped", "not run"
    elif stage.verdict == "not-judged":
        tag, said = "skipped", "not judged"
    elif stage.excused or stage.upstream == "dirty":
        tag, said = "skipped", stage.excused or DIRTY
    else:
        tag, said = "failure" if stage.verdict == "out" else "error", stage.verdict
    found = ElementTree.SubElement(test, tag, message=said)
    if stage.verdict != "not-run":
        found.text = printable("\n".join(story(stage)))
    return test


def _largest(stage: StageVerdict) -> str:
    ratios = [one.worst for one in stage.arrays if one.worst is not None]
    if stage.verdict == "invalid" or (stage.verdict == "out" and not any(ratios)):
        return ""
    return f"{max(ratios):.3g}" if ratios else ""


def _remark(stage: StageVerdict) -> str:
    spared = sum(one.masked + (one.outside if one.verdict != "out" else 0) for one in stage.arrays)
    remarks = [f"{spared} elements beyond their bounds spared"] if spared else []
    remarks += [DIRTY] if stage.upstream == "dirty" and not stage.causes else []
    remarks += [stage.excused] if stage.excused else []
    remarks += [stage.causes[0].cause] if stage.causes else []
    return "; ".join(remarks)
