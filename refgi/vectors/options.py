"""Options of the check, for both its command lines: refgi's own and that of a kit's check.py."""

from typing import NamedTuple


class Option(NamedTuple):
    """An option of the check."""

    flag: str
    key: str  # in what `asked_from` takes
    help: str
    metavar: str = ""  # of its value; a choice: "a|b", the first where nothing is said; "": it has none
    many: bool = False  # it may be repeated


OPTIONS = (
    Option("--chained", "chained", "The port has read its own outputs, not the kit's."),
    Option("--stage", "stages", "Only stages whose name begins so; repeatable.", "NAME", many=True),
    Option("--case", "cases", "Only cases whose id begins so; repeatable.", "ID", many=True),
    Option("--tier", "tiers", "Of a stage or an array: T0 equal, T1 float32 rounding, T2 storage in half floats, T2B "
           "in 8 bits, R11G11B10F, RGB9E5; repeatable.", "[NAME=]TIER", many=True),
    Option("--depth", "depths", "How depth is stored: linear, ndc (a depth buffer), gl (-1 to 1) or reversed, in 16, "
           "24 (where nothing is said) or 32 (a float) bits; repeatable.", "[ARRAY=]KIND:NEAR:FAR[:BITS]", many=True),
    Option("--layout", "layout", "rgba: texels of up to four components, (h, w, 4) or (4, h, w), are taken too.",
           "planes|rgba"),
    Option("--unordered", "unordered", "Stages whose lists are in another order, such as lights; repeatable.", "NAME",
           many=True),
    Option("--expect", "expect", "Stages that may fail, [CASE/]STAGE a line.", "FILE"),
    Option("--require", "require", "Cases, stages or CASE/STAGE that must have run, by their beginning, or all; "
           "repeatable.", "NAME", many=True),
    Option("--fail-fast", "fail_fast", "Stop at the first wrong stage."),
    Option("--format", "form", "github: annotations of GitHub Actions.", "text|github"),
    Option("--json", "json_file", "Write the verdicts as JSON.", "FILE"),
    Option("--junit", "junit_file", "Write the verdicts as JUnit XML.", "FILE"),
)
