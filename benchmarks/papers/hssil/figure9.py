"""Figure 9: a basket whose lit side the camera does not see, by one camera and by several."""

import dataclasses
import time
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.papers import pictures
from benchmarks.papers.hssil.references import mean_of, traced
from benchmarks.papers.hssil.scenes import side_views
from benchmarks.papers.hssil.subjects import BASKET, LARGE, every_texel, lit, smaller, wide_frame
from benchmarks.papers.judging import errors_of
from benchmarks.papers.records import Cell, Figure, Picture, Table
from refgi.sssil import HssilSettings

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.frame import Frame

Array = npt.NDArray[Any]

SIZE = LARGE / 2
ONE, SIDES, PLACED, MORE = "one", "sides", "placed", "more"
TITLES = {ONE: "one camera", SIDES: "two side views besides", PLACED: "one camera placed besides",
          MORE: "three cameras placed besides"}


class Way(NamedTuple):
    """One number of cameras."""

    settings: HssilSettings
    light: Array
    seconds: float


def figure9(bench: "Workbench") -> Figure:
    """Make Figure 9 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and samples.

    Returns
    -------
    Figure
        Light by one camera, by side views of one's own, by cameras that are placed, and by path tracing.
    """
    frame = wide_frame(bench, BASKET, SIZE)
    base = every_texel(smaller(frame, 1, radius=None))  # what is missing is what is not seen
    ways = {key: _way(frame, dataclasses.replace(base, **changes)) for key, changes in _changes().items()}
    free = traced(bench, frame, (BASKET, SIZE), visibility=False)
    exact = traced(bench, frame, (BASKET, SIZE))
    covered = frame.gbuffer.covered
    rows = [(TITLES[key], *_judged(way.light, free, ways[ONE].light, covered), 1e3 * way.seconds)
            for key, way in ways.items()]
    rows.append(("path tracing", *_judged(exact, free, ways[ONE].light, covered), None))
    return Figure(
        shows="A plant basket lit on its far side: with one camera its light is missing, with side views it comes "
              "back.",
        facts=(frame.scene.description, f"{frame.width} x {frame.height} pixels", f"{base.levels} levels from half "
               "resolution, every texel", f"path tracing with {bench.scale.truth_samples} samples a pixel"),
        pictures=_pictures(frame, ways, free, exact), columns=3,
        tables=(Table("Light and error in % of the mean of path tracing in which nothing blocks",
                      ("", "light", "RMSE", "of the missing light, back", "ms, 64 samples"), tuple(rows)),),
        notes=_notes(ways, free, exact, covered))


def _changes() -> dict[str, dict[str, Any]]:
    return {ONE: {}, SIDES: {"views": side_views()}, PLACED: {"cameras": 1}, MORE: {"cameras": 3}}


def _way(frame: "Frame", settings: HssilSettings) -> Way:
    usual = dataclasses.replace(settings, pattern="row")  # of which the time is of interest
    lit(frame, usual)  # compiles what it needs
    started = time.perf_counter()
    lit(frame, usual)
    return Way(settings, lit(frame, settings), time.perf_counter() - started)


def _judged(light: Array, free: Array, one: Array, covered: Array) -> tuple[Cell, ...]:
    mean, all_of_it, alone = (mean_of(picture, covered) for picture in (light, free, one))
    missing = all_of_it - alone
    back = 100 * (mean - alone) / missing if missing > 0 else 0.0
    return 100 * mean / max(all_of_it, 1e-30), errors_of(light, free, covered).rmse, back


def _pictures(frame: "Frame", ways: dict[str, Way], free: Array, exact: Array) -> tuple[Picture, ...]:
    covered = frame.gbuffer.covered
    exposure = pictures.exposure_of(free, covered)
    shown = [pictures.seen(f"{key}_seen", TITLES[key], "with direct light", frame, ways[key].light, ways[key].settings)
             for key in (ONE, SIDES)]
    shown.append(pictures.seen("exact_seen", "path tracing", "with direct light", frame, exact))
    shown += [pictures.indirect(key, TITLES[key], "indirect light", way.light, exposure, way.settings)
              for key, way in ways.items()]
    shown += [pictures.indirect("free", "path tracing, v = 1", "everything shines, nothing blocks", free, exposure),
              pictures.indirect("exact", "path tracing", "everything shines", exact, exposure)]
    return tuple(shown)


def _notes(ways: dict[str, Way], free: Array, exact: Array, covered: Array) -> tuple[str, ...]:
    whole = mean_of(free, covered)
    share = {key: 100 * mean_of(way.light, covered) / max(whole, 1e-30) for key, way in ways.items()}
    cost = {key: way.seconds / ways[ONE].seconds for key, way in ways.items()}
    least = min(float((way.light - ways[ONE].light).min()) for way in ways.values())
    return (
        f"One camera finds {share[ONE]:.0f} % of the light that would come if nothing blocked; two side views bring it "
        f"to {share[SIDES]:.0f} %, one camera that the method places itself to {share[PLACED]:.0f} %, three to "
        f"{share[MORE]:.0f} %. The maximum of several views is never less than one of them (the least difference is "
        f"{np.float64(least):.1g} W/m²).",
        f"Each camera draws the scene anew: the times are {cost[SIDES]:.1f}, {cost[PLACED]:.1f} and {cost[MORE]:.1f} "
        "times that of one camera, which is why the paper does not use it in the game.",
        f"With what blocks, path tracing has {100 * mean_of(exact, covered) / max(whole, 1e-30):.0f} %: the basket "
        "stands between its lit side and much of what it would light.")
