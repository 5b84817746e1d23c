"""Stages of temporal coherence: motion of surfaces, reprojection into the frame before (HSS Sec. 3.3)."""

import dataclasses
from typing import Any

import numpy as np

from refgi.rsm.raster.projection import Projection
from refgi.scene import Scene
from refgi.settings import replaced
from refgi.sssil.reprojection import SNAP, SourceView, reproject
from refgi.sssil.settings import TemporalSettings
from refgi.sssil.temporal.motion import previous_points
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Run, Spec
from refgi.vectors.stages.buffers import (
    VECTOR,
    _half_texel,
    _map_names,
    _maps_of,
    geometry_of,
)
from refgi.vectors.stages.direct import _upside_down, surface_points

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

    def still(arrays: Arrays, real: Any) -> Arrays:
        return {**run(arrays, real), "motion.position": arrays["gbuffer.position"],
                "motion.normal": arrays["gbuffer.normal"]}

    def doubled(arrays: Arrays, real: Any) -> Arrays:
        made = run(arrays, real)
        return {**made, "motion.position": 2 * arrays["gbuffer.position"] - made["motion.position"]}

    recipe.add("motion", "where each pixel's point on its triangle was a frame earlier: the same mean of its corners",
               run, ("scene.vertices", "scene.faces", "scene.material_of_face", "before.vertices", "gbuffer.position",
                     "gbuffer.normal", "gbuffer.triangle_id", *_map_names("camera")), {
                   "motion.position": Spec("xyz, row, column", "m", "where it was", "world"),
                   "motion.normal": Spec("xyz, row, column", VECTOR, "its normal then", "world"),
                   "motion.speed": Spec("row, column", "pixels", "how far it moved as this frame's camera sees it"),
               }, paper="HSS Sec. 4", exact=("scene.vertices", "before.vertices", "gbuffer.position"), bugs=(
                   Bug("points are taken to rest", still, "HSS Sec. 4"),
                   Bug("points are moved on, not back", doubled, "HSS Sec. 4"),
                   Bug("speed is a share of the picture, not pixels", writing(
                       run, motion__speed=lambda a: a / view.width), "pixels a frame"),
               ))
    return "motion.position", "motion.normal"


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

    def run(arrays: Arrays, real: Any, how: TemporalSettings = settings) -> Arrays:
        light = [arrays["before.irradiance"], *([arrays["before.frames"][None]] if counted else [])]
        position, normal = (np.ascontiguousarray(arrays[name], real) for name in points)
        mean, weight = reproject(
            np.concatenate(light).astype(real), view_before(arrays, maps, real), position, normal,
            np.asarray(arrays[reads[2]]) >= 0, depth_tolerance=how.depth_tolerance, normal_cosine=how.normal_cosine,
            fetch=how.fetch)
        made = {"reprojected.irradiance": mean[:3], "reprojected.weight": weight}
        return made | ({"reprojected.frames": mean[3]} if counted else {})

    def changed(**values: Any) -> Run:
        return lambda a, r: run(a, r, replaced(settings, values))

    def literal(**bugs: Any) -> Run:
        return lambda a, r: {**run(a, r), **_reprojected(a, points, settings, **bugs)}

    def undivided(arrays: Arrays, real: Any) -> Arrays:
        made = run(arrays, real)
        return {**made, "reprojected.irradiance": made["reprojected.irradiance"] * made["reprojected.weight"]}

    now = dict(zip(("origin", "frame", "half"), (view.origin, view.frame, view.half), strict=True))
    other = "nearest" if settings.fetch == "bilinear" else "bilinear"
    writes = {"reprojected.irradiance": dataclasses.replace(LIGHT, what="mean over the texels that show the same "
                                                            "surface; 0 where none does"),
              "reprojected.weight": Spec("row, column", "1", "share of the bilinear weights that those texels have; 0: "
                                         "disoccluded or outside")}
    writes |= {"reprojected.frames": FRAMES} if counted else {}
    recipe.add("reprojected", "light of the frame before at this frame's points: the texels around, those that show "
               "the same surface by depth and normal", run, reads, writes, paper=WARP,
               exact=(points[0], "before.origin", "before.depth"), bugs=(
                   Bug("this frame's camera in place of that of the frame before", reading(run, **{
                       f"before__{key}": lambda a, key=key: np.asarray(now[key], a.dtype) for key in now}), WARP),
                   Bug("no reprojection: the same pixel of the frame before", lambda a, r: {
                       **run(a, r), "reprojected.irradiance": a["before.irradiance"]}, WARP),
                   Bug("rows run upwards", reading(run, before__frame=_upside_down),
                       "row 0 is the top row"),
                   Bug("texel centres lie at 0 instead of 1/2", reading(run, before__frame=_half_texel(maps)),
                       "centres at + 1/2"),
                   Bug(f"the {other} texel" if other == "nearest" else "the mean of the four texels around",
                       changed(fetch=other), ""),
                   Bug("columns run leftwards", reading(run, before__frame=lambda a: a * np.array(
                       [[-1.0], [1.0], [1.0]], a.dtype)), "column 0 is at the left"),
                   Bug("positions are not relative to the eye of the frame before: its origin is left out", reading(
                       run, before__origin=np.zeros_like), WARP),
                   Bug("neither depths nor normals are compared", changed(
                       depth_tolerance=1.0, normal_cosine=-1.0), WARP),
                   Bug("the tolerance of depth is twice as large", changed(
                       depth_tolerance=2 * settings.depth_tolerance), WARP),
                   Bug("the tolerance of depth is half as large", changed(
                       depth_tolerance=settings.depth_tolerance / 2), WARP),
                   Bug("tangents of the whole angles of view, not of half", reading(run, before__half=lambda a: (
                       2 * a / (1 - a**2))), "half angles"),
                   Bug("tangents across and down are exchanged", reading(run, before__half=lambda a: a[::-1]),
                       "across, then down"),
                   Bug("where nothing was found the old light of the pixel stays", lambda a, r: _kept(a, run(a, r)),
                       "0 where disoccluded"),
                   Bug("depths are not compared", changed(depth_tolerance=1.0), WARP),
                   Bug("normals are not compared", changed(normal_cosine=-1.0), WARP),
                   Bug("depths are compared with the point's alone, not with that of its plane",
                       literal(planes=False), "docs/methods/hssil: planes at grazing angles"),
                   Bug("the tolerance is in metres, not a share of the depth", literal(metres=True), WARP),
                   *((Bug("the sum of weights is not divided by", undivided, "weighted mean"),)
                     if settings.fetch == "bilinear" else ())))


def _kept(arrays: Arrays, made: Arrays) -> dict[str, Array]:
    """Return what the stage writes with the same pixel's light where no texel was found."""
    return {**made, "reprojected.irradiance": np.where(
        made["reprojected.weight"] > 0, made["reprojected.irradiance"], arrays["before.irradiance"])}


def _reprojected(
    arrays: Arrays, points: tuple[str, str], settings: TemporalSettings, *, planes: bool = True, metres: bool = False,
) -> dict[str, Array]:
    """Return reprojected light and weight, in float64, with a bug."""
    place, normal = (np.asarray(arrays[name], np.float64) for name in points)
    origin, frame, half, depth, up, light = (np.asarray(arrays[f"before.{key}"], np.float64) for key in (
        "origin", "frame", "half", "depth", "normal", "irradiance"))
    (h, w), axes = depth.shape, frame[0] * np.array([[1 / half[0]], [1 / half[1]], [1.0]])
    d = place - origin[0].reshape(3, 1, 1)
    x, y, z = np.tensordot(axes, d, 1)
    ahead = (z > 0) & (np.asarray(arrays["gbuffer.triangle_id"]) >= 0)
    z = np.where(ahead, z, 1.0)
    column, row = ((c / z + 1) * size / 2 - 0.5 for c, size in ((x, w), (y, h)))
    ahead &= (column >= -0.5) & (column <= w - 0.5) & (row >= -0.5) & (row <= h - 0.5)
    if settings.fetch == "nearest":
        column, row = np.rint(column), np.rint(row)
    column, row = (np.where(np.abs(c - np.rint(c)) <= SNAP, np.rint(c), c) for c in (column, row))
    margin = settings.depth_tolerance * (1.0 if metres else z)
    total, weight = np.zeros_like(place), np.zeros_like(z)
    for below in (0, 1):
        for beside in (0, 1):
            i, j = np.floor(row).astype(int) + below, np.floor(column).astype(int) + beside
            share = (1 - np.abs(column - j)) * (1 - np.abs(row - i))
            known = ahead & (i >= 0) & (i < h) & (j >= 0) & (j < w)
            i, j = np.clip(i, 0, h - 1), np.clip(j, 0, w - 1)
            ray = np.tensordot(frame[0].T, np.stack([half[0] * ((2 * j + 1) / w - 1), half[1] * ((2 * i + 1) / h - 1),
                                                     np.ones_like(z)]), 1)
            slant, plane = (normal * ray).sum(axis=0), (normal * d).sum(axis=0)
            near = np.abs(depth[i, j] - z) <= margin
            if planes:
                near |= (slant < 0) & (np.abs(depth[i, j] * slant - plane) <= -margin * slant)
            share = share * (known & near & ((up[:, i, j] * normal).sum(axis=0) >= settings.normal_cosine))
            total, weight = total + share * light[:, i, j], weight + share
    return {"reprojected.irradiance": np.divide(total, weight, out=np.zeros_like(total), where=weight > 0),
            "reprojected.weight": weight}
