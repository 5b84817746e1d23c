"""Beyond the paper: what leaving out visibility costs, and which of its approximations costs how much."""

from collections.abc import Mapping
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

from benchmarks.harness import interleaved
from benchmarks.papers.hssil.subjects import (
    HORSE,
    JUDGED,
    TITLES,
    expected_light,
    frame_of,
    light_of,
    smaller,
    standard_error,
)
from benchmarks.papers.records import Cell, Figure, Picture, Plot, Table
from benchmarks.papers.workbench import Errors, Gallery, Workbench, errors_of, mean_of
from refgi.bench.grid import Choice
from refgi.bench.split import Renderer, chain_of
from refgi.compare.pages import Axes, Curve, curves_plot, number
from refgi.compare.pictures import error_scale, luminance
from refgi.frame import Frame
from refgi.settings import replaced
from refgi.sssil import HssilSettings
from refgi.truth import TruthSettings
from refgi.types import Array

FREE = "none"
NAMES: dict[str, str] = {FREE: "v = 1, as published", "bitmask": "bitmask of the screen",
                         "rays": "a ray to each sample"}
MANY = 1024  # samples: next to no noise is left
THICKNESS = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1)  # share of the diagonal


class Judged(NamedTuple):
    """One scene by all ways to know what lies between."""

    frame: Frame
    settings: dict[str, HssilSettings]
    light: dict[str, Array]  # of many samples
    exact: Array  # path tracing, seen emitters
    off: dict[str, Errors]
    off_usual: dict[str, Errors]  # of the paper's samples
    seconds: dict[str, float]
    noise: float  # standard error of path tracing, % of the mean
    sweep: dict[float, float]  # RMSE of the bitmask by thickness


def visibility(bench: Workbench, scenes: tuple[str, ...]) -> Figure:
    """What leaving out visibility costs, and what a bitmask of the screen and rays bring back."""
    found = {TITLES[name]: _judged(bench, name) for name in scenes}
    shown: list[Picture] = []
    rows: list[tuple[Cell, ...]] = []
    for name, (title, one) in zip(scenes, found.items(), strict=True):
        _add_pictures(Gallery(one.frame, one.exact, shown), name, title, one)
        covered = one.frame.gbuffer.covered
        rows += [(f"{title}, {said}", mean_of(one.light[key], covered), *one.off[key], one.off_usual[key].rmse,
                  1e3 * one.seconds[key], one.seconds[key] / one.seconds[FREE]) for key, said in NAMES.items()]
        rows.append((f"{title}, path tracing", mean_of(one.exact, covered), one.noise, None, 0.0, None, None, None))
    curves = [Curve(f"{title}, bitmask", list(one.sweep), list(one.sweep.values())) for title, one in found.items()]
    curves += [Curve(f"{title}, {NAMES[key]}", [THICKNESS[0], THICKNESS[-1]], [one.off[key].rmse] * 2, True)
               for title, one in found.items() for key in (FREE, "rays")]
    first = next(iter(found.values()))
    samples = first.settings[FREE].sampling.samples

    def each(value: Any) -> str:
        return " and ".join(value(one) for one in found.values())

    def rmse(key: str) -> str:
        return each(lambda one: f"{one.off[key].rmse:.1f}")

    def cost(key: str) -> str:
        return each(lambda one: f"{one.seconds[key] / one.seconds[FREE]:.1f}")

    return Figure(
        facts=(*(one.frame.scene.description for one in found.values()), f"{first.frame.width}² pixels",
               f"{first.settings[FREE].sampling.levels} levels from half resolution", f"{MANY} samples",
               f"path tracing with {bench.scale.truth_samples} samples a pixel"), pictures=shown,
        tables=[Table("Error in % of the mean, against path tracing in which only what the camera sees shines",
                      ("", "mean, W/m²", "RMSE", "MAE", "darker by", f"RMSE, {samples} samples", f"ms, {samples} "
                       "samples", "times as long"), rows)],
        plots=[Plot(curves_plot(curves, Axes("assumed thickness, share of the diagonal", "RMSE, % of the mean",
                                             log_x=True)),
                    "Error of the bitmask over the thickness that surfaces are assumed to have.")],
        notes=(
            f"Without visibility the pictures of {' and '.join(found)} are "
            f"{each(lambda one: f'{-one.off[FREE].lost:.0f}')} % too bright (RMSE {rmse(FREE)} % of the mean); with a "
            f"ray to each sample the RMSE is {rmse('rays')} %, with the bitmask {rmse('bitmask')} %.",
            f"Rays take {cost('rays')} times as long as no visibility, the bitmask {cost('bitmask')} times. Its best "
            f"thickness here is {each(lambda one: f'{min(one.sweep, key=one.sweep.get):g}')} of the diagonal: thinner "
            "surfaces let light through, thicker ones cast shadows of what is not there.",
            f"Path tracing's own standard error is {each(lambda one: f'{one.noise:.1f}')} % (in its row). What rays "
            "leave besides is noise of the samples, light of texels instead of points, and near receivers the disc "
            "that stands for each texel."))


def _judged(bench: Workbench, name: str) -> Judged:
    frame = frame_of(bench, name, JUDGED)
    base = smaller(frame, 1, radius=None)  # all light that the picture can give: what is left is visibility
    settings = {key: replaced(base, {"visibility": key}) for key in NAMES}
    many = {key: replaced(one, {"samples": MANY}) for key, one in settings.items()}
    light, usual = ({key: light_of(frame, one) for key, one in ways.items()} for ways in (many, settings))
    truth, covered = bench.traced(frame, emitters="visible"), frame.gbuffer.covered
    off, off_usual = ({key: errors_of(one, truth.mean, covered) for key, one in made.items()}
                      for made in (light, usual))
    seconds = interleaved({key: partial(light_of, frame, one) for key, one in settings.items()}, bench.few)
    sweep = {share: errors_of(light_of(frame, replaced(many["bitmask"], {"thickness": share})), truth.mean,
                              covered).rmse for share in THICKNESS}
    return Judged(frame, settings, light, truth.mean, off, off_usual, seconds, standard_error(truth, covered), sweep)


def _add_pictures(gallery: Gallery, name: str, title: str, one: Judged) -> None:
    for key, light in one.light.items():
        gallery.indirect(f"{name}_{key}", f"{title}, {NAMES[key]}", f"RMSE {one.off[key].rmse:.1f} %", light,
                         one.settings[key])
    gallery.indirect(f"{name}_exact", f"{title}, path tracing", "seen emitters", one.exact)
    extra = luminance(one.light[FREE]) - luminance(one.light["rays"])
    scale = error_scale([extra], gallery.covered)
    gallery.mapped(f"{name}_extra", f"{title}: light through what blocks it",
                   f"v = 1 less rays, full colour at {number(scale.high)} W/m²", extra, scale)
    gallery.errors({f"{name}_{key}": (said, one.light[key]) for key, said in NAMES.items()}, one.exact)


# each step from the picture before it, by the names of the approximations; the first is path tracing of all light
STEPS = {"truth": "path tracing", "unseen senders": "only what the camera sees shines",
         "visibility": "nothing blocks (v = 1)", "rest": "a pixel is a point (Eq. 3)",
         "clamp": "a pixel is a disc (Eq. 4)", "levels": "levels, averaged",
         "downsampling": "the closest of four for their average", "cut": "the paper's reach",
         "upsampling": "from half resolution on", "few samples": "64 samples a level"}
FRAMES = "the mean of 19 frames"  # the temporal filter with a = 0.9 takes away as much noise


class Split(NamedTuple):
    """One scene from step to step."""

    made: dict[str, Array]  # by the keys of STEPS
    variants: dict[str, Array]
    covered: Array
    noise: float  # standard error of path tracing of all light, % of the mean

    def step(self, after: str, before: str = "") -> tuple[float, float]:
        """Return the root mean square and the mean of what a step changes, in % of the mean of path tracing."""
        before = before or list(STEPS)[list(STEPS).index(after) - 1]
        off = errors_of(self.made[after], self.made[before], self.covered)
        share = mean_of(self.made[before], self.covered) / max(mean_of(self.made["truth"], self.covered), 1e-30)
        return off.rmse * share, -off.lost * share


def split(bench: Workbench, scenes: tuple[str, ...], shown: tuple[str, ...],
          variants: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Which of the paper's approximations costs how much, from path tracing to the published picture."""
    found = {name: _split(bench, name, variants) for name in scenes}
    frame, horse = frame_of(bench, HORSE, JUDGED), found[HORSE]
    gallery, usual = Gallery(frame, horse.made["truth"]), smaller(frame)
    gallery.indirect("truth", STEPS["truth"], TITLES[HORSE], horse.made["truth"])
    for key in shown:
        gallery.indirect(key, STEPS[key], f"changes {horse.step(key)[0]:.1f} %", horse.made[key])

    def row(title: str, after: str, before: str = "") -> tuple[Cell, ...]:
        off = [one.step(after, before) for one in found.values()]
        return (title, *(rms for rms, _ in off), *(mean for _, mean in off))

    def each(after: str, before: str = "", digits: int = 1) -> str:
        return ", ".join(f"{one.step(after, before)[0]:.{digits}f}" for one in found.values())

    def largest(name: str) -> str:
        key = max(list(STEPS)[1:], key=lambda step: found[name].step(step)[0])
        return f"{TITLES[name]}: {STEPS[key]} ({found[name].step(key)[0]:.0f} %)"

    return Figure(
        facts=(f"{frame.width}² pixels", f"path tracing with {bench.scale.truth_samples} samples a pixel",
               f"{usual.sampling.levels} levels of half resolution, a radius of {usual.sampling.radius:.3g}: texels as "
               "small beside their distance, and as much of the picture, as by the paper's settings at 1280 x 720"),
        pictures=gallery.pictures,
        tables=(Table("What each approximation changes in the picture before it, in % of the mean of path tracing: "
                      "root mean square, and change of the mean",
                      ("", *(f"{TITLES[name]}, RMS" for name in scenes), *(f"{TITLES[name]}, mean" for name in scenes)),
                      [*(row(STEPS[after], after) for _, after in pairwise(STEPS)),
                       row("all together", "few samples", "truth")]),
                Table("The published picture with one thing changed: RMSE in % of the mean, against path tracing in "
                      "which only what the camera sees shines, without and with what blocks",
                      ("", *(f"{TITLES[name]}, {what}" for name in scenes for what in ("v = 1", "with v"))),
                      [(title, *(errors_of(one.variants[title], one.made[key], one.covered).rmse
                                 for one in found.values() for key in ("visibility", "unseen senders")))
                        for title in variants])),
        notes=(
            f"The largest step is: {'; '.join(map(largest, found))}. What the camera does not see is worth "
            f"{each('unseen senders')} %, v = 1 {each('visibility')} %: the two that the paper names. They have "
            "opposite signs.",
            f"Pixels for surfaces cost {each('rest')} %, discs for points {each('clamp')} %, levels {each('levels')} "
            f"%, the closest of four instead of their average {each('downsampling')} %, the radius {each('cut')} %, "
            f"half resolution {each('upsampling')} %, and 64 samples {each('few samples')} %. The mean of "
            "19 frames, which has as little noise as the temporal filter leaves, shows what remains of the last.",
            f"Together they come to {each('few samples', 'truth', 0)} % of the mean. Path tracing's own standard "
            f"error, {', '.join(f'{one.noise:.1f}' for one in found.values())} %, is part of the first three."))


def _split(bench: Workbench, name: str, variants: Mapping[str, Mapping[str, Any]]) -> Split:
    frame = frame_of(bench, name, JUDGED)
    renderer = Renderer(frame.scene, TruthSettings(samples=bench.scale.truth_samples), width=frame.width,
                        height=frame.height, rsm_resolution=frame.rsm_resolution)
    links = chain_of(renderer, Choice("hssil", (), smaller(frame)), 1, alone=False).links
    varied = {title: light_of(frame, smaller(frame, **changes)) for title, changes in variants.items()
              if title != FRAMES} | {FRAMES: expected_light(frame, smaller(frame), 19)}
    covered, found = frame.gbuffer.covered, {link.name: link.pictures[0] for link in links}
    made: dict[str, Array] = {}
    for step in STEPS:  # one that a small picture does not take, such as levels, changes nothing
        made[step] = found[step] if step in found else list(made.values())[-1]
    return Split(made, varied, covered, standard_error(renderer.truth(), covered))
