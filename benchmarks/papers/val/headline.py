"""Figure 1: the body in the box, lit once around, with the time of its frame."""

from typing import TYPE_CHECKING

import numpy as np

from benchmarks.papers import pictures
from benchmarks.papers.judging import errors_of
from benchmarks.papers.records import Figure, Table
from benchmarks.papers.timing import interleaved
from benchmarks.papers.val.subjects import (
    HORSE,
    JUDGED,
    clamped,
    drawing,
    frame_of,
    published,
    rounds,
    scene_of,
    settings_of,
    shadowed,
    timed_size,
)
from refgi.cluster.val import val

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench

PAPER_FPS = 19.7


def headline(bench: "Workbench") -> Figure:
    """Make Figure 1 again.

    Parameters
    ----------
    bench : Workbench
        Sizes and repeats.

    Returns
    -------
    Figure
        The picture, its parts, its time and its error.
    """
    scene = scene_of(bench, HORSE)
    frame = frame_of(bench, HORSE, timed_size(bench) / bench.scale.size)
    ways = {"interleaved and blurred": published(bench, scene), "all lights at every pixel": clamped(bench, scene)}
    seconds = interleaved({title: drawing(bench, scene, one) for title, one in ways.items()}, rounds(bench))
    light = {title: val(frame, one) for title, one in ways.items()}
    block, full = ways
    small = frame_of(bench, HORSE, JUDGED)
    right = shadowed(bench, small, settings_of(bench), (HORSE, JUDGED))
    off = {block: errors_of(light[block], light[full], frame.gbuffer.covered),
           full: errors_of(val(small, settings_of(bench)), right, small.gbuffer.covered)}
    exposure = pictures.exposure_of(light[full], frame.gbuffer.covered)
    shown = (pictures.seen("seen", "one bounce", f"{1 / seconds[block]:.1f} frames per second", frame, light[block],
                           ways[block]),
             pictures.seen("direct", "direct light alone", "what is left without", frame, np.zeros_like(light[block])),
             pictures.indirect("indirect", "indirect light alone", block, light[block], exposure, ways[block]),
             pictures.indirect("full", "indirect light alone", full, light[full], exposure, ways[full]))
    rows = tuple((title, 1e3 * seconds[title], 1 / seconds[title], PAPER_FPS if title == block else None, *off[title])
                 for title in ways)
    return Figure(
        shows="One bounce in a scene of 17 thousand faces at 800 x 800 pixels, all free to move, at 19.7 "
              "frames per second; 30 area lights see for all lights.",
        facts=(scene.description, f"{scene.face_count} faces", f"{frame.width}² pixels", f"{ways[block].lights} lights",
               f"{ways[block].area_lights} area lights"),
        pictures=shown, columns=4,
        tables=(Table("Whole frames; error in % of the mean irradiance: of all lights against a ray to each, of "
                      "interleaving against all lights at every pixel",
                      ("", "ms", "fps", "fps, paper", "RMSE", "MAE", "darker by"), rows, frozenset({3})),),
        notes=(f"The frame takes {1e3 * seconds[block]:.0f} ms on two cores, {1 / seconds[block]:.1f} a second, on the "
               "paper's graphics processor of 2006 and at its 800 x 800 pixels 51 ms. Nothing is kept from frame to "
               "frame.",
               f"Without interleaving it takes {1e3 * seconds[full]:.0f} ms. 30 area lights in place of a ray to each "
               f"light cost {off[full].rmse:.1f} % of the mean (RMSE), interleaving and its blur another "
               f"{off[block].rmse:.1f} %: light that is smoothed over edges of shadow, and what 64 neighbours with "
               "different lights leave of their pattern."))
