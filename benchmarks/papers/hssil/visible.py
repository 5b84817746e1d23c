"""Beyond the paper: what leaving out visibility costs, and what a bitmask of the screen and rays bring back."""

import dataclasses
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy.typing as npt

from benchmarks.papers import pictures
from benchmarks.papers.curves import Axes, Curve, drawn
from benchmarks.papers.hssil.references import doubt, mean_of, traced
from benchmarks.papers.hssil.subjects import HALL, HORSE, JUDGED, TITLES, frame_of, lit, smaller
from benchmarks.papers.judging import Errors, errors_of
from benchmarks.papers.records import Cell, Figure, Picture, Plot, Table
from benchmarks.papers.timing import interleaved
from refgi.compare.maps import error_scale, luminance
from refgi.compare.report import number
from refgi.sssil import HssilSettings
from refgi.sssil.settings import Visibility

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.frame import Frame

Array = npt.NDArray[Any]

NONE: Visibility = "none"
BITMASK: Visibility = "bitmask"
RAYS: Visibility = "rays"
NAMES: dict[Visibility, str] = {NONE: "v = 1, as published", BITMASK: "bitmask of the screen",
                                RAYS: "a ray to each sample"}
MANY = 1024  # samples: next to no noise is left
THICKNESS = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1)  # share of the diagonal


class Judged(NamedTuple):
    """One scene by all ways."""

    frame: "Frame"
    settings: dict[Visibility, HssilSettings]
    light: dict[Visibility, Array]  # of many samples
    usual: dict[Visibility, Array]  # of the paper's
    exact: Array  # path tracing, seen emitters
    off: dict[Visibility, Errors]
    off_usual: dict[Visibility, Errors]
    seconds: dict[Visibility, float]
    noise: float  # standard error of path tracing, % of the mean
    sweep: dict[float, float]  # RMSE of the bitmask by thickness


def visible(bench: "Workbench") -> Figure:
    """Compare the ways to know what lies between.

    Parameters
    ----------
    bench : Workbench
        Sizes and samples.

    Returns
    -------
    Figure
        How much too bright the published method is, and how right the bitmask.
    """
    found = {name: _judged(bench, name) for name in (HORSE, HALL)}
    rows = [row for name, one in found.items() for row in _rows(TITLES[name], one)]
    curves = [Curve(f"{TITLES[name]}, bitmask", list(one.sweep), list(one.sweep.values()))
              for name, one in found.items()]
    curves += [Curve(f"{TITLES[name]}, {NAMES[key]}", [THICKNESS[0], THICKNESS[-1]], [one.off[key].rmse] * 2, True)
               for name, one in found.items() for key in (NONE, RAYS)]
    one = found[HORSE]
    return Figure(
        shows="The paper supposes that all that is seen sees each other (v = 1), and gives no bound of the error.",
        facts=(*(view.frame.scene.description for view in found.values()), f"{one.frame.width}² pixels",
               f"{one.settings[NONE].levels} levels from half resolution", f"{MANY} samples",
               f"path tracing with {bench.scale.truth_samples} samples a pixel"),
        pictures=tuple(picture for name, view in found.items() for picture in _pictures(name, view)), columns=4,
        tables=(Table("Error in % of the mean, against path tracing in which only what the camera sees shines",
                      ("", "mean, W/m²", "RMSE", "MAE", "darker by", f"RMSE, {one.settings[NONE].samples} samples",
                       f"ms, {one.settings[NONE].samples} samples", "times as long"), tuple(rows)),),
        plots=(Plot(drawn(curves, Axes("assumed thickness, share of the diagonal", "RMSE, % of the mean", log_x=True)),
                    "Error of the bitmask over the thickness that surfaces are assumed to have."),),
        notes=_notes(found))


def _judged(bench: "Workbench", name: str) -> Judged:
    frame = frame_of(bench, name, JUDGED)
    base = smaller(frame, 1, radius=None)  # all light that the picture can give: what is left is visibility
    settings = {key: dataclasses.replace(base, visibility=key) for key in NAMES}
    many = {key: dataclasses.replace(one, samples=MANY) for key, one in settings.items()}
    light = {key: lit(frame, one) for key, one in many.items()}
    usual = {key: lit(frame, one) for key, one in settings.items()}
    exact = traced(bench, frame, (name, JUDGED), emitters="seen")
    covered = frame.gbuffer.covered
    off, off_usual = ({key: errors_of(one, exact, covered) for key, one in made.items()} for made in (light, usual))
    taken = interleaved({key: partial(lit, frame, one) for key, one in settings.items()},
                        max(1, bench.scale.repeats // 2))
    seconds: dict[Visibility, float] = {key: taken[key] for key in settings}
    sweep = {share: errors_of(lit(frame, dataclasses.replace(many[BITMASK], thickness=share)), exact, covered).rmse
             for share in THICKNESS}
    return Judged(frame, settings, light, usual, exact, off, off_usual, seconds,
                  doubt(bench, frame, (name, JUDGED), emitters="seen"), sweep)


def _rows(title: str, one: Judged) -> list[tuple[Cell, ...]]:
    covered = one.frame.gbuffer.covered
    return [(f"{title}, {NAMES[key]}", mean_of(light, covered), *one.off[key], one.off_usual[key].rmse,
             1e3 * one.seconds[key], one.seconds[key] / one.seconds[NONE]) for key, light in one.light.items()] + [
        (f"{title}, path tracing", mean_of(one.exact, covered), one.noise, None, 0.0, None, None, None)]


def _pictures(name: str, one: Judged) -> list[Picture]:
    covered = one.frame.gbuffer.covered
    exposure = pictures.exposure_of(one.exact, covered)
    shown = [pictures.indirect(f"{name}_{key}", f"{TITLES[name]}, {NAMES[key]}", f"RMSE {one.off[key].rmse:.1f} %",
                               light, exposure, one.settings[key]) for key, light in one.light.items()]
    shown.append(pictures.indirect(f"{name}_exact", f"{TITLES[name]}, path tracing", "seen emitters", one.exact,
                                   exposure))
    extra = luminance(one.light[NONE]) - luminance(one.light[RAYS])
    scale = error_scale([extra], covered)
    shown.append(pictures.mapped(f"{name}_extra", f"{TITLES[name]}: light through what blocks it",
                                 f"v = 1 less rays, full colour at {number(scale.high)} W/m²", extra, covered, scale))
    return shown + pictures.errors({f"{name}_{key}": (NAMES[key], one.light[key]) for key in NAMES}, one.exact, covered)


def _notes(found: dict[str, Judged]) -> tuple[str, ...]:
    def each(key: Visibility, part: str) -> str:
        return " and ".join(f"{getattr(one.off[key], part):.1f}" for one in found.values())

    brighter = " and ".join(f"{-one.off[NONE].lost:.0f}" for one in found.values())
    cost = {key: " and ".join(f"{one.seconds[key] / one.seconds[NONE]:.1f}" for one in found.values())
            for key in (BITMASK, RAYS)}
    best = " and ".join(f"{min(one.sweep.items(), key=lambda item: item[1])[0]:g}" for one in found.values())
    return (
        f"Without visibility the pictures of {' and '.join(TITLES[name] for name in found)} are {brighter} % too "
        f"bright (RMSE {each(NONE, 'rmse')} % of the mean); with a ray to each sample the RMSE is {each(RAYS, 'rmse')} "
        f"%, with the bitmask {each(BITMASK, 'rmse')} %.",
        f"Rays take {cost[RAYS]} times as long as no visibility, the bitmask {cost[BITMASK]} times. Its best thickness "
        f"here is {best} of the diagonal: thinner surfaces let light through, thicker ones cast shadows of what is "
        "not there.",
        f"Path tracing's own standard error is {' and '.join(f'{one.noise:.1f}' for one in found.values())} % (in its "
        "row). What rays leave besides is noise of the samples, light of texels instead of points, and near receivers "
        "the disc that stands for each texel.")
