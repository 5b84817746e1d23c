"""Frames a second of a frame session beside the papers' cards, with the error of what makes them fast.

A figure of a paper is of its own graphics card and of light and camera in motion unless said; ours are of this machine,
of `refgi.frames`: buffers of what rests are kept, memory is that of the frames before. Settings are the papers' numbers
of lights and pixels; an error is RMSE over the mean to the same lights without what is named. The papers' scenes are
used where REFGI_DATA names their folder, built-in ones of as many faces elsewhere.
"""

import statistics
import time
import warnings
from collections import defaultdict
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

import refgi
from benchmarks.harness import Row, moved, own_seconds, paper_scene, relative_rmse
from refgi.errors import RefgiWarning
from refgi.frame import Frame
from refgi.methods import find_method, usual_shadows
from refgi.scene import Scene
from refgi.settings import of, replaced

STEP = 1e-4  # m between two frames
MOTIONS = {"light and camera move": (True, True), "the camera moves": (False, True), "the light moves": (True, False),
           "all rests": (False, False)}
SHOWN = 5  # stages of a frame that are named, those that take most


class Subject(NamedTuple):
    """A frame whose rate a paper prints."""

    scene: str
    method: str
    settings: dict[str, Any]  # by key
    width: int
    height: int
    aim: float  # frames a second, light and camera in motion
    paper: str  # what it prints, and of which card
    full: tuple[str, dict[str, Any]]  # the method, and changed settings, without what makes it fast


VAL = {"lights": 1024, "pattern": "halton", "visibility": "val"}
EVERYWHERE = ("val", {"lights": 1024, "interleaving": 1})
SUBJECTS = {
    "sii, 768 lights cut at 5 %": Subject(
        "cornell_sphere:faces=17000", "sii",
        {"cut_share": 0.05, "reference_length": 0.171, "clamp": "none"}, 512, 512, 48, "48, 6800 GT, splatting alone",
        ("sii", {"clamp": "none"})),
    "sii, ring caustic of 4096 lights": Subject(
        "ring", "sii", {"lights": 4096, "warp": "B", "importance": "peak", "cut_share": 0.05, "reference_length": 1.0,
                        "clamp": "none"}, 512, 512, 95, "95, 6800 GT, splatting alone",
        ("sii", {"lights": 4096, "warp": "B", "importance": "peak", "clamp": "none"})),
    "multires, dragon and bunny": Subject(
        "dragon_bunny", "multires", {}, 1024, 1024, 25, "21, GTX 280", ("sii", {"lights": 256, "pattern": "grid"})),
    "multires, flying bunnies": Subject(
        "flying_bunnies", "multires", {}, 1024, 1024, 25, "25, GTX 280", ("sii", {"lights": 256, "pattern": "grid"})),
    "val to 5 %, horse": Subject(
        "cornell_horse", "val", {"lights": 1024}, 800, 800, 19.7, "19.7, 8800 GTX, interleaved, blurred", EVERYWHERE),
    "val at subsplats, horse": Subject(
        "cornell_horse", "multires", VAL, 800, 800, 19.7, "19.7, 8800 GTX, interleaved and blurred", EVERYWHERE),
    "val interleaved, horse": Subject(
        "cornell_horse", "val", {"lights": 1024, "interleaving": 8}, 800, 800, 19.7, "19.7, 8800 GTX", EVERYWHERE),
    "val to 5 %, sponza": Subject(
        "sponza", "val", {"lights": 1024}, 800, 800, 13.4, "13.4, 8800 GTX, interleaved and blurred", EVERYWHERE),
    "val at subsplats, sponza": Subject(
        "sponza", "multires", VAL, 800, 800, 13.4, "13.4, 8800 GTX, interleaved and blurred", EVERYWHERE),
    "val interleaved, sponza": Subject(
        "sponza", "val", {"lights": 1024, "interleaving": 8}, 800, 800, 13.4, "13.4, 8800 GTX", EVERYWHERE),
}


def rows(quick: bool) -> Iterator[Row]:
    warnings.simplefilter("ignore", RefgiWarning)  # cuts and clamps are the papers'
    for name, subject in SUBJECTS.items():
        if quick:
            subject = subject._replace(width=subject.width // 4, height=subject.height // 4)
        scene = paper_scene(subject.scene)
        for motion in MOTIONS:
            yield _rate(f"{name}: {motion}", scene, subject, *MOTIONS[motion], repeats=5 if quick else 15)
        yield Row(f"{name}: RMSE / mean to {_told(subject.full)}", _error(scene, subject), "")


def _told(full: tuple[str, dict[str, Any]]) -> str:
    method, settings = full
    return ", ".join([method, *(f"{key} {value}" for key, value in settings.items())])


def _rate(name: str, scene: Scene, subject: Subject, light: bool, camera: bool, repeats: int) -> Row:
    """Return the median rate of frames between which light and camera move, or one of them, or none."""
    settings = of(find_method(subject.method).settings, **subject.settings)
    session = refgi.frames(scene, subject.method, settings, width=subject.width, height=subject.height)
    taken, spent = [], defaultdict[str, list[float]](list)
    for number in range(3 + repeats):
        shown = moved(scene, STEP * number, light=light, camera=camera)
        started = time.perf_counter()
        session.render(shown)
        seconds = time.perf_counter() - started
        if number < 3:  # kernels, and the memory of two frames
            continue
        taken.append(seconds)
        for stage, own in own_seconds(session.runs).items():
            spent[stage].append(own)
    parts = sorted(((statistics.median(times), stage) for stage, times in spent.items()), reverse=True)[:SHOWN]
    note = (f"{1 / max(taken):.3g} to {1 / min(taken):.3g}; paper {subject.paper}; ms: "
            + ", ".join(f"{stage} {1e3 * own:.1f}" for own, stage in parts if own >= 1e-4))
    aim = f">= {subject.aim}" if light and camera else ""
    return Row(name, 1 / statistics.median(taken), "frames/s", aim, note)


def _error(scene: Scene, subject: Subject) -> float:
    """Return the RMSE of irradiance over the mean, both over all pixels, to that without what makes frames fast."""
    pictures = []
    for name, changed in ((subject.method, subject.settings), subject.full):
        method = find_method(name)
        settings = replaced(method.settings(), changed)
        frame = Frame(scene, width=subject.width, height=subject.height, shadows=usual_shadows(settings))
        pictures.append(np.asarray(method.compute(frame, settings)[0], np.float64))
    return relative_rmse(*pictures)
