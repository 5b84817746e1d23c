"""The full sum of 1024 lights at every pixel, beside what splats cut off."""

from functools import partial
from typing import TYPE_CHECKING

from benchmarks.papers.judging import errors_of
from benchmarks.papers.records import Figure, Table
from benchmarks.papers.sii.subjects import BOX, full_sum, splats
from benchmarks.papers.timing import interleaved
from refgi.splat import sii
from refgi.splat.reach.reference_length import PAPER_OVERDRAW

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

LIGHTS = 1024
PAPER_PIXELS = 512 * 512
SHARES = (0, 1, 5, 7, 10)  # I_low in % of I_0
PAPER_FPS = {1: 14, 5: 48}  # 768 lights: 1 % from Figure 11, 5 % from Figure 12


def headline(bench: "Workbench") -> Figure:
    """Time the sum that cuts nothing, and measure what cuts cost.

    Parameters
    ----------
    bench : Workbench
        Sizes and frames.

    Returns
    -------
    Figure
        Time and error by I_low.
    """
    frame, full = bench.frame(BOX), full_sum(bench, BOX)
    covered = frame.gbuffer.covered
    run = {share: partial(sii, frame, splats(bench, BOX, lights=LIGHTS, i_low=share / 100)) for share in SHARES}
    seconds = interleaved({str(share): work for share, work in run.items()}, bench.scale.repeats)
    rows = []
    for share, work in run.items():
        off = errors_of(work(), full, covered)
        taken = seconds[str(share)]
        rows.append((f"{share} %" if share else "0: every light at every pixel", 1e3 * taken, 1 / taken,
                     PAPER_FPS.get(share), *off))
    pairs = LIGHTS * int(covered.sum()) / seconds["0"]
    cut = f"{PAPER_PIXELS * PAPER_OVERDRAW * PAPER_FPS[5] / 1e9:.2f}"
    return Figure(
        shows="The paper has no such row: on its hardware every splat had to be cut.",
        facts=(BOX, f"{LIGHTS} lights", f"{pairs / 1e9:.2f} thousand million pairs a second"),
        tables=(Table("Time, and error against every texel in % of the mean irradiance",
               ("I_low", "ms", "fps", "fps, paper, 768 lights", "RMSE", "MAE", "energy lost"), tuple(rows),
               frozenset({3})),),
        notes=(f"The full sum of {LIGHTS} lights runs at {1 / seconds['0']:.1f} frames per second, "
               f"{1 / seconds['0'] / PAPER_FPS[5]:.2f} times the rate of 768 splats cut at 5 % in 2006 and "
               f"{1 / seconds['0'] / PAPER_FPS[1]:.2f} times that at 1 %. It looks at {pairs / 1e9:.2f} thousand "
               f"million pairs a second; the paper's splats came to {cut} (125 at each of 512² pixels, 48 times a "
               "second).",
               f"What the cut costs: the MAE against every texel is {rows[0][5]:.1f} % without and {rows[2][5]:.1f} % "
               f"with the cut of 5 %, which loses {rows[2][6]:.0f} % of the energy; it saves "
               f"{1 - seconds['5'] / seconds['0']:.0%} of the time."))
