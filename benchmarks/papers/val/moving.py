"""Scenes that move: how far pictures and area lights jump from frame to frame; Figures 11 and 12."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from benchmarks.harness import interleaved
from benchmarks.papers.records import Figure, Picture, Rows, Table, relative
from benchmarks.papers.val.subjects import (
    AREA_LIGHTS,
    ATRIUM,
    MARCH,
    MOVING,
    Clustered,
    blob_at,
    clustered_along,
    drawing,
    lit_by,
    march,
    published,
    rays_to,
    scene_of,
    settings_of,
)
from benchmarks.papers.workbench import Gallery, Workbench, changes, errors_of, seen_by
from refgi.cluster.val import val
from refgi.frame import Frame
from refgi.lights import PixelLights
from refgi.scene import Scene
from refgi.settings import replaced
from refgi.stages import Memory, observe
from refgi.types import Array

FEW = 8  # area lights
EXACT = "a ray to each light"
RESTARTED, WARM = f"{AREA_LIGHTS} area lights, restarted", f"{AREA_LIGHTS}, started from the last frame"
FEWER, INTERLEAVED = f"{FEW} area lights, restarted", f"{AREA_LIGHTS}, interleaved and blurred"
WALLS = 4  # pieces of Figure 12's scene that are not the blob's


class Motion(NamedTuple):
    """Displacements between two frames, in per cent of the scene's diagonal."""

    lights: float  # mean of the pixel lights
    typical: float  # mean of the area lights' centres
    nearly_all: float  # 95th percentile of theirs
    largest: float


def motion(before: Clustered, after: Clustered, diagonal: float) -> Motion:
    """Measure how far lights and the centres of their clusters move; cluster k of one frame is k of the other.

    Only clusters that have lights in both frames count, and lights of the same texel of the shadow map.
    """
    held = (before.clusters.members > 0) & (after.clusters.members > 0)
    centers = np.linalg.norm(after.clusters.center[:, held] - before.clusters.center[:, held], axis=0)
    lights = _paired(before.lights, after.lights)
    share = 100 / diagonal
    return Motion(share * _mean(lights), share * _mean(centers), share * _percentile(centers, 95),
                  share * _percentile(centers, 100))


def mean_motion(steps: Sequence[Motion]) -> Motion:
    """Return means over the frames of a sequence, and the largest of all."""
    lights, typical, nearly_all, largest = (np.array([getattr(step, key) for step in steps]) for key in Motion._fields)
    return Motion(_mean(lights), _mean(typical), _mean(nearly_all), _percentile(largest, 100))


def _paired(before: PixelLights, after: PixelLights) -> Array:
    if before.texel is None or after.texel is None:
        return np.zeros(0)
    _, here, there = np.intersect1d(before.texel, after.texel, return_indices=True)
    displacement: Array = np.linalg.norm(after.position[:, there] - before.position[:, here], axis=0)
    return displacement


def _mean(values: Array) -> float:
    return float(np.mean(values)) if np.size(values) else 0.0


def _percentile(values: Array, percentage: float) -> float:
    return float(np.percentile(values, percentage)) if np.size(values) else 0.0


class Steadiness(NamedTuple):
    """How steady one way to light a sequence is."""

    mae: float  # against a ray to each light, % of the mean, mean over frames
    change: float  # from frame to frame, mean magnitude, % of the mean
    excess: float  # of it, what a ray to each light does not show
    motion: Motion | None  # of its area lights


class Moved(NamedTuple):
    """A sequence and what came of it."""

    frames: list[Frame]
    ways: dict[str, Steadiness]

    @property
    def table(self) -> Table:
        """One row for each way to light it."""
        rows: Rows = [(way, one.mae, one.change, one.excess, *(one.motion or (None,) * 4))
                      for way, one in self.ways.items()]
        return Table("Error and change from frame to frame in % of the mean irradiance; motion from frame to frame in "
                     "% of the scene's diagonal",
                     ("", "MAE", "change", "change that rays do not show", "lights, mean", "centres, mean",
                      "centres, 95 %", "centres, farthest"), rows)

    @property
    def note(self) -> str:
        """A sentence or two."""
        exact, ours, warm, block = (self.ways[way] for way in (EXACT, RESTARTED, WARM, INTERLEAVED))
        moved = ours.motion or Motion(0, 0, 0, 0)
        return (f"From frame to frame the picture by rays changes by {exact.change:.1f} % of the mean, that of "
                f"{AREA_LIGHTS} area lights by {ours.change:.1f} %; {ours.excess:.1f} % is change that rays do not "
                f"show, with clusters taken over from the last frame {warm.excess:.1f} %, interleaved and blurred "
                f"{block.excess:.1f} %. Centres of area lights move by {moved.typical:.2f} % of the diagonal in the "
                f"mean, their lights by {moved.lights:.2f} %.")


def sequence(bench: Workbench, scene_at: Callable[[float], Scene], step: float) -> Moved:
    """Light a scene that moves, by rays to each light and by area lights; `step` is the time between frames."""
    count = max(3, bench.scale.repeats)
    span = step * (count - 1)
    frames = [seen_by(bench, scene_at(span * k / (count - 1)), MOVING) for k in range(count)]
    settings = settings_of(bench)
    few = replaced(settings, {"clusters.count": FEW})
    ways = {RESTARTED: (settings, clustered_along(frames, settings, warm=False)),
            WARM: (settings, clustered_along(frames, settings, warm=True)),
            FEWER: (few, clustered_along(frames, few, warm=False))}
    restarted = ways[RESTARTED][1]
    made: dict[str, list[Array]] = {way: [] for way in (EXACT, *ways, INTERLEAVED)}
    for k, frame in enumerate(frames):
        with observe(memory=Memory()):  # what may occlude is found once a frame
            made[EXACT].append(rays_to(frame, restarted[k].lights, settings))
            for way, (one, found) in ways.items():
                made[way].append(lit_by(frame, found[k], one))
            made[INTERLEAVED].append(val(frame, published(bench, frame.scene)))
    clusters = {way: found for way, (_, found) in ways.items()} | {INTERLEAVED: restarted}
    return Moved(frames, {way: _steadiness(frames, pictures, made[EXACT], clusters.get(way))
                              for way, pictures in made.items()})


def _steadiness(frames: list[Frame], made: list[Array], exact: list[Array],
                found: list[Clustered] | None) -> Steadiness:
    covered = [frame.gbuffer.covered for frame in frames]
    mean = float(np.mean([light[:, seen].mean() for light, seen in zip(exact, covered, strict=True)]))
    mae = float(np.mean([errors_of(*three).mae for three in zip(made, exact, covered, strict=True)]))
    beyond = [light - right for light, right in zip(made, exact, strict=True)]
    diagonal = frames[0].scene.geometry.diagonal
    moves = None if found is None else mean_motion([motion(*pair, diagonal) for pair in pairwise(found)])
    return Steadiness(mae, changes(made, covered, mean), changes(beyond, covered, mean), moves)


def walking(bench: Workbench, times: tuple[float, ...], step: float, fps: dict[str, float]) -> Figure:
    """Figure 11: bodies that walk through an atrium of 100 thousand faces in all; still, in the paper: Table 1."""
    settings = published(bench, scene_of(bench, MARCH))
    shown: list[Picture] = []
    for t in times:
        frame = seen_by(bench, march(t))
        light = val(frame, settings)
        gallery = Gallery(frame, light, shown)
        gallery.camera(f"at{100 * t:.0f}", f"at {t:g} of the way", f"{frame.scene.face_count} faces", light, settings)
    gallery.indirect("indirect", "indirect light at the end", "8 x 8 pixels interleaved, blurred", light)
    seconds = interleaved({"moving bodies": drawing(bench, scene_of(bench, MARCH), settings),
                           "still": drawing(bench, scene_of(bench, ATRIUM), settings)}, bench.few)
    moving = sequence(bench, march, step)
    return Figure(
        facts=(scene_of(bench, MARCH).description, f"{frame.scene.face_count} faces", f"{len(moving.frames)} frames, "
               "8 cm of the way apart", f"steadiness at {moving.frames[0].width}²"), pictures=shown,
        ratios=[relative("frames per second, relative to the atrium of Table 1",
                         {name: 1 / taken for name, taken in seconds.items()}, dict(fps), "still")],
        tables=(moving.table, Table("Whole frames", ("", "ms", "fps", "fps, paper"), [
            (name, 1e3 * taken, 1 / taken, fps[name]) for name, taken in seconds.items()])),
        notes=(f"Whole frames take {1e3 * seconds['moving bodies']:.0f} ms, {1 / seconds['moving bodies']:.1f} a "
               "second, the paper's 14: nothing is kept from frame to frame, so bodies that move cost what bodies "
               "that rest do, there and here.",
               moving.note,
               f"The MAE against rays is {moving.ways[RESTARTED].mae:.0f} % of the mean here: with {AREA_LIGHTS} area "
               "lights in a hall of 30 m each is metres wide, and its rectangle reaches where it has no lights.",
               "Two four-legged bodies stand in for the dragons and the built-in atrium for Sponza, so only ratios "
               "and the look can be compared, not the pictures themselves."))


def changing_topology(bench: Workbench, times: tuple[float, ...], step: float, fps: float) -> Figure:
    """Figure 12: a blob whose pieces join and part, cut anew from its field in every frame."""
    settings = published(bench, blob_at(0.0))
    seconds = interleaved({t: drawing(bench, blob_at(t), settings) for t in times}, max(1, bench.few - 1))
    shown: list[Picture] = []
    rows: list[tuple[Any, ...]] = []
    for t in times:
        frame = seen_by(bench, blob_at(t))
        count, faces = pieces(frame.scene), frame.scene.face_count
        Gallery(frame, shown=shown).camera(f"at{100 * t:.0f}", f"t = {t:g}", f"{count} pieces, {faces} faces",
                                           val(frame, settings), settings)
        rows.append((f"t = {t:g}", count, faces, 1e3 * seconds[t], 1 / seconds[t], fps))
    moving = sequence(bench, blob_at, step)
    _, counts, faces_of, _, rates, _ = zip(*rows, strict=True)
    return Figure(
        facts=(frame.scene.description, f"{len(moving.frames)} frames, a hundredth of a period apart",
               f"steadiness at {moving.frames[0].width}²"), pictures=shown,
        tables=(Table("Pieces, faces and whole frames", ("", "pieces", "faces", "ms", "fps", "fps, paper"), rows),
                moving.table),
        notes=(f"The blob falls into {min(counts)} to {max(counts)} pieces and has {min(faces_of)} to {max(faces_of)} "
               f"faces with the stage's; frames come at {min(rates):.1f} to {max(rates):.1f} a second, whatever hangs "
               "together: nothing is prepared for a shape. Cutting the surface from its field is not in the time, nor "
               "in the paper's.",
               moving.note))


def pieces(scene: Scene) -> int:
    """Return how many pieces the blob over its stage has: parts of its surface that hang together."""
    faces: Any = scene.geometry.faces
    count = len(scene.geometry.vertices)
    first, second = faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel()
    joined = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(count, count))
    label = connected_components(joined, directed=False)[1]
    return len(np.unique(label[faces[:, 0]])) - WALLS
