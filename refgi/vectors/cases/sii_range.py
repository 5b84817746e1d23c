"""The range of pixel lights: Splatting Indirect Illumination with its cut, from the buffers to the sum."""

from functools import partial

import numpy as np

from refgi.splat.sii.settings import SiiSettings
from refgi.splat.sii.steps import ellipsoids
from refgi.vectors.cases import sii
from refgi.vectors.cases.scenes import AWAY, DOWN, SPOT, SUN, Plan, Plans, cases_of, recorded_plan, room
from refgi.vectors.recipe import Recipe
from refgi.vectors.recorded import record
from refgi.vectors.spec import Case

EXPONENTS = (0.25, 1.0, 2.0, 3.0, 10.0, 40.0, 100.0, 1000.0)


def settings_of(plan: Plan) -> SiiSettings:
    """Return the settings of a plan with the paper's cut, unless it says otherwise."""
    return sii.settings_of(plan._replace(choices={"cut": "relative", **plan.choices}))


def bounds(id: str) -> Case:
    """Return the bounds of regions by their exponents."""
    recipe = Recipe(id, "sii", "ellipsoids around the region of lights and lobes of several exponents")
    record(recipe, lambda: ellipsoids(np.array(EXPONENTS)))
    return recipe.case()


QUICK_PLANS: Plans = {
    "sii-range-spot": lambda: Plan("the paper's cut of 5 % with the picture's reference length; no lobes",
                                   room(SPOT, matte=True), (21, 16), 13, 24, {}),
    "sii-range-lamps": lambda: Plan("lamps of unequal strength, lobes of their own range, discs", room(SPOT, DOWN, SUN),
                                    (17, 13), 11, 12, {"clamp": "disc"}),
    "sii-range-length": lambda: Plan("10 % with a reference length of 3 m", room(SPOT), (16, 12), 13, 16,
                                     {"cut.share": 0.1, "cut.reference_length": 3.0}),
    "sii-range-no-flux": lambda: Plan("a lamp that meets no surface: no light, a picture of 0", room(AWAY, matte=True),
                                      (12, 9), 7, 5, {}),
}
FULL_PLANS: Plans = {
    "sii-range-large": lambda: Plan("32 x 24 pixels, 2 x 32 lights", room(SPOT, SUN, smooth=True), (32, 24), 23, 32,
                                    {}),
}


def ranged(id: str, plan: Plan) -> Case:
    """Return `sii` with a cut as planned."""
    return recorded_plan(id, plan, "sii", settings_of(plan))


QUICK, FULL = cases_of(QUICK_PLANS, ranged), cases_of(FULL_PLANS, ranged)
QUICK["sii-range-bounds"] = partial(bounds, "sii-range-bounds")
