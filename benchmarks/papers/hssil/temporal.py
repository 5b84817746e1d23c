"""Section 3.3: what the temporal filter takes away from noise, frame by frame, and what it leaves behind in motion."""

import math
from typing import Any, NamedTuple

import numpy as np

from benchmarks.papers.hssil.subjects import WIDE, expected_light, frame_of, light_of, scene_of, smaller
from benchmarks.papers.records import Figure, Plot, Table
from benchmarks.papers.workbench import Gallery, Workbench, changes, errors_of
from refgi.compare.pages import Axes, Curve, curves_plot
from refgi.frame import Frame
from refgi.scene import Scene
from refgi.sssil import HssilSettings
from refgi.sssil.settings import TemporalSettings
from refgi.sssil.temporal import Sequence
from refgi.stages import observe
from refgi.types import Array

RAW, PRINTED, RECURSIVE = "each frame alone", "as printed", "recursive"
WAYS = {RAW: None, PRINTED: TemporalSettings(form="printed"), RECURSIVE: TemporalSettings(warm_up=False)}
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


def filtered(bench: Workbench, scene: str) -> Figure:
    """Filter sequences with a resting and with a moving camera; noise beside what independent frames would give."""
    count, model = max(4, 3 * bench.scale.repeats), scene_of(bench, scene)
    settings = smaller(frame := frame_of(bench, scene, SIZE, wide=WIDE))
    found = {RESTING: _courses(bench, [model] * count, settings, frame),
             MOVING: _courses(bench, _moved(model, count), settings, frame)}
    gallery = Gallery(frame, found[RESTING][RECURSIVE].last)
    rows, curves = [], []
    kept: dict[str, dict[str, float]] = {motion: {} for motion in found}  # variance in the last frame, %
    for motion, ways in found.items():
        alone = float(np.mean(np.square(ways[RAW].noise)))
        for way, one in ways.items():
            title = f"{motion}, {way}"
            kept[motion][way] = 100 * one.noise[-1] ** 2 / max(alone, 1e-30)
            rows.append((title, one.noise[0], one.noise[-1], kept[motion][way], one.change, 100 * one.reused,
                         one.share))
            curves.append(Curve(title, range(1, count + 1), one.noise))
            gallery.indirect(f"{motion.split()[0]}_{way.replace(' ', '_')}", title,
                             f"last frame, RMSE {one.noise[-1]:.1f} %", one.last, settings)
    a = TemporalSettings().weight
    usual = math.sqrt(np.mean(np.square(found[RESTING][RAW].noise)))
    curves.append(Curve("independent frames, recursive", range(1, count + 1),
                        [math.sqrt(share) * usual for share in left(a, count)], dashed=True))
    share = [ways[RECURSIVE].share for ways in found.values()]
    resting, moving = kept.values()
    calm = found[MOVING][RAW].change / max(found[MOVING][RECURSIVE].change, 1e-30)
    return Figure(
        facts=(frame.scene.description, f"{frame.width} x {frame.height} pixels", f"{count} frames",
               "half resolution", f"{settings.sampling.levels} levels",
               f"{settings.sampling.samples} samples, others in each frame",
               "a = 0.9"), pictures=gallery.pictures,
        tables=[Table(f"Noise in % of the mean, against the mean of {bench.scale.truth_samples} pictures with other "
                      "samples; flicker: how it changes from frame to frame", (
                          "", "first frame", "last frame", "variance left, %", "flicker", "found again, %",
                          "filter, % of the time"), rows)],
        plots=[Plot(curves_plot(curves, Axes("frame", "RMSE, % of the mean")),
                    "Noise frame by frame; dashed: what independent frames of the first one's noise would give.")],
        notes=(
            f"With a resting camera {resting[RECURSIVE]:.0f} % of the variance is left after {count} frames of the "
            f"recursive filter (independent frames: {100 * left(a, count)[-1]:.0f} %, in the end "
            f"{100 * (1 - a) / (1 + a):.0f} %); the form as printed, a mean of two frames, leaves "
            f"{resting[PRINTED]:.0f} % ({100 * (a**2 + (1 - a) ** 2):.0f} %).",
            f"With a moving camera {moving[RECURSIVE]:.0f} % is left, {100 * found[MOVING][RECURSIVE].reused:.0f} % "
            f"of the pixels are found again in the frame before, and flicker falls to 1 / {calm:.1f}; some "
            "light went along from where the picture lit it differently.",
            f"The filter takes {min(share):.0f} to {max(share):.0f} % of the time of so small a picture's indirect "
            "light; the paper calls its cost negligible and does not print it."))


def _moved(scene: Scene, count: int) -> list[Scene]:
    """Return a scene from a camera that moves on between frames."""
    start, target = (np.array(place) for place in (scene.camera.eye, scene.camera.target))
    along = np.arange(count)[:, None] * np.array(STEP)
    return [scene.with_camera(eye=tuple(start + step), target=tuple(target + step / 2)) for step in along]


def _courses(bench: Workbench, scenes: list[Scene], settings: HssilSettings, like: Frame) -> dict[str, Course]:
    """Light a sequence in each way."""
    options: dict[str, Any] = {"width": like.width, "height": like.height, "rsm_resolution": bench.scale.rsm_resolution}
    views = {id(scene): Frame(scene, **options) for scene in scenes}  # a resting camera has one
    means = {key: expected_light(view, settings, bench.scale.truth_samples) for key, view in views.items()}
    right, covered = [means[id(scene)] for scene in scenes], [views[id(scene)].gbuffer.covered for scene in scenes]
    mean = float(np.mean([light[:, seen].mean() for light, seen in zip(right, covered, strict=True)]))

    def course(temporal: TemporalSettings | None) -> Course:
        list(Sequence(scenes[:2], settings, temporal, method=light_of, **options))  # kernels are loaded untimed
        with observe() as log:
            steps = list(Sequence(scenes, settings, temporal, method=light_of, **options))
        light = [step.irradiance for step in steps]
        off = [errors_of(*three).rmse for three in zip(light, right, covered, strict=True)]
        beyond = [one - true for one, true in zip(light, right, strict=True)]
        filtering, whole = log.seconds("sssil.temporal"), sum(log.seconds(name) for name in (
            "sssil.pyramid", "sssil.gather", "sssil.upsample"))
        return Course(off, changes(beyond, covered, mean), float(np.mean([step.reused for step in steps[1:]])),
                      light[-1], 100 * filtering / whole)

    return {name: course(temporal) for name, temporal in WAYS.items()}


def left(a: float, frames: int) -> list[float]:
    """Return which share of its variance independent noise keeps under the recursive filter of weight `a`.

    1 for the first frame, towards (1 - a) / (1 + a).
    """
    end = (1 - a) / (1 + a)
    return [end + (1 - end) * a ** (2 * k) for k in range(frames)]
