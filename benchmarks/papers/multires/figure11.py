"""Figure 11: a low and a high normal threshold, and surface detail by Eq. 3 in place of what the high one loses."""

from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from benchmarks.papers import pictures
from benchmarks.papers.judging import Errors, errors_of
from benchmarks.papers.multires.subjects import (
    BUDDHA,
    LARGE,
    drawing,
    frame_of,
    full_sum,
    scene_of,
    settings_of,
    subsplats_of,
    unclamped,
)
from benchmarks.papers.records import Bar, Figure, Ratios, Table
from benchmarks.papers.timing import interleaved
from refgi.splat.multires import multires

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

DETAIL = 0.5  # a of Eq. 3


class Subject(NamedTuple):
    """One panel."""

    name: str
    title: str
    normal_threshold: float
    detail: float
    fps: float  # in the paper


SUBJECTS = (Subject("low", "threshold 0.25", 0.25, 0.0, 8), Subject("high", "threshold 1.4", 1.4, 0.0, 32),
            Subject("detail", "threshold 1.4, surface detail", 1.4, DETAIL, 32))


def figure11(bench: "Workbench") -> Figure:
    """Make Figure 11 again.

    Parameters
    ----------
    bench : Workbench
        Sizes.

    Returns
    -------
    Figure
        Pictures, speed and error of three panels.
    """
    frame, scene = frame_of(bench, BUDDHA), scene_of(bench, BUDDHA)
    covered = frame.gbuffer.covered
    settings = {s.name: settings_of(bench, BUDDHA, normal_threshold=s.normal_threshold, detail=s.detail)
                for s in SUBJECTS}
    large = frame_of(bench, BUDDHA, LARGE)
    work: dict[str, Any] = {name: drawing(bench, scene, one) for name, one in settings.items()}
    work |= {f"{name} alone": partial(multires, large, one) for name, one in settings.items()}
    seconds = interleaved(work, bench.scale.repeats)
    counts = {name: len(subsplats_of(large, one).pixel) for name, one in settings.items()}
    full, bare = full_sum(frame, settings["low"]), full_sum(frame, unclamped(settings["low"]))
    made = {name: multires(frame, one) for name, one in settings.items()}
    off = {name: errors_of(light, full, covered) for name, light in made.items()}
    exposure = pictures.exposure_of(full, covered)
    shown = [pictures.indirect(s.name, s.title, f"RMSE {off[s.name].rmse:.1f} %, {1 / seconds[s.name]:.1f} frames "
                               "per second", made[s.name], exposure, settings[s.name]) for s in SUBJECTS]
    shown.append(pictures.indirect("full", "every pixel", "the same lights, what all three stand for", full, exposure))
    shown += [pictures.seen(f"{s.name}_seen", s.title, "with direct light", frame, made[s.name]) for s in SUBJECTS]
    rows = []
    for s in SUBJECTS:
        without = errors_of(multires(frame, unclamped(settings[s.name])), bare, covered)
        rows.append((s.title, 1e3 * seconds[s.name], 1 / seconds[s.name], s.fps, 1e3 * seconds[f"{s.name} alone"],
                     counts[s.name], *off[s.name], without.rmse))
    return Figure(
        shows="The Buddha with a normal threshold of 0.25 at 8 frames per second, of 1.4 at 32, and of 1.4 with detail "
              "put back by the angle between normal and view.",
        facts=(scene.description, f"{scene.face_count} faces", f"times and subsplats at {2 * bench.scale.size}²",
               f"{settings['low'].lights} lights"),
        pictures=tuple(shown), columns=4,
        ratios=(Ratios("frames per second, relative to a threshold of 0.25", tuple(
            Bar(s.title, seconds["low"] / seconds[s.name], s.fps / SUBJECTS[0].fps) for s in SUBJECTS)),
                Ratios("the same of the indirect part alone", tuple(
            Bar(s.title, seconds["low alone"] / seconds[f"{s.name} alone"], None) for s in SUBJECTS))),
        tables=(Table("Speed of whole frames, and error against the same lights at every pixel in % of the mean",
                      ("", "ms", "fps", "fps, paper", "ms, indirect part", "subsplats", "RMSE", "MAE", "darker by",
                       "RMSE, no clamp"), tuple(rows), frozenset({3})),),
        notes=_notes(seconds, counts, off))


def _notes(seconds: dict[str, float], counts: dict[str, int], off: dict[str, Errors]) -> tuple[str, ...]:
    gain, kept = seconds["low"] / seconds["high"], counts["high"] / counts["low"]
    alone = seconds["low alone"] / seconds["high alone"]
    better = "less" if off["detail"].rmse < off["high"].rmse else "more"
    return (
        f"The high threshold leaves {kept:.2f} of the subsplats and draws frames {gain:.2f} times as fast, the "
        f"indirect part {alone:.2f} times, the paper 4 times: its frame is all splats, this one's shadow map, buffers "
        f"and direct light stay. The RMSE rises from {off['low'].rmse:.1f} to {off['high'].rmse:.1f} % of the "
        "mean.",
        f"Eq. 3 costs {1e3 * (seconds['detail alone'] - seconds['high alone']):+.1f} ms and only ever darkens: it "
        f"takes {off['detail'].lost - off['high'].lost:.0f} % of the light away. It looks like the lost detail and is "
        f"not it: its RMSE is {off['detail'].rmse:.1f} %, {better} than the {off['high'].rmse:.1f} % without.",
    )
