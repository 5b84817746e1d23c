"""Single soft shadows: of square lamps over a floor (Figures 4 and 5), soft and crisp under two spots (Figure 13).

A lamp is one cluster of pixel lights on a square grid, so that the method sees it as it sees any cluster, and a ray to
each of its lights is the truth for it.
"""

import dataclasses
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from benchmarks.harness import interleaved
from benchmarks.papers.records import Figure, Picture, Table
from benchmarks.papers.val.subjects import (
    JUDGED,
    SMALL,
    Clustered,
    body,
    clustered,
    frame_of,
    grouped,
    lit_by,
    placed,
    rays_to,
    settings_of,
    shadowed,
)
from benchmarks.papers.workbench import Gallery, Workbench, errors_of
from refgi.cluster.kmeans import cluster
from refgi.cluster.rectangle import area_lights
from refgi.cluster.settings import ValSettings
from refgi.cluster.val import val
from refgi.compare.pictures import luminance
from refgi.frame import Frame
from refgi.lights import PixelLights
from refgi.scene import Camera, Material, Scene, SpotLight
from refgi.scene.builtin.surfaces import rectangle
from refgi.scene.model import merge
from refgi.types import Array

Vector = tuple[float, float, float]

FLOOR, BOARD = Material("floor", (0.7, 0.7, 0.7)), Material("board", (0.6, 0.45, 0.3))
HALF = 1.8  # m, half a side of the floor: what is far sets the bias of the series
GRID = 12  # lights along a side of a lamp
FLUX = 40.0  # W, of a lamp
PUBLISHED, STEP = "as published: 4 terms, mip", "PCSS"
SHADOW, DEEP = 0.9, 0.1  # of the light that would come without occlusion: less is a shadow, less than that its core


class View(NamedTuple):
    """A lamp, what it shines on and who looks."""

    name: str
    title: str
    center: Vector  # of the lamp, m
    normal: Vector  # along an axis
    side: float  # m
    eye: Vector
    target: Vector
    stands: str = "body"  # what throws the shadow: "body" or "board"


def _frame(bench: Workbench, view: View, factor: float) -> Frame:
    """Return a view with a light of no use, since frames must have one."""
    standing = [placed(body(), (0.0, 0.0, 0.0), 1.0, -0.6)] if view.stands == "body" else [
        rectangle((-0.4, 0.0, 0.0), (0.8, 0.0, 0.0), (0.0, 1.0, 0.0), BOARD, "board"),
        rectangle((-HALF, 0.0, -HALF), (2 * HALF, 0.0, 0.0), (0.0, 2.0, 0.0), FLOOR, "back")]
    floor = rectangle((-HALF, 0.0, HALF), (2 * HALF, 0.0, 0.0), (0.0, 0.0, -2 * HALF), FLOOR, "floor")
    geometry, materials = merge([floor, *standing], smooth=True)
    light = SpotLight((0.0, 6.0, 0.0), (0.0, -1.0, 0.001), 0.1, 0.2, (1.0, 1.0, 1.0))
    size = max(8, round(factor * bench.scale.size))
    return Frame(Scene(view.name, geometry, materials, Camera(view.eye, view.target), (light,)), width=size,
                 height=size, rsm_resolution=8)


def _one_cluster(view: View, settings: ValSettings, diagonal: float) -> Clustered:
    """Return a lamp's lights, of equal flux in the middles of equal squares, as one cluster."""
    normal = np.asarray(view.normal, np.float64)
    first, second = np.eye(3)[np.flatnonzero(normal == 0)]
    along = view.side * ((np.arange(GRID) + 0.5) / GRID - 0.5)
    u, v = (part.ravel() for part in np.meshgrid(along, along))
    position = np.asarray(view.center)[:, None] + first[:, None] * u + second[:, None] * v
    count = position.shape[1]
    lights = PixelLights(position.astype(np.float32), np.repeat(normal[:, None], count, 1).astype(np.float32),
                         np.full((3, count), FLUX / count, np.float32), None, None, None, count)
    found = cluster(lights.position, lights.normal, 1, diagonal=diagonal)
    return Clustered(lights, found, area_lights(lights, found, settings.area))


def small_and_large(bench: Workbench, views: tuple[View, ...], fps: float) -> Figure:
    """Figure 4: the soft shadows of a small and of a larger area light ("more than" so many frames per second)."""
    settings = settings_of(bench)
    frames = {view.name: _frame(bench, view, JUDGED) for view in views}
    found = {view.name: _one_cluster(view, settings, frames[view.name].scene.geometry.diagonal) for view in views}
    seconds = interleaved({name: partial(lit_by, frame, found[name], settings) for name, frame in frames.items()},
                          bench.scale.repeats)
    shown: list[Picture] = []
    rows = []
    for view in views:
        frame, lamp = frames[view.name], found[view.name]
        right, light = rays_to(frame, lamp.lights, settings), lit_by(frame, lamp, settings)
        gallery = Gallery(frame, right, shown)
        off = errors_of(light, right, gallery.covered)
        gallery.indirect(view.name, view.title, f"RMSE {off.rmse:.1f} %", light, settings)
        gallery.indirect(f"{view.name}_rays", f"{view.title}, by rays", "a ray to each of its lights",
                         right)
        rows.append((view.title, view.side, float(lamp.areas.delta[0]), *off, 1e3 * seconds[view.name],
                     1 / seconds[view.name], fps))
    return Figure(
        facts=("the four-legged body on a floor", f"{frame.scene.face_count} faces", f"{frame.width}² pixels",
               f"map of {settings.maps.resolution}² texels"), pictures=shown,
        tables=[Table("Size of the lamp and of its area light; error against rays in % of the mean; map and light",
                      ("", "side, m", "area light, m", "RMSE", "MAE", "darker by", "ms", "fps", "fps, paper"), rows)],
        notes=("The shadow of the larger light is wider and softer, as in the paper. Against rays the pictures are "
               f"{rows[0][3]:.1f} and {rows[1][3]:.1f} % of the mean off, most of it where feet touch the floor: the "
               "bias of four terms lets light through next to a blocker.",
               f"Map, filters and light of one lamp take {rows[0][6]:.0f} and {rows[1][6]:.0f} ms; the paper draws "
               "more than 200 a second on a graphics processor, at a size it does not give."))


def failures(bench: Workbench, views: tuple[View, ...], ways: dict[str, dict[str, Any]]) -> Figure:
    """Figure 5: what soft shadows from one filtered map do wrong, and which part of the method does it."""
    shown: list[Picture] = []
    rmse: dict[str, list[float]] = {way: [] for way in ways}
    for view in views:
        frame, made = _frame(bench, view, SMALL), {}
        for way, changes in ways.items():
            settings = settings_of(bench, **changes)
            lamp = _one_cluster(view, settings, frame.scene.geometry.diagonal)
            made[way] = lit_by(frame, lamp, settings)
        right = rays_to(frame, lamp.lights, settings)
        gallery = Gallery(frame, right, shown)
        for way, light in made.items():
            rmse[way].append(errors_of(light, right, gallery.covered).rmse)
        gallery.indirect(f"{view.name}_published", view.title, f"RMSE {rmse[PUBLISHED][-1]:.1f} %", made[PUBLISHED])
        gallery.indirect(f"{view.name}_rays", f"{view.title}, by rays", "what is right", right)
        gallery.errors({f"{view.name}_published": (view.title, made[PUBLISHED])}, right)
        gallery.indirect(f"{view.name}_step", f"{view.title}, PCSS", f"RMSE {rmse[STEP][-1]:.1f} %", made[STEP])

    def said(way: str) -> str:
        return ", ".join(f"{value:.1f}" for value in rmse[way]) + " %"

    return Figure(
        facts=("one lamp, one map", f"{frame.width}² pixels", f"map of {settings.maps.resolution}² texels"),
        pictures=shown,
        tables=[Table("RMSE against rays in % of the mean, with parts of the method replaced",
                      ("", *(view.title for view in views)), [(way, *off) for way, off in rmse.items()])],
        notes=(
            f"The three pictures are {said(PUBLISHED)} off as published. Every texel of the disc, which knows no "
            f"steps between mip levels, comes to {said('4 terms, every texel')}.",
            f"Sixteen terms, whose bias is a quarter, come to {said('16 terms, every texel')}; PCSS, with "
            f"the receiver's plane and the cone towards the light, to {said(STEP)}. One hard shadow comes to "
            f"{said('one hard shadow')}.",
            "What is left with PCSS is the method's one mean depth of blockers and its round filter for a "
            "square light; next to contacts the published series lets light through where PCSS does not, as the "
            "paper says of its own."))


def behind_a_light(bench: Workbench, ways: dict[str, dict[str, Any]]) -> Figure:
    """Figure 7: three lights of different normals in one cluster, and a blocker that crosses the cluster's plane."""
    board = rectangle((-0.35, 0.5, 0.0), (0.7, 0.0, 0.0), (0.0, 0.6, 0.0), BOARD, "board")
    wall = rectangle((-HALF, 0.0, -0.6), (2 * HALF, 0.0, 0.0), (0.0, 2.0, 0.0), FLOOR, "wall")
    geometry, materials = merge([wall, board], smooth=True)
    lamp = SpotLight((0.0, 6.0, 0.0), (0.0, -1.0, 0.001), 0.1, 0.2, (1.0, 1.0, 1.0))  # of no use
    size = max(8, round(JUDGED * bench.scale.size))
    frame = Frame(Scene("plane", geometry, materials, Camera((0.9, 0.9, 2.2), (0.0, 0.8, -0.6)), (lamp,)), width=size,
                  height=size, rsm_resolution=8)
    tilt = np.sqrt(0.5)
    lights = PixelLights(np.array([[-0.02, 0.0, 0.02], [0.8] * 3, [0.8] * 3], np.float32),
                         np.array([[0.0] * 3, [tilt, 1.0, tilt], [-tilt, 0.0, tilt]], np.float32),
                         np.full((3, 3), FLUX / 3, np.float32), None, None, None, 3)
    settings = {way: settings_of(bench, **{"clusters.count": 1} | one) for way, one in ways.items()}
    made = {way: lit_by(frame, grouped(frame, lights, one), one) for way, one in settings.items()}
    right = rays_to(frame, lights, settings_of(bench))
    gallery, height = Gallery(frame, right), frame.gbuffer.position[1]
    gallery.indirect("rays", "by rays", "a ray to each of three lights", right)
    off: dict[str, list[float]] = {}
    for k, (way, light) in enumerate(made.items()):
        sides = [errors_of(light, right, gallery.covered & side).rmse for side in (height > 0.8, height <= 0.8)]
        off[way] = [errors_of(light, right, gallery.covered).rmse, *sides]
        gallery.indirect(f"way{k + 1}", way, f"RMSE {off[way][0]:.1f} %", light, settings[way])
    published, *others = off
    return Figure(
        facts=("three lights of one cluster that look up, ahead and back", f"{size}² pixels",
               "the cluster's plane is level with them, a board before the wall crosses it"), pictures=gallery.pictures,
        tables=[Table("RMSE against a ray to each light, in % of the mean: in all, above the cluster's plane and below",
                      ("what lies behind an area light", "RMSE", "above", "below"),
                      [(way, *values) for way, values in off.items()])],
        notes=("The board's shadow breaks off at the plane: below it the map knows no blocker, all is lit, "
               f"{off[published][2]:.0f} % of the mean off. What lies behind comes to "
               + ", ".join(f"{off[way][2]:.0f} % by {way}" for way in others) + ".",))


class Soft(NamedTuple):
    """How soft one scene's shadows are."""

    size: float  # mean size of area lights, cm
    here: float  # share of the shadow that is penumbra, %
    exact: float  # the same by a ray to each light
    rmse: float  # % of the mean


def soft_and_crisp(bench: Workbench, titles: dict[str, str]) -> Figure:
    """Figure 13: soft and crisp indirect shadows, from a wide and from a narrow spot."""
    shown: list[Picture] = []
    found, settings = {}, settings_of(bench)
    for name, title in titles.items():
        small = frame_of(bench, name, SMALL)
        exact = shadowed(bench, small, settings)
        found[name] = one = _measured(small, settings, exact)
        light = val(frame := frame_of(bench, name), settings)
        gallery = Gallery(frame, light, shown)
        gallery.camera(f"{name}_seen", title, "with direct light", light, settings)
        gallery.indirect(f"{name}_indirect", f"{title}, indirect light",
                         f"{one.here:.0f} % of the shadow is penumbra", light)
        Gallery(small, exact, shown).indirect(f"{name}_rays", f"{title}, a ray to each light",
                                              f"{one.exact:.0f} % of the shadow", exact)
    wide, narrow = found["wide"], found["narrow"]
    return Figure(
        facts=("the four-legged body in the Cornell box", f"{settings.lights.count} lights",
               "spots of equal flux at the left wall", f"judged at {small.width}²"), pictures=shown,
        tables=[Table("Shadows: pixels that get less than 90 % of what would come without occlusion, and how many of "
                      "them get more than 10 %", ("", "size of an area light, cm", "penumbra, %",
                                                  "penumbra by rays, %", "RMSE, % of the mean"),
                      [(titles[name], *one) for name, one in found.items()])],
        notes=(
            f"Of the shadow {wide.here:.0f} % is penumbra under the wide spot and {narrow.here:.0f} % under the narrow "
            f"one; by a ray to each light {wide.exact:.0f} and {narrow.exact:.0f} %. Area lights are {wide.size:.1f} "
            f"cm wide there and {narrow.size:.1f} cm here: their size alone decides, as in the paper.",
            f"The RMSE against those rays is {wide.rmse:.1f} % of the mean under the wide spot and {narrow.rmse:.1f} % "
            "under the narrow one, whose shadows lie on top of each other and hide nothing."))


def _measured(frame: Frame, settings: ValSettings, exact: Array) -> Soft:
    free, light = val(frame, dataclasses.replace(settings, visibility=None)), val(frame, settings)
    covered, areas = frame.gbuffer.covered, clustered(frame, settings).areas
    used = areas.members > 0
    size = 100 * float(areas.delta[used].mean()) if used.any() else 0.0
    return Soft(size, penumbra(light, free, covered), penumbra(exact, free, covered),
                errors_of(light, exact, covered).rmse)


def penumbra(light: Array, free: Array, covered: Array) -> float:
    """Return how much of the shadow is penumbra, in per cent; `free` is irradiance without occlusion."""
    most = luminance(free)
    judged = covered & (most > 0)
    share = np.divide(luminance(light), most, out=np.ones_like(most), where=judged)[judged]
    shadow = share < SHADOW
    return 100 * int(np.count_nonzero(shadow & (share > DEEP))) / max(1, int(np.count_nonzero(shadow)))
