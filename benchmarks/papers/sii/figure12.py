"""Figure 12: gathering from the reflective shadow map against splatting, quality and speed."""

from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from benchmarks.papers import pictures
from benchmarks.papers.judging import Errors, errors_of
from benchmarks.papers.records import Bar, Figure, Ratios, Table
from benchmarks.papers.sii.subjects import BOX, full_sum, splats, unshadowed_truth
from benchmarks.papers.timing import interleaved
from refgi.splat import GatherSettings, gather, sii

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench


WHOLE_MAP = 1.4143  # map widths: a disc past every corner


class Subject(NamedTuple):
    """One picture of the figure."""

    name: str
    title: str
    settings: Any
    fps: float | None  # in the paper


def figure12(bench: "Workbench") -> Figure:
    """Make Figure 12 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and frames.

    Returns
    -------
    Figure
        Six pictures and one of gathering from the whole map, their speed and their errors.
    """
    frame, full, truth = bench.frame(BOX), full_sum(bench, BOX), unshadowed_truth(bench, BOX)
    covered, subjects = frame.gbuffer.covered, _subjects(bench)
    run = {s.name: partial(gather if isinstance(s.settings, GatherSettings) else sii, frame, s.settings)
           for s in subjects}
    seconds = interleaved(run, bench.scale.repeats)
    made = {s.name: run[s.name]() for s in subjects}
    exposure = pictures.exposure_of(full, covered)
    judged = {name: (errors_of(light, full, covered), errors_of(light, truth, covered))
              for name, light in made.items()}
    shown = [pictures.indirect(s.name, s.title, f"RMSE {judged[s.name][0].rmse:.1f} % of the mean, "
                               f"{1e3 * seconds[s.name]:.1f} ms", made[s.name], exposure, s.settings)
             for s in subjects]
    shown += pictures.errors({s.name: (s.title, made[s.name]) for s in subjects}, full, covered)
    slowest = subjects[0]
    rows = tuple((s.title, 1e3 * seconds[s.name], 1 / seconds[s.name], s.fps, *judged[s.name][0][:2],
                  *judged[s.name][1][:2]) for s in subjects)
    return Figure(
        shows="Gathering with 1020, 308 and 156 samples, interpolated from every eighth pixel, beside 768 and 108 "
              "splats.",
        facts=(BOX, "indirect light alone"), pictures=tuple(shown), columns=7,
        ratios=(Ratios(f"frames per second, relative to {slowest.title}",
                tuple(Bar(s.title, seconds[slowest.name] / seconds[s.name], s.fps and s.fps / (slowest.fps or 1))
                              for s in subjects)),),
        tables=(Table("Time and error, in % of the mean irradiance", (
            "", "ms", "fps", "fps, paper", "RMSE to every texel", "MAE to every texel",
            "RMSE to truth without visibility", "MAE to truth without visibility"), rows, frozenset({3})),),
        notes=_notes(subjects, seconds, {name: off for name, (off, _) in judged.items()}))


def _notes(subjects: list[Subject], seconds: dict[str, float], off: dict[str, Errors]) -> tuple[str, ...]:
    most, _, least, whole, five, ten, few = (s.name for s in subjects)
    return (
        f"768 splats at 5 % run {seconds[most] / seconds[five]:.1f} times as fast as 1020 samples, in the paper 3.4 "
        f"times, and with a MAE of {off[five].mae:.0f} % against {off[most].mae:.0f} %. 10 % are "
        f"{seconds[five] / seconds[ten]:.2f} times as fast as 5 % (paper 1.73), 108 lights "
        f"{seconds[five] / seconds[few]:.2f} times (paper 5.29): what a frame costs without any splat counts for more "
        "here than on hardware that is bound by fragments.",
        f"Gathering looks around each pixel's own place in the map, to 0.3 of its width as its paper proposes. What "
        f"lights from further away is missing whatever the number of samples: {off[most].lost:.0f} % of the energy. "
        f"Over the whole map 1020 samples lose {round(off[whole].lost)} %, with a MAE of {off[whole].mae:.1f} %: near "
        "each pixel they lie dense, so no light outshines its neighbours. The paper does not state its radius.",
        f"From {subjects[0].settings.samples} to {subjects[2].settings.samples} samples gathering gains "
        f"{seconds[most] / seconds[least]:.1f} times (paper 5.9): pixels that cannot be interpolated and the "
        "interpolation itself take their share.",
    )


def _subjects(bench: "Workbench") -> list[Subject]:
    grid = bench.scale.size // 8
    gathered = [Subject(f"gather{n}", f"RSM, {n} samples", GatherSettings(samples=n, grid=grid), fps)
                for n, fps in ((1020, 14), (308, 44), (156, 82))]
    gathered.append(Subject("gather_whole", "RSM, 1020 samples, whole map",
                            GatherSettings(samples=1020, grid=grid, radius=WHOLE_MAP), None))
    splatted = [Subject(f"sii{n}_{x}", f"SII, {n} lights, {x} %", splats(bench, BOX, lights=n, i_low=x / 100), fps)
              for n, x, fps in ((768, 5, 48), (768, 10, 83), (108, 5, 254))]
    return gathered + splatted
