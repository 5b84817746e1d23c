"""The range of pixel lights: Splatting Indirect Illumination with its cut, from the buffers to the sum."""

from refgi.settings import of
from refgi.splat.sii.settings import RelativeCut, SiiSettings
from refgi.vectors.cases.plan import Plan, Plans, cases_of
from refgi.vectors.cases.scenes import AWAY, DOWN, SPOT, SUN, room
from refgi.vectors.cases.sii import add_lit, drawn
from refgi.vectors.cases.vpl import default_shifts
from refgi.vectors.recipe import Recipe
from refgi.vectors.spec import Case
from refgi.vectors.stages.pairs import add_footprints
from refgi.vectors.stages.sii_range import add_range
from refgi.vectors.stages.sii_range_sum import add_ellipsoids


def settings_of(plan: Plan) -> SiiSettings:
    """Return the settings of a plan, whose lights are Halton points; no clamp unless it says otherwise."""
    return of(SiiSettings, **{"lights": plan.lights * len(plan.scene.lights), "clamp": "none", "cut": "relative",
                              **plan.choices})


def ranged(id: str, plan: Plan) -> Case:
    """Return `sii` with a cut as planned: buffers, lights, ranges, sum."""
    recipe, lamps, settings = Recipe(id, "sii", plan.what), len(plan.scene.lights), settings_of(plan)
    add_lit(recipe, plan.scene, plan.size, plan.maps, drawn(plan.scene, plan.maps, plan.lights * lamps),
            shifts=default_shifts(lamps))
    if settings.pairs.needs_footprints:
        add_footprints(recipe, lamps)
    cut = settings.reach.cut
    assert isinstance(cut, RelativeCut)
    add_range(recipe, plan.lights * lamps, cut.share, cut.reference_length, settings.pairs)
    add_ellipsoids(recipe)
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


QUICK, FULL = cases_of(QUICK_PLANS, ranged), cases_of(FULL_PLANS, ranged)
