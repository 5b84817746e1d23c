"""Figure 8: a spot moves from the wall to the ceiling; clusters that are taken over get lost, restarted ones stay."""

import dataclasses
import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from refgi.cluster.clustering.kmeans import in_use
from refgi.cluster.settings import ValSettings
from refgi.frame import Frame
from refgi.papers.curves import Axes, Curve, drawn
from refgi.papers.judging import errors_of
from refgi.papers.records import Figure, Picture, Plot, Table
from refgi.papers.subjects import seen_by
from refgi.papers.val.lit import lit
from refgi.papers.val.motion import Motion, mean_motion, motion
from refgi.papers.val.painting import painted
from refgi.papers.val.subjects import HORSE, SMALL, Clustered, clustered, scene_of, settings_of, shadowed

if TYPE_CHECKING:
    from refgi.papers.workbench import Workbench

EYE = (0.278, 0.36, 0.08)  # m, where the spot is
LOW, HIGH = math.radians(4), math.radians(64)  # elevation of its axis at the start and at the ceiling
TITLES = {"restart": "restarted every frame", "warm": "started from the last frame"}
DISTANCES = {"raw": "metres and radians", "normalised": "normalised"}


class Run(NamedTuple):
    """One way to cluster the frames of the sequence."""

    frames: list[Clustered]
    counts: list[int]  # clusters with lights, frame by frame


def figure8(bench: "Workbench") -> Figure:
    """Make Figure 8 again.

    Parameters
    ----------
    bench : Workbench
        Sizes.

    Returns
    -------
    Figure
        Clustering with lights in each frame on the way to the ceiling and back, and pictures of both ends.
    """
    there = max(9, 3 * bench.scale.repeats)
    frames = moved(bench, there)
    settings = {distance: settings_of(bench, distance=distance) for distance in DISTANCES}
    runs = {(distance, start): clustered_along(frames, one, warm=start == "warm")
            for distance, one in settings.items() for start in TITLES}
    number = list(range(1, len(frames) + 1))
    curves = [Curve(f"{TITLES[start]}, {DISTANCES[distance]}", number, run.counts, start == "warm")
              for (distance, start), run in runs.items()]
    moves = {key: _motion(run, frames[0]) for key, run in runs.items()}
    off = {start: _error(bench, settings["raw"], runs["raw", start].frames[there - 1], there) for start in TITLES}
    rows = tuple((curve.name, run.counts[0], run.counts[there - 1], run.counts[-1], *moves[key])
                 for (key, run), curve in zip(runs.items(), curves, strict=True))
    return Figure(
        shows="A spot moves from the wall to the ceiling. With the clusters of the last frame to start from, ever more "
              "of them lose all their lights; restarted from the same lights in every frame, all stay.",
        facts=(scene_of(bench, HORSE).description, f"{len(frames)} frames, to the ceiling and back",
               f"{settings['raw'].lights} lights", f"{settings['raw'].area_lights} clusters"),
        pictures=_pictures(runs, frames, there), columns=4,
        tables=(Table("Clustering with lights, and how far things move between two frames in % of the scene's diagonal",
                      ("", "on the wall", "on the ceiling", "back on the wall", "lights, mean", "centres, mean",
                       "centres, 95 %", "centres, farthest"), rows),),
        plots=(Plot(drawn(curves, Axes("frame", "clusters with lights")),
                    f"Clustering with lights in each frame; frame {there} is on the ceiling."),),
        notes=_notes(runs, moves, off, there))


def moved(bench: "Workbench", there: int) -> list[Frame]:
    """Return frames in which the spot turns from the wall to the ceiling and back.

    Parameters
    ----------
    bench : Workbench
        Sizes.
    there : int
        Frames up to the ceiling.

    Returns
    -------
    list of Frame
        2 there - 1 of them.
    """
    scene: Any = scene_of(bench, HORSE)
    up = np.linspace(LOW, HIGH, there)
    found = []
    for elevation in (*up, *up[-2::-1]):
        axis = (0.0, math.sin(elevation), math.cos(elevation))
        light = dataclasses.replace(scene.lights[0], position=EYE, direction=axis, inner_half_angle=math.radians(20),
                                    outer_half_angle=math.radians(26))
        found.append(seen_by(bench, scene.with_lights(light)))
    return found


def clustered_along(frames: list[Frame], settings: ValSettings, *, warm: bool) -> Run:
    """Cluster the lights of one frame after another.

    Parameters
    ----------
    frames : list of Frame
        The frames.
    settings : ValSettings
        How.
    warm : bool
        Whether each frame starts from the clusters of the one before.

    Returns
    -------
    Run
        Clustering, and how many of them have lights.
    """
    found: list[Clustered] = []
    for frame in frames:
        start = found[-1].clusters if warm and found else None
        found.append(clustered(frame, settings, start))
    return Run(found, [in_use(one.clusters) for one in found])


def _motion(run: Run, frame: Frame) -> Motion:
    diagonal = frame.scene.geometry.diagonal
    return mean_motion([motion(*pair, diagonal) for pair in pairwise(run.frames)])


def _pictures(runs: dict[tuple[str, str], Run], frames: list[Frame], there: int) -> tuple[Picture, ...]:
    shown = []
    for place, number in (("wall", 0), ("ceiling", there - 1)):
        for start, title in TITLES.items():
            run = runs["raw", start]
            shown.append(painted(f"{place}_{start}", f"on the {place}, {title}",
                                 f"frame {number + 1}, {run.counts[number]} clusters", frames[number],
                                 run.frames[number]))
    return tuple(shown)


def _error(bench: "Workbench", settings: ValSettings, found: Clustered, there: int) -> float:
    """Return the RMSE of the picture on the ceiling, in % of the mean."""
    frame = seen_by(bench, moved(bench, there)[there - 1].scene, SMALL)
    right = shadowed(bench, frame, settings, "on the ceiling")
    return errors_of(lit(frame, found, settings), right, frame.gbuffer.covered).rmse


def _notes(runs: dict[tuple[str, str], Run], moves: dict[tuple[str, str], Motion], off: dict[str, float],
           there: int) -> tuple[str, ...]:
    warm, kept = runs["raw", "warm"].counts, runs["raw", "restart"].counts
    mild = runs["normalised", "warm"].counts
    step = moves["normalised", "restart"]
    return (
        f"By the printed distance {warm[0]} clusters become {warm[there - 1]} on the way to the ceiling when each "
        f"frame starts from the last; restarted they are never fewer than {min(kept)}. Back on the wall {warm[-1]} "
        "have lights: those that were left behind there are reactivated, as the paper expects.",
        f"The normalised distance, by which the default clusters, leaves {mild[there - 1]} of {mild[0]} on the same "
        "way.",
        f"On the ceiling the picture's RMSE against a ray to each light is {off['warm']:.1f} % of the mean with the "
        f"clusters that are left and {off['restart']:.1f} % with restarted ones.",
        f"Restarted, a centre moves by {step.typical:.2f} % of the diagonal from frame to frame in the mean while "
        f"lights move by {step.lights:.2f} %; 95 of 100 move by less than {step.nearly_all:.2f} %. Not all of it is "
        f"smooth: the farthest step is {step.largest:.1f} %, of a cluster that takes other lights on the far side of "
        "an edge.")
