"""What is wrong with a port over all cases: a bug shows wherever its stage does; what explains them all comes first."""

from collections.abc import Callable, Iterable

from refgi.vectors.manifest import Cause, CommonCause, Finding, StageVerdict
from refgi.vectors.spec import kind_of

CAUSES = 3  # that are told


def findings(verdicts: Iterable[StageVerdict], tried: Callable[[StageVerdict], set[str]]) -> tuple[Finding, ...]:
    """Return one finding a kind of stage that is wrong by itself, in the order in which they are met.

    Those made from wrong inputs are not blamed. `tried` gives the likely bugs of a verdict's stage that its case can
    tell: causes go by the share of wrong verdicts that they explain, of those that could know them.
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


def _common(wrong: list[StageVerdict], tried: list[set[str]]) -> tuple[CommonCause, ...]:
    """Return the causes that explain most, the best fit first where they explain as much."""
    fits: dict[str, list[Cause]] = {}
    for one in wrong:
        for cause in one.causes:
            if cause.share > 0:
                fits.setdefault(cause.cause, []).append(cause)
    likely = set().union(*tried)
    told = []
    for name, own in fits.items():
        knowing = sum(name in known for known in tried) if name in likely else len(wrong)
        told.append((-len(own) / (knowing + 1), -round(sum(one.share for one in own) / len(own), 2), CommonCause(
            cause=name, paper=own[0].paper, explained=len(own), tried=knowing)))
    remarks = [CommonCause(cause=one.cause, explained=0, tried=len(wrong)) for one in wrong[0].causes]
    best = [one for *_, one in sorted(told, key=lambda one: one[:2])]
    return tuple(best or remarks)[:CAUSES]
