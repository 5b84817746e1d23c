"""Temporal coherence as a chain of stages: reprojection, entering pixels, clamp of earlier light, blend (HSS 3.3)."""

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from refgi.literal import temporal as literal
from refgi.rsm.raster.projection import Projection, camera_projection
from refgi.scene import Scene
from refgi.sssil.settings import TemporalSettings
from refgi.sssil.temporal.entering import fetch_entering
from refgi.sssil.temporal.filter import blend
from refgi.sssil.temporal.neighbourhood import clamp_to_neighbourhood
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages.buffers import VECTOR, _add_ids, _add_surface, _give_maps, _map_names
from refgi.vectors.stages.reprojection import (
    FORM,
    FRAMES,
    LIGHT,
    add_motion,
    add_reprojection,
    camera_reads,
    view_before,
)


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

    def run(arrays: Arrays, real: Any) -> Arrays:
        made = np.array(arrays[light], real)
        old = np.ascontiguousarray(arrays["before.irradiance"], real)
        normal = {"before.normal": np.zeros_like(old)}
        share = fetch_entering(old, view_before({**arrays, **normal}, maps, real),
                               np.ascontiguousarray(arrays[position], real), np.asarray(arrays[reads[3]]) >= 0,
                               np.ascontiguousarray(arrays["reprojected.weight"], real), (0.0, 0.0, 0.0), speed, made)
        return {"entering.irradiance": made, "entering.share": share}

    form = Form(literal.entering, {
        "light": light, "weight": "reprojected.weight", "position": position, "triangle_id": "gbuffer.triangle_id",
        **camera_reads("before"), "depth": "before.depth", "irradiance": "before.irradiance"},
        ("entering.irradiance", "entering.share"), {"speed": speed})
    recipe.add("entering", "points that lay outside the earlier picture take the light at its edge, the less the "
               "farther they moved", run, reads, {
                   "entering.irradiance": replace(LIGHT, what="as reprojected, with the edge's light"),
                   "entering.share": Spec("row, column", "1", "exp(-v / entering_speed), v pixels; 0 but for points "
                                          "that entered"),
               }, paper="HSS Sec. 3.3", exact=(position, "before.origin"), bugs=form.bugs("entering"),
               variants=(form,))
    return "entering.irradiance"


def _add_clamp(recipe: Recipe, settings: TemporalSettings, light: str) -> str:
    """Add the clamp of earlier light to the new light around."""
    deviations, radius = settings.clamp, settings.clamp_radius
    assert deviations is not None

    def run(arrays: Arrays, real: Any) -> Arrays:
        made = np.array(arrays[light], real)
        clamp_to_neighbourhood(np.ascontiguousarray(arrays["new.irradiance"], real),
                               np.asarray(arrays["gbuffer.triangle_id"]) >= 0, deviations, radius, made)
        return {"clamped.irradiance": made}

    form = Form(literal.clamp, {"earlier": light, "new": "new.irradiance", "triangle_id": "gbuffer.triangle_id"},
                ("clamped.irradiance",), {"deviations": deviations, "radius": radius})
    recipe.add("clamp", "earlier light within some standard deviations of the mean of the new light in a square", run,
               (light, "new.irradiance", "gbuffer.triangle_id"), {
                   "clamped.irradiance": replace(LIGHT, what="earlier light, clamped")},
               paper="docs/methods/hssil", bugs=form.bugs("clamp"), variants=(form,))
    return "clamped.irradiance"


def _add_blend(recipe: Recipe, settings: TemporalSettings, light: str, moved: bool) -> None:
    counted, entered = settings.counts_frames, settings.entering_speed is not None
    reads = ("new.irradiance", light, "reprojected.weight", *(("reprojected.frames",) if counted else ()),
             *(("entering.share",) if entered else ()), *(("motion.speed",) if moved else ()))

    def run(arrays: Arrays, real: Any) -> Arrays:
        made = np.concatenate([arrays[light], *([arrays["reprojected.frames"][None]] if counted else [])]).astype(real)
        share = np.array(arrays["reprojected.weight"], real)
        others = (np.ascontiguousarray(arrays[name], real) if used else None for name, used in
                  (("motion.speed", moved), ("entering.share", entered)))
        blend(np.ascontiguousarray(arrays["new.irradiance"], real), made, share, settings, *others)
        frames = {"temporal.frames": made[3]} if counted else {}
        return {"temporal.irradiance": made[:3], "temporal.share": share} | frames

    writes = {"temporal.irradiance": replace(LIGHT, what="F_i; I_i where nothing was found"),
              "temporal.share": Spec("row, column", "1", "a of each pixel")}
    writes |= {"temporal.frames": FRAMES} if counted else {}
    optional = {"frames": ("reprojected.frames", counted), "entering_share": ("entering.share", entered),
                "speed": ("motion.speed", moved)}
    form = Form(literal.blend, {"new": "new.irradiance", "earlier": light, "weight": "reprojected.weight",
                                **{key: name for key, (name, used) in optional.items() if used}}, (*writes,),
                {"a": settings.weight, "falloff": settings.speed})
    kinds = (("counted", counted), ("entering", entered), ("moving", moved))
    recipe.add("temporal", "light of this frame and of those before" + (", at most n / (n + 1) of these" if counted
                                                                        else ""), run, reads, writes, paper=FORM,
               bugs=form.bugs("blend", *(f"blend/{kind}" for kind, used in kinds if used)), variants=(form,))
