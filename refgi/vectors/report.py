"""What a check says: the text that people read, annotations of GitHub Actions, JUnit XML."""

from pathlib import Path
from xml.etree import ElementTree

from refgi.errors import InputError, printable
from refgi.texts import annotation, table
from refgi.vectors.manifest import Result, StageVerdict
from refgi.vectors.words import stories, story

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
        tag, said = "skipped", stage.excused or "made from wrong inputs"
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
    remarks += ["made from wrong inputs"] if stage.upstream == "dirty" else []
    remarks += [stage.excused] if stage.excused else []
    remarks += [stage.causes[0].cause] if stage.causes else []
    return "; ".join(remarks)
