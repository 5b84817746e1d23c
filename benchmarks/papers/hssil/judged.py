"""Beside path tracing: the point form factor and that of a disc (Figure 5), one camera and several (Figure 9)."""

import dataclasses
from typing import Any

import numpy as np

from benchmarks.harness import seconds_of
from benchmarks.papers.hssil.levels import scan_line
from benchmarks.papers.hssil.subjects import (
    LARGE,
    RADIUS_FIGURE_5,
    every_texel,
    frame_of,
    light_of,
    noise_of,
    reach_of,
    scaled_radius,
    smaller,
    standard_error,
    wide_frame,
)
from benchmarks.papers.records import Cell, Figure, Picture, Plot, Table
from benchmarks.papers.workbench import Gallery, Workbench, errors_of, mean_of
from refgi.compare.pages import Axes, curves_plot
from refgi.compare.pictures import luminance
from refgi.frame import Frame
from refgi.settings import replaced
from refgi.sssil import HssilSettings
from refgi.sssil.settings import PRESETS
from refgi.types import Array

POINT, DISC, POINT_LIMIT, DISC_LIMIT = "point", "disc", "point_limit", "disc_limit"
POINT_MANY, DISC_MANY, BLURRED, MANY = "point_many", "disc_many", "blurred", 1024
NAMES = {POINT: "Eq. 3, 64 samples", DISC: "Eq. 4, 64 samples", POINT_MANY: f"Eq. 3, {MANY} samples",
         DISC_MANY: f"Eq. 4, {MANY} samples", BLURRED: "Eq. 4, 64 samples, interleaved and blurred",
         POINT_LIMIT: "Eq. 3, every texel", DISC_LIMIT: "Eq. 4, every texel"}
SAMPLED = (POINT, DISC, POINT_MANY, DISC_MANY)
SEEN, OPEN, ALL = "seen", "open", "all"
TRUTHS: dict[str, tuple[str, str, dict[str, Any]]] = {
    OPEN: ("path tracing, v = 1", "what the camera sees shines, nothing blocks",
           {"emitters": "visible", "visibility": False}),
    SEEN: ("path tracing, seen emitters", "what the camera sees shines", {"emitters": "visible"}),
    ALL: ("path tracing", "everything shines", {})}
ONE, SIDES = "one", "sides"
CAMERAS = {ONE: "one camera", SIDES: "two side views besides"}


def point_or_disc(bench: Workbench, scene: str, line: float) -> Figure:
    """Figure 5: Eq. 3 and Eq. 4 against path tracing, by exact direct light, along a line (share of the height)."""
    frame = frame_of(bench, scene, LARGE, shadows="exact")
    settings = settings_of_figure_5(frame)
    point = replaced(settings, {"form_factor": "point"})
    ways = {POINT: point, DISC: settings, POINT_MANY: replaced(point, {"samples": MANY}),
            DISC_MANY: replaced(settings, {"samples": MANY}),
            BLURRED: replaced(settings, {"pattern": "interleaved", "blur": "geometry_blur"}),
            POINT_LIMIT: every_texel(point), DISC_LIMIT: every_texel(settings)}
    truths = {key: bench.traced(frame, **changes) for key, (*_, changes) in TRUTHS.items()}
    made = {key: light_of(frame, one) for key, one in ways.items()}
    light = made | {key: truth.mean for key, truth in truths.items()}
    gallery, row = Gallery(frame, light[OPEN]), round(line * frame.height)
    off = {key: errors_of(one, light[OPEN], gallery.covered) for key, one in light.items()}
    top = {key: _highest(one, light[OPEN], row) for key, one in light.items()}
    mean = mean_of(light[OPEN], gallery.covered)
    noise = {key: 100 * noise_of(frame, ways[key], light[key]) / mean for key in (*SAMPLED, BLURRED)}
    noise |= {key: standard_error(truth, gallery.covered) for key, truth in truths.items()}
    names = NAMES | {key: title for key, (title, *_) in TRUTHS.items()}
    for key in (*SAMPLED, BLURRED):
        gallery.indirect(key, NAMES[key], f"noise {noise[key]:.1f} %, RMSE {off[key].rmse:.1f} %", light[key],
                         ways[key])
    gallery.pictures[:] = [_marked(picture, row) for picture in gallery.pictures]
    for key, (title, said, _) in TRUTHS.items():
        gallery.indirect(key, title, said, light[key])
    gallery.errors({key: (NAMES[key], light[key]) for key in (DISC, DISC_MANY, DISC_LIMIT)}, light[OPEN])
    curves = [scan_line(names[key], light[key], row, dashed=key in TRUTHS)
              for key in (*SAMPLED, DISC_LIMIT, *TRUTHS)]
    return Figure(
        facts=(frame.scene.description, f"{frame.width}² pixels", f"radius {settings.sampling.radius:g}",
               "4 levels from full resolution", "64 and 1024 samples a level, every pixel its own",
               "direct light with a shadow ray a pixel",
               f"path tracing with {bench.scale.truth_samples} samples a pixel"), pictures=gallery.pictures,
        tables=[Table("Errors in % of the mean, against path tracing in which only what the camera sees shines and "
                      "nothing blocks", ("", "RMSE", "MAE", "darker by", "highest above it along the line, %",
                                         "noise"),
                      [(names[key], *off[key], top[key], noise.get(key)) for key in light])],
        plots=[Plot(curves_plot(curves, Axes("pixel", "irradiance, W/m²")),
                    f"Luminance along row {row + 1}, which the first pictures mark.")],
        notes=(
            f"With 64 samples Eq. 3 has {(noise[POINT] / max(noise[DISC], 1e-30)) ** 2:.1f} times the variance of Eq. "
            f"4, and along the line it rises up to {top[POINT]:.0f} % of the mean above path tracing, Eq. 4 up to "
            f"{top[DISC]:.0f} %: the spikes of the paper's red curve, lower in its green one. Eq. 4 reduces noise, "
            f"as the paper says, and is not free of it: {noise[DISC]:.0f} % of the mean where every pixel has 64 "
            f"samples of its own, {noise[DISC_MANY]:.0f} % with {MANY}, and {noise[BLURRED]:.0f} % with 64 that are "
            "interleaved and blurred along surfaces, as by default.",
            f"In the limit of every texel Eq. 3 is {off[POINT_LIMIT].rmse:.1f} % off path tracing of the same emitters "
            f"without visibility (RMSE) and Eq. 4 {off[DISC_LIMIT].rmse:.1f} %. Eq. 4 is the darker one, by "
            f"{off[DISC_LIMIT].lost - off[POINT_LIMIT].lost:.1f} % of the mean: a disc near a receiver sends less than "
            "its point form says, and a texel at full resolution is a small disc only where surfaces are some texels "
            "apart.",
            f"Where surfaces block each other, path tracing of the same emitters falls by {off[SEEN].lost:.1f} %; what "
            f"the camera does not see would add {off[SEEN].lost - off[ALL].lost:.1f} %: the bias that the paper speaks "
            "of.",
            f"Four levels reach {100 * reach_of(frame, settings):.0f} % of the picture's diagonal, as in the paper."))


def settings_of_figure_5(frame: Frame) -> HssilSettings:
    """Return Figure 5's settings: full resolution, 4 levels of 64 samples, a radius of 40 in 720 rows.

    Every pixel has its own samples, so that noise shows along the line.
    """
    return replaced(PRESETS["paper"], {"radius": scaled_radius(frame, RADIUS_FIGURE_5), "start": "full",
                                       "pattern": "pixel"})


def _highest(light: Array, right: Array, row: int) -> float:
    """Return how far a picture is above the reference along a row, at most, in % of the reference's mean there."""
    line, true = luminance(light)[row], luminance(right)[row]
    return 100 * max(0.0, float((line - true).max())) / max(float(true.mean()), 1e-30)


def _marked(picture: Picture, row: int) -> Picture:
    """Draw the line that is plotted."""
    pixels = picture.pixels.copy()
    thick = max(1, len(pixels) // 240)  # so that it is seen on a page, where pictures are small
    pixels[row - thick // 2 : row - thick // 2 + thick] = (255, 60, 60)
    return dataclasses.replace(picture, pixels=pixels)


def several_cameras(bench: Workbench, scene: str, ways: dict[str, dict[str, Any]]) -> Figure:
    """Figure 9: a basket whose lit side the camera does not see, by one camera and by several."""
    frame = wide_frame(bench, scene, LARGE / 2)
    base = every_texel(smaller(frame, 1, radius=None))  # what is missing is what is not seen
    settings = {key: replaced(base, changes) for key, changes in ways.items()}
    light = {key: light_of(frame, one) for key, one in settings.items()}
    seconds = {key: _seconds(frame, one) for key, one in settings.items()}
    free, exact = bench.traced(frame, visibility=False).mean, bench.traced(frame).mean
    gallery = Gallery(frame, free)
    for key in (ONE, SIDES):
        gallery.camera(f"{key}_seen", CAMERAS[key], "with direct light", light[key], settings[key])
    gallery.camera("exact_seen", "path tracing", "with direct light", exact)
    for key, one in light.items():
        gallery.indirect(key, CAMERAS[key], "indirect light", one, settings[key])
    gallery.indirect("free", "path tracing, v = 1", "everything shines, nothing blocks", free)
    gallery.indirect("exact", "path tracing", "everything shines", exact)
    whole, alone = (mean_of(one, gallery.covered) for one in (free, light[ONE]))

    def judged(one: Array) -> tuple[float, float, float]:
        mean, missing = mean_of(one, gallery.covered), whole - alone
        back = 100 * (mean - alone) / missing if missing > 0 else 0.0
        return 100 * mean / max(whole, 1e-30), errors_of(one, free, gallery.covered).rmse, back

    rows: list[tuple[Cell, ...]] = [(CAMERAS[key], *judged(one), 1e3 * seconds[key]) for key, one in light.items()]
    rows.append(("path tracing", *judged(exact), None))
    share = {key: judged(one)[0] for key, one in light.items()}
    cost = seconds[SIDES] / seconds[ONE]
    least = min(float((one - light[ONE]).min()) for one in light.values())
    return Figure(
        facts=(frame.scene.description, f"{frame.width} x {frame.height} pixels",
               f"{base.sampling.levels} levels from half resolution, every texel",
               f"path tracing with {bench.scale.truth_samples} samples a pixel"),
        pictures=gallery.pictures,
        tables=[Table("Light and error in % of the mean of path tracing in which nothing blocks",
                      ("", "light", "RMSE", "of the missing light, back", "ms, 64 samples"), rows)],
        notes=(
            f"One camera finds {share[ONE]:.0f} % of the light that would come if nothing blocked; two side views "
            f"bring it to {share[SIDES]:.0f} %. The maximum of several views is never less than one of them (the least "
            f"difference is {np.float64(least):.1g} W/m²).",
            f"Each camera draws the scene anew: the time is {cost:.1f} times that of one camera, and the paper's game "
            "does without.",
            f"With what blocks, path tracing has {judged(exact)[0]:.0f} %: the basket stands between its lit side and "
            "much of what it would light."))


def _seconds(frame: Frame, settings: HssilSettings) -> float:
    """Return the time of the paper's samples."""
    usual = replaced(settings, {"pattern": "row"})
    light_of(frame, usual)  # compiles what it needs
    return seconds_of(lambda: light_of(frame, usual))
