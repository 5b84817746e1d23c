"""Stages of the maps of area lights: views, blockers, distances to the nearest of them (VAL Sec. 4.2, 5.1).

Every area light has a map here. One that is empty, inf everywhere, occludes nothing: V is 1.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np

from refgi.cluster.maps.occluders import ends_of, occluders, selected_blockers
from refgi.cluster.maps.shadow_maps import BACKWARD, ShadowMaps, draw_maps, farthest, farthest_corner, map_centers
from refgi.cluster.settings import ValSettings
from refgi.scene import Geometry
from refgi.settings import replaced
from refgi.vectors.recipe import Recipe, reading, writing
from refgi.vectors.spec import Array, Arrays, Bug, Spec
from refgi.vectors.stages.buffers import SCENE
from refgi.vectors.stages.val_clusters import extent_of

SHEET = "area light, row, column"
VIEW = ("maps.center", "areas.frame")
EXTENTS = ("extents.visible", "extents.illuminated")


def add_maps(recipe: Recipe, settings: ValSettings) -> None:
    """Add the map of each area light: where it looks from, what may block, distances, nearest and farthest."""
    _add_views(recipe, settings)
    _add_blockers(recipe, settings)
    _add_depth(recipe, settings)
    if settings.maps.behind == "dual_paraboloid":
        _add_depth(recipe, settings, behind=True)

    def run(arrays: Arrays, real: Any) -> Arrays:
        depth = np.ascontiguousarray(arrays["maps.depth"], real)
        return {"maps.near": depth.min(axis=(1, 2)), "maps.far": farthest(depth)}

    recipe.add("maps.range", "nearest and farthest distance on each map", run, ("maps.depth",), {
        "maps.near": Spec("area light", "m", "least distance; inf on an empty map"),
        "maps.far": Spec("area light", "m", "greatest finite distance; 0 on an empty map")},
        paper="E-VAL-05", bugs=(
            Bug("texels without surface count as the farthest",
                writing(run, maps__far=lambda a: np.full_like(a, 1e4)), "E-VAL-05"),
            Bug("the nearest of all maps counts for each",
                writing(run, maps__near=lambda a: np.full_like(a, a.min())), "E-VAL-05: each map")))


def _add_views(recipe: Recipe, settings: ValSettings) -> None:
    share = settings.drawn_maps.near_share

    def run(arrays: Arrays, real: Any, near: float = share) -> Arrays:  # noqa: ARG001
        box = extent_of(arrays, "visible", "illuminated")
        center = map_centers(arrays["clusters.center"], arrays["clusters.normal"], extent_of(arrays, "illuminated"))
        return {"maps.center": center, "maps.ball": near * arrays["areas.radius"],
                "maps.scene_far": farthest_corner(box, center)}

    recipe.facts["maps"] = {"texels a side": settings.maps.resolution,
                            "lift, of the illuminated extent's largest coordinate": 4e-6,
                            "ball, of the cluster's radius": share, "projection": "paraboloid (x, y) / (1 + z)"}
    recipe.add("maps.views", "where maps look from, and the ball within which nothing blocks", run,
               (*EXTENTS, "clusters.center", "clusters.normal", "areas.radius"),
               {"maps.center": Spec("area light, xyz", "m", "centre of the map, a little off the surface", "world"),
                "maps.ball": Spec("area light", "m", "what is nearer to the centre blocks nothing"),
                "maps.scene_far": Spec("area light", "m", "to the farthest corner of the extents' common box")},
               paper="VAL Sec. 5.1, E-VAL-12", bugs=(
                   Bug("the centre is not lifted off the surface",
                       lambda a, r: {**run(a, r), "maps.center": a["clusters.center"].T}, "docs/methods/val"),
                   Bug("the ball has the cluster's radius", lambda a, r: run(a, r, 1.0), "a share of the radius"),
                   Bug("nothing is left out near the centre", lambda a, r: run(a, r, 0.0), "E-VAL-12"),
                   Bug("centres are lifted into the surface", reading(run, clusters__normal=lambda a: -a), "")))


def _add_blockers(recipe: Recipe, settings: ValSettings) -> None:
    alone = settings.maps.occluders_alone

    def run(arrays: Arrays, real: Any, lights: bool = True, touching: bool = not alone) -> Arrays:  # noqa: ARG001
        geometry = _geometry(arrays)
        frame: Any = SimpleNamespace(
            scene=SimpleNamespace(geometry=geometry, face_count=len(geometry.faces)),
            gbuffer=SimpleNamespace(triangle_id=np.asarray(arrays["gbuffer.triangle_id"])),
            extent=extent_of(arrays, "visible", "illuminated"), illuminated_extent=extent_of(arrays, "illuminated"))
        where: Any = SimpleNamespace(position=arrays["lights.position"] if lights else np.zeros((3, 0)))
        return {"maps.blocks": occluders(geometry, ends_of(frame, where), touching=touching)}

    recipe.facts["maps.blocks"] = {"tolerance, of the diagonal of the extents' common box": 1e-6}
    recipe.add("maps.blockers", "triangles with ends of light, seen vertices and pixel lights, on both sides", run,
               ("scene.vertices", "scene.faces", "gbuffer.triangle_id", "lights.position", *EXTENTS),
               {"maps.blocks": Spec("triangle", "1", "whether it may lie between a light and a receiver", tier="T0")},
               paper="docs/methods/val_visibility", bugs=(
                   Bug("all triangles block", writing(run, maps__blocks=np.ones_like), "walls of a room do not"),
                   Bug("pixel lights do not count as ends", lambda a, r: run(a, r, lights=False), ""),
                   Bug("triangles on the hull block too", lambda a, r: run(a, r, touching=True), "")))


def _add_depth(recipe: Recipe, settings: ValSettings, behind: bool = False) -> None:
    """Add the maps, or those of the hemispheres behind."""
    chosen, name = settings.drawn_maps, "maps.behind" if behind else "maps.depth"
    axes, key = (BACKWARD if behind else np.eye(3)), name.replace(".", "__")

    def run(arrays: Arrays, real: Any, **how: Any) -> Arrays:
        blockers = selected_blockers(_geometry(arrays), np.asarray(arrays["maps.blocks"]))
        center, frame, ball = (np.ascontiguousarray(arrays[name], np.float64) for name in (*VIEW, "maps.ball"))
        depth = draw_maps(blockers, center, axes @ frame, ball, replaced(chosen, how), real, None)[0]
        depth[np.asarray(arrays["areas.members"]) == 0] = np.inf
        return {name: depth}

    def moved(arrays: Arrays, real: Any) -> Arrays:
        frame, step = arrays["areas.frame"], 2 / chosen.resolution
        turned = frame[:, 2] - step * (frame[:, 0] + frame[:, 1])  # texel centres at 0 near the axis
        return run({**arrays, "areas.frame": np.stack([frame[:, 0], frame[:, 1], turned], axis=1)}, real)

    recipe.add("maps.depth_behind" if behind else "maps.depth", "distance from each map's centre to the nearest "
               "blocker" + (" behind the light: right and forward are turned round" if behind else ""), run,
               (*SCENE, "maps.blocks", *VIEW, "maps.ball", "areas.members"),
               {name: Spec(SHEET, "m", "distance along the texel's direction (2s, 2t, 1 - q) / (1 + q), "
                                   "q = s^2 + t^2; inf without blocker, outside the disc, without lights",
                                   paper="VAL Sec. 4.2, E-VAL-06")},
               paper="VAL Sec. 4.2, E-VAL-06, E-VAL-12", exact=("scene.vertices", *VIEW), bugs=(
                   Bug("rows run upwards", writing(run, **{key: lambda a: a[:, ::-1]}), "right, down, forward"),
                   Bug("rows and columns are exchanged", writing(run, **{key: lambda a: a.swapaxes(1, 2)}), ""),
                   Bug("texel centres lie at 0 instead of 1/2", moved, "centres at + 1/2"),
                   Bug("depth along the axis, not distance", writing(run, **{key: _axial}), "E-VAL-06"),
                   Bug("directions are linear in the angle", writing(run, **{key: _equiangular}),
                       "s = x / (1 + z), VAL-11"),
                   Bug("surfaces near the centre block", reading(run, maps__ball=np.zeros_like), "E-VAL-12"),
                   *(() if behind else (Bug("triangles are left out whole where they reach into the ball",
                                            lambda a, r: run(a, r, near_geometry="planes"), "E-VAL-12"),)),
                   Bug("the map of a cluster behind its plane", reading(run, areas__frame=lambda a: a * (
                       (-1,), (1,), (-1,))), "forward is the normal")))


def _squares(n: int) -> tuple[Array, Array, Array]:
    s, t = np.meshgrid(*[(np.arange(n) + 0.5) * 2 / n - 1] * 2)
    return s, t, s * s + t * t


def _axial(depth: Array) -> Array:
    square = _squares(depth.shape[1])[2]
    return depth * np.where(square <= 1, (1 - square) / (1 + square), 1)


def _equiangular(depth: Array) -> Array:
    """Return what a map of radius theta / (pi / 2) would hold, by its nearest texels."""
    n = depth.shape[1]
    s, t, square = _squares(n)
    rho = np.sqrt(square)
    scale = np.divide(np.tan(np.minimum(rho, 1) * np.pi / 4), rho, out=np.ones_like(rho), where=rho > 0)
    row, column = (np.clip(((x * scale + 1) * n / 2).astype(int), 0, n - 1) for x in (t, s))
    return np.where(square <= 1, depth[:, row, column], np.inf)


def _geometry(arrays: Arrays) -> Geometry:
    faces = np.asarray(arrays["scene.faces"], np.int32)
    return Geometry(np.asarray(arrays["scene.vertices"], np.float64), faces, np.zeros(len(faces), np.int32))


def shadow_maps_of(arrays: Arrays, real: Any) -> ShadowMaps:
    """Return the maps among arrays, one an area light; zeros for what is not among them."""
    near = np.asarray(arrays["maps.near"], np.float64)
    count, none = len(near), np.zeros(len(near))
    center, frame = (np.ascontiguousarray(arrays.get(name, np.zeros((count, *shape))), np.float64)
                     for name, shape in zip(VIEW, ((3,), (3, 3)), strict=True))
    depth = np.ascontiguousarray(arrays.get("maps.depth", np.zeros((count, 0, 0))), real)
    return ShadowMaps(depth, np.where(np.isfinite(near), np.arange(count), -1), center, frame, near,
                      np.asarray(arrays.get("maps.far", none), np.float64),
                      np.asarray(arrays.get("maps.scene_far", none), np.float64))
