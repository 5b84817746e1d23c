"""Figure 7: time by level."""

from typing import TYPE_CHECKING

from benchmarks.papers.hssil.subjects import HALL, scene_of, wide_frame
from benchmarks.papers.hssil.times import SETUPS, Spent, spent
from benchmarks.papers.records import Bar, Cell, Figure, Ratios, Table

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

HALF = SETUPS[4]  # half resolution, 64 samples, with a fifth level
INNER = 1 / 3  # samples of the first level's disc, of those of a crown


def figure7(bench: "Workbench") -> Figure:
    """Make Figure 7 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and repeats.

    Returns
    -------
    Figure
        Milliseconds and shares by level, beside the share of samples.
    """
    one, frame = spent(bench)[HALF.title], wide_frame(bench, HALL)
    share = expected(len(one.gather))
    rows: list[tuple[Cell, ...]] = [(f"level {k + 1}", 1e3 * seconds, 100 * seconds / sum(one.gather), 100 * share[k])
                                    for k, seconds in enumerate(one.gather)]
    return Figure(
        shows="Milliseconds by mipmap level for half resolution and 64 samples; more than 70 % of the time goes into "
              "the first level. The bars' heights are not printed.",
        facts=(scene_of(bench, HALL).description, f"{frame.width} x {frame.height} pixels", HALF.title,
               f"medians of {bench.scale.repeats}"),
        ratios=(Ratios("per cent of the time of sampling", tuple(
            Bar(f"level {k + 1}", 100 * seconds / sum(one.gather), None) for k, seconds in enumerate(one.gather))),),
        tables=(Table("Time by level", ("", "ms", "% of the time", "% of the samples"), tuple(rows)),),
        notes=_notes(one, share))


def expected(levels: int) -> list[float]:
    """Return each level's share of all samples: a quarter of the texels in each, a disc besides in the first.

    Parameters
    ----------
    levels : int
        How many.

    Returns
    -------
    list of float
        They add up to 1.

    Examples
    --------
    >>> [round(share, 3) for share in expected(4)]
    [0.803, 0.15, 0.038, 0.009]
    """
    work = [(1 + INNER * (k == 0)) / 4**k for k in range(levels)]
    return [one / sum(work) for one in work]


def _notes(one: Spent, share: list[float]) -> tuple[str, ...]:
    first, last = (100 * one.gather[k] / sum(one.gather) for k in (0, -1))
    return (
        f"The first level takes {first:.0f} % of the time (paper: more than 70 %). It holds {100 * share[0]:.0f} % of "
        "the samples: those of its crown, and a third as many of the disc within, which the paper does not count.",
        f"The last level takes {last:.1f} % for {100 * share[-1]:.1f} % of the samples, and its crown reaches twice as "
        "far as that of the level before.")
