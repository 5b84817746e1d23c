"""Stages of the maps of area lights: views, blockers, distances to the nearest of them (VAL Sec. 4.2, 5.1).

Every area light has a map here. One that is empty, inf everywhere, occludes nothing: V is 1.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np

from refgi.cluster.maps.occluders import ends_of, occluders, selected_blockers
from refgi.cluster.maps.shadow_maps import BACKWARD, ShadowMaps, draw_maps, farthest, farthest_corner, map_centers
from refgi.cluster.settings import ValSettings
from refgi.literal import val_maps as literal
from refgi.scene import Geometry
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Arrays, Spec
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

    form = Form(literal.map_ranges, {"depth": "maps.depth"}, ("maps.near", "maps.far"))
    recipe.add("maps.range", "nearest and farthest distance on each map", run, ("maps.depth",), {
        "maps.near": Spec("area light", "m", "least distance; inf on an empty map"),
        "maps.far": Spec("area light", "m", "greatest finite distance; 0 on an empty map")},
        paper="E-VAL-05", bugs=form.bugs("map_ranges"), variants=(form,))


def _add_views(recipe: Recipe, settings: ValSettings) -> None:
    share = settings.drawn_maps.near_share

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        box = extent_of(arrays, "visible", "illuminated")
        center = map_centers(arrays["clusters.center"], arrays["clusters.normal"], extent_of(arrays, "illuminated"))
        return {"maps.center": center, "maps.ball": share * arrays["areas.radius"],
                "maps.scene_far": farthest_corner(box, center)}

    form = Form(literal.map_views, {
        "visible": EXTENTS[0], "illuminated": EXTENTS[1], "center": "clusters.center", "normal": "clusters.normal",
        "radius": "areas.radius"}, ("maps.center", "maps.ball", "maps.scene_far"), {"near_distance": share})
    recipe.facts["maps"] = {"texels a side": settings.maps.resolution,
                            "lift, of the illuminated extent's largest coordinate": 4e-6,
                            "ball, of the cluster's radius": share, "projection": "paraboloid (x, y) / (1 + z)"}
    recipe.add("maps.views", "where maps look from, and the ball within which nothing blocks", run,
               (*EXTENTS, "clusters.center", "clusters.normal", "areas.radius"),
               {"maps.center": Spec("area light, xyz", "m", "centre of the map, a little off the surface", "world"),
                "maps.ball": Spec("area light", "m", "what is nearer to the centre blocks nothing"),
                "maps.scene_far": Spec("area light", "m", "to the farthest corner of the extents' common box")},
               paper="VAL Sec. 5.1, E-VAL-12", bugs=form.bugs("map_views"), variants=(form,))


def _add_blockers(recipe: Recipe, settings: ValSettings) -> None:
    touching = not settings.maps.occluders_alone

    def run(arrays: Arrays, real: Any) -> Arrays:  # noqa: ARG001
        geometry = _geometry(arrays)
        frame: Any = SimpleNamespace(
            scene=SimpleNamespace(geometry=geometry, face_count=len(geometry.faces)),
            gbuffer=SimpleNamespace(triangle_id=np.asarray(arrays["gbuffer.triangle_id"])),
            extent=extent_of(arrays, "visible", "illuminated"), illuminated_extent=extent_of(arrays, "illuminated"))
        where: Any = SimpleNamespace(position=arrays["lights.position"])
        return {"maps.blocks": occluders(geometry, ends_of(frame, where), touching=touching)}

    form = Form(literal.blockers, {
        "vertices": "scene.vertices", "faces": "scene.faces", "triangle_id": "gbuffer.triangle_id",
        "light_position": "lights.position", "visible": EXTENTS[0], "illuminated": EXTENTS[1]},
        ("maps.blocks",), {"touching": touching})
    recipe.facts["maps.blocks"] = {"tolerance, of the diagonal of the extents' common box": 1e-6}
    recipe.add("maps.blockers", "triangles with ends of light, seen vertices and pixel lights, on both sides", run,
               ("scene.vertices", "scene.faces", "gbuffer.triangle_id", "lights.position", *EXTENTS),
               {"maps.blocks": Spec("triangle", "1", "whether it may lie between a light and a receiver", tier="T0")},
               paper="docs/methods/val_visibility", bugs=form.bugs("blockers"), variants=(form,))


def _add_depth(recipe: Recipe, settings: ValSettings, behind: bool = False) -> None:
    """Add the maps, or those of the hemispheres behind."""
    chosen, name = settings.drawn_maps, "maps.behind" if behind else "maps.depth"
    axes = BACKWARD if behind else np.eye(3)

    def run(arrays: Arrays, real: Any) -> Arrays:
        drawn = selected_blockers(_geometry(arrays), np.asarray(arrays["maps.blocks"]))
        center, frame, ball = (np.ascontiguousarray(arrays[name], np.float64) for name in (*VIEW, "maps.ball"))
        depth = draw_maps(drawn, center, axes @ frame, ball, chosen, real, None)[0]
        depth[np.asarray(arrays["areas.members"]) == 0] = np.inf
        return {name: depth}

    form = Form(literal.depth_maps_behind if behind else literal.depth_maps, {
        "vertices": "scene.vertices", "faces": "scene.faces", "blocks": "maps.blocks", "center": VIEW[0],
        "frame": VIEW[1], "ball": "maps.ball", "members": "areas.members"}, (name,), {"texels": chosen.resolution})
    recipe.add("maps.depth_behind" if behind else "maps.depth", "distance from each map's centre to the nearest "
               "blocker" + (" behind the light: right and forward are turned round" if behind else ""), run,
               (*SCENE, "maps.blocks", *VIEW, "maps.ball", "areas.members"),
               {name: Spec(SHEET, "m", "distance along the texel's direction (2s, 2t, 1 - q) / (1 + q), "
                                   "q = s^2 + t^2; inf without blocker, outside the disc, without lights",
                                   paper="VAL Sec. 4.2, E-VAL-06")},
               paper="VAL Sec. 4.2, E-VAL-06, E-VAL-12", exact=("scene.vertices", *VIEW),
               bugs=form.bugs("depth_maps", *(() if behind else ("depth_maps/ahead",))), variants=(form,))


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
