"""Stages of temporal coherence: motion of surfaces, reprojection into the frame before (HSS Sec. 3.3)."""

import dataclasses
from typing import Any

import numpy as np

from refgi.literal import temporal as literal
from refgi.rsm.raster.projection import Projection
from refgi.scene import Scene
from refgi.sssil.reprojection import SourceView, reproject
from refgi.sssil.settings import TemporalSettings
from refgi.sssil.temporal.motion import previous_points
from refgi.vectors.recipe import Recipe, reading
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Bug, Spec
from refgi.vectors.stages.buffers import VECTOR, _map_names, _maps_of, geometry_of
from refgi.vectors.stages.direct import surface_points

FORM = "HSS Sec. 3.3, recursive: F_i = a W(F_{i-1}) + (1 - a) I_i (E-HSS-11)"
WARP = "HSS Sec. 3.3: depth and normal decide whether it is the same surface (E-HSS-11)"
LIGHT = Spec("rgb, row, column", "W/m^2", "filtered light of the frame before", "linear RGB", FORM)
FRAMES = Spec("row, column", "1", "frames in which the pixel's surface was found")


def add_motion(recipe: Recipe, scene: Scene, before: Scene, view: Projection) -> tuple[str, str]:
    """Add where each pixel's point was in the frame before, and how far it moved across the picture."""
    def run(arrays: Arrays, real: Any) -> Arrays:
        old = dataclasses.replace(before.geometry, vertices=np.asarray(arrays["before.vertices"], np.float64))
        buffer = surface_points(arrays, real, scene, _maps_of(arrays, "camera", view))
        made = previous_points(buffer, geometry_of(arrays, scene), old)
        return {"motion.position": made.position, "motion.normal": made.normal, "motion.speed": made.speed}

    form = Form(literal.motion, {"position": "gbuffer.position", "normal": "gbuffer.normal", "faces": "scene.faces",
                                 "triangle_id": "gbuffer.triangle_id", "vertices": "scene.vertices",
                                 "before": "before.vertices", **camera_reads("camera")},
                ("motion.position", "motion.normal", "motion.speed"))
    recipe.add("motion", "where each pixel's point on its triangle was a frame earlier: the same mean of its corners",
               run, ("scene.vertices", "scene.faces", "scene.material_of_face", "before.vertices", "gbuffer.position",
                     "gbuffer.normal", "gbuffer.triangle_id", *_map_names("camera")), {
                   "motion.position": Spec("xyz, row, column", "m", "where it was", "world"),
                   "motion.normal": Spec("xyz, row, column", VECTOR, "its normal then", "world"),
                   "motion.speed": Spec("row, column", "pixels", "how far it moved as this frame's camera sees it"),
               }, paper="HSS Sec. 4", exact=("scene.vertices", "before.vertices", "gbuffer.position"),
               bugs=form.bugs("motion"), variants=(form,))
    return "motion.position", "motion.normal"


def camera_reads(view: str) -> dict[str, str]:
    """Return what a literal form reads of a camera."""
    return {key: f"{view}.{key}" for key in ("origin", "frame", "half")}


def view_before(arrays: Arrays, maps: Projection, real: Any) -> SourceView:
    """Return the view of the frame before among arrays."""
    depth, normal = (np.ascontiguousarray(arrays[f"before.{key}"], real) for key in ("depth", "normal"))
    return SourceView(_maps_of(arrays, "before", maps), depth, normal)


def add_reprojection(
    recipe: Recipe, points: tuple[str, str], maps: Projection, view: Projection, settings: TemporalSettings
) -> None:
    """Add light of the frame before at this frame's points; `maps`: that frame's camera, `view`: this one's."""
    counted = settings.counts_frames
    kept = ("irradiance", "frames") if counted else ("irradiance",)
    reads = (*points, "gbuffer.triangle_id", *_map_names("before"), "before.depth", "before.normal",
             *(f"before.{key}" for key in kept))

    def run(arrays: Arrays, real: Any) -> Arrays:
        light = [arrays["before.irradiance"], *([arrays["before.frames"][None]] if counted else [])]
        position, normal = (np.ascontiguousarray(arrays[name], real) for name in points)
        mean, weight = reproject(
            np.concatenate(light).astype(real), view_before(arrays, maps, real), position, normal,
            np.asarray(arrays[reads[2]]) >= 0, depth_tolerance=settings.depth_tolerance,
            normal_cosine=settings.normal_cosine, fetch=settings.fetch)
        made = {"reprojected.irradiance": mean[:3], "reprojected.weight": weight}
        return made | ({"reprojected.frames": mean[3]} if counted else {})

    now = dict(zip(("origin", "frame", "half"), (view.origin, view.frame, view.half), strict=True))
    writes = {"reprojected.irradiance": dataclasses.replace(LIGHT, what="mean over the texels that show the same "
                                                            "surface; 0 where none does"),
              "reprojected.weight": Spec("row, column", "1", "share of the bilinear weights that those texels have; 0: "
                                         "disoccluded or outside")}
    writes |= {"reprojected.frames": FRAMES} if counted else {}
    form = Form(literal.reprojection, {
        "position": points[0], "normal": points[1], "triangle_id": "gbuffer.triangle_id", **camera_reads("before"),
        "depth": "before.depth", "normal_before": "before.normal", **{key: f"before.{key}" for key in kept}},
        (*writes,), {"depth_tolerance": settings.depth_tolerance, "normal_cosine": settings.normal_cosine,
                     "fetch": settings.fetch})
    recipe.add("reprojected", "light of the frame before at this frame's points: the texels around, those that show "
               "the same surface by depth and normal", run, reads, writes, paper=WARP,
               exact=(points[0], "before.origin", "before.depth"), variants=(form,), bugs=(
                   Bug("this frame's camera in place of that of the frame before", reading(form, **{
                       f"before__{key}": lambda a, key=key: np.asarray(now[key], a.dtype) for key in now}), WARP),
                   *form.bugs("reprojection", f"reprojection/{settings.fetch}")))
