"""How far pictures are off: by criteria (Figures 1, 11, 12), beside path tracing (Figure 13), at edges (Figure 15)."""

import math
from functools import partial
from typing import Any

import numpy as np
from scipy.ndimage import binary_dilation

from benchmarks.harness import interleaved
from benchmarks.papers.multires.subjects import (
    LARGE,
    count_of,
    drawing,
    every_texel,
    frame_of,
    full_sum,
    least_distance,
    levels_of,
    scene_of,
    settings_of,
    unclamped,
)
from benchmarks.papers.records import Case, Figure, Picture, Table, relative
from benchmarks.papers.workbench import Errors, Gallery, Workbench, errors_of, seen_by
from refgi.compare.pictures import DIVERGING, Scale, luminance
from refgi.frame import Frame
from refgi.lights.shares import with_equal_solid_angles
from refgi.pairs.settings import DistanceClamp
from refgi.scene import Camera, Material, Scene, SpotLight
from refgi.scene.builtin.surfaces import rectangle
from refgi.scene.model import Mesh, merge
from refgi.settings import of, replaced
from refgi.splat.gather import GatherSettings, gather
from refgi.splat.multires import MultiresSettings, multires
from refgi.types import Array

WHOLE_MAP = 1.4143  # map widths: a disc past every corner
WHITE, RED = Material("white", (0.7, 0.7, 0.7)), Material("sender", (0.8, 0.5, 0.35))
AWAY, HALF = 2.0, 0.5  # m from camera to wall; half of what the camera sees of the wall
PLATE = 0.5  # m, of the plate from the wall
NEAR = 32  # its artefact is measured within this part of the picture's side, to either side of the edge


def surface_detail(bench: Workbench, scene: str, cases: tuple[Case, ...]) -> Figure:
    """Figure 11: a low and a high normal threshold, and surface detail by Eq. 3 in place of what the high one loses."""
    frame, large, model = frame_of(bench, scene), frame_of(bench, scene, LARGE), scene_of(bench, scene)
    settings = {c.name: settings_of(bench, scene, **c.settings) for c in cases}
    work: dict[str, Any] = {name: drawing(bench, model, one) for name, one in settings.items()}
    work |= {f"{name} alone": partial(multires, large, one) for name, one in settings.items()}
    seconds = interleaved(work, bench.scale.repeats)
    counts = {name: count_of(large, one) for name, one in settings.items()}
    full, bare = full_sum(frame, settings["low"]), full_sum(frame, unclamped(settings["low"]))
    made = {name: multires(frame, one) for name, one in settings.items()}
    gallery, rows = Gallery(frame, full), []
    off = {name: errors_of(light, full, gallery.covered) for name, light in made.items()}
    for c in cases:
        gallery.indirect(c.name, c.title, f"RMSE {off[c.name].rmse:.1f} %, {1 / seconds[c.name]:.1f} frames per second",
                         made[c.name], settings[c.name])
        without = errors_of(multires(frame, unclamped(settings[c.name])), bare, gallery.covered)
        rows.append((c.title, 1e3 * seconds[c.name], 1 / seconds[c.name], c.printed, 1e3 * seconds[f"{c.name} alone"],
                     counts[c.name], *off[c.name], without.rmse))
    gallery.indirect("full", "every pixel", "the same lights, what all three stand for", full)
    lit = Gallery(frame_of(bench, scene, shadows="exact"), shown=gallery.pictures)  # texels of a map are no detail
    for c in cases:
        lit.camera(f"{c.name}_seen", c.title, "with direct light", made[c.name])
    better = "less" if off["detail"].rmse < off["high"].rmse else "more"
    return Figure(
        facts=(model.description, f"{model.face_count} faces", f"times and subsplats at {2 * bench.scale.size}²",
               f"{settings['low'].lights.count} lights"),
        pictures=gallery.pictures,
        ratios=(relative("frames per second, relative to a threshold of 0.25",
                         {c.title: 1 / seconds[c.name] for c in cases}, {c.title: c.printed for c in cases}),
                relative("the same of the indirect part alone",
                         {c.title: 1 / seconds[f"{c.name} alone"] for c in cases}, {})),
        tables=[Table("Speed of whole frames, and error against the same lights at every pixel in % of the mean",
                      ("", "ms", "fps", "fps, paper", "ms, indirect part", "subsplats", "RMSE", "MAE", "darker by",
                       "RMSE, no clamp"), rows)],
        notes=(
            f"The high threshold leaves {counts['high'] / counts['low']:.2f} of the subsplats and draws frames "
            f"{seconds['low'] / seconds['high']:.2f} times as fast, the indirect part "
            f"{seconds['low alone'] / seconds['high alone']:.2f} times, the paper 4 times: its frame is all splats, "
            "this one's shadow map, buffers and direct light stay. The RMSE rises from "
            f"{off['low'].rmse:.1f} to {off['high'].rmse:.1f} % of the mean.",
            f"Eq. 3 costs {1e3 * (seconds['detail alone'] - seconds['high alone']):+.1f} ms and only ever darkens: it "
            f"takes {off['detail'].lost - off['high'].lost:.0f} % of the light away. It looks like the lost detail and "
            f"is not it: its RMSE is {off['detail'].rmse:.1f} %, {better} than the {off['high'].rmse:.1f} % without."))


def two_pictures(bench: Workbench, scene: str, part: int) -> Figure:
    """Figure 1: direct light alone, and with indirect light refined to a part of the picture's resolution."""
    frame, base = frame_of(bench, scene, shadows="exact"), settings_of(bench, scene)
    levels = levels_of(frame, (frame.width // part, frame.width))
    settings = {f"at {n}²": replaced(base, {"finest": level}) for n, level in levels.items()}
    full, gallery = full_sum(frame, base), Gallery(frame)
    gallery.camera("direct", "direct light alone", "what is left without", np.zeros_like(full))
    rows = []
    for title, one in settings.items():
        light, count = multires(frame, one), count_of(frame, one)
        rows.append((title, count, *errors_of(light, full, gallery.covered)))
        gallery.camera(f"seen{len(rows)}", f"indirect light {title}", f"{count} subsplats", light, one)
    return Figure(
        facts=(frame.scene.description, f"{frame.width}² pixels", f"{base.lights.count} lights"),
        pictures=gallery.pictures,
        tables=[Table("Subsplats, and errors against the same lights at every pixel in % of the mean",
                      ("finest", "subsplats", "RMSE", "MAE", "darker by"), rows)],
        notes=(f"Refined to half the resolution as the paper's, indirect light is {rows[0][2]:.1f} % off (RMSE) with "
               f"{rows[0][1]} subsplats, to all of it {rows[1][2]:.1f} % with {rows[1][1]}.",))


def rows_of_criteria(bench: Workbench, scenes: dict[str, str], ways: dict[str, dict[str, Any]]) -> Figure:
    """Figure 12: several scenes by direct light alone and with subsplats refined by each of the criteria."""
    shown: list[Picture] = []
    found: dict[tuple[str, str], tuple[int, Errors]] = {}
    for k, (way, changes) in enumerate(ways.items()):
        for name, title in scenes.items():
            frame = frame_of(bench, name, shadows="exact")
            settings = settings_of(bench, name, **changes)
            full = bench.once(("every pixel", name), partial(full_sum, frame, settings))
            gallery = Gallery(frame, shown=shown)
            if not k:
                gallery.camera(f"{name}_direct", title, "direct light alone", np.zeros_like(full))
            light = multires(frame, settings)
            found[way, name] = count_of(frame, settings), errors_of(light, full, gallery.covered)
            gallery.camera(f"{name}_{k + 1}", f"{title}, {way}", f"{found[way, name][0]} subsplats", light, settings)
    rows: list[tuple[Any, ...]] = [
        (way, *(found[way, name][0] for name in scenes), *(found[way, name][1].rmse for name in scenes))
        for way in ways]
    low, high, fine, coarse, detail = (np.array(row[1:], float).reshape(2, -1) for row in rows)

    def span(values: Array) -> str:
        return f"{values.min():.2f} to {values.max():.2f}"

    return Figure(
        facts=(f"{frame.width}² pixels", f"{settings.lights.count} lights", "bodies stand in for the paper's"),
        pictures=shown,
        tables=[Table("Subsplats, and RMSE against the same lights at every pixel in % of the mean",
                      ("", *scenes.values(), *(f"{title}, RMSE" for title in scenes.values())), rows)],
        notes=(
            f"The high threshold of curvature leaves {span(high[0] / low[0])} of the subsplats of the low one, that of "
            f"normals {span(coarse[0] / fine[0])}; the RMSE rises {span(high[1] / low[1])} and "
            f"{span(coarse[1] / fine[1])} times.",
            f"Detail by Eq. 3 costs no subsplat and leaves {span(detail[1] / coarse[1])} of the RMSE of the same "
            "threshold without: a look, not a nearer picture, where that is above 1."))


def beside_path_tracing(bench: Workbench, scene: str) -> Figure:
    """Figure 13: the method beside every pixel, gathering, every texel and path tracing; clamp, equal solid angles."""
    frame, settings = frame_of(bench, scene), settings_of(bench, scene)
    unshadowed, truth = (bench.traced(frame, visibility=visible).mean for visible in (False, True))
    gallery, bare = Gallery(frame, unshadowed), unclamped(settings)
    equal = replaced(bare, {"as_published": "equal_solid_angle"})
    made = {"multires": ("multiresolution splatting", multires(frame, settings)),
            "naive": ("the same lights, every pixel", full_sum(frame, settings)),
            "gather": ("gathering, 1024 samples",
                       gather(frame, of(GatherSettings, samples=1024, interpolation="none", radius=WHOLE_MAP))),
            "multires_bare": ("multiresolution, no clamp", multires(frame, bare)),
            "texels_clamped": ("every texel, clamped", every_texel(frame, settings)),
            "texels": ("every texel, no clamp", every_texel(frame, bare)),
            "equal": ("every texel, equal solid angles", every_texel(frame, equal))}
    against = {name: [errors_of(light, right, gallery.covered) for right in (unshadowed, truth)]
               for name, (_, light) in made.items()}
    for name, (title, light) in made.items():
        gallery.indirect(name, title, f"MAE {against[name][0].mae:.0f} % without, {against[name][1].mae:.0f} % with "
                         "visibility", light)
    gallery.indirect("unshadowed", "path tracing, no visibility", "what all of these leave out", unshadowed)
    gallery.indirect("truth", "path tracing", "one bounce", truth)
    exact, less = (luminance(made[name][1]) for name in ("texels", "equal"))
    ratio = np.divide(less, exact, out=np.ones_like(exact), where=exact > 0)
    gallery.mapped("equal_ratio", "equal over exact solid angles", "blue: too dim, red: too bright, up to 25 %",
                   ratio.astype(np.float32), Scale(0.75, 1.25, DIVERGING, "ratio"))
    near, clamp, changed = (errors_of(made[a][1], made[b][1], gallery.covered) for a, b in (
        ("multires", "naive"), ("texels_clamped", "texels"), ("equal", "texels")))
    solid, every = _solid_angle_ratios(frame), against["texels"]
    return Figure(
        facts=(scene, f"{settings.lights.count} lights, clamped at {least_distance(bench, scene):.3g} m"),
        pictures=gallery.pictures,
        tables=(Table("Errors, in % of the mean irradiance",
                      ("", *(f"{what}, {which} visibility" for which in ("no", "with")
                             for what in ("RMSE", "MAE", "darker by"))),
                      [(title, *against[name][0], *against[name][1]) for name, (title, _) in made.items()]),
                Table("Exact over equal solid angle of this spot's texels, and in closed form",
                      ("", "here", "closed form"), solid)),
        notes=(
            f"The method differs from the same lights at every pixel by an RMSE of {near.rmse:.1f} % and a MAE of "
            f"{near.mae:.1f} % of the mean; the paper calls the two near indistinguishable.",
            f"The clamp loses {clamp.lost:.0f} % of the energy of every texel. That no clamp is needed with every "
            "texel holds for how bright a single dot is, not for the sum: its RMSE to path tracing without visibility "
            f"is {every[0].rmse:.0f} % with a MAE of {every[0].mae:.1f} %, from pixels beside edges that the light's "
            "own texels touch.",
            f"None of these knows what blocks indirect light: every texel is {-every[1].lost:.0f} % too bright for "
            f"path tracing. Of the paper's three differences the clamp makes {clamp.mae:.1f} % of the mean (MAE), "
            f"equal solid angles {changed.mae:.1f} %, visibility {every[1].mae:.1f} %.",
            f"Equal solid angles give a texel in the middle of the cone 1 / {solid[0][1]:.2f} of its light and one at "
            f"the rim 1 / {solid[1][1]:.2f}; indirect light changes by {changed.mae:.1f} % of the mean, dimmer where "
            "the spot's middle shines and brighter where its rim does. Exact solid angles are the default."))


def _solid_angle_ratios(frame: Frame) -> list[tuple[str, float, float]]:
    """Return how much more than an equal share a spot's texels in the middle and at the rim subtend: here, closed form.

    Within its cone a texel's density of solid angle is cos^3, its mean 2 (1 - cos) / tan^2 of the half angle.
    """
    rsm = frame.rsms[0]
    light: Any = rsm.light
    cosine, tangent = math.cos(light.outer_half_angle), math.tan(light.outer_half_angle)
    middle = tangent**2 / (2 * (1 - cosine))
    exact, equal = rsm.solid_angle, with_equal_solid_angles(rsm).solid_angle
    inside = np.asarray(exact != equal)
    share = np.divide(exact, equal, out=np.ones_like(exact), where=inside)[inside]
    return [("in the middle", float(share.max()), middle), ("at the rim", float(share.min()), middle * cosine**3)]


def edges(bench: Workbench, scene: str, rules: dict[str, dict[str, Any]], seconds: dict[str, float]) -> Figure:
    """Figure 15: an edge on the border of cells and one along their diagonals, with and without the rules against them.

    The paper's relative times of a frame are "2-3 percent" and "as much as a 40 percent speed penalty".
    """
    rows: list[tuple[Any, ...]] = []
    shown: list[Picture] = []
    for name, title, plate, selected in (("border", "edge on a border", _level_plate(), ("no rule", "rim")),
                                      ("diagonal", "diagonal edge", _tilted_plate(), ("no rule", "corner", "literal"))):
        frame = seen_by(bench, _before_a_wall(plate))
        settings = {rule: of(MultiresSettings, clamp=DistanceClamp(0.1), **one) for rule, one in rules.items()}
        made = {rule: multires(frame, one) for rule, one in settings.items()}
        full, near = full_sum(frame, settings["no rule"]), _near_the_edge(frame)
        gallery = Gallery(frame, full, shown)
        titled = {f"{name}_{rule.replace(' ', '_')}": (f"{title}, {rule}", made[rule]) for rule in selected}
        for key, (said, light) in titled.items():
            gallery.indirect(key, said, "interpolated", light)
        gallery.indirect(f"{name}_blocks", f"{title}, no rule", "not interpolated",
                         multires(frame, replaced(settings["no rule"], {"upsampling": "nearest"})))
        gallery.errors(titled, full)
        rows += [(f"{title}, {rule}", count_of(frame, one), errors_of(made[rule], full, gallery.covered).rmse,
                  errors_of(made[rule], full, gallery.covered & near).rmse) for rule, one in settings.items()]
    usual = {rule: settings_of(bench, scene, **changes) for rule, changes in rules.items()}
    taken = interleaved({rule: drawing(bench, scene_of(bench, scene), one) for rule, one in usual.items()},
                        bench.scale.repeats)
    counts = {rule: count_of(frame_of(bench, scene, LARGE), one) for rule, one in usual.items()}
    more, longer = ({rule: value[rule] / value["no rule"] for rule in rules} for value in (counts, taken))
    artefact = {title: off for title, _, _, off in rows}

    def near_edge(edge: str, *rules: str) -> str:
        return ", ".join(f"{artefact[f'{edge}, {rule}']:.2f} % ({rule})" for rule in rules)

    return Figure(
        facts=("a plate before a wall, lit from one side", "256 lights", f"costs: {scene_of(bench, scene).name}"),
        pictures=shown,
        ratios=[relative("time of a frame, relative to no rule", taken, dict(seconds))],
        tables=(Table("Subsplats, and errors against every pixel in % of the mean: in all, and within "
                      f"{bench.scale.size // NEAR} pixels of the edge",
                      ("", "subsplats", "RMSE", "RMSE near the edge"), rows),
                Table("What the rules cost on the dragon's stand-in",
                      ("rule", "subsplats", "times as many", "times the time"),
                      [(rule, counts[rule], more[rule], longer[rule]) for rule in rules])),
        notes=(
            "Near the edge on a border the error is "
            f"{near_edge('edge on a border', 'no rule', 'corner', 'literal', 'rim')} of the mean; near the diagonal "
            f"one {near_edge('diagonal edge', 'no rule', 'corner', 'literal', 'all eight', 'rim')}.",
            f"The dragon's stand-in has {more['rim']:.2f} times the subsplats with a rim and takes "
            f"{longer['rim'] - 1:+.0%} of time (paper: up to 40 %).",
            f"What the paper says of diagonals, read to the letter, gives {more['literal']:.2f} times the subsplats "
            f"and {longer['literal'] - 1:+.0%} of time where the paper has 2 to 3 %: its rule may be another. It "
            "hardly mends this edge, nor does the default, refining across a bare corner alone "
            f"({more['corner']:.2f} times, {longer['corner'] - 1:+.0%}). All eight neighbours do, with "
            f"{more['all eight']:.2f} times the subsplats, or a rim: more than the default is to take from every other "
            "figure, so the edge stays as wrong as the table says."))


def _level_plate() -> Mesh:
    """Return a plate whose upper edge lies on the axis of view: on the border of cells of every level."""
    return rectangle((-2.0, -2.0, PLATE), (4.0, 0.0, 0.0), (0.0, 2.0, 0.0), WHITE, "plate")


def _tilted_plate() -> Mesh:
    """Return a square plate on its corner: its edges run through corners of cells."""
    reach = HALF * (AWAY - PLATE) / AWAY  # half the picture, where the plate stands
    return rectangle((-reach, 0.0, PLATE), (reach, -reach, 0.0), (reach, reach, 0.0), WHITE, "plate")


def _before_a_wall(plate: Mesh) -> Scene:
    wall = rectangle((-2.0, -2.0, 0.0), (4.0, 0.0, 0.0), (0.0, 4.0, 0.0), WHITE, "wall")
    sender = rectangle((-0.6, -1.0, 1.0), (0.0, 0.0, -1.0), (0.0, 2.0, 0.0), RED, "sender")
    geometry, materials = merge([wall, sender, plate])
    camera = Camera((0.0, 0.0, AWAY), (0.0, 0.0, 0.0), vfov=2 * math.atan(HALF / AWAY))
    light = SpotLight((1.5, 0.3, 0.75), (-1.0, -0.1, -0.12), math.radians(14), math.radians(18), (9.0, 9.0, 9.0))
    return Scene("edge", geometry, materials, camera, (light,))


def _near_the_edge(frame: Frame) -> Array:
    front = frame.gbuffer.depth < AWAY - PLATE / 2
    reach = max(1, frame.height // NEAR)
    near: Array = binary_dilation(front, iterations=reach) & binary_dilation(~front, iterations=reach)
    return near
