"""Light with visibility: clusters of area lights, pixel lights with rays or maps, the path-traced truth."""

import math
from collections.abc import Callable
from typing import Any

from refgi.cluster.settings import ValSettings
from refgi.scene import Camera, Scene, SpotLight
from refgi.settings import of
from refgi.truth.settings import TruthSettings
from refgi.truth.vpl import VplSettings
from refgi.vectors.cases.scenes import (
    AWAY,
    BULB,
    DOWN,
    SPOT,
    SUN,
    Plan,
    Plans,
    cases_of,
    far_away,
    kerbs,
    room,
    stacked,
)

SEED = 1  # of the lights' shifts: without one, points lie on the borders of texels
CLOSE = Camera((1.0, 1.05, 0.95), (-0.4, 0.35, -0.5), (0.1, 1.0, 0.0), math.radians(65))  # rolled, fills the picture
ABOVE = Camera((0.2, 2.5, 0.1), (0.15, 0.0, 0.1), (0.0, 0.0, -1.0), math.radians(34))  # sees no wall
BESIDE = Camera((1.5, 0.8, 1.6), (-0.1, 0.3, -0.3), (0.1, 1.0, 0.0), math.radians(50))  # sees what is below the table
FLOOR_LAMP = SpotLight((0.3, 1.6, 0.35), (-0.2, -1.0, -0.25), 0.2, 0.42, (4.0, 2.6, 1.3))


def vpl_settings(plan: Plan) -> VplSettings:
    """Return the settings of a plan: so many lights of each map."""
    return of(VplSettings, **{"lights": plan.lights * len(plan.scene.lights), **plan.choices})


def val_settings(plan: Plan) -> ValSettings:
    """Return the settings of a plan."""
    return of(ValSettings, **plan.choices)


def truth_settings(plan: Plan) -> TruthSettings:
    """Return the settings of a plan, as a port would first write it."""
    return of(TruthSettings, **{"estimator": "hemisphere", "directions": 64, "samples": 2048, "seed": 1,
                                **plan.choices})


def plan(
    what: str, scene: Callable[[], Scene], size: tuple[int, int], maps: int, lights: int, **choices: Any
) -> Callable[[], Plan]:
    """Return a plan of `val`; `choices` by their keys, over those that all cases share."""
    plain = {"lights": lights, "seed": SEED, "clamp": "none", "maps_resolution": 15, "interleaving": 1}
    return lambda: Plan(what, scene(), size, maps, lights, plain | choices)


def traced(what: str, *lamps: Any, smooth: bool = False, matte: bool = False, **choices: Any) -> Callable[[], Plan]:
    """Return a plan of the truth of a room; `choices` by their keys."""
    return lambda: Plan(what, room(*lamps, smooth=smooth, matte=matte), (20, 14), 1, choices=choices, shadows="exact")


VPL: Plans = {
    "vpl-spot": lambda: Plan("one spot, no lobes; shadows of a shelf and a lid", room(SPOT, matte=True), (24, 18), 13,
                             32),
    "vpl-smooth": lambda: Plan("interpolated normals on a ball: pixels that face lights below their triangle; lobes",
                               room(SPOT, smooth=True), (26, 20), 13, 24),
    "vpl-sun": lambda: Plan("spot and directional lamp, purely glossy surfaces", room(DOWN, SUN), (19, 13), 11, 14),
    "vpl-no-flux": lambda: Plan("a lamp that meets no surface: no light, a picture of 0", room(AWAY, matte=True),
                                (12, 9), 7, 5),
    "vpl-maps": lambda: Plan("a map of 96 points for each light; holes pulled and pushed over two levels",
                             room(SPOT, matte=True), (16, 12), 13, 12, {
                                 "maps": "imperfect", "maps.points": 96, "maps.resolution": 16, "maps.splat": 0.6,
                                 "maps.levels": 2, "maps.bias": 1.0}),
}
VPL_FULL: Plans = {
    "vpl-large": lambda: Plan("48 x 36 pixels, 2 x 64 lights", room(SPOT, DOWN), (48, 36), 23, 64),
    "vpl-maps-bare": lambda: Plan("maps of 512 points for lights of two lamps, boxes as wide as discs, no filled holes",
                                  room(SPOT, SUN, smooth=True), (26, 20), 13, 12, {
                                      "maps": "imperfect", "maps.points": 512, "maps.resolution": 32}),
}
VAL: Plans = {
    "val-csm": plan("convolution shadow maps by the defaults, maps of an odd side; two lamps, a cluster of one light, "
                    "an area light that nothing occludes", lambda: room(SPOT, BULB, matte=True, camera=CLOSE),
                    (17, 13), 16, 64, clusters=8, clamp="disc"),
    "val-pcss": plan("blockers texel by texel, interpolated normals, glossy lights; lights change clusters still in "
                     "the last round", lambda: room(SPOT, smooth=True, camera=CLOSE), (17, 13), 13, 30, clusters=6,
                     rounds=3, visibility="pcss"),
    "val-single": plan("more clusters asked for than lights, coincident lights: hard shadows",
                       lambda: room(SPOT, matte=True, camera=CLOSE), (17, 13), 5, 16, clusters=30),
    "val-empty": plan("coincident lights at which clusters begin, so that some stay empty; depths in metres",
                      lambda: room(SPOT, matte=True, smooth=True, camera=ABOVE), (15, 11), 3, 24, clusters=9,
                      depth_scale="map"),
    "val-interleaved": plan("blocks of 3 x 3 pixels in a picture of odd size, PCF, blur with every subset; 4 m from "
                            "the origin, pixels without surface, a ball",
                            lambda: far_away(room(SPOT, BULB, matte=True, smooth=True), 4.0), (20, 14), 16, 36,
                            clusters=5, interleaving=3, visibility="pcf", blur_extent=0.3),
    "val-rim": plan("kerbs beside the lights, down to their plane: maps with geometry at the rim of the disc",
                    lambda: kerbs(FLOOR_LAMP, camera=CLOSE), (15, 11), 9, 12, clusters=3),
}
VAL_FULL: Plans = {
    "val-published": plan("the printed forms: raw distances, squares of alpha / pi, the search by solid angle; blocks "
                          "of 4 x 4 pixels, lights by cluster, blur without missing subsets",
                          lambda: room(SPOT, BULB, camera=CLOSE), (18, 14), 16, 64, clusters=6, interleaving=4,
                          assignment="cluster", every_subset=False, distance="raw", prefilter="brute",
                          as_published=("val_alpha", "val_alpha_over_pi", "val_search_solid_angle")),
    "val-options": plan("rectangles along the spread of lights, Delta the longer side, unbiased and foreshortened; 6 "
                        "damped terms, V doubled and cut, depths up to the scene's end",
                        lambda: room(SPOT, smooth=True), (17, 13), 13, 40, clusters=4, axes="pca",
                        area_extent="longer", unbiased_area=True, foreshortened=True, terms=6, attenuation=1.0,
                        rescale="scale2", depth_scale="scene", distance="squared"),
    "val-bytes": plan("basis in 8 bits and half floats, as in the published textures",
                      lambda: room(SPOT, matte=True, camera=CLOSE), (17, 13), 13, 24, clusters=4,
                      quantisation="published"),
    "val-dual": plan("a second map behind each area light, PCF of 3 x 3 texels; a slab below the table that is lit",
                     lambda: stacked(SPOT, BULB, camera=BESIDE), (20, 14), 13, 36, clusters=4, visibility="pcf",
                     texels=3, behind="dual_paraboloid"),
    "val-csm-dual": plan("convolution shadow maps of both hemispheres; clusters by place alone, lit pixels behind them",
                         lambda: stacked(SPOT, BULB, camera=BESIDE), (20, 14), 13, 24, clusters=3, normal_weight=0.0,
                         behind="dual_paraboloid"),
    "val-pcss-dual": plan("blockers on maps of both hemispheres, texel by texel; Delta is foreshortened",
                          lambda: stacked(SPOT, BULB, camera=BESIDE), (20, 14), 13, 24, clusters=4,
                          visibility="pcss", foreshortened=True, behind="dual_paraboloid"),
    "val-shadowless": plan("area lights without shadows, blocks of 2 x 2 pixels, the mean of all",
                           lambda: room(SPOT, camera=CLOSE), (12, 9), 11, 20, clusters=3, visibility=None,
                           interleaving=2, blur="box"),
    "val-rays": plan("rays to the rectangle of each area light, for pixels behind it as well; interpolated normals",
                     lambda: room(SPOT, matte=True, smooth=True, camera=CLOSE), (12, 9), 11, 20, clusters=3,
                     visibility="rays_rectangle", behind="raytrace"),
    "val-projected": plan("texels of the map projected back onto the rectangle",
                          lambda: kerbs(FLOOR_LAMP, camera=CLOSE), (15, 11), 13, 18, clusters=3,
                          visibility="back_projection"),
}
TRUTH: Plans = {
    "truth-one-bounce": traced("light of three lamps after one bounce, glossy and purely glossy surfaces", SPOT, BULB,
                               SUN),
    "truth-matte": traced("diffuse surfaces alone, one lamp", SPOT, matte=True),
    "truth-visible": traced("only what the camera sees emits and nothing blocks: what a screen-space method can find",
                            SPOT, BULB, matte=True, emitters="visible", visibility=False),
}
TRUTH_FULL: Plans = {
    "truth-two-bounces": traced("light after one and two bounces", SPOT, BULB, bounces=2),
    "truth-smooth": traced("a ball with interpolated normals", SPOT, BULB, smooth=True),
}
QUICK = {**cases_of(VPL, "vpl", vpl_settings), **cases_of(VAL, "val", val_settings),
         **cases_of(TRUTH, "truth", truth_settings)}
FULL = {**cases_of(VPL_FULL, "vpl", vpl_settings), **cases_of(VAL_FULL, "val", val_settings),
        **cases_of(TRUTH_FULL, "truth", truth_settings)}
