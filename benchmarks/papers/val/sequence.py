"""Frames of a scene that moves, and how far its pictures and area lights jump from one frame to the next."""

import dataclasses
from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.papers.judging import errors_of
from benchmarks.papers.records import Table
from benchmarks.papers.subjects import seen_by
from benchmarks.papers.val.lit import lit
from benchmarks.papers.val.motion import Motion, changes, mean_motion, motion
from benchmarks.papers.val.subjects import (
    AREA_LIGHTS,
    MOVING,
    Clustered,
    clustered,
    published,
    rays_to,
    settings_of,
)
from refgi.cluster.settings import ValSettings
from refgi.cluster.val import val
from refgi.stages import Memory, observe

if TYPE_CHECKING:
    from benchmarks.papers.workbench import Workbench
    from refgi.frame import Frame
    from refgi.scene import Scene

Array = npt.NDArray[Any]

FEW = 8  # area lights
EXACT = "a ray to each light"
RESTARTED, WARM = f"{AREA_LIGHTS} area lights, restarted", f"{AREA_LIGHTS}, started from the last frame"
FEWER, INTERLEAVED = f"{FEW} area lights, restarted", f"{AREA_LIGHTS}, interleaved and blurred"


class Steadiness(NamedTuple):
    """How steady one way to light a sequence is."""

    mae: float  # against a ray to each light, % of the mean, mean over frames
    change: float  # from frame to frame, mean magnitude, % of the mean
    excess: float  # of it, what a ray to each light does not show
    motion: Motion | None  # of its area lights


class Sequence(NamedTuple):
    """A sequence and what came of it."""

    frames: "list[Frame]"
    found: list[Clustered]  # restarted in every frame
    ways: dict[str, Steadiness]


def sequence(bench: "Workbench", scene_at: "Callable[[float], Scene]", span: float) -> Sequence:
    """Light a scene that moves, by rays to each light and by area lights.

    Parameters
    ----------
    bench : Workbench
        Sizes, and how many frames.
    scene_at : callable
        The scene at a time.
    span : float
        Time from the first to the last frame.

    Returns
    -------
    Sequence
        Frames, clusters, and how steady pictures are.
    """
    count = frame_count(bench)
    frames = [seen_by(bench, scene_at(span * k / (count - 1)), MOVING) for k in range(count)]
    settings = settings_of(bench)
    restarted, warm = _along(frames, settings, warm=False), _along(frames, settings, warm=True)
    few = dataclasses.replace(settings, area_lights=FEW)
    fewer = _along(frames, few, warm=False)
    made: dict[str, list[Array]] = {way: [] for way in (EXACT, RESTARTED, WARM, FEWER, INTERLEAVED)}
    for frame, one, other, third in zip(frames, restarted, warm, fewer, strict=True):
        with observe(memory=Memory()):  # what may occlude is found once a frame
            made[EXACT].append(rays_to(frame, one.lights))
            made[RESTARTED].append(lit(frame, one, settings))
            made[WARM].append(lit(frame, other, settings))
            made[FEWER].append(lit(frame, third, few))
            made[INTERLEAVED].append(val(frame, published(bench, frame.scene)))
    of = {RESTARTED: restarted, WARM: warm, FEWER: fewer, INTERLEAVED: restarted}
    return Sequence(frames, restarted, {way: _steadiness(frames, pictures, made[EXACT], of.get(way))
                                        for way, pictures in made.items()})


def frame_count(bench: "Workbench") -> int:
    """Return how many frames a sequence has.

    Parameters
    ----------
    bench : Workbench
        Says how often things are done.

    Returns
    -------
    int
        3 or more.
    """
    return max(3, bench.scale.repeats)


def table(found: Sequence) -> Table:
    """Return the table of a sequence.

    Parameters
    ----------
    found : Sequence
        What `sequence` gave.

    Returns
    -------
    Table
        One row for each way to light it.
    """
    rows = tuple((way, one.mae, one.change, one.excess, *(one.motion or (None,) * 4))
                 for way, one in found.ways.items())
    return Table("Error and change from frame to frame in % of the mean irradiance; motion from frame to frame in % of "
                 "the scene's diagonal",
                 ("", "MAE", "change", "change that rays do not show", "lights, mean", "centres, mean",
                  "centres, 95 %", "centres, farthest"), rows)


def note(found: Sequence) -> str:
    """Say how steady a sequence is.

    Parameters
    ----------
    found : Sequence
        What `sequence` gave.

    Returns
    -------
    str
        A sentence or two.
    """
    exact, ours, warm, block = (found.ways[way] for way in (EXACT, RESTARTED, WARM, INTERLEAVED))
    moved = ours.motion or Motion(0, 0, 0, 0)
    return (f"From frame to frame the picture by rays changes by {exact.change:.1f} % of the mean, that of "
            f"{AREA_LIGHTS} area lights by {ours.change:.1f} %; {ours.excess:.1f} % is change that rays do not show, "
            f"with clusters taken over from the last frame {warm.excess:.1f} %, interleaved and blurred "
            f"{block.excess:.1f} %. Centres of area lights move by {moved.typical:.2f} % of the diagonal in the "
            f"mean, their lights by {moved.lights:.2f} %.")


def _along(frames: "list[Frame]", settings: ValSettings, *, warm: bool) -> list[Clustered]:
    found: list[Clustered] = []
    for frame in frames:
        found.append(clustered(frame, settings, found[-1].clusters if warm and found else None))
    return found


def _steadiness(frames: "list[Frame]", made: list[Array], exact: list[Array],
                found: list[Clustered] | None) -> Steadiness:
    covered = [frame.gbuffer.covered for frame in frames]
    mean = float(np.mean([light[:, seen].mean() for light, seen in zip(exact, covered, strict=True)]))
    mae = float(np.mean([errors_of(*three).mae for three in zip(made, exact, covered, strict=True)]))
    beyond = [light - right for light, right in zip(made, exact, strict=True)]
    diagonal = frames[0].scene.geometry.diagonal
    moves = None if found is None else mean_motion([motion(*pair, diagonal) for pair in pairwise(found)])
    return Steadiness(mae, changes(made, covered, mean), changes(beyond, covered, mean), moves)
