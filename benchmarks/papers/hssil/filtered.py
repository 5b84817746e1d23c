"""Section 3.3: what the temporal filter takes away from noise, frame by frame, and what it leaves behind in motion."""

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.papers import pictures
from benchmarks.papers.curves import Axes, Curve, drawn
from benchmarks.papers.hssil.references import expected_light
from benchmarks.papers.hssil.subjects import HALL, WIDE, frame_of, lit, scene_of, smaller
from benchmarks.papers.judging import errors_of
from benchmarks.papers.records import Figure, Picture, Plot, Table
from benchmarks.papers.val.motion import changes
from refgi.frame import Frame
from refgi.sssil import HssilSettings
from refgi.sssil.temporal.sequence import Sequence
from refgi.sssil.temporal.settings import TemporalSettings
from refgi.stages import observe

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.scene import Scene

Array = npt.NDArray[Any]

RAW, PRINTED, RECURSIVE = "each frame alone", "as printed", "recursive"
WAYS = {RAW: None, PRINTED: TemporalSettings(form="printed"), RECURSIVE: TemporalSettings()}
RESTING, MOVING = "resting camera", "moving camera"
SIZE = 3 / 8  # of the run's: each frame is judged by the mean of many pictures
STEP = (0.04, 0.002, 0.012)  # m: how far the camera moves from frame to frame


class Course(NamedTuple):
    """One way to light one sequence."""

    noise: list[float]  # RMSE against the mean of many pictures, % of the mean, frame by frame
    change: float  # of the noise from frame to frame, % of the mean
    reused: float  # share of pixels found in the frame before, mean
    last: Array
    share: float  # of the frame's indirect light, time of the filter, %


def filtered(bench: "Workbench") -> Figure:
    """Filter sequences with a resting and with a moving camera.

    Parameters
    ----------
    bench : Workbench
        Sizes, and how many frames.

    Returns
    -------
    Figure
        Noise frame by frame, beside what independent frames would give.
    """
    count = frame_count(bench)
    frame = frame_of(bench, HALL, SIZE, wide=WIDE)
    settings = smaller(frame)
    found = {motion: courses(bench, scenes, settings, frame) for motion, scenes in
             ((RESTING, [scene_of(bench, HALL)] * count), (MOVING, moved(scene_of(bench, HALL), count)))}
    rows = tuple((f"{motion}, {way}", one.noise[0], one.noise[-1], kept(ways, way), one.change, 100 * one.reused,
                  one.share)
                 for motion, ways in found.items() for way, one in ways.items())
    return Figure(
        shows="Blending each frame with the one before, warped to the new camera, takes away noise at next to no cost. "
              "The paper has no figure of it.",
        facts=(frame.scene.description, f"{frame.width} x {frame.height} pixels", f"{count} frames",
               "half resolution", f"{settings.levels} levels", f"{settings.samples} samples, others in each frame",
               "a = 0.9"),
        pictures=_pictures(frame, found, settings), columns=3,
        tables=(Table(f"Noise in % of the mean, against the mean of {bench.scale.truth_samples} pictures with other "
                      "samples; flicker: how it changes from frame to frame", (
            "", "first frame", "last frame", "variance left, %", "flicker", "found again, %",
            "filter, % of the time"), rows),),
        plots=(Plot(drawn(_curves(found), Axes("frame", "RMSE, % of the mean")),
                    "Noise frame by frame; dashed: what independent frames of the first one's noise would give."),),
        notes=_notes(found))


def frame_count(bench: "Workbench") -> int:
    """Return how many frames a sequence has.

    Parameters
    ----------
    bench : Workbench
        Says how often things are done.

    Returns
    -------
    int
        4 or more.
    """
    return max(4, 3 * bench.scale.repeats)


def moved(scene: "Scene", count: int) -> "list[Scene]":
    """Return a scene from a camera that moves on between frames.

    Parameters
    ----------
    scene : Scene
        The scene.
    count : int
        Frames.

    Returns
    -------
    list of Scene
        All of the same geometry.
    """
    start, target = (np.array(place) for place in (scene.camera.eye, scene.camera.target))
    along = np.arange(count)[:, None] * np.array(STEP)
    return [scene.with_camera(eye=tuple(start + step), target=tuple(target + step / 2)) for step in along]


def courses(bench: "Workbench", scenes: "list[Scene]", settings: HssilSettings, like: Frame) -> dict[str, Course]:
    """Light a sequence in each way.

    Parameters
    ----------
    bench : Workbench
        Sizes.
    scenes : list of Scene
        The frames.
    settings : HssilSettings
        How each is lit.
    like : Frame
        Says how large they are.

    Returns
    -------
    dict of str to Course
        By the names of `WAYS`.
    """
    options: dict[str, Any] = {"width": like.width, "height": like.height, "rsm_resolution": bench.scale.rsm_resolution}
    views = {id(scene): Frame(scene, **options) for scene in scenes}  # a resting camera has one
    means = {key: expected_light(view, settings, bench.scale.truth_samples) for key, view in views.items()}
    right, covered = [means[id(scene)] for scene in scenes], [views[id(scene)].gbuffer.covered for scene in scenes]
    mean = float(np.mean([light[:, seen].mean() for light, seen in zip(right, covered, strict=True)]))

    def course(temporal: TemporalSettings | None) -> Course:
        with observe() as log:
            steps = list(Sequence(scenes, settings, temporal, method=lit, **options))
        light = [step.irradiance for step in steps]
        off = [errors_of(*three).rmse for three in zip(light, right, covered, strict=True)]
        beyond = [one - true for one, true in zip(light, right, strict=True)]
        filtering, whole = log.seconds("sssil.temporal"), sum(log.seconds(name) for name in (
            "sssil.pyramid", "sssil.gather", "sssil.upsample"))
        return Course(off, changes(beyond, covered, mean), float(np.mean([step.reused for step in steps[1:]])),
                      light[-1], 100 * filtering / whole)

    return {name: course(temporal) for name, temporal in WAYS.items()}


def kept(ways: dict[str, Course], way: str) -> float:
    """Return how much of the variance is left in the last frame.

    Parameters
    ----------
    ways : dict of str to Course
        One sequence in each way.
    way : str
        Which.

    Returns
    -------
    float
        In % of the mean variance of unfiltered frames.
    """
    alone = float(np.mean(np.square(ways[RAW].noise)))
    return 100 * ways[way].noise[-1] ** 2 / max(alone, 1e-30)


def left(a: float, frames: int) -> list[float]:
    """Return which share of its variance independent noise keeps under the recursive filter.

    Parameters
    ----------
    a : float
        Weight of the frame before.
    frames : int
        How many.

    Returns
    -------
    list of float
        1 for the first frame, towards (1 - a) / (1 + a).

    Examples
    --------
    >>> [round(share, 3) for share in left(0.9, 3)]
    [1.0, 0.82, 0.674]
    """
    end = (1 - a) / (1 + a)
    return [end + (1 - end) * a ** (2 * k) for k in range(frames)]


def _curves(found: dict[str, dict[str, Course]]) -> list[Curve]:
    curves = []
    for motion, ways in found.items():
        for way, one in ways.items():
            curves.append(Curve(f"{motion}, {way}", range(1, len(one.noise) + 1), one.noise))
    alone = found[RESTING][RAW].noise
    usual = math.sqrt(np.mean(np.square(alone)))
    expected = [math.sqrt(share) * usual for share in left(TemporalSettings().weight, len(alone))]
    return [*curves, Curve("independent frames, recursive", range(1, len(alone) + 1), expected, dashed=True)]


def _pictures(frame: Frame, found: dict[str, dict[str, Course]], settings: HssilSettings) -> tuple[Picture, ...]:
    exposure = pictures.exposure_of(found[RESTING][RECURSIVE].last, frame.gbuffer.covered)
    return tuple(pictures.indirect(f"{motion.split()[0]}_{way.replace(' ', '_')}", f"{motion}, {way}",
                                   f"last frame, RMSE {one.noise[-1]:.1f} %", one.last, exposure, settings)
                 for motion, ways in found.items() for way, one in ways.items())


def _notes(found: dict[str, dict[str, Course]]) -> tuple[str, ...]:
    a, frames = TemporalSettings().weight, len(found[RESTING][RAW].noise)
    expected = 100 * left(a, frames)[-1]
    share = [ways[RECURSIVE].share for ways in found.values()]
    least, most = min(share), max(share)
    resting, moving = ({way: kept(ways, way) for way in WAYS} for ways in found.values())
    again = 100 * found[MOVING][RECURSIVE].reused
    calm = found[MOVING][RAW].change / max(found[MOVING][RECURSIVE].change, 1e-30)
    return (
        f"With a resting camera {resting[RECURSIVE]:.0f} % of the variance is left after {frames} frames of the "
        f"recursive filter (independent frames: {expected:.0f} %, in the end {100 * (1 - a) / (1 + a):.0f} %); the "
        f"form as printed, a mean of two frames, leaves {resting[PRINTED]:.0f} % "
        f"({100 * (a**2 + (1 - a) ** 2):.0f} %).",
        f"With a moving camera {moving[RECURSIVE]:.0f} % is left, {again:.0f} % "
        f"of the pixels are found again in the frame before, and flicker falls to 1 / {calm:.1f}; some "
        "light went along from where the picture lit it differently.",
        f"The filter takes {least:.0f} to {most:.0f} % of the time of so small a picture's indirect "
        "light; the paper calls its cost negligible and does not print it.")
