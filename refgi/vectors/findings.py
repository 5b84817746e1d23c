"""What is wrong with a port over all cases: a bug shows wherever its stage does; what explains them all comes first."""

from collections.abc import Iterable

from refgi.vectors.manifest import Cause, Finding, StageVerdict
from refgi.vectors.spec import kind_of

CAUSES = 3  # that are told


def findings(verdicts: Iterable[StageVerdict]) -> tuple[Finding, ...]:
    """Return one finding a kind of stage that is wrong by itself, in the order in which they are met.

    Parameters
    ----------
    verdicts : iterable of StageVerdict
        Of all cases, with all their causes; those made from wrong inputs are not blamed.

    Returns
    -------
    tuple of Finding
        Causes by the number of wrong verdicts that they explain, then by how well.
    """
    ran: dict[str, int] = {}
    wrong: dict[str, list[StageVerdict]] = {}
    for one in verdicts:
        kind = kind_of(one.stage)
        ran[kind] = ran.get(kind, 0) + (one.verdict != "not-run")
        if one.verdict in ("out", "invalid") and one.upstream != "dirty":
            wrong.setdefault(kind, []).append(one)
    return tuple(Finding(stage=kind, first=(own[0].case, own[0].stage), wrong=len(own), ran=ran[kind],
                         causes=_common(own)) for kind, own in wrong.items())


def _common(wrong: list[StageVerdict]) -> tuple[Cause, ...]:
    """Return the causes that explain most; `share` is of the verdicts."""
    fits: dict[str, list[Cause]] = {}
    for one in wrong:
        for cause in one.causes:
            if cause.share > 0:
                fits.setdefault(cause.cause, []).append(cause)
    best = sorted(fits.values(), key=lambda own: (-len(own), -round(sum(one.share for one in own) / len(own), 2)))
    told = tuple(own[0].model_copy(update={"share": len(own) / len(wrong)}) for own in best)
    return (told or wrong[0].causes)[:CAUSES]
