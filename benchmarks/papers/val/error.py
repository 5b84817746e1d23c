"""The error of the picture by the number of area lights (Figure 10); step by step: `refgi bench --split`."""

import time

import numpy as np

from benchmarks.papers.records import Cell, Figure, Plot, Table
from benchmarks.papers.val.subjects import (
    AREA_LIGHTS,
    JUDGED,
    clamped,
    frame_of,
    published,
    settings_of,
    shadowed,
)
from benchmarks.papers.workbench import Gallery, Workbench, errors_of
from refgi.cluster.val import val
from refgi.compare.pages import Axes, Curve, curves_plot


def by_area_lights(bench: Workbench, scene: str, shown: tuple[int, ...], further: tuple[int, ...],
                   kinds: dict[str, str]) -> Figure:
    """Figure 10: more and more area lights, to one for every light; beside it a ray to each and path tracing.

    PCSS, which reads every texel, is drawn up to the paper's number of area lights.
    """
    frame, settings = frame_of(bench, scene, JUDGED), settings_of(bench)
    right, traced = shadowed(bench, frame, settings), bench.traced(frame).mean
    gallery, most = Gallery(frame, right), settings.lights.count
    rmse: dict[tuple[str, int], float] = {}  # % of the mean, against a ray to each light
    truth, seconds = {}, {}  # of the series: MAE against path tracing, s
    for m in (*shown, *(n for n in further if shown[-1] < n < most), most):
        for kind in kinds if m <= AREA_LIGHTS else ("csm", "hard") if m == most else ("csm",):
            started = time.perf_counter()
            light = val(frame, settings_of(bench, clusters_count=m, visibility=kind))
            taken = time.perf_counter() - started
            rmse[kind, m] = errors_of(light, right, gallery.covered).rmse
            if kind == "csm":
                seconds[m], truth[m] = taken, errors_of(light, traced, gallery.covered).mae
                if m in shown:
                    gallery.indirect(f"areas{m}", f"{m} area lights", f"RMSE {rmse[kind, m]:.1f} %", light)
                if m == AREA_LIGHTS:
                    usual = light
    title = f"{AREA_LIGHTS} area lights"
    block = val(frame, published(bench, frame.scene))
    gallery.indirect("rays", "a ray to each light", f"{settings.lights.count} lights", right)
    gallery.indirect("traced", "path tracing", "without pixel lights", traced)
    gallery.indirect("interleaved", f"{title}, interleaved", "8 x 8 and blurred", block)
    gallery.camera("seen", title, "with direct light", usual)
    gallery.errors({f"areas{AREA_LIGHTS}": (title, usual)}, right)
    vpl_off = errors_of(right, traced, gallery.covered).mae
    off = errors_of(block, val(frame, clamped(bench, frame.scene)), gallery.covered).mae
    counts = sorted(seconds)
    rows: list[tuple[Cell, ...]] = [(str(m), *(rmse.get((kind, m)) for kind in kinds), truth[m], 1e3 * seconds[m])
                                    for m in counts]
    curves = [Curve(said, [m for m in counts if (kind, m) in rmse],
                    [rmse[kind, m] for m in counts if (kind, m) in rmse], kind == "hard")
              for kind, said in kinds.items()]
    curves.append(Curve("series, MAE against path tracing", counts, [truth[m] for m in counts], True))
    slope = float(np.polyfit(np.log(shown), np.log([rmse["csm", m] for m in shown]), 1)[0])
    return Figure(
        facts=(frame.scene.description, f"{frame.width}² pixels", f"{settings.lights.count} lights",
               f"path tracing with {bench.scale.truth_samples} samples a pixel"), pictures=gallery.pictures,
        tables=[Table("RMSE in % of the mean, by number of area lights",
                      ("area lights", *kinds.values(), "series, MAE against path tracing", "ms, series"),
                      [*rows, ("a ray to each light", 0.0, 0.0, 0.0, vpl_off, None)])],
        plots=[Plot(curves_plot(curves, Axes("area lights", "RMSE, % of the mean", log_x=True, log_y=True)),
                    "Error against a ray to each light over the number of area lights.")],
        notes=(
            f"From 2 to {AREA_LIGHTS} area lights the RMSE against a ray to each light falls from "
            f"{rmse['csm', 2]:.1f} to {rmse['csm', AREA_LIGHTS]:.1f} % of the mean, about as their "
            f"number to the {slope:.2f}. One hard shadow for each area light comes to "
            f"{rmse['hard', 2]:.1f} and {rmse['hard', AREA_LIGHTS]:.1f} %, and PCSS to "
            f"{rmse['pcss', 2]:.1f} and {rmse['pcss', AREA_LIGHTS]:.1f} %: what soft shadows gain in RMSE, the "
            "bias of four terms takes back the more, the smaller the area lights; what is left of their worth is that "
            "bands turn into gradients.",
            f"With {most} area lights it is {rmse['csm', most]:.1f} %: each light is then its own area light "
            "without a size, one texel of a depth map is compared, and only the map's texels are left of the error. "
            "Between, clusters of two or three lights still have the series' bias, which does not shrink with them.",
            f"Against path tracing the MAE of the same lights with rays is {vpl_off:.1f} %, of {title} "
            f"{truth[AREA_LIGHTS]:.1f} %: the number of lights decides, not that of area lights. Bright dots where "
            "walls meet are lights next to a receiver, clamped by the disc that each stands for as in the reference.",
            f"Interleaved over 8 x 8 pixels and blurred, as the paper's pictures, {title} are another "
            f"{off:.1f} % (MAE) off what they come to without."))
