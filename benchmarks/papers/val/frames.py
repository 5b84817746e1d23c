"""Whole frames and their time (Figure 1, Tables 1 and 2), and the error by the number of area lights (Figure 10)."""

import statistics
import time
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from benchmarks.harness import interleaved, own_seconds
from benchmarks.papers.records import Bar, Cell, Figure, Picture, Plot, Ratios, Table, relative
from benchmarks.papers.val.subjects import (
    AREA_LIGHTS,
    ATRIUM,
    BOX,
    HORSE,
    JUDGED,
    PAPER_SIZE,
    TITLES,
    clamped,
    drawing,
    frame_of,
    published,
    scene_of,
    settings_of,
    shadowed,
    timed_size,
)
from benchmarks.papers.workbench import Gallery, Workbench, errors_of
from refgi.cluster.settings import ValSettings
from refgi.cluster.val import val
from refgi.compare.pages import Axes, Curve, curves_plot
from refgi.scene import Scene
from refgi.stages import observe


def by_area_lights(bench: Workbench, scene: str, shown: tuple[int, ...], further: tuple[int, ...],
                   kinds: dict[str, str]) -> Figure:
    """Figure 10: more and more area lights, to one for every light; beside it a ray to each and path tracing.

    PCSS, which reads every texel, is drawn up to the paper's number of area lights.
    """
    frame, settings = frame_of(bench, scene, JUDGED), settings_of(bench)
    right, traced = shadowed(bench, frame, settings), bench.traced(frame).mean
    gallery, most = Gallery(frame, right), settings.lights.count
    rmse: dict[tuple[str, int], float] = {}  # % of the mean, against a ray to each light
    truth, seconds = {}, {}  # of the series: MAE against path tracing, s
    for m in (*shown, *(n for n in further if shown[-1] < n < most), most):
        for kind in kinds if m <= AREA_LIGHTS else ("csm", "hard") if m == most else ("csm",):
            started = time.perf_counter()
            light = val(frame, settings_of(bench, clusters_count=m, visibility=kind))
            taken = time.perf_counter() - started
            rmse[kind, m] = errors_of(light, right, gallery.covered).rmse
            if kind == "csm":
                seconds[m], truth[m] = taken, errors_of(light, traced, gallery.covered).mae
                if m in shown:
                    gallery.indirect(f"areas{m}", f"{m} area lights", f"RMSE {rmse[kind, m]:.1f} %", light)
                if m == AREA_LIGHTS:
                    usual = light
    title = f"{AREA_LIGHTS} area lights"
    block = val(frame, published(bench, frame.scene))
    gallery.indirect("rays", "a ray to each light", f"{settings.lights.count} lights", right)
    gallery.indirect("traced", "path tracing", "without pixel lights", traced)
    gallery.indirect("interleaved", f"{title}, interleaved", "8 x 8 and blurred", block)
    gallery.camera("seen", title, "with direct light", usual)
    gallery.errors({f"areas{AREA_LIGHTS}": (title, usual)}, right)
    vpl_off = errors_of(right, traced, gallery.covered).mae
    off = errors_of(block, val(frame, clamped(bench, frame.scene)), gallery.covered).mae
    counts = sorted(seconds)
    rows: list[tuple[Cell, ...]] = [(str(m), *(rmse.get((kind, m)) for kind in kinds), truth[m], 1e3 * seconds[m])
                                    for m in counts]
    curves = [Curve(said, [m for m in counts if (kind, m) in rmse],
                    [rmse[kind, m] for m in counts if (kind, m) in rmse], kind == "hard")
              for kind, said in kinds.items()]
    curves.append(Curve("series, MAE against path tracing", counts, [truth[m] for m in counts], True))
    slope = float(np.polyfit(np.log(shown), np.log([rmse["csm", m] for m in shown]), 1)[0])
    return Figure(
        facts=(frame.scene.description, f"{frame.width}² pixels", f"{settings.lights.count} lights",
               f"path tracing with {bench.scale.truth_samples} samples a pixel"), pictures=gallery.pictures,
        tables=[Table("RMSE in % of the mean, by number of area lights",
                      ("area lights", *kinds.values(), "series, MAE against path tracing", "ms, series"),
                      [*rows, ("a ray to each light", 0.0, 0.0, 0.0, vpl_off, None)])],
        plots=[Plot(curves_plot(curves, Axes("area lights", "RMSE, % of the mean", log_x=True, log_y=True)),
                    "Error against a ray to each light over the number of area lights.")],
        notes=(
            f"From 2 to {AREA_LIGHTS} area lights the RMSE against a ray to each light falls from "
            f"{rmse['csm', 2]:.1f} to {rmse['csm', AREA_LIGHTS]:.1f} % of the mean, about as their "
            f"number to the {slope:.2f}. One hard shadow for each area light comes to "
            f"{rmse['hard', 2]:.1f} and {rmse['hard', AREA_LIGHTS]:.1f} %, and PCSS to "
            f"{rmse['pcss', 2]:.1f} and {rmse['pcss', AREA_LIGHTS]:.1f} %: what soft shadows gain in RMSE, the "
            "bias of four terms takes back the more, the smaller the area lights; what is left of their worth is that "
            "bands turn into gradients.",
            f"With {most} area lights it is {rmse['csm', most]:.1f} %: each light is then its own area light "
            "without a size, one texel of a depth map is compared, and only the map's texels are left of the error. "
            "Between, clusters of two or three lights still have the series' bias, which does not shrink with them.",
            f"Against path tracing the MAE of the same lights with rays is {vpl_off:.1f} %, of {title} "
            f"{truth[AREA_LIGHTS]:.1f} %: the number of lights decides, not that of area lights. Bright dots where "
            "walls meet are lights next to a receiver, clamped by the disc that each stands for as in the reference.",
            f"Interleaved over 8 x 8 pixels and blurred, as the paper's pictures, {title} are another "
            f"{off:.1f} % (MAE) off what they come to without."))


def one_frame(bench: Workbench, name: str, fps: float) -> Figure:
    """Figure 1: the body in the box, lit once around, with the time of its frame."""
    scene, frame = scene_of(bench, name), frame_of(bench, name, timed_size(bench) / bench.scale.size)
    ways = {"interleaved and blurred": published(bench, scene), "all lights at every pixel": clamped(bench, scene)}
    seconds = interleaved({title: drawing(bench, scene, one) for title, one in ways.items()}, bench.few)
    light = {title: val(frame, one) for title, one in ways.items()}
    block, full = ways
    small, usual = frame_of(bench, name, JUDGED), settings_of(bench)
    gallery = Gallery(frame, light[full])
    off = {block: errors_of(light[block], light[full], gallery.covered),
           full: errors_of(val(small, usual), shadowed(bench, small, usual), small.gbuffer.covered)}
    gallery.camera("seen", "one bounce", f"{1 / seconds[block]:.1f} frames per second", light[block], ways[block])
    gallery.camera("direct", "direct light alone", "what is left without", np.zeros_like(light[block]))
    gallery.indirect("indirect", "indirect light alone", block, light[block], ways[block])
    gallery.indirect("full", "indirect light alone", full, light[full], ways[full])
    return Figure(
        facts=(scene.description, f"{scene.face_count} faces", f"{frame.width}² pixels",
               f"{ways[block].lights.count} lights", f"{AREA_LIGHTS} area lights"), pictures=gallery.pictures,
        tables=[Table("Whole frames; error in % of the mean irradiance: of all lights against a ray to each, of "
                      "interleaving against all lights at every pixel",
                      ("", "ms", "fps", "fps, paper", "RMSE", "MAE", "darker by"),
                      [(title, 1e3 * taken, 1 / taken, fps if title == block else None, *off[title])
                       for title, taken in seconds.items()])],
        notes=(f"The frame takes {1e3 * seconds[block]:.0f} ms on two cores, {1 / seconds[block]:.1f} a second, on the "
               "paper's graphics processor of 2006 and at its 800 x 800 pixels 51 ms. Nothing is kept from frame to "
               "frame.",
               f"Without interleaving it takes {1e3 * seconds[full]:.0f} ms. 30 area lights in place of a ray to each "
               f"light cost {off[full].rmse:.1f} % of the mean (RMSE), interleaving and its blur another "
               f"{off[block].rmse:.1f} %: light that is smoothed over edges of shadow, and what 64 neighbours with "
               "different lights leave of their pattern."))


def four_scenes(bench: Workbench, faces: dict[str, str], fps: dict[str, float]) -> Figure:
    """Table 1: frames per second of four scenes; their faces in the paper are told as printed."""
    scenes = {name: scene_of(bench, name) for name in TITLES}
    block = {name: published(bench, scene) for name, scene in scenes.items()}
    seconds = interleaved({name: drawing(bench, scene, block[name]) for name, scene in scenes.items()}, bench.few)
    rate = {name: 1 / taken for name, taken in seconds.items()}
    shown: list[Picture] = []
    for name, title in TITLES.items():
        gallery = Gallery(frame_of(bench, name), shown=shown)
        gallery.camera(name.replace(" ", "_"), title, f"{scenes[name].face_count} faces",
                       val(gallery.frame, block[name]), block[name])
    return Figure(
        facts=(f"{timed_size(bench)}² pixels", f"{block[BOX].lights.count} lights", f"{AREA_LIGHTS} area lights",
               "whole frames, nothing kept from one to the next", f"medians of {bench.few}"), pictures=shown,
        ratios=[relative("frames per second, relative to the Cornell box",
                         {TITLES[name]: one for name, one in rate.items()},
                         {TITLES[name]: one for name, one in fps.items()})],
        tables=[Table("Frames per second", ("", "faces, paper", "faces", "ms", "fps", "fps, paper"),
                      [(title, faces[name], scenes[name].face_count, 1e3 * seconds[name], rate[name], fps[name])
                       for name, title in TITLES.items()])],
        notes=(
            f"The scene of 98 thousand faces comes to {rate[ATRIUM] / rate[BOX]:.2f} of the plain box's rate, in the "
            f"paper to {fps[ATRIUM] / fps[BOX]:.2f}: there and here all faces are drawn into 30 maps, here by two "
            "cores instead of a graphics processor, but only those that may occlude anything.",
            f"The four rates are {', '.join(f'{one:.1f}' for one in rate.values())} at {timed_size(bench)}² pixels, "
            f"the paper's {', '.join(f'{one:g}' for one in fps.values())} at {PAPER_SIZE}² on a graphics processor of "
            "2006."))


class Step(NamedTuple):
    """One line of Table 2."""

    title: str
    stages: tuple[str, ...]  # how their names begin
    paper_ms: float


STEPS = (Step("deferred rendering", ("rsm.gbuffer", "rsm.resolve", "rsm.rasterize", "rsm.direct", "rsm.shadow_map",
                                     "rsm.lamp_irradiance", "rsm.facing", "frame."), 0.4),
         Step("VPL generation", ("rsm.reflective", "lights.", "rsm.solid_angles"), 0.1),
         Step("VAL clustering", ("cluster.kmeans", "cluster.area_lights"), 0.5),
         Step("CSSM", ("cluster.shadow_maps", "cluster.occluders", "cluster.blockers", "cluster.distances",
                       "cluster.seen_vertices", "rsm.paraboloid"), 4.2),
         Step("indirect illumination", ("cluster.irradiance", "cluster.visibility", "pairs."), 35.0),
         Step("geometry-aware blur", ("cluster.blur",), 10.7))
REST = "all else"  # between stages: memory, arrays that are laid out anew
ALL = "all lights"


def steps(bench: Workbench) -> Figure:
    """Table 2: where the time of a frame goes."""
    usual, large = (HORSE, "interleaved"), (ATRIUM, "interleaved")
    settings = {(name, way): (clamped if way == ALL else published)(bench, scene_of(bench, name))
                for name, way in (usual, (HORSE, ALL), large)}
    spent = {key: _profile(bench, scene_of(bench, key[0]), one) for key, one in settings.items()}
    paper = sum(step.paper_ms for step in STEPS)
    columns = ("", *(f"{TITLES[name]}, {way}, {unit}" for name, way in spent for unit in ("ms", "%")), "ms, paper",
               "%, paper")
    printed: Mapping[str, float | None] = {step.title: step.paper_ms for step in STEPS} | {REST: None, "frame": paper}

    def row(title: str, ms: float | None) -> list[Cell]:
        here = [value for one in spent.values() for value in (1e3 * one[title], 100 * one[title] / one["frame"])]
        return [title, *here, ms, None if ms is None else 100 * ms / paper]

    def share(step: int, key: tuple[str, str] = usual) -> str:
        return f"{100 * spent[key][STEPS[step].title] / spent[key]['frame']:.0f} %"

    return Figure(
        facts=(*(f"{TITLES[name]}: {scene_of(bench, name).face_count} faces" for name in (HORSE, ATRIUM)),
               f"{timed_size(bench)}² pixels", f"{settings[usual].lights.count} lights",
               f"{AREA_LIGHTS} area lights"),
        ratios=[Ratios("per cent of a frame's time, Cornell Horse, interleaved", [
            Bar(step.title, 100 * spent[usual][step.title] / spent[usual]["frame"], 100 * step.paper_ms / paper)
            for step in STEPS])],
        tables=[Table("Time by step", columns, [row(title, ms) for title, ms in printed.items()])],
        notes=(
            f"Indirect illumination takes {share(4)} of the frame (paper: 69 %), the blur {share(5)} (21 %), the "
            f"shadow maps {share(3)} (8 %), buffers and direct light {share(0)} (1 %): cores have no units that draw "
            "triangles or filter textures, so what those did for next to nothing has its price here.",
            "The shadow maps hold the search for faces that may occlude anything at all, which bodies at rest would "
            "need once. Series and mip levels of a map are built where they are looked up, inside the indirect "
            "illumination, so that they stay in the cache: the paper counts them with its shadow maps.",
            f"In the scene of 98 thousand faces shadow maps take {share(3, large)} and indirect illumination "
            f"{share(4, large)}. Without interleaving and blur the frame of the Cornell Horse takes "
            f"{spent[HORSE, ALL]['frame'] / spent[usual]['frame']:.1f} times as long: an area light's visibility is "
            "looked up once for all of its lights at a pixel, so a 64th of the lights is not a 64th of the work."))


def _profile(bench: Workbench, scene: Scene, settings: ValSettings) -> dict[str, float]:
    """Return median seconds of each step, of what lies between them, and of the frame."""
    draw = drawing(bench, scene, settings)
    draw()
    found = []
    for _ in range(bench.few):
        with observe() as log:
            started = time.perf_counter()
            draw()
            whole = time.perf_counter() - started
        own = own_seconds(log.runs)
        parts = {step.title: sum(taken for name, taken in own.items() if name.startswith(step.stages))
                 for step in STEPS}
        found.append(parts | {REST: whole - sum(parts.values()), "frame": whole})
    return {key: statistics.median(one[key] for one in found) for key in found[0]}
