"""Beyond the paper: the error of the picture over the speed that it is paid for with."""

import dataclasses
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.papers import pictures
from benchmarks.papers.curves import Axes, Curve, drawn
from benchmarks.papers.judging import errors_of
from benchmarks.papers.multires.subjects import (
    LARGE,
    frame_of,
    full_sum,
    settings_of,
    share_lit,
    subsplats_of,
    unclamped,
)
from benchmarks.papers.records import Cell, Figure, Picture, Plot, Table
from benchmarks.papers.timing import interleaved
from refgi.lights.selection import choose_lights, footprints
from refgi.splat.error_target.error_driven import error_driven
from refgi.splat.multires import MultiresSettings, multires

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.frame import Frame

Array = npt.NDArray[Any]

SCENES = ("cornell_sphere", "atrium")
THRESHOLDS = (0.05, 0.1, 0.25, 0.5, 1.0, 1.4)
DIAGONALS = ("off", "corner", "literal", "full8")
COARSEST = (16, 32, 64, 128, 256)  # cells along a side that no refinement is needed for
FINE = 0.1  # normal threshold beside them
TARGETS = (0.01, 0.02, 0.05)
FAMILIES = ("normal thresholds", "indirect resolutions", "diagonal modes", "coarsest cells", "error-driven")
GOAL = 1.0  # % of the mean, where speed-ups are read off


class Point(NamedTuple):
    """One setting."""

    family: str
    said: str
    settings: MultiresSettings
    speedup: float = 0.0  # over the same lights at every pixel
    saved: float = 0.0  # pairs of light and pixel over those that were evaluated
    rmse: float = 0.0  # % of the mean


def headline(bench: "Workbench") -> Figure:
    """Draw the error over the speed-up.

    Parameters
    ----------
    bench : Workbench
        Sizes and frames.

    Returns
    -------
    Figure
        A curve for each way to trade error for speed, on two scenes with and without a clamp.
    """
    cases = {(scene, clamped): _measured(bench, scene, clamped) for scene in SCENES for clamped in (True, False)}
    rows: list[tuple[Cell, ...]] = []
    plots: list[Plot] = []
    for (scene, clamped), (points, seconds) in cases.items():
        title = f"{scene}, {'clamped' if clamped else 'no clamp'}"
        rows += [(f"{title}: {p.said}", 1e3 * seconds / p.speedup, p.speedup, p.saved, p.rmse) for p in points]
        plots += _plots(title, points)
    return Figure(
        shows="The paper compares frame rates of pictures that look alike. How far a picture is off, and what each "
              "part of the error buys, it does not say.",
        facts=(f"{LARGE * bench.scale.size}² pixels", "256 lights", "the indirect part alone",
               "errors against the same lights at every pixel"),
        pictures=tuple(_picture(bench, scene) for scene in SCENES), columns=2, plots=tuple(plots),
        tables=(Table("Milliseconds, speed-up, all pairs over those evaluated, and RMSE in % of the mean irradiance",
                      ("", "ms", "speed-up", "fewer pairs", "RMSE"), tuple(rows)),),
        notes=_notes({key: points for key, (points, _) in cases.items()}))


def _measured(bench: "Workbench", scene: str, clamped: bool) -> tuple[list[Point], float]:
    """Return all points of a case, and the seconds of every pixel."""
    frame, base = frame_of(bench, scene, LARGE), settings_of(bench, scene)
    base = base if clamped else unclamped(base)
    points, covered = _points(base), frame.gbuffer.covered
    work = {p.said: partial(multires, frame, p.settings) for p in points} | {"full": partial(full_sum, frame, base)}
    seconds = interleaved(work, max(1, bench.scale.repeats // 2))
    full, found = full_sum(frame, base), []
    for point in points:
        light, saved = _lit(frame, point.settings)
        found.append(point._replace(speedup=seconds["full"] / seconds[point.said], saved=saved,
                                    rmse=errors_of(light, full, covered).rmse))
    return found, seconds["full"]


def _lit(frame: "Frame", settings: MultiresSettings) -> tuple[Array, float]:
    """Return irradiance, and all pairs over those that it took."""
    if settings.target_error is None:
        return multires(frame, settings), 1 / share_lit(subsplats_of(frame, settings), frame.gbuffer.covered)
    driven = error_driven(frame.gbuffer, choose_lights(frame, settings), settings, footprints(frame, settings))
    return driven.irradiance, driven.full_pairs / max(1, driven.pairs)


def _plots(title: str, points: list[Point]) -> list[Plot]:
    found = []
    for what, said in (("speedup", "speed-up over every pixel"), ("saved", "all pairs over those evaluated")):
        curves = [Curve(name, [getattr(p, what) for p in points if p.family == name],
                        [p.rmse for p in points if p.family == name]) for name in FAMILIES]
        axes = Axes(said, "RMSE, % of the mean", log_x=True, log_y=True)
        found.append(Plot(drawn(curves, axes), f"{title}: error over {said}."))
    return found


def _points(base: MultiresSettings) -> list[Point]:
    replace = partial(dataclasses.replace, base)
    thresholds, levels, diagonals, cells, driven = FAMILIES
    return [
        *(Point(thresholds, f"normal threshold {t:g}", replace(normal_threshold=t)) for t in THRESHOLDS),
        *(Point(levels, f"down to {1 << n} by {1 << n} pixels", replace(finest=n)) for n in range(4)),
        *(Point(diagonals, f"diagonal rule {name}", replace(diagonal=name)) for name in DIAGONALS),
        *(Point(cells, f"from {n}² cells, normal threshold {FINE:g}", replace(coarsest=n, normal_threshold=FINE))
          for n in COARSEST),
        *(Point(driven, f"target error {100 * t:g} %", replace(target_error=t)) for t in TARGETS)]


def _picture(bench: "Workbench", scene: str) -> Picture:
    frame, settings = frame_of(bench, scene), settings_of(bench, scene)
    return pictures.seen(scene, scene, f"clamped at {settings.clamp_value:.3g} m", frame, multires(frame, settings),
                         settings)


def _notes(cases: dict[tuple[str, bool], list[Point]]) -> tuple[str, ...]:
    said = []
    for (scene, clamped), points in cases.items():
        title = f"{scene} {'with' if clamped else 'without'} clamp"
        good = [p for p in points if p.rmse <= GOAL]
        least = min(points, key=lambda p: p.rmse)
        best = max(good, key=lambda p: p.saved, default=None)
        said.append(f"{title}: least error {least.rmse:.2f} % ({least.said}), " + (
            f"no setting within {GOAL:g} %" if best is None else
            f"within {GOAL:g} % {best.saved:.1f} times fewer pairs and {best.speedup:.1f} times as fast as every pixel "
            f"({best.said})"))
    driven = [p for points in cases.values() for p in points if p.family == FAMILIES[-1]]
    kept = sum(p.rmse <= 100 * (p.settings.target_error or np.inf) for p in driven)
    slope = {key: _gain(points) for key, points in cases.items()}
    return (
        "; ".join(said) + ".",
        f"Error-driven refinement keeps its target in {kept} of {len(driven)} runs. Its time and pairs take in what "
        "it spends on finding out.",
        "A lower normal threshold helps while creases lead the error; then plane surfaces do, over which light changes "
        "near its senders and which no threshold on normals or depth refines: only a finer set of cells to begin with "
        "does. Halving the threshold from 0.1 to 0.05 brings " + ", ".join(
            f"{value:.0%} less ({scene}{'' if clamped else ', no clamp'})" for (scene, clamped), value in slope.items())
        + " of the RMSE.",
    )


def _gain(points: list[Point]) -> float:
    first, second = (p.rmse for p in points[:2])
    return 1 - first / second
