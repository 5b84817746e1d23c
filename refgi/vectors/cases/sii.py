"""Splatting indirect illumination, from the buffers to the sum."""

from refgi.settings import of
from refgi.splat.sii.settings import SiiSettings
from refgi.vectors.cases.scenes import (
    BEHIND,
    BULB,
    DOWN,
    POLE,
    RAMP,
    SPOT,
    SUN,
    Plan,
    Plans,
    cases_of,
    coloured,
    far_away,
    recorded_plan,
    room,
    sheet,
)
from refgi.vectors.spec import Case


def settings_of(plan: Plan) -> SiiSettings:
    """Return the settings of a plan, whose lights are Halton points; no clamp unless it says otherwise."""
    return of(SiiSettings, **{"lights": plan.lights * len(plan.scene.lights), "clamp": "none", **plan.choices})


def splatting(id: str, plan: Plan) -> Case:
    """Return `sii` as planned: buffers, lights, sum."""
    return recorded_plan(id, plan, "sii", settings_of(plan))


QUICK_PLANS: Plans = {
    "sii-halton": lambda: Plan("one spot, Halton points, no warp, no lobes", room(SPOT, matte=True), (24, 18), 13, 40),
    "sii-three-lamps": lambda: Plan(
        "spot, cube and directional maps of unequal strength; glossy and purely glossy surfaces",
        room(SPOT, BULB, SUN), (24, 18), 16, 16, {"seed": 1}),
    "sii-warp-a": lambda: Plan("points warped by method A over 3 levels; clamped by discs", room(SPOT, BULB), (24, 18),
                               16, 30, {"seed": 1, "clamp": "disc", "warp": "A"}),
    "sii-warp-b": lambda: Plan("random points, given, warped by method B over 5 levels", room(SPOT), (17, 11), 13, 30,
                               {"seed": 1, "pattern": "random", "warp": "B", "warp.levels": 5}),
    "sii-grid": lambda: Plan("6 x 6 cells of a map; a light that shines straight down, a camera that looks straight "
                             "down", room(DOWN, camera=POLE), (15, 21), 17, 36, {"pattern": "grid"}),
    "sii-one-texel": lambda: Plan("maps of one texel, two lights", room(SPOT, DOWN), (8, 6), 1, 1,
                                  {"pattern": "grid"}),
    "sii-ramp": lambda: Plan("a spot of a squared ramp beside one of the smoothstep", room(RAMP, SPOT, matte=True),
                             (12, 9), 11, 10, {"seed": 1}),
    "sii-sheet": lambda: Plan("a slanted sheet lit from behind, a lamp without green, a map that is half empty",
                              sheet(BEHIND), (12, 9), 12, 24),
}
FULL_PLANS: Plans = {
    "sii-smooth": lambda: Plan("interpolated normals on a ball", room(SPOT, BULB, smooth=True), (32, 24), 24, 36,
                               {"seed": 1}),
    "sii-far": lambda: Plan("a scene 50 m from the origin, in float32 to 4 um", far_away(room(SPOT, matte=True), 50.0),
                            (24, 18), 13, 40),
    "sii-colours": lambda: Plan("vertex colours multiply the diffuse part, of glossy surfaces too",
                                coloured(room(SPOT, BULB)), (24, 18), 13, 18, {"seed": 1}),
    "sii-occluded": lambda: Plan("ambient occlusion of receivers; openness is given", room(SPOT), (24, 18), 13, 18,
                                 {"ambient_occlusion": "openness", "ambient_occlusion.radius": 1.0}),
    "sii-bytes": lambda: Plan("places in half floats, directions and flux in 8 bits, as in the published textures",
                              room(SPOT, BULB), (17, 13), 13, 20, {"seed": 1, "quantisation": "published"}),
    "sii-large": lambda: Plan("64 x 48 pixels, 256 lights of two lamps", room(SPOT, BULB), (64, 48), 48, 128,
                              {"seed": 1, "warp": "A"}),
}
QUICK, FULL = cases_of(QUICK_PLANS, splatting), cases_of(FULL_PLANS, splatting)
