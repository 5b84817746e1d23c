"""Figure 6: times of five setups beside those of both cards."""

from typing import TYPE_CHECKING

from benchmarks.papers.hssil.subjects import HALL, LARGE, WIDE, scene_of, settings_of, wide_frame
from benchmarks.papers.hssil.times import SETUPS, Setup, Spent, spent
from benchmarks.papers.records import Bar, Cell, Figure, Ratios, Table

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

CARDS = ("8800 GTS", "GTX 260")
FIRST = SETUPS[0]  # what ratios are relative to


def figure6(bench: "Workbench") -> Figure:
    """Make Figure 6 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and repeats.

    Returns
    -------
    Figure
        Milliseconds by step and setup, and ratios within each machine.
    """
    found = spent(bench)
    frame = wide_frame(bench, HALL)
    return Figure(
        shows="Milliseconds of sampling, upsampling and compositing for five setups, on two graphics processors.",
        facts=(scene_of(bench, HALL).description, f"{frame.width} x {frame.height} pixels",
               f"radius {settings_of(frame).radius:g} texels", f"medians of {bench.scale.repeats}",
               "from the G-buffer and direct light to the picture"),
        ratios=tuple(Ratios(f"time of {what}, relative to {FIRST.title} (paper: {CARDS[1]})",
                            tuple(Bar(setup.title, _time(found[setup.title], what) / _time(found[FIRST.title], what),
                                      _printed(setup, what) / _printed(FIRST, what)) for setup in SETUPS))
                     for what in ("sampling", "the whole pass")),
        tables=(Table("Milliseconds", ("", "levels", "sampling", *(f"sampling, {card}" for card in CARDS),
                                       "upsampling", *(f"upsampling, {card}" for card in CARDS), "compositing",
                                       *(f"compositing, {card}" for card in CARDS), "total",
                                       *(f"total, {card}" for card in CARDS)),
                      tuple(_row(setup, found[setup.title]) for setup in SETUPS),
                      frozenset({3, 4, 6, 7, 9, 10, 12, 13})),),
        notes=_notes(found, full=abs(bench.scale.size * LARGE * WIDE - 1280) < 1))


def _row(setup: Setup, one: Spent) -> tuple[Cell, ...]:
    return (setup.title, 1e3 * one.pyramid, 1e3 * sum(one.gather), *setup.gather, 1e3 * one.upsampling,
            *setup.upsampling, 1e3 * one.compositing, *setup.compositing, 1e3 * one.total, *setup.total)


def _time(one: Spent, what: str) -> float:
    return sum(one.gather) if what == "sampling" else one.total


def _printed(setup: Setup, what: str) -> float:
    return (setup.gather if what == "sampling" else setup.total)[1]


def _notes(found: dict[str, Spent], *, full: bool) -> tuple[str, ...]:
    quarter, quarter_256, half_256, half, five = (found[setup.title] for setup in SETUPS)
    samples, pixels = sum(quarter_256.gather) / sum(quarter.gather), sum(half.gather) / sum(quarter.gather)
    more = 100 * (sum(five.gather) / sum(half.gather) - 1)
    notes = [
        f"Four times the samples take {samples:.1f} times as long (paper: 3.8), four times the texels {pixels:.1f} "
        f"times (3.4 to 3.7), a fifth level {more:.1f} % more (the text says about 1 %; its samples are 0.3 % of all).",
        f"The setups that the paper calls equal in cost, quarter resolution with 256 samples and half resolution with "
        f"64, take {1e3 * quarter_256.total:.1f} and {1e3 * half.total:.1f} ms here (33.6 and 34.8 on the "
        f"{CARDS[0]}); Figure 8 shows what each is worth."]
    if full:
        notes.append(
            f"Half resolution, 4 levels, 64 samples takes {1e3 * half.total:.1f} ms on two cores, beside 34.8 ms on "
            f"the {CARDS[0]} and 10.5 on the {CARDS[1]}; quarter resolution {1e3 * quarter.total:.1f} beside 13.9 and "
            f"4.6; half with 256 samples {1e3 * half_256.total:.1f} beside 110.6 and 32.6.")
    return (*notes, "All receivers of a row share a pattern, so that their samples lie side by side in memory; the "
            "paper's texture units fetch each alone.")
