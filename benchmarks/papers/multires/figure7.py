"""Figure 7: a picture from subsplats by nearest neighbour and by naive bilinear interpolation, against the tent."""

import dataclasses
from functools import partial
from typing import TYPE_CHECKING, Any, get_args

from benchmarks.papers import pictures
from benchmarks.papers.judging import Errors, errors_of
from benchmarks.papers.multires.subjects import DRAGON, LARGE, frame_of, full_sum, settings_of, subsplats_of, unclamped
from benchmarks.papers.records import Figure, Table
from benchmarks.papers.timing import interleaved
from refgi.lights.selection import choose_lights
from refgi.splat.multires import MultiresSettings, Upsampling, multires
from refgi.splat.subsplats.evaluate import at_subsplats, evaluate
from refgi.splat.subsplats.upsample import upsample

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

TITLES = {"nearest": "nearest neighbour", "naive_bilinear": "naive bilinear", "demo": "the authors' demo",
          "tent": "tent (default)", "filter_all": "tent, rendered texels filtered too"}


def figure7(bench: "Workbench") -> Figure:
    """Make Figure 7 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and the frame.

    Returns
    -------
    Figure
        A picture, its error and the time of each way to upsample.
    """
    frame = frame_of(bench, DRAGON)
    covered, settings = frame.gbuffer.covered, _ways(settings_of(bench, DRAGON))
    full = full_sum(frame, settings["tent"])
    bare = full_sum(frame, unclamped(settings["tent"]))
    seconds = _timed(bench)
    made = {way: multires(frame, one) for way, one in settings.items()}
    off = {way: errors_of(light, full, covered) for way, light in made.items()}
    exposure = pictures.exposure_of(full, covered)
    shown = [pictures.indirect(way, title, f"RMSE {off[way].rmse:.1f} % of the mean", made[way], exposure,
                               settings[way]) for way, title in TITLES.items()]
    shown += pictures.errors({way: (title, made[way]) for way, title in TITLES.items()}, full, covered)
    rows = []
    for way, title in TITLES.items():
        without = errors_of(multires(frame, unclamped(settings[way])), bare, covered)
        rows.append((title, 1e3 * seconds[way], off[way].rmse, off[way].mae, off[way].lost, without.rmse, without.mae))
    return Figure(
        shows="Nearest neighbour shows blocks, bilinear interpolation of each level by itself halos and rings.",
        facts=(DRAGON, f"{settings['tent'].lights} lights", "errors against the same lights at every pixel"),
        pictures=tuple(shown), columns=5,
        tables=(Table("Time at twice the size, and errors in % of the mean irradiance",
                      ("upsampling", "ms", "RMSE", "MAE", "energy lost", "RMSE, no clamp", "MAE, no clamp"),
                      tuple(rows)),),
        notes=_notes(off))


def _ways(settings: MultiresSettings) -> dict[str, MultiresSettings]:
    made = {way: dataclasses.replace(settings, upsampling=way) for way in get_args(Upsampling)}
    made["filter_all"] = dataclasses.replace(settings, as_published=frozenset({"ams_filter_all"}))
    return made


def _timed(bench: "Workbench") -> dict[str, float]:
    frame, settings = frame_of(bench, DRAGON, LARGE), settings_of(bench, DRAGON)
    subsplats, covered = subsplats_of(frame, settings), frame.gbuffer.covered
    values = evaluate(*at_subsplats(frame.gbuffer, subsplats), choose_lights(frame, settings), settings)
    work: dict[str, Any] = {way: partial(upsample, values, subsplats, covered, way) for way in get_args(Upsampling)}
    work["filter_all"] = partial(upsample, values, subsplats, covered, "tent", filter_all=True)
    return interleaved(work, bench.scale.repeats)


def _notes(off: dict[str, Errors]) -> tuple[str, ...]:
    best = min(off, key=lambda way: off[way].rmse)
    return (
        f"Against the same lights at every pixel nearest neighbour has an RMSE of {off['nearest'].rmse:.1f} % of the "
        f"mean, naive bilinear interpolation {off['naive_bilinear'].rmse:.1f} %, the tent {off['tent'].rmse:.1f} %; "
        f"least has {TITLES[best]} with {off[best].rmse:.1f} %. Naive interpolation of a level spreads its light over "
        "cells of other levels and takes darkness from them: the halos and rings of the paper.",
        f"Taken literally the published rule filters texels that were lit at that very resolution too, so even single "
        f"pixels blur; keeping them brings the RMSE from {off['filter_all'].rmse:.1f} to {off['tent'].rmse:.1f} %.")
