"""Pixel lights with visibility, from the buffers to the sum."""

from refgi.settings import of
from refgi.truth.vpl import VplSettings
from refgi.vectors.cases.scenes import AWAY, DOWN, SPOT, SUN, Plan, Plans, cases_of, recorded_plan, room
from refgi.vectors.spec import Case


def shadowed(id: str, plan: Plan) -> Case:
    """Return `vpl` as planned: buffers, lights, visibility by rays or maps, sum."""
    return recorded_plan(id, plan, "vpl", settings_of(plan))


def settings_of(plan: Plan) -> VplSettings:
    """Return the settings of a case: so many lights of each map."""
    return of(VplSettings, **{"lights": plan.lights * len(plan.scene.lights), **plan.choices})


QUICK_PLANS: Plans = {
    "vpl-spot": lambda: Plan("one spot, no lobes; shadows of a shelf and a lid", room(SPOT, matte=True), (24, 18), 13,
                             32),
    "vpl-smooth": lambda: Plan("interpolated normals on a ball: pixels that face lights below their triangle; lobes",
                               room(SPOT, smooth=True), (26, 20), 13, 24),
    "vpl-sun": lambda: Plan("spot and directional lamp, purely glossy surfaces", room(DOWN, SUN), (19, 13), 11, 14),
    "vpl-no-flux": lambda: Plan("a lamp that meets no surface: no light, a picture of 0", room(AWAY, matte=True),
                                (12, 9),
                                7, 5),
    "vpl-maps": lambda: Plan("a map of 96 points for each light; holes pulled and pushed over two levels",
                             room(SPOT, matte=True), (16, 12), 13, 12, {
                                 "maps": "imperfect", "maps.points": 96, "maps.resolution": 16, "maps.splat": 0.6,
                                 "maps.levels": 2, "maps.bias": 1.0}),
}
FULL_PLANS: Plans = {
    "vpl-large": lambda: Plan("48 x 36 pixels, 2 x 64 lights", room(SPOT, DOWN), (48, 36), 23, 64),
    "vpl-maps-bare": lambda: Plan("maps of 512 points for lights of two lamps, boxes as wide as discs, no filled holes",
                                  room(SPOT, SUN, smooth=True), (26, 20), 13, 12, {
                                      "maps": "imperfect", "maps.points": 512, "maps.resolution": 32}),
}


QUICK, FULL = cases_of(QUICK_PLANS, shadowed), cases_of(FULL_PLANS, shadowed)
