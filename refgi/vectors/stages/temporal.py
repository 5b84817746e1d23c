"""Temporal coherence as a chain of stages: reprojection, entering pixels, clamp of earlier light, blend (HSS 3.3)."""

import math
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from refgi.rsm.raster.projection import Projection, camera_projection
from refgi.scene import Scene
from refgi.sssil.settings import TemporalSettings
from refgi.sssil.temporal.entering import fetch_entering
from refgi.sssil.temporal.filter import blend
from refgi.sssil.temporal.neighbourhood import clamp_to_neighbourhood
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run, Spec
from refgi.vectors.stages.buffers import VECTOR, _add_ids, _add_surface, _give_maps, _map_names
from refgi.vectors.stages.direct import _upside_down
from refgi.vectors.stages.reprojection import FORM, FRAMES, LIGHT, add_motion, add_reprojection, view_before


def add_temporal(
    recipe: Recipe, scene: Scene, before: Scene, size: tuple[int, int], settings: TemporalSettings,
    lights: tuple[Array, Array, Array],
) -> None:
    """Add the blend of a frame with that before.

    `lights`: filtered light of the frame before (3, h, w), in how many frames its surfaces were found, and the light of
    this frame as computed.
    """
    maps = camera_projection(before.camera, *size)
    view = camera_projection(scene.camera, *size)
    _give_maps(recipe, "before", maps)
    moved = not np.array_equal(scene.geometry.vertices, before.geometry.vertices)
    if not moved:
        _add_ids(recipe, "before", "before", maps, before)
        _add_surface(recipe, "before", "before", maps, before, ("depth", "normal"))
    else:
        _give_seen(recipe, before, size)
    recipe.give("before.irradiance", lights[0], LIGHT)
    recipe.give("before.frames", lights[1], FRAMES)
    recipe.give("new.irradiance", lights[2], replace(LIGHT, what="I_i, light of this frame as computed"))
    points = add_motion(recipe, scene, before, view) if moved else ("gbuffer.position", "gbuffer.normal")
    add_reprojection(recipe, points, maps, view, settings)
    light = "reprojected.irradiance"
    if settings.entering_speed is not None:
        light = _add_entering(recipe, points[0], maps, settings, light)
    if settings.clamp is not None:
        light = _add_clamp(recipe, settings, light)
    _add_blend(recipe, settings, light, moved)
    recipe.facts["temporal"] = {key: value for key, value in asdict(settings).items() if value is not None}


def _give_seen(recipe: Recipe, before: Scene, size: tuple[int, int]) -> None:
    """Give what the frame before saw, where its triangles were elsewhere, and where they were."""
    from refgi.frame import Frame

    depth, normal = Frame(before, width=size[0], height=size[1], dtype=np.float64).gbuffer.resolve("depth", "normal")
    recipe.give("before.depth", depth, Spec("row, column", "m", "depth in the frame before; inf without surface"))
    recipe.give("before.normal", normal, Spec("xyz, row, column", VECTOR, "normals in the frame before", "world"))
    recipe.give("before.vertices", before.geometry.vertices, Spec("vertex, xyz", "m", "where the corners were",
                                                                  "world"))


def _add_entering(
    recipe: Recipe, position: str, maps: Projection, settings: TemporalSettings, light: str
) -> str:
    """Add the light of the earlier picture's edge for points that lay outside it."""
    speed = settings.entering_speed
    assert speed is not None
    reads = (light, "reprojected.weight", position, "gbuffer.triangle_id", *_map_names("before"), "before.depth",
             "before.irradiance")

    def run(arrays: Arrays, real: Any, v: float = speed) -> Arrays:
        made = np.array(arrays[light], real)
        old = np.ascontiguousarray(arrays["before.irradiance"], real)
        normal = {"before.normal": np.zeros_like(old)}
        share = fetch_entering(old, view_before({**arrays, **normal}, maps, real),
                               np.ascontiguousarray(arrays[position], real), np.asarray(arrays[reads[3]]) >= 0,
                               np.ascontiguousarray(arrays["reprojected.weight"], real), (0.0, 0.0, 0.0), v, made)
        return {"entering.irradiance": made, "entering.share": share}

    recipe.add("entering", "points that lay outside the earlier picture take the light at its edge, the less the "
               "farther they moved", run, reads, {
                   "entering.irradiance": replace(LIGHT, what="as reprojected, with the edge's light"),
                   "entering.share": Spec("row, column", "1", "exp(-v / entering_speed), v pixels; 0 but for points "
                                          "that entered"),
               }, paper="HSS Sec. 3.3", exact=(position, "before.origin"), bugs=(
                   Bug("powers of 2 in place of e", lambda a, r: run(a, r, speed / math.log(2)), "exp(-v / speed)"),
                   Bug("the share does not depend on the speed", writing(run, entering__share=lambda a: (
                       a > 0).astype(a.dtype)), "HSS Sec. 3.3"),
                   Bug("the share grows with the speed: exp(v / speed)", writing(
                       run, entering__share=lambda a: (a > 0).astype(a.dtype) / np.where(a > 0, a, 1)),
                       "exp(-v / speed)"),
                   Bug("the share is 1 - exp(-v / speed)", writing(run, entering__share=lambda a: np.where(
                       a > 0, 1 - a, 0)), "exp(-v / speed)"),
                   Bug("the speed is squared: a gaussian, not an exponential", writing(
                       run, entering__share=lambda a: np.where(a > 0, np.exp(-np.log(np.where(a > 0, a, 1)) ** 2), 0)),
                       "exp(-v / speed)"),
                   Bug("the speed is half as large", lambda a, r: run(a, r, speed / 2), "exp(-v / speed)"),
                   Bug("the speed is twice as large", lambda a, r: run(a, r, 2 * speed), "exp(-v / speed)"),
                   Bug("columns run leftwards", reading(run, before__frame=lambda a: a * np.array(
                       [[-1.0], [1.0], [1.0]], a.dtype)), "column 0 is at the left"),
                   Bug("entering pixels get no light", lambda a, r: {**run(a, r), "entering.irradiance": a[light]},
                       "HSS Sec. 3.3"),
                   Bug("rows run upwards", reading(run, before__frame=_upside_down),
                       "row 0 is the top row")))
    return "entering.irradiance"


def _add_clamp(recipe: Recipe, settings: TemporalSettings, light: str) -> str:
    """Add the clamp of earlier light to the new light around."""
    deviations, radius = settings.clamp, settings.clamp_radius
    assert deviations is not None

    def run(arrays: Arrays, real: Any, d: float = deviations, n: int = radius) -> Arrays:
        made = np.array(arrays[light], real)
        clamp_to_neighbourhood(np.ascontiguousarray(arrays["new.irradiance"], real),
                               np.asarray(arrays["gbuffer.triangle_id"]) >= 0, d, n, made)
        return {"clamped.irradiance": made}

    recipe.add("clamp", "earlier light within some standard deviations of the mean of the new light in a square", run,
               (light, "new.irradiance", "gbuffer.triangle_id"), {
                   "clamped.irradiance": replace(LIGHT, what="earlier light, clamped")},
               paper="docs/methods/hssil", bugs=(
                   Bug("the square is one pixel wider", lambda a, r: run(a, r, deviations, radius + 1), ""),
                   Bug("the square is one pixel narrower", lambda a, r: run(a, r, deviations, radius - 1), ""),
                   Bug("the square is twice as wide: its size is taken for its radius",
                       lambda a, r: run(a, r, deviations, 2 * radius), ""),
                   Bug("earlier light is not clamped", lambda a, r: {
                       "clamped.irradiance": np.asarray(a[light], r)}, ""),
                   Bug("half as many deviations", lambda a, r: run(a, r, deviations / 2), ""),
                   Bug("the new light is clamped, not the earlier one", lambda a, r: run(
                       {**a, light: a["new.irradiance"]}, r), ""),
                   Bug("the square is taken of the earlier light, not of the new", lambda a, r: run(
                       {**a, "new.irradiance": a[light]}, r), ""),
                   Bug("twice as many deviations", lambda a, r: run(a, r, 2 * deviations), ""),
                   Bug("pixels without surface count as dark", reading(run, gbuffer__triangle_id=np.zeros_like), ""),
                   Bug("earlier light is replaced by the mean", lambda a, r: run(a, r, 0.0), "")))
    return "clamped.irradiance"


def _summed(made: Arrays, earlier: Array, new: Array, share_of_new: float) -> dict[str, Array]:
    """Return what the blend writes with a fixed share of the new light."""
    return {**made, "temporal.irradiance": made["temporal.share"] * earlier + share_of_new * new}


def _add_blend(recipe: Recipe, settings: TemporalSettings, light: str, moved: bool) -> None:
    counted, entered = settings.counts_frames, settings.entering_speed is not None
    reads = ("new.irradiance", light, "reprojected.weight", *(("reprojected.frames",) if counted else ()),
             *(("entering.share",) if entered else ()), *(("motion.speed",) if moved else ()))

    def run(arrays: Arrays, real: Any, how: TemporalSettings = settings) -> Arrays:
        made = np.concatenate([arrays[light], *([arrays["reprojected.frames"][None]] if counted else [])]).astype(real)
        share = np.array(arrays["reprojected.weight"], real)
        others = (np.ascontiguousarray(arrays[name], real) if used else None for name, used in
                  (("motion.speed", moved), ("entering.share", entered)))
        blend(np.ascontiguousarray(arrays["new.irradiance"], real), made, share, how, *others)
        frames = {"temporal.frames": made[3]} if counted else {}
        return {"temporal.irradiance": made[:3], "temporal.share": share} | frames

    def by(share: Any) -> Run:
        """Return the blend with another share, made of arrays and of what the stage writes."""
        def wrong(arrays: Arrays, real: Any) -> Arrays:
            made = run(arrays, real)
            a = share(arrays, made)
            return {**made, "temporal.share": a, "temporal.irradiance": (
                a * arrays[light] + (1 - a) * arrays["new.irradiance"])}

        return wrong

    bugs = [
        Bug("a and 1 - a are exchanged", by(lambda _, made: 1 - made["temporal.share"]), FORM),
        Bug("disoccluded pixels are blended with black", by(lambda arrays, made: np.maximum(
            made["temporal.share"], np.where(arrays["reprojected.weight"] > 0, 0, settings.weight))),
            "a = 0 (E-HSS-11)"),
        Bug("a is scaled by the share of texels found", by(lambda arrays, made: (
            made["temporal.share"] * arrays["reprojected.weight"])), FORM),
        Bug("a is the same for pixels that were not found: no test of the weight", by(lambda _, made: np.full_like(
            made["temporal.share"], settings.weight)), "a = 0 (E-HSS-11)"),
        Bug("a is squared", by(lambda _, made: made["temporal.share"] ** 2), FORM),
        Bug("a is half as large", by(lambda _, made: made["temporal.share"] / 2), FORM),
        Bug("this frame's light is not multiplied by 1 - a: new light counts whole", lambda a, r: _summed(
            run(a, r), a[light], a["new.irradiance"], 1.0), FORM),
        Bug("new light is left out: earlier light times a alone", lambda a, r: _summed(
            run(a, r), a[light], a["new.irradiance"], 0.0), FORM),
        Bug("light of this frame alone: nothing is blended", lambda a, r: {
            **run(a, r), "temporal.irradiance": a["new.irradiance"]}, FORM),
        Bug("earlier light replaces the new where it was found: a is 1", by(lambda arrays, _: np.where(
            arrays["reprojected.weight"] > 0, 1.0, 0.0)), FORM),
        Bug("earlier light is added, not blended", lambda a, r: {**run(a, r), "temporal.irradiance": (
            a["new.irradiance"] + settings.weight * a[light])}, FORM),
    ]
    if counted:
        bugs += [
            Bug("a is the same from the first frame on", by(lambda arrays, _: np.where(
                arrays["reprojected.weight"] > 0, settings.weight, 0)), "min(a, n / (n + 1))"),
            Bug("n counts this frame as well", by(lambda arrays, _: np.where(
                arrays["reprojected.weight"] > 0, np.minimum(settings.weight, (arrays["reprojected.frames"] + 1) / (
                    arrays["reprojected.frames"] + 2)), 0)), "min(a, n / (n + 1))"),
            Bug("a is the larger of a and n / (n + 1): max in place of min", by(lambda arrays, _: np.where(
                arrays["reprojected.weight"] > 0, np.maximum(settings.weight, arrays["reprojected.frames"] / (
                    arrays["reprojected.frames"] + 1)), 0)), "min(a, n / (n + 1))"),
            Bug("a is at most 1 / (n + 1), not n / (n + 1): shares are exchanged", by(lambda arrays, _: np.where(
                arrays["reprojected.weight"] > 0, np.minimum(settings.weight, 1 / (
                    arrays["reprojected.frames"] + 1)), 0)), "min(a, n / (n + 1))"),
            Bug("the count of frames starts at 0 where nothing was found, not at 1", writing(
                run, temporal__frames=lambda a: np.where(a == 1, 0, a)), "n + 1"),
            Bug("frames are counted twice", writing(run, temporal__frames=lambda a: a + 1), "n + 1"),
            Bug("the count of frames does not start again where nothing was found", lambda a, r: {
                **run(a, r), "temporal.frames": np.where(a["reprojected.weight"] > 0, a["reprojected.frames"],
                                                         settings.weight) + 1}, "n + 1"),
            Bug("frames are not counted on", writing(run, temporal__frames=lambda a: a - 1), "n + 1"),
        ]
    if entered:
        bugs.append(Bug("entering pixels take their new light alone", reading(run, entering__share=np.zeros_like),
                        "HSS Sec. 3.3"))
    if moved:
        bugs.append(Bug("a does not fall with the speed", reading(run, motion__speed=np.zeros_like),
                        "a exp(-v / speed)"))
    writes = {"temporal.irradiance": replace(LIGHT, what="F_i; I_i where nothing was found"),
              "temporal.share": Spec("row, column", "1", "a of each pixel")}
    writes |= {"temporal.frames": FRAMES} if counted else {}
    recipe.add("temporal", "light of this frame and of those before" + (", at most n / (n + 1) of these" if counted
                                                                        else ""), run, reads, writes, paper=FORM,
               bugs=tuple(bugs))
