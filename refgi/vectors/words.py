"""What people read of a verdict."""

import difflib
from collections.abc import Iterable

from refgi.vectors.manifest import ArrayVerdict, StageVerdict


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a hint at the nearest name, or nothing where none is near."""
    near = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean {near[0]!r}?" if near else ""


def story(stage: StageVerdict) -> list[str]:
    """Return what is wrong with a stage, line by line: arrays, worst elements, causes."""
    lines = [f"{stage.case}: {stage.stage} is {stage.verdict}"]
    lines += [f"  {fault(one)}" for one in stage.arrays if one.verdict in ("out", "invalid")]
    lines += [f"  likely: {one.cause} ({one.share:.0%} of what differs{f'; {one.paper}' if one.paper else ''})"
              if one.share else f"  {one.cause}" for one in stage.causes]
    return lines


def fault(array: ArrayVerdict) -> str:
    """Return what is wrong with an array: its worst element with both values, or why it cannot be compared."""
    if array.verdict == "invalid":
        return f"{array.name}: {array.said}"
    place = ", ".join(map(str, array.element or ()))
    values = " and ".join(f"{'NaN or infinity' if value is None else f'{value:.9g}'} {word}" for value, word in (
        (array.expected, "expected"), (array.got, "here")))
    said = f" ({array.said})" if array.said else ""
    bound = "" if array.bound is None else f", bound {array.bound:.2g}"
    count = "1 element" if array.outside == 1 else f"{array.outside} elements"
    return f"{array.name}[{place}]: {values}{bound}; {count} out{said}"
