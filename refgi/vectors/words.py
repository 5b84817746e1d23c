"""What people read of a verdict."""

from collections.abc import Iterable

from refgi.errors import nearest
from refgi.vectors.manifest import ArrayVerdict, Cause, CommonCause, Result, StageVerdict


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
