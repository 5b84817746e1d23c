"""What a run found, as text: the score, and every survivor with its line."""

import statistics
from collections.abc import Sequence

from benchmarks.mutate.faults import KINDS
from benchmarks.mutate.results import Result
from benchmarks.mutate.trial import CAUGHT, INVALID, SAME, SURVIVED, TIMEOUT
from refgi.cli.session import table

HEAD = ("faults", "tried", "caught", "by time", "survived", "same pictures", "invalid", "score")


def as_text(results: Sequence[Result]) -> str:
    """Return the score by kind, then survivors that change a picture, then those that change none."""
    blocks = [_scores(results)]
    for outcome, title in ((SURVIVED, "Survivors"), (SAME, "Survivors that change no picture")):
        found = sorted(result for result in results if result.outcome == outcome)
        if found:
            blocks.append("\n\n".join([f"{title}: {len(found)}", *map(diff, found)]))
    if times := [result.seconds for result in results if result.outcome != INVALID]:
        blocks.append(f"{statistics.mean(times):.0f} s a fault, median {statistics.median(times):.0f} s, longest "
                      f"{max(times):.0f} s")
    return "\n\n".join(blocks)


def diff(result: Result) -> str:
    """Return the changed line of a survivor, and the picture that shows it."""
    fault = result.fault
    shown = f"; shows in {result.by}" if result.by else ""
    where = f" in {fault.function}" if fault.function else ""
    return (f"{fault.file}:{fault.line}{where}, {fault.operator} ({fault.id}){shown}\n"
            f"- {fault.before.strip()}\n+ {fault.after.strip()}")


def survivors(results: Sequence[Result]) -> int:
    """Return how many faults change a picture and no test."""
    return sum(result.outcome == SURVIVED for result in results)


def _scores(results: Sequence[Result]) -> str:
    rows: list[tuple[str, ...]] = [HEAD]
    for kind in KINDS:
        some = [result.outcome for result in results if result.fault.kind == kind]
        caught, late, survived, same, invalid = (some.count(outcome)
                                                 for outcome in (CAUGHT, TIMEOUT, SURVIVED, SAME, INVALID))
        judged = caught + late + survived
        if some:
            score = f"{caught + late} of {judged}"
            rows.append((kind, *map(str, (len(some) - invalid, caught, late, survived, same, invalid)), score))
    return table(rows, right=frozenset(range(1, 8)))
