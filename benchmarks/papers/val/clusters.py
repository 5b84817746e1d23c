"""Clusters of lights: by position and normal (Figure 6), under a moving spot (Figure 8), one by one (Figure 9)."""

import dataclasses
import math
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.harness import interleaved
from benchmarks.papers.records import Cell, Figure, Picture, Plot, Table
from benchmarks.papers.val.moving import mean_motion, motion
from benchmarks.papers.val.subjects import (
    AREA_LIGHTS,
    SMALL,
    Clustered,
    clustered,
    clustered_along,
    drawing,
    frame_of,
    grouped,
    lit_by,
    maps_of,
    published,
    rays_to,
    scene_of,
    settings_of,
    shadowed,
)
from benchmarks.papers.workbench import Gallery, Workbench, errors_of, palette, seen_by
from refgi.cluster.kmeans import in_use, mean_angle
from refgi.cluster.settings import ValSettings
from refgi.cluster.val import val
from refgi.compare.pages import Axes, Curve, curves_plot
from refgi.compare.pictures import luminance
from refgi.frame import Frame
from refgi.image import tone_map
from refgi.lights.selection import choose_lights
from refgi.scene import Scene
from refgi.types import Array

BENT = 30.0  # degrees from its cluster's normal to a light's: such a cluster lies around an edge
TARGET, VFOV = (0.4, 0.42, 0.4), math.radians(20)  # m and rad, of Figure 6's camera: at the corner
EYE = (0.278, 0.36, 0.08)  # m, where Figure 8's spot is
LOW, HIGH = math.radians(4), math.radians(64)  # elevation of its axis at the start and at the ceiling
NORMAL_WEIGHT = 0.3  # diagonals for a unit of normals: a pixel's light lies on its own side of an edge
OFTEN = 10  # clusterings timed for each frame: they take milliseconds
GREY, INK = 0.55, 0.8  # how bright surfaces without lights are, how strong clusters' colours


def painted(name: str, title: str, said: str, frame: Frame, found: Clustered, settings: Any = None) -> Picture:
    """Colour every directly lit pixel by the cluster of the pixel light next to it.

    The picture's one plane, Y, holds the cluster's number, -1 where there is none.
    """
    number = cluster_of_pixel(frame, found)
    colours = np.concatenate([palette(len(found.clusters.members)), np.ones((1, 3))])
    shade = np.asarray(tone_map(np.moveaxis(_shading(frame), 0, -1), 1.0), np.float64) / 255
    coloured = number >= 0
    mixed = np.where(coloured[..., None], INK * colours[number] * (0.35 + 0.65 * shade), GREY * shade)
    return Picture(name, title, said, (255 * mixed + 0.5).astype(np.uint8), {"Y": number.astype(np.float32)}, settings)


def cluster_of_pixel(frame: Frame, found: Clustered) -> Array:
    """Return which cluster (h, w) the nearest light of each directly lit pixel belongs to, -1 for the others."""
    position, normal, covered = frame.gbuffer.resolve("position", "normal", "covered")
    direct = covered & (luminance(frame.direct) > 0)
    number = np.full(direct.shape, -1, np.int64)
    if direct.any() and found.lights.position.shape[1]:
        reach = NORMAL_WEIGHT * frame.scene.geometry.diagonal
        tree = cKDTree(np.concatenate([found.lights.position, reach * found.lights.normal]).T)
        nearest = tree.query(np.concatenate([position[:, direct], reach * normal[:, direct]]).T)[1]
        number[direct] = found.clusters.of[nearest]
    return number


def _shading(frame: Frame) -> Array:
    """Return grey surfaces, lit from the camera."""
    position, normal, covered = frame.gbuffer.resolve("position", "normal", "covered")
    view = np.asarray(frame.scene.camera.eye, np.float64)[:, None, None] - position
    length = np.sqrt((view**2).sum(axis=0))
    cosine = np.abs((view * normal).sum(axis=0)) / np.where(length > 0, length, 1)
    grey: Array = np.where(covered, 0.15 + 0.75 * cosine, 0.0)
    return np.broadcast_to(grey, (3, *grey.shape))


class Measured(NamedTuple):
    """What a criterion of clustering came to."""

    mean_angle: float  # degrees, between a light's normal and its cluster's
    largest_angle: float
    bent: int  # clusters that hold a light more than BENT off
    radius: float  # mean distance of a light from its cluster's centre, % of the diagonal
    rounds: int
    rmse: float  # % of the mean


def criteria(bench: Workbench, scene: str, ways: dict[str, tuple[str, dict[str, Any]]]) -> Figure:
    """Figure 6: clusters by position alone, and by position and normal, drawn on the picture."""
    model = scene_of(bench, scene)
    frame, small = seen_by(bench, model.with_camera(target=TARGET, vfov=VFOV)), frame_of(bench, scene, SMALL)
    measured, shown = {}, []
    for name, (title, changes) in ways.items():
        settings = settings_of(bench, **changes)
        found = clustered(frame, settings)
        off = errors_of(val(small, settings), shadowed(bench, small, settings), small.gbuffer.covered)
        measured[name] = one = _measured(found, model.geometry.diagonal, off.rmse)
        shown.append(painted(name, title, f"mean angle {one.mean_angle:.1f}°, {one.bent} clusters around an edge",
                             frame, found, settings))
    position, both, raw = (measured[name] for name in ("position", "both", "raw"))
    return Figure(
        facts=(model.description, f"{found.lights.position.shape[1]} lights",
               f"{len(found.clusters.members)} clusters"), pictures=shown,
        tables=[Table("Angle between a light's normal and its cluster's, distance from its centre, and the error of "
                      "the picture against a ray to each light",
                      ("", "mean angle, °", "largest, °", f"clusters with more than {BENT:.0f}°",
                       "distance, % of the diagonal", "rounds", "RMSE, % of the mean"),
                      [(title, *measured[name]) for name, (title, _) in ways.items()])],
        notes=(
            f"With normals in the distance the mean angle inside clusters falls from {position.mean_angle:.1f} to "
            f"{both.mean_angle:.1f} degrees and the number of clusters around an edge from {position.bent} to "
            f"{both.bent}: the shape of the paper's figure. They are {both.radius / position.radius:.2f} times as wide "
            "for it.",
            "The paper adds metres to radians, so what its weights mean depends on the unit of length: in this box of "
            f"about half a metre the printed form comes to {raw.mean_angle:.1f} degrees and {raw.bent} clusters around "
            "an edge. The default divides distances by the scene's diagonal and angles by pi.",
            f"The error of the picture, which the paper's figure does not show, is {position.rmse:.1f} % of the mean "
            f"by position alone and {both.rmse:.1f} % with normals."))


def _measured(found: Clustered, diagonal: float, rmse: float) -> Measured:
    lights, clusters = found.lights, found.clusters
    cosine = (lights.normal * clusters.normal[:, clusters.of]).sum(axis=0, dtype=np.float64)
    angle = np.arccos(np.clip(cosine, -1, 1))
    bent = len(np.unique(clusters.of[np.degrees(angle) > BENT]))
    distance = np.linalg.norm(lights.position - clusters.center[:, clusters.of], axis=0)
    share = 100 * float(distance.mean()) / diagonal if distance.size else 0.0
    return Measured(math.degrees(mean_angle(lights.normal, clusters)), float(np.degrees(angle.max(initial=0.0))), bent,
                    share, clusters.rounds, rmse)


def to_the_ceiling(bench: Workbench, scene: str, starts: dict[str, str], distances: dict[str, str]) -> Figure:
    """Figure 8: a spot moves from the wall to the ceiling; clusters taken over get lost, restarted ones stay."""
    there = max(9, 3 * bench.scale.repeats)
    frames = moved(bench, scene_of(bench, scene), there)
    settings = {distance: settings_of(bench, distance=distance) for distance in distances}
    runs = {(distance, start): clustered_along(frames, one, warm=start == "warm")
            for distance, one in settings.items() for start in starts}
    counts = {key: [in_use(one.clusters) for one in run] for key, run in runs.items()}
    diagonal, ceiling = frames[0].scene.geometry.diagonal, there - 1
    moves = {key: mean_motion([motion(*pair, diagonal) for pair in pairwise(run)]) for key, run in runs.items()}
    shown = [painted(f"{place}_{start}", f"on the {place}, {title}",
                     f"frame {k + 1}, {counts['raw', start][k]} clusters", frames[k], runs["raw", start][k])
             for place, k in (("wall", 0), ("ceiling", ceiling)) for start, title in starts.items()]
    small = seen_by(bench, frames[ceiling].scene, SMALL)
    right = shadowed(bench, small, settings["raw"])
    off = {start: errors_of(lit_by(small, runs["raw", start][ceiling], settings["raw"]), right,
                            small.gbuffer.covered).rmse for start in starts}
    titles = {(distance, start): f"{starts[start]}, {distances[distance]}" for distance, start in runs}
    warm, kept, mild = counts["raw", "warm"], counts["raw", "restart"], counts["normalised", "warm"]
    step = moves["normalised", "restart"]
    times = {distance: _times_of_starts(bench, frames[there // 2], runs[distance, "warm"][there // 2 - 1], one)
             for distance, one in settings.items()}
    slower = [one["restart"].frame / one["warm"].frame for one in times.values()]
    return Figure(
        facts=(scene_of(bench, scene).description, f"{len(frames)} frames, to the ceiling and back",
               f"{settings['raw'].lights.count} lights", f"{AREA_LIGHTS} clusters"), pictures=shown,
        tables=[Table("Clusters with lights, and how far things move between two frames in % of the scene's diagonal",
                      ("", "on the wall", "on the ceiling", "back on the wall", "lights, mean", "centres, mean",
                       "centres, 95 %", "centres, farthest"),
                      [(titles[key], used[0], used[ceiling], used[-1], *moves[key]) for key, used in counts.items()]),
                Table("Half way up: rounds of k-means, its time, and that of a whole frame as published",
                      ("", "rounds", "clustering, ms", "frame, ms"),
                      [(titles[key], *times[key[0]][key[1]]) for key in counts])],
        plots=[Plot(curves_plot([Curve(titles[key], range(1, len(frames) + 1), used, key[1] == "warm")
                                 for key, used in counts.items()], Axes("frame", "clusters with lights")),
                    f"Clusters with lights in each frame; frame {there} is on the ceiling.")],
        notes=(
            f"By the printed distance {warm[0]} clusters become {warm[ceiling]} on the way to the ceiling when each "
            f"frame starts from the last; restarted they are never fewer than {min(kept)}. Back on the wall {warm[-1]} "
            "have lights: those that were left behind there are reactivated, as the paper expects.",
            f"The normalised distance, by which the default clusters, leaves {mild[ceiling]} of {mild[0]} on the same "
            "way.",
            f"On the ceiling the picture's RMSE against a ray to each light is {off['warm']:.1f} % of the mean with "
            f"the clusters that are left and {off['restart']:.1f} % with restarted ones.",
            f"Restarted, a centre moves by {step.typical:.2f} % of the diagonal from frame to frame in the mean while "
            f"lights move by {step.lights:.2f} %; 95 of 100 move by less than {step.nearly_all:.2f} %. Not all of it "
            f"is smooth: the farthest step is {step.largest:.1f} %, of a cluster that takes other lights on the far "
            "side of an edge.",
            f"A frame takes {min(slower):.3f} to {max(slower):.3f} times as long with restarted clusters."))


class StartTime(NamedTuple):
    """What a start of k-means costs."""

    rounds: int
    clustering: float  # ms
    frame: float  # ms


def _times_of_starts(bench: Workbench, frame: Frame, before: Clustered, settings: ValSettings) -> dict[str, StartTime]:
    """Time k-means from its own start and from the clusters of the frame before; frames differ in that alone."""
    starts = {"restart": None, "warm": before.clusters}
    lights = choose_lights(frame, settings.lights)
    whole = published(bench, frame.scene, distance=settings.clusters.distance)
    work = {key: partial(grouped, frame, lights, settings, start) for key, start in starts.items()}
    seconds = interleaved(work, OFTEN * bench.scale.repeats)
    rest = interleaved({"frame": drawing(bench, frame.scene, whole)}, bench.scale.repeats)["frame"] - seconds["restart"]
    return {key: StartTime(run().clusters.rounds, 1000 * seconds[key], 1000 * (rest + seconds[key]))
            for key, run in work.items()}


def moved(bench: Workbench, scene: Scene, there: int) -> list[Frame]:
    """Return frames in which the spot turns from the wall to the ceiling, the last of `there`, and back."""
    up, light, found = np.linspace(LOW, HIGH, there), scene.lights[0], []
    for elevation in (*up, *up[-2::-1]):
        spot: Any = {"position": EYE, "direction": (0.0, math.sin(elevation), math.cos(elevation)),
                     "inner_half_angle": math.radians(20), "outer_half_angle": math.radians(26)}
        found.append(seen_by(bench, scene.with_lights(dataclasses.replace(light, **spot))))
    return found


def one_by_one(bench: Workbench, scene: str, count: int) -> Figure:
    """Figure 9: the shadows of single area lights, all clusters, and the picture that they add up to."""
    frame, settings = frame_of(bench, scene), settings_of(bench)
    found = clustered(frame, settings)
    maps, members = maps_of(frame, found, settings), found.clusters.members
    flux = np.bincount(found.clusters.of, found.lights.flux.sum(axis=0), len(members))
    strongest = [int(m) for m in np.argsort(-flux, kind="stable")[:count] if members[m] > 0]
    total = lit_by(frame, found, settings, maps)
    shown: list[Picture] = []
    for rank, m in enumerate(strongest):
        part = lit_by(frame, _alone(found, m), settings, maps)
        Gallery(frame, part, shown).indirect(f"light{rank + 1}", f"area light {m + 1} alone",
                                             f"{members[m]} lights, {100 * found.areas.delta[m]:.1f} cm", part)
    shown.append(painted("clusters", "all clusters", f"{len(members)} area lights", frame, found))
    gallery = Gallery(frame, total, shown)
    gallery.indirect("indirect", "the sum of all", "indirect light", total, settings)
    gallery.camera("seen", "with direct light", "as the paper's", total, settings)
    rows = _judged(bench, frame_of(bench, scene, SMALL), settings, strongest)
    single = [float(row[4]) for row in rows[:-1] if isinstance(row[4], float)]
    parts = sum(np.asarray(lit_by(frame, _alone(found, m), settings, maps), np.float64) for m in range(len(members)))
    apart = float(np.abs(parts - total).max() / max(float(np.abs(total).max()), 1e-30))
    return Figure(
        facts=(frame.scene.description, f"{found.lights.position.shape[1]} lights", f"{len(members)} area lights",
               f"{np.count_nonzero(maps.map_of >= 0)} of them with a map"), pictures=shown,
        tables=[Table("Single area lights and their sum: error against a ray to each of their lights, in % of the mean "
                      "of each picture", ("", "lights", "size, cm", "% of the flux", "RMSE", "MAE", "darker by"),
                      rows)],
        notes=(
            f"Single area lights are {min(single):.1f} to {max(single):.1f} % of their mean off, the sum of all "
            f"{rows[-1][4]:.1f} %: errors of many overlapping soft shadows do hide each other, as the paper says.",
            f"Pictures of all single area lights add up to the whole one to {apart:.1g} of its largest value; float32 "
            "sums in another order.",
            "Area lights near an edge of the box give most of their light to the wall next to them."))


def _alone(found: Clustered, number: int) -> Clustered:
    """Return the same lights, all dark but those of one cluster."""
    shines, lights = found.clusters.of == number, found.lights
    glossy = {} if lights.lobe_flux is None else {"lobe_flux": lights.lobe_flux * shines}
    return found._replace(lights=lights._replace(flux=lights.flux * shines, **glossy))


def _judged(bench: Workbench, frame: Frame, settings: ValSettings, chosen: list[int]) -> list[tuple[Cell, ...]]:
    found, covered = clustered(frame, settings), frame.gbuffer.covered
    maps, flux = maps_of(frame, found, settings), found.lights.flux.sum()
    rows: list[tuple[Cell, ...]] = []
    for m in chosen:
        single = _alone(found, m)
        off = errors_of(lit_by(frame, single, settings, maps), rays_to(frame, single.lights, settings), covered)
        rows.append((f"area light {m + 1}", int(found.clusters.members[m]), 100 * float(found.areas.delta[m]),
                     100 * float(single.lights.flux.sum() / flux), *off))
    whole = errors_of(lit_by(frame, found, settings, maps), shadowed(bench, frame, settings), covered)
    return [*rows, ("all", found.lights.position.shape[1], None, 100.0, *whole)]
