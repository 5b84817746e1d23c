"""Where the time of the indirect pass goes: from the G-buffer and direct light to the picture."""

import statistics
import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

from benchmarks.papers.hssil.subjects import HALL, lit, ready, settings_of, wide_frame
from refgi.frame import compose
from refgi.sssil import HssilSettings
from refgi.stages import observe

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.frame import Frame


class Setup(NamedTuple):
    """One column of Figure 6, ms on (a) the GeForce 8800 GTS and (b) the GTX 260."""

    start: str
    levels: int
    samples: int
    gather: tuple[float, float]
    upsampling: tuple[float, float]
    compositing: tuple[float, float]
    total: tuple[float, float]

    @property
    def title(self) -> str:
        """How tables call it."""
        return f"{self.start}, {self.levels} levels, {self.samples} samples"


SETUPS = (Setup("quarter", 4, 64, (7.1, 2.3), (5.7, 1.7), (1.1, 0.6), (13.9, 4.6)),
          Setup("quarter", 4, 256, (26.8, 8.9), (5.7, 1.7), (1.1, 0.6), (33.6, 11.2)),
          Setup("half", 4, 256, (102.4, 29.9), (7.1, 2.1), (1.1, 0.6), (110.6, 32.6)),
          Setup("half", 4, 64, (26.6, 7.8), (7.1, 2.1), (1.1, 0.6), (34.8, 10.5)),
          Setup("half", 5, 64, (26.8, 7.85), (7.2, 2.1), (1.1, 0.6), (35.1, 10.55)))


class Spent(NamedTuple):
    """Median seconds of an indirect pass."""

    pyramid: float
    gather: tuple[float, ...]  # by level, the first one first
    upsampling: float
    compositing: float
    total: float  # with what lies between


def spent(bench: "Workbench") -> dict[str, Spent]:
    """Time the paper's setups in turn.

    Parameters
    ----------
    bench : Workbench
        Sizes and repeats; keeps the times, which two figures show.

    Returns
    -------
    dict of str to Spent
        By the setups' titles.
    """
    frame = ready(wide_frame(bench, HALL))
    work = {setup.title: settings_of(frame, start=setup.start, levels=setup.levels, samples=setup.samples)
            for setup in SETUPS}
    return bench.once("times of hssil", lambda: timed(frame, work, bench.scale.repeats))


def timed(frame: "Frame", work: Mapping[str, HssilSettings], repeats: int) -> dict[str, Spent]:
    """Time indirect passes in turn, A B C A B C ..., after one run of each that compiles what it needs.

    Parameters
    ----------
    frame : Frame
        The scene, seen and lit.
    work : mapping of str to HssilSettings
        What to time.
    repeats : int
        Rounds.

    Returns
    -------
    dict of str to Spent
        Medians.
    """
    for settings in work.values():
        _pass(frame, settings)
    runs: dict[str, list[Spent]] = {name: [] for name in work}
    for _ in range(repeats):
        for name, settings in work.items():
            runs[name].append(_pass(frame, settings))
    return {name: _median(found) for name, found in runs.items()}


def _pass(frame: "Frame", settings: HssilSettings) -> Spent:
    with observe() as log:
        started = time.perf_counter()
        compose(frame.direct, lit(frame, settings), frame.gbuffer, frame.materials)
        total = time.perf_counter() - started
    levels = [run.seconds for run in log.runs if run.name == "sssil.gather"][::-1]  # coarsest first
    return Spent(log.seconds("sssil.pyramid"), tuple(levels), log.seconds("sssil.upsample"),
                 log.seconds("frame.compose"), total)


def _median(found: list[Spent]) -> Spent:
    levels = tuple(statistics.median(level) for level in zip(*(one.gather for one in found), strict=True))
    single = {key: statistics.median(getattr(one, key) for one in found)
              for key in ("pyramid", "upsampling", "compositing", "total")}
    return Spent(gather=levels, **single)
