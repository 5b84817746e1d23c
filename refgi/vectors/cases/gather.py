"""Gathering from reflective shadow maps, from the scene to the picture."""

import math

import numpy as np

from refgi.frame import Frame
from refgi.pairs.irradiance import Receivers
from refgi.rsm import Rsm
from refgi.sampling import halton
from refgi.scene import SpotLight
from refgi.settings import of
from refgi.splat.gather.gather import GatherSettings
from refgi.splat.gather.steps import gather_steps
from refgi.types import Array
from refgi.vectors.cases.scenes import AWAY, BULB, DOWN, SPOT, SUN, Plan, Plans, cases_of, recorded_plan, room
from refgi.vectors.recipe import Recipe
from refgi.vectors.recorded import record
from refgi.vectors.spec import Case

SQUARE = SpotLight((0.25, 1.5, 0.125), (0.0, -1.0, 0.0), 0.4, math.pi / 4, (3.0, 1.0, 2.0))  # a map of half extent 1


def settings_of(plan: Plan) -> GatherSettings:
    """Return the settings of a plan; every pixel runs the sum unless it says otherwise."""
    return of(GatherSettings, **{"interpolation": None, **plan.choices})


def gathering(id: str, plan: Plan) -> Case:
    """Return `gather` as planned."""
    return recorded_plan(id, plan, "gather", settings_of(plan))


def at_borders() -> Case:
    """Return gathering at points that are given: on a map's border, outside, behind the lamp, at it, on a texel."""
    scene, disc = room(SQUARE, matte=True), of(GatherSettings, radius=0.4).disc
    recipe = Recipe("gather-border", "gather", "points on the border of a map, beyond it, behind the lamp, at it, on a "
                    "texel's surface; a sample in the middle of the disc")
    recipe.scene, xi = scene, np.concatenate([[[0.0, 0.0], [0.0, 0.5]], halton(22, start=1)])

    def irradiance() -> Array:
        rsms = Frame(scene, dtype=np.float64, rsm_resolution=13).rsms
        return gather_steps(border_points(rsms[0]), rsms, disc, xi)

    record(recipe, irradiance)
    return recipe.case()


def border_points(rsm: Rsm) -> Receivers:
    """Return points on the border of a map, outside, behind the lamp, at it, on a texel."""
    view = rsm.projection
    places = [(a, b, z) for z in (1.0, 0.5) for a in (-1.0, -0.5, 0.0, 1.0)
              for b in (-1.0, 0.0, 0.75, 1.0)]  # on the map
    places += [(1.5, 0.25, 1.0), (-3.0, 1.5, 0.5), (0.0, -2.0, 1.0), (8.0, 8.0, 0.25)]  # beyond it
    local = [(a * z, b * z, z) for a, b, z in places]
    local += [(0.5, 0.25, -0.25), (-0.25, 0.5, -0.5), (0.0, 0.0, -0.25), (0.5, 0.0, 0.0),
              (0.0, 0.0, 0.0)]  # behind, at it
    position = view.origin[0] + np.asarray(local) @ view.frame[0]
    position = np.concatenate([position.T, rsm.position[:, 3:9:5, 2:11:4].reshape(3, -1)], axis=1)
    normal = np.tile([[0.0], [1.0], [0.0]], position.shape[1])
    normal[:, len(places) : len(local)] *= -1
    normal[:, 1 : len(places) : 3] = [[0.8], [0.0], [0.6]]
    return Receivers(position[:, None], normal[:, None], np.ones((1, position.shape[1]), np.bool_))


QUICK_PLANS: Plans = {
    "gather-spot": lambda: Plan("one spot, discs of 0.3 map widths, no lobes", room(SPOT, matte=True), (24, 18), 13,
                                choices={"samples": 24, "radius": 0.3}),
    "gather-three-lamps": lambda: Plan(
        "spot, cube and directional maps; of glossy surfaces the diffuse part alone", room(SPOT, BULB, SUN), (17, 13),
        11, choices={"samples": 16, "radius": 0.5}),
    "gather-behind": lambda: Plan(
        "receivers behind the lamp, texels moved back by 2 cm, xi1^2 as weight, discs of more than the map",
        room(DOWN, matte=True), (19, 23), 12, choices={
            "samples": 20, "radius": 1.5, "disc.offset": 0.02, "disc.as_published": frozenset({"rsm_weight_squared"})}),
    "gather-interpolated": lambda: Plan(
        "interpolated between 9 x 9 coarse pixels where surfaces are similar", room(SPOT, DOWN, smooth=True), (31, 25),
        12, choices={"samples": 12, "radius": 0.4, "interpolation": "coarse", "interpolation.grid": 9,
             "interpolation.reach": 0.2}),
}
FULL_PLANS: Plans = {
    "gather-no-flux": lambda: Plan("a lamp that meets no surface: no light, a picture of 0", room(AWAY, matte=True),
                                   (12, 9), 7, choices={"samples": 8}),
}


QUICK, FULL = {**cases_of(QUICK_PLANS, gathering), "gather-border": at_borders}, cases_of(FULL_PLANS, gathering)
