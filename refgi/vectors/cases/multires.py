"""Adaptive multiresolution splatting, from the scene to the picture."""

import math
from typing import Any

from refgi.scene import Camera, Scene, merge
from refgi.settings import of
from refgi.splat.multires.settings import ByIrradiance, Criteria, MultiresSettings
from refgi.vectors.cases.scenes import (
    AWAY,
    DOWN,
    FLOOR,
    SPOT,
    SUN,
    WALL,
    Plan,
    Plans,
    cases_of,
    quad,
    room,
    stored_scene,
)

CLOSE = Camera((1.0, 1.05, 0.95), (-0.4, 0.35, -0.5), (0.1, 1.0, 0.0), math.radians(65))  # fills the picture
AT_WALL = Camera((0.2, 1.4, 0.8), (0.1, 1.4, -1.0), (0.0, 1.0, 0.0), math.radians(30))  # the back wall alone


def settings_of(plan: Plan) -> MultiresSettings:
    """Return the settings of a plan, whose lights lie on a grid; few cells on the coarsest level."""
    coarsest = {} if "subsplats" in plan.choices else {"coarsest": 5}
    return of(MultiresSettings, **{"lights": plan.lights * len(plan.scene.lights), **coarsest, **plan.choices})


def pole(*lights: Any) -> Scene:
    """Return a floor, a thin slanted pole one to two pixels wide and a glossy fold, before the void.

    The two sides of the fold differ in z of their normals alone.
    """
    geometry, materials = merge([quad((-1, 0, 0.6), (2, 0, 0), (0, 0, -1.2), FLOOR),
                                 quad((0.25, 0.0, 0.1), (0.05, 0, 0.02), (-0.2, 1.6, 0.1), FLOOR),
                                 quad((-0.8, 0.05, 0.4), (0.112, 0, -0.384), (0, 0.8, 0), WALL),
                                 quad((-0.688, 0.05, 0.016), (-0.112, 0, -0.384), (0, 0.8, 0), WALL)], smooth=False)
    camera = Camera((0.4, 0.9, 2.4), (-0.1, 0.55, 0.0), (0.0, 1.0, 0.0), math.radians(45))
    return stored_scene(Scene("kit pole", geometry, materials, camera, lights))


QUICK_PLANS: Plans = {
    "multires-odd": lambda: Plan(
        "defaults but for the depth's threshold: ranges, bare corners, tent; 45 x 35 pixels, cut cells",
        room(SPOT), (45, 35), 12, 16, {"depth.threshold": 0.3}),
    "multires-edge": lambda: Plan(
        "a thin edge before the void, directional lamp; rim of one pixel, no corners, no clamp",
        pole(SUN), (41, 30), 18, 36, {"rim": 1, "diagonal": "off", "clamp": "none"}),
    "multires-wall": lambda: Plan(
        "a flat wall, no cell is refined; each pixel has the light of its subsplat",
        room(SUN, DOWN, camera=AT_WALL), (19, 14), 15, 9, {"upsampling": "nearest"}),
    "multires-no-flux": lambda: Plan(
        "a lamp that meets no surface: no light, a picture of 0", room(AWAY, matte=True), (18, 13), 9, 9, {}),
    "multires-published": lambda: Plan(
        "printed forms: every cell across a corner, every cell filtered, depths in metres; Eq. 3",
        room(SPOT, matte=True, smooth=True), (26, 35), 15, 25, {
            "diagonal": "literal", "traversal": "list", "clamp": "none", "depth.measure": "absolute",
            "depth.threshold": 0.4, "normal.components": "xy", "detail": 0.3,
            "as_published": frozenset({"ams_filter_all", "ams_all_corners"})}),
    "multires-slopes": lambda: Plan(
        "slopes of depth and Eq. 1, finest level 1, all neighbours, means of cells, the demo's filter",
        room(SPOT, DOWN, matte=True, smooth=True), (33, 25), 15, 9, {
            "depth": None, "normal": None, "derivative": "slope", "curvature": "chord", "finest": 1,
            "diagonal": "full8", "representative": "mean", "upsampling": "demo", "derivative.threshold": 0.2,
            "curvature.threshold": 0.3}),
}
FULL_PLANS: Plans = {
    "multires-large": lambda: Plan("64 x 48 pixels, 2 x 64 lights, 6 levels", room(SPOT, DOWN, smooth=True), (64, 48),
                                   25, 64, {"coarsest": 2}),
    "multires-rate": lambda: Plan(
        "Eq. 1 over the distance, thresholds of depth that fall with the level; levels interpolated one by one",
        room(SPOT, smooth=True), (45, 31), 12, 16, {
            "curvature": "rate", "normal": None, "upsampling": "naive_bilinear", "depth.measure": "demo",
            "depth.threshold": 0.2, "curvature.threshold": 2.0}),
    "multires-lights": lambda: Plan("lists of each light's own, split where its irradiance changes", room(SPOT, DOWN),
                                    (29, 22), 12, 4, {"subsplats": ByIrradiance(coarsest=5, threshold=0.15),
                                                      "clamp": "none"}),
    "multires-start": lambda: Plan(
        "lists that begin with what geometry refines; T a share of the largest sum of all lights, over their number",
        room(SPOT), (23, 18), 15, 9, {"subsplats": ByIrradiance(
            coarsest=5, threshold=0.3, form="brightest", criteria=of(Criteria, depth_threshold=0.3)), "clamp": "none"}),
    "multires-rays": lambda: Plan("a shadow ray from each subsplat to each light", room(SPOT, DOWN), (37, 27), 13, 16,
                                  {"visibility": "rays", "clamp": "none"}),
    "multires-soft": lambda: Plan("soft shadows of clusters at subsplats", room(SPOT, camera=CLOSE), (29, 22), 12, 16, {
        "visibility": "val", "clusters": 3, "maps_resolution": 13, "clamp": "none"}),
    "multires-double": lambda: Plan("rendered at twice the width and height, as the paper's pictures", pole(SUN, SPOT),
                                    (21, 15), 16, 25, {"supersampled": True}),
}


QUICK, FULL = (cases_of(plans, "multires", settings_of) for plans in (QUICK_PLANS, FULL_PLANS))
