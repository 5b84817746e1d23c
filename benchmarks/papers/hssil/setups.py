"""Five setups: their times beside those of two cards (Figure 6), by level (Figure 7), and their pictures (Figure 8)."""

import statistics
import time
from typing import Any, NamedTuple

import numpy as np

from benchmarks.papers.hssil.subjects import (
    HALL,
    LARGE,
    WIDE,
    light_of,
    noise_of,
    reach_of,
    ready,
    scene_of,
    settings_of,
    wide_frame,
)
from benchmarks.papers.records import Bar, Figure, Ratios, Table, relative
from benchmarks.papers.workbench import Gallery, Workbench, errors_of, mean_of
from refgi.frame import Frame, compose
from refgi.sssil import HssilSettings
from refgi.stages import observe
from refgi.types import Array

CARDS = ("8800 GTS", "GTX 260")
INNER = 1 / 3  # samples of the first level's disc, of those of a crown


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

    def settings(self, frame: Frame) -> HssilSettings:
        return settings_of(frame, start=self.start, levels=self.levels, samples=self.samples)


SETUPS = (Setup("quarter", 4, 64, (7.1, 2.3), (5.7, 1.7), (1.1, 0.6), (13.9, 4.6)),
          Setup("quarter", 4, 256, (26.8, 8.9), (5.7, 1.7), (1.1, 0.6), (33.6, 11.2)),
          Setup("half", 4, 256, (102.4, 29.9), (7.1, 2.1), (1.1, 0.6), (110.6, 32.6)),
          Setup("half", 4, 64, (26.6, 7.8), (7.1, 2.1), (1.1, 0.6), (34.8, 10.5)),
          Setup("half", 5, 64, (26.8, 7.85), (7.2, 2.1), (1.1, 0.6), (35.1, 10.55)))


class Spent(NamedTuple):
    """Milliseconds of an indirect pass."""

    pyramid: float
    upsampling: float
    compositing: float
    total: float  # with what lies between
    levels: tuple[float, ...]  # the first one first

    @property
    def gather(self) -> float:
        """Of sampling all levels."""
        return sum(self.levels)


def spent(bench: Workbench) -> dict[Setup, Spent]:
    """Time the paper's setups in turn, from the G-buffer and direct light to the picture; medians."""
    def timed() -> dict[Setup, Spent]:
        frame = ready(wide_frame(bench, HALL))
        runs: dict[Setup, list[Spent]] = {setup: [] for setup in SETUPS}
        for _ in range(1 + bench.scale.repeats):  # the first one compiles
            for setup, found in runs.items():
                found.append(_pass(frame, setup.settings(frame)))
        return {setup: _median(found[1:]) for setup, found in runs.items()}

    return bench.once("times of hssil", timed)


def _pass(frame: Frame, settings: HssilSettings) -> Spent:
    with observe() as log:
        started = time.perf_counter()
        compose(frame.direct, light_of(frame, settings), frame.gbuffer, frame.materials)
        total = time.perf_counter() - started
    levels = [1e3 * run.seconds for run in log.runs if run.name == "sssil.gather"][::-1]  # coarsest first
    pyramid, upsampling, compositing = (1e3 * log.seconds(name) for name in (
        "sssil.pyramid", "sssil.upsample", "frame.compose"))
    return Spent(pyramid, upsampling, compositing, 1e3 * total, tuple(levels))


def _median(found: list[Spent]) -> Spent:
    single: Any = {key: statistics.median(getattr(one, key) for one in found) for key in Spent._fields[:-1]}
    return Spent(**single, levels=tuple(map(statistics.median, zip(*(one.levels for one in found), strict=True))))


def five_setups(bench: Workbench) -> Figure:
    """Figure 6: times of five setups beside those of both cards."""
    found, frame = spent(bench), wide_frame(bench, HALL)
    columns = ["", "levels"]
    for step in ("sampling", "upsampling", "compositing", "total"):
        columns += [step, *(f"{step}, {card}" for card in CARDS)]
    rows = [(setup.title, one.pyramid, one.gather, *setup.gather, one.upsampling, *setup.upsampling, one.compositing,
             *setup.compositing, one.total, *setup.total) for setup, one in found.items()]
    sampling, total = ({setup.title: getattr(one, part) for setup, one in found.items()}
                       for part in ("gather", "total"))
    quarter, quarter_256, half_256, half, five = found.values()
    notes = [
        f"Four times the samples take {quarter_256.gather / quarter.gather:.1f} times as long (paper: 3.8), four times "
        f"the texels {half.gather / quarter.gather:.1f} times (3.4 to 3.7), a fifth level "
        f"{100 * (five.gather / half.gather - 1):.1f} % more (the text says about 1 %; its samples are 0.3 % of all).",
        "The setups that the paper calls equal in cost, quarter resolution with 256 samples and half resolution with "
        f"64, take {quarter_256.total:.1f} and {half.total:.1f} ms here (33.6 and 34.8 on the {CARDS[0]}); Figure 8 "
        "shows what each is worth."]
    if abs(bench.scale.size * LARGE * WIDE - 1280) < 1:
        notes.append(
            f"Half resolution, 4 levels, 64 samples takes {half.total:.1f} ms on two cores, beside 34.8 ms on the "
            f"{CARDS[0]} and 10.5 on the {CARDS[1]}; quarter resolution {quarter.total:.1f} beside 13.9 and 4.6; half "
            f"with 256 samples {half_256.total:.1f} beside 110.6 and 32.6.")
    said = f"relative to {SETUPS[0].title} (paper: {CARDS[1]})"
    return Figure(
        facts=(scene_of(bench, HALL).description, f"{frame.width} x {frame.height} pixels",
               f"radius {settings_of(frame).sampling.radius:g} texels", f"medians of {bench.scale.repeats}",
               "from the G-buffer and direct light to the picture"),
        ratios=(relative(f"time of sampling, {said}", sampling, {setup.title: setup.gather[1] for setup in SETUPS}),
                relative(f"time of the whole pass, {said}", total, {setup.title: setup.total[1] for setup in SETUPS})),
        tables=[Table("Milliseconds", columns, rows, CARDS)],
        notes=(*notes, "All receivers of a row share a pattern, so that their samples lie side by side in memory; the "
               "paper's texture units fetch each alone."))


def by_level(bench: Workbench) -> Figure:
    """Figure 7: time by level, of half resolution and 64 samples with a fifth level."""
    setup, frame = SETUPS[4], wide_frame(bench, HALL)
    levels = spent(bench)[setup].levels
    of_time, of_samples = [100 * ms / sum(levels) for ms in levels], [100 * one for one in expected(len(levels))]
    rows = enumerate(zip(levels, of_time, of_samples, strict=True))
    return Figure(
        facts=(scene_of(bench, HALL).description, f"{frame.width} x {frame.height} pixels", setup.title,
               f"medians of {bench.scale.repeats}"),
        ratios=[Ratios("per cent of the time of sampling",
                       [Bar(f"level {k + 1}", share, None) for k, share in enumerate(of_time)])],
        tables=[Table("Time by level", ("", "ms", "% of the time", "% of the samples"),
                      [(f"level {k + 1}", *row) for k, row in rows])],
        notes=(
            f"The first level takes {of_time[0]:.0f} % of the time (paper: more than 70 %). It holds "
            f"{of_samples[0]:.0f} % of the samples: those of its crown, and a third as many of the disc within, which "
            "the paper does not count.",
            f"The last level takes {of_time[-1]:.1f} % for {of_samples[-1]:.1f} % of the samples, and its crown "
            "reaches twice as far as that of the level before."))


def expected(levels: int) -> list[float]:
    """Return each level's share of all samples: a quarter of the texels in each, a disc besides in the first."""
    work = [(1 + INNER * (k == 0)) / 4**k for k in range(levels)]
    return [one / sum(work) for one in work]


class Made(NamedTuple):
    """One setup's picture."""

    light: Array
    settings: HssilSettings
    noise: float  # standard deviation, % of the mean
    rmse: float  # against every texel from full resolution on, as far as the picture reaches
    lost: float  # how much darker it is in all


def three_setups(bench: Workbench, scene: str) -> Figure:
    """Figure 8: indirect light by three setups of Figure 6, two of a cost and the cheapest, and a picture of one."""
    shown = (SETUPS[0], SETUPS[1], SETUPS[3])
    frame, seconds = ready(wide_frame(bench, scene)), spent(bench)
    limit = light_of(frame, settings_of(frame, radius=None, start="full", levels=6, pattern="all"))
    gallery, made = Gallery(frame, limit), {setup: _made(frame, setup, limit) for setup in shown}
    cheap, dense, fine = made.values()
    for k, (setup, one) in enumerate(made.items()):
        gallery.indirect(f"setup{k + 1}", setup.title, f"noise {one.noise:.1f} %, in all {one.rmse:.1f} %", one.light,
                         one.settings)
    gallery.camera("direct", "direct light", "what is left without", np.zeros_like(limit))
    gallery.camera("seen", f"with indirect light: {shown[0].title}", "the paper's choice", cheap.light, cheap.settings)
    gallery.indirect("limit", "every texel", "from full resolution on, six levels", limit)
    gallery.errors({f"setup{k + 1}": (setup.title, one.light) for k, (setup, one) in enumerate(made.items())}, limit)
    ms = [seconds[setup].total for setup in shown]
    better = "less" if dense.rmse < fine.rmse else "more"
    return Figure(
        facts=(frame.scene.description, f"{frame.width} x {frame.height} pixels", "the game is not published: a "
               "built-in hall stands in"), pictures=gallery.pictures,
        tables=[Table("Time and reach; noise, and error against every texel of six levels from full resolution on, "
                      "in % of the mean",
                      ("", "ms", *(f"ms, {card}" for card in CARDS), "reach, % of the diagonal", "noise", "RMSE",
                       "darker by"),
                      [(setup.title, seconds[setup].total, *setup.total, 100 * reach_of(frame, one.settings),
                        one.noise, one.rmse, one.lost) for setup, one in made.items()], CARDS)],
        notes=(
            f"At what the paper calls the same cost, {ms[1]:.1f} and {ms[2]:.1f} ms here, quarter resolution with 256 "
            f"samples is {dense.rmse:.1f} % off the limit and half resolution with 64 samples {fine.rmse:.1f} %: "
            f"{better} error for the lower resolution. Its noise is {dense.noise:.1f} % against {fine.noise:.1f} %, "
            "and it reaches twice as far, which is what the paper sees in it.",
            f"Quarter resolution with 64 samples takes {ms[0]:.1f} ms; its noise is {cheap.noise:.1f} % of the mean "
            f"before any temporal filter, and four times the samples bring it to {dense.noise:.1f} %.",
            f"In all the three are {cheap.lost:.1f}, {dense.lost:.1f} and {fine.lost:.1f} % too dark: what their "
            "crowns do not reach is missing, and by Eq. 4 a sample is darker the more texels it stands for."))


def _made(frame: Frame, setup: Setup, limit: Array) -> Made:
    settings, covered = setup.settings(frame), frame.gbuffer.covered
    light = light_of(frame, settings)
    noise = 100 * noise_of(frame, settings, light) / max(mean_of(limit, covered), 1e-30)
    whole = errors_of(light, limit, covered)
    return Made(light, settings, noise, whole.rmse, whole.lost)
