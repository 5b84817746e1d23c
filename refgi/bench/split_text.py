"""Splits of errors in words: tables as Markdown, and the sentences that a page says."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from refgi.compare.report import number

if TYPE_CHECKING:
    from refgi.bench.results import Part, Split

COLUMNS = ("approximation", "mean, %", "RMS, %", "spread, %", "share, %", "RMSE without, %", "mean without, %")
ALL = "all together"
LEAST = 0.01  # of the mean square: what is taken back and not said


def rows_of_split(split: "Split") -> list[tuple[str, ...]]:
    """Return a row for each part and one for the whole, by `COLUMNS`, over the truth's mean.

    Change of the mean, root mean square and spread over seeds of what the part changes, its share of the whole's mean
    square, then the whole's RMSE and change of the mean with it switched off.
    """
    parts = [(part.name, percent(part.mean), percent(part.error.rmse), percent(part.error.spread),
              percent(part.share), percent(part.alone.rmse if part.alone else None),
              percent(_mean_without(split, part))) for part in split.parts]
    return [*parts, (ALL, percent(split.mean), percent(split.error.rmse), percent(split.error.spread), "100", "", "")]


def said_of_split(split: "Split") -> str:
    """Return what a split says: the largest share and what takes most back, how squares add up, what helps most.

    The settings alone where nothing is known.
    """
    known = [part for part in split.parts if part.share is not None]
    if not known or split.squares is None or split.cross is None:
        return f"{split.label}: not known."
    main = max(known, key=lambda part: part.share or 0.0)
    least = min(known, key=lambda part: part.share or 0.0)
    taken = -(least.share or 0.0)
    back = f", of which {least.name} takes back {percent(taken)} %" if taken > LEAST else ""
    text = (f"{split.label}: RMSE {percent(split.error.rmse)} %, of whose square {percent(main.share)} % is "
            f"{main.name}{back}. Mean squares of the parts sum to {percent(split.squares)} % of the truth's mean "
            f"squared, twice their cross terms to {percent(split.cross)} %, both together to "
            f"{percent(split.squares + split.cross)} %.")
    without = [(part.alone.rmse, part.name) for part in known if part.alone and part.alone.rmse is not None]
    if not without:
        return text
    rmse, name = min(without)
    return f"{text} With {name} alone switched off RMSE would be {percent(rmse)} %."


def tables_of(splits: "Sequence[Split]") -> list[str]:
    """Return the tables of a scene's splits as lines of Markdown; none without splits."""
    return [line for split in splits for line in _table(split)]


def percent(value: float | None) -> str:
    """Return a share in %, with its sign; nothing where it is not known."""
    return "" if value is None else number(100 * value)


def _table(split: "Split") -> Iterator[str]:
    yield from ("", f"Error split of {split.label}, {split.width} x {split.height}:", "")
    yield from (f"| {' | '.join(COLUMNS)} |", f"|---|{'--:|' * (len(COLUMNS) - 1)}")
    yield from (f"| {' | '.join(row)} |" for row in rows_of_split(split))
    yield from ("", said_of_split(split))


def _mean_without(split: "Split", part: "Part") -> float | None:
    if part.alone is None or part.alone.mean is None or split.mean is None:
        return None
    return split.mean - part.alone.mean
