"""Figure 8: indirect light by three setups of Figure 6, and the picture that comes of one."""

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.papers import pictures
from benchmarks.papers.hssil.references import mean_of, noise_of
from benchmarks.papers.hssil.subjects import HALL, lit, reach_of, ready, settings_of, wide_frame
from benchmarks.papers.hssil.times import SETUPS, Setup, Spent, spent
from benchmarks.papers.judging import errors_of
from benchmarks.papers.records import Figure, Picture, Table
from refgi.sssil import HssilSettings

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.frame import Frame

Array = npt.NDArray[Any]

SHOWN = (SETUPS[0], SETUPS[1], SETUPS[3])  # those of a cost, and the cheapest


class Made(NamedTuple):
    """One setup's picture."""

    settings: HssilSettings
    light: Array
    noise: float  # standard deviation, % of the mean
    error: float  # against every texel from full resolution on, as far as the picture reaches
    lost: float  # how much darker it is in all


def figure8(bench: "Workbench") -> Figure:
    """Make Figure 8 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and repeats.

    Returns
    -------
    Figure
        Direct light, indirect light by three setups, and the final picture.
    """
    frame = ready(wide_frame(bench, HALL))
    limit = lit(frame, settings_of(frame, radius=None, start="full", levels=6, pattern="all"))
    made = {setup: _made(frame, setup, limit) for setup in SHOWN}
    seconds = spent(bench)
    rows = tuple((setup.title, 1e3 * seconds[setup.title].total, setup.total[0], setup.total[1],
                  100 * reach_of(frame, one.settings), one.noise, one.error, one.lost)
                 for setup, one in made.items())
    return Figure(
        shows="Views of the game with the indirect light of three setups; 64 samples from quarter resolution on are "
              "enough for a satisfying picture.",
        facts=(frame.scene.description, f"{frame.width} x {frame.height} pixels", "the game is not published: a "
               "built-in hall stands in"),
        pictures=_pictures(frame, made, limit), columns=3,
        tables=(Table("Time and reach; noise, and error against every texel of six levels from full resolution on, "
                      "in % of the mean", (
            "", "ms", "ms, 8800 GTS", "ms, GTX 260", "reach, % of the diagonal", "noise",
            "RMSE", "darker by"), rows, frozenset({2, 3})),),
        notes=_notes(made, seconds))


def _made(frame: "Frame", setup: Setup, limit: Array) -> Made:
    settings = settings_of(frame, start=setup.start, levels=setup.levels, samples=setup.samples)
    light, covered = lit(frame, settings), frame.gbuffer.covered
    noise = 100 * noise_of(frame, settings, light) / max(mean_of(limit, covered), 1e-30)
    whole = errors_of(light, limit, covered)
    return Made(settings, light, noise, whole.rmse, whole.lost)


def _pictures(frame: "Frame", made: dict[Setup, Made], limit: Array) -> tuple[Picture, ...]:
    covered = frame.gbuffer.covered
    exposure = pictures.exposure_of(limit, covered)
    shown = [pictures.indirect(f"setup{k + 1}", setup.title, f"noise {one.noise:.1f} %, in all {one.error:.1f} %",
                               one.light, exposure, one.settings) for k, (setup, one) in enumerate(made.items())]
    first = next(iter(made.values()))
    shown += [pictures.seen("direct", "direct light", "what is left without", frame, np.zeros_like(limit)),
              pictures.seen("seen", f"with indirect light: {SHOWN[0].title}", "the paper's choice", frame, first.light,
                            first.settings),
              pictures.indirect("limit", "every texel", "from full resolution on, six levels", limit, exposure)]
    off = {f"setup{k + 1}": (setup.title, one.light) for k, (setup, one) in enumerate(made.items())}
    return (*shown, *pictures.errors(off, limit, covered))


def _notes(made: dict[Setup, Made], seconds: dict[str, Spent]) -> tuple[str, ...]:
    cheap, dense, fine = (made[setup] for setup in SHOWN)
    ms = {setup: 1e3 * seconds[setup.title].total for setup in SHOWN}
    better = "less" if dense.error < fine.error else "more"
    at = f"{ms[SHOWN[1]]:.1f} and {ms[SHOWN[2]]:.1f} ms"
    return (
        f"At what the paper calls the same cost, {at} here, quarter resolution with 256 samples is {dense.error:.1f} % "
        f"off the limit and half resolution with 64 samples {fine.error:.1f} %: {better} "
        f"error for the lower resolution. Its noise is {dense.noise:.1f} % against {fine.noise:.1f} %, and it reaches "
        "twice as far, which is what the paper sees in it.",
        f"Quarter resolution with 64 samples takes {ms[SHOWN[0]]:.1f} ms; its noise is {cheap.noise:.1f} % of the mean "
        f"before any temporal filter, and four times the samples bring it to {dense.noise:.1f} %.",
        f"In all the three are {cheap.lost:.1f}, {dense.lost:.1f} and {fine.lost:.1f} % too dark: what their crowns do "
        "not reach is missing, and by Eq. 4 a sample is darker the more texels it stands for.")

