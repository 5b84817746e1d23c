"""Stages of temporal coherence: motion, reprojection into the frame before, entering pixels, clamp, blend (HSS 3.3)."""

import dataclasses
import math
from typing import Any

import numpy as np

from refgi.rsm.raster.projection import Projection, camera_projection
from refgi.scene import Scene
from refgi.settings import replaced
from refgi.sssil.reprojection import SNAP, SourceView, reproject
from refgi.sssil.settings import TemporalSettings
from refgi.sssil.temporal.entering import fetch_entering
from refgi.sssil.temporal.filter import blend
from refgi.sssil.temporal.motion import previous_points
from refgi.sssil.temporal.neighbourhood import clamp_to_neighbourhood
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Decoy, Run, Spec
from refgi.vectors.stages.buffers import (
    VECTOR,
    _add_ids,
    _add_surface,
    _give_maps,
    _half_texel,
    _map_names,
    _maps_of,
    geometry_of,
)
from refgi.vectors.stages.direct import surface_points

FORM = "HSS Sec. 3.3, recursive: F_i = a W(F_{i-1}) + (1 - a) I_i (E-HSS-11)"
WARP = "HSS Sec. 3.3: depth and normal decide whether it is the same surface (E-HSS-11)"
LIGHT = Spec("rgb, row, column", "W/m^2", "filtered light of the frame before", "linear RGB", FORM)
FRAMES = Spec("row, column", "1", "frames in which the pixel's surface was found")


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
    recipe.give("new.irradiance", lights[2], dataclasses.replace(LIGHT, what="I_i, light of this frame as computed"))
    points = _add_motion(recipe, scene, before, view) if moved else ("gbuffer.position", "gbuffer.normal")
    _add_reprojection(recipe, points, maps, view, settings)
    light = "reprojected.irradiance"
    if settings.entering_speed is not None:
        light = _add_entering(recipe, points[0], maps, settings, light)
    if settings.clamp is not None:
        light = _add_clamp(recipe, settings, light)
    _add_blend(recipe, settings, light, moved)
    recipe.facts["temporal"] = {key: value for key, value in dataclasses.asdict(settings).items() if value is not None}


def _give_seen(recipe: Recipe, before: Scene, size: tuple[int, int]) -> None:
    """Give what the frame before saw, where its triangles were elsewhere, and where they were."""
    from refgi.frame import Frame

    depth, normal = Frame(before, width=size[0], height=size[1], dtype=np.float64).gbuffer.resolve("depth", "normal")
    recipe.give("before.depth", depth, Spec("row, column", "m", "depth in the frame before; inf without surface"))
    recipe.give("before.normal", normal, Spec("xyz, row, column", VECTOR, "normals in the frame before", "world"))
    recipe.give("before.vertices", before.geometry.vertices, Spec("vertex, xyz", "m", "where the corners were",
                                                                  "world"))


def _add_motion(recipe: Recipe, scene: Scene, before: Scene, view: Projection) -> tuple[str, str]:
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
               }, paper="HSS Sec. 4", exact=("scene.vertices", "before.vertices", "gbuffer.position"), decoys=(
                   Decoy("points are taken to rest", still, "HSS Sec. 4"),
                   Decoy("points are moved on, not back", doubled, "HSS Sec. 4"),
                   Decoy("speed is a share of the picture, not pixels", writing(
                       run, motion__speed=lambda a: a / view.width), "pixels a frame"),
               ))
    return "motion.position", "motion.normal"


def _view_of(arrays: Arrays, maps: Projection, real: Any) -> SourceView:
    return SourceView(_maps_of(arrays, "before", maps), *(np.ascontiguousarray(arrays[f"before.{key}"], real)
                                                          for key in ("depth", "normal")))


def _add_reprojection(
    recipe: Recipe, points: tuple[str, str], maps: Projection, view: Projection, settings: TemporalSettings
) -> None:
    counted = settings.counts_frames
    kept = ("irradiance", "frames") if counted else ("irradiance",)
    reads = (*points, "gbuffer.triangle_id", *_map_names("before"), "before.depth", "before.normal",
             *(f"before.{key}" for key in kept))

    def run(arrays: Arrays, real: Any, how: TemporalSettings = settings) -> Arrays:
        light = [arrays["before.irradiance"], *([arrays["before.frames"][None]] if counted else [])]
        mean, weight = reproject(
            np.concatenate(light).astype(real), _view_of(arrays, maps, real),
            *(np.ascontiguousarray(arrays[name], real) for name in points), np.asarray(arrays[reads[2]]) >= 0,
            depth_tolerance=how.depth_tolerance, normal_cosine=how.normal_cosine, fetch=how.fetch)
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
               exact=(points[0], *_map_names("before"), "before.depth"), decoys=(
                   Decoy("this frame's camera in place of that of the frame before", reading(run, **{
                       f"before__{key}": lambda a, key=key: np.asarray(now[key], a.dtype) for key in now}), WARP),
                   Decoy("no reprojection: the same pixel of the frame before", lambda a, r: {
                       **run(a, r), "reprojected.irradiance": a["before.irradiance"]}, WARP),
                   Decoy("rows run upwards", reading(run, before__frame=lambda a: a * np.array([1, -1, 1]).reshape(3, 1)),
                         "row 0 is the top row"),
                   Decoy("texel centres lie at 0 instead of 1/2", reading(run, before__frame=_half_texel(maps)),
                         "centres at + 1/2"),
                   Decoy(f"the {other} texel" if other == "nearest" else "the mean of the four texels around",
                         changed(fetch=other), ""),
                   Decoy("depths are not compared", changed(depth_tolerance=1.0), WARP),
                   Decoy("normals are not compared", changed(normal_cosine=-1.0), WARP),
                   Decoy("depths are compared with the point's alone, not with that of its plane",
                         literal(planes=False), "docs/methods/hssil: planes at grazing angles"),
                   Decoy("the tolerance is in metres, not a share of the depth", literal(metres=True), WARP),
                   *((Decoy("the sum of weights is not divided by", undivided, "weighted mean"),)
                     if settings.fetch == "bilinear" else ())))


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
        share = fetch_entering(old, _view_of({**arrays, **normal}, maps, real),
                               np.ascontiguousarray(arrays[position], real), np.asarray(arrays[reads[3]]) >= 0,
                               np.ascontiguousarray(arrays["reprojected.weight"], real), (0.0, 0.0, 0.0), v, made)
        return {"entering.irradiance": made, "entering.share": share}

    recipe.add("entering", "points that lay outside the earlier picture take the light at its edge, the less the "
               "farther they moved", run, reads, {
                   "entering.irradiance": dataclasses.replace(LIGHT, what="as reprojected, with the edge's light"),
                   "entering.share": Spec("row, column", "1", "exp(-v / entering_speed), v pixels; 0 but for points "
                                          "that entered"),
               }, paper="HSS Sec. 3.3", exact=(position, *_map_names("before")), decoys=(
                   Decoy("powers of 2 in place of e", lambda a, r: run(a, r, speed / math.log(2)), "exp(-v / speed)"),
                   Decoy("the share does not depend on the speed", writing(run, entering__share=lambda a: (
                       a > 0).astype(a.dtype)), "HSS Sec. 3.3"),
                   Decoy("entering pixels get no light", lambda a, r: {**run(a, r), "entering.irradiance": a[light]},
                         "HSS Sec. 3.3"),
                   Decoy("rows run upwards", reading(run, before__frame=lambda a: a * np.array([1, -1, 1]).reshape(3, 1)),
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
                   "clamped.irradiance": dataclasses.replace(LIGHT, what="earlier light, clamped")},
               paper="docs/methods/hssil", decoys=(
                   Decoy("the square is one pixel wider", lambda a, r: run(a, r, deviations, radius + 1), ""),
                   Decoy("twice as many deviations", lambda a, r: run(a, r, 2 * deviations), ""),
                   Decoy("pixels without surface count as dark", reading(run, gbuffer__triangle_id=np.zeros_like), ""),
                   Decoy("earlier light is replaced by the mean", lambda a, r: run(a, r, 0.0), "")))
    return "clamped.irradiance"


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

    decoys = [
        Decoy("a and 1 - a are exchanged", by(lambda _, made: 1 - made["temporal.share"]), FORM),
        Decoy("disoccluded pixels are blended with black", by(lambda arrays, made: np.maximum(
            made["temporal.share"], np.where(arrays["reprojected.weight"] > 0, 0, settings.weight))),
            "a = 0 (E-HSS-11)"),
        Decoy("a is scaled by the share of texels found", by(lambda arrays, made: (
            made["temporal.share"] * arrays["reprojected.weight"])), FORM),
        Decoy("earlier light is added, not blended", lambda a, r: {**run(a, r), "temporal.irradiance": (
            a["new.irradiance"] + settings.weight * a[light])}, FORM),
    ]
    if counted:
        decoys += [
            Decoy("a is the same from the first frame on", by(lambda arrays, _: np.where(
                arrays["reprojected.weight"] > 0, settings.weight, 0)), "min(a, n / (n + 1))"),
            Decoy("n counts this frame as well", by(lambda arrays, _: np.where(
                arrays["reprojected.weight"] > 0, np.minimum(settings.weight, (arrays["reprojected.frames"] + 1) / (
                    arrays["reprojected.frames"] + 2)), 0)), "min(a, n / (n + 1))"),
            Decoy("frames are not counted on", writing(run, temporal__frames=lambda a: a - 1), "n + 1"),
        ]
    if entered:
        decoys.append(Decoy("entering pixels take their new light alone", reading(run, entering__share=np.zeros_like),
                            "HSS Sec. 3.3"))
    if moved:
        decoys.append(Decoy("a does not fall with the speed", reading(run, motion__speed=np.zeros_like),
                            "a exp(-v / speed)"))
    writes = {"temporal.irradiance": dataclasses.replace(LIGHT, what="F_i; I_i where nothing was found"),
              "temporal.share": Spec("row, column", "1", "a of each pixel")}
    writes |= {"temporal.frames": FRAMES} if counted else {}
    recipe.add("temporal", "light of this frame and of those before" + (", at most n / (n + 1) of these" if counted
                                                                        else ""), run, reads, writes, paper=FORM,
               decoys=tuple(decoys))
