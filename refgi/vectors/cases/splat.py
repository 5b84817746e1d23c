"""Pairs of lights and receivers; splatting, with and without its cut; gathering from reflective shadow maps."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from refgi.frame import Frame
from refgi.pairs.irradiance import Receivers
from refgi.pairs.steps import pairs
from refgi.rsm import Rsm
from refgi.sampling import halton
from refgi.scene import SpotLight
from refgi.settings import of
from refgi.splat.gather.gather import GatherSettings
from refgi.splat.gather.steps import gather_steps
from refgi.splat.sii.settings import SiiSettings
from refgi.splat.sii.steps import ellipsoids
from refgi.types import Array
from refgi.vectors.cases.scenes import (
    AWAY,
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
    room,
    sheet,
)
from refgi.vectors.recorded import record
from refgi.vectors.spec import Case, Recipe

COUNT = 160  # pairs
EXPONENTS = (0.25, 1.0, 2.0, 3.0, 10.0, 40.0, 100.0, 1000.0)
SQUARE = SpotLight((0.25, 1.5, 0.125), (0.0, -1.0, 0.0), 0.4, math.pi / 4, (3.0, 1.0, 2.0))  # a map of half extent 1


def single_pairs(id: str, what: str, *, glossy: bool) -> Case:
    """Return one light and one receiver at a time: random ones, then what makes ports fail."""
    random = np.random.default_rng(11)
    place, toward = random.normal(size=(3, COUNT)), _unit(random.normal(size=(3, COUNT)))
    apart = 10.0 ** random.uniform(-3, 3, COUNT)
    subnormal = np.s_[74:78]  # lights of such a flux, at distances that do not make it more: GPUs read it as 0
    apart[subnormal] = np.maximum(apart[subnormal], 10.0)
    receiver = place + apart * toward
    normal = _unit(0.4 * random.normal(size=(3, COUNT)) + toward)
    facing = _unit(0.4 * random.normal(size=(3, COUNT)) - toward)
    flux = 10.0 ** random.uniform(-4, 2, (3, COUNT))
    receiver[:, :8] = place[:, :8]  # coincident: no light, no NaN
    facing[:, 8:24] = _across(toward[:, 8:24]) - 1e-3 * toward[:, 8:24]  # grazing
    normal[:, 24:40] = _across(toward[:, 24:40]) + 1e-3 * toward[:, 24:40]
    facing[:, 40:52] *= -1  # behind the receiver
    normal[:, 52:64] *= -1  # behind the light
    facing[:, 64:70], normal[:, 64:70] = -facing[:, 64:70], -normal[:, 64:70]  # both
    flux[:, 70:74] = 0.0
    flux[:, subnormal] = 1e-40
    lobes: tuple[Array, ...] = ()
    if glossy:
        lobe = 10.0 ** random.uniform(-4, 2, (3, COUNT))
        axis, above = _unit(0.5 * random.normal(size=(3, COUNT)) + toward), _unit(normal)
        height = (axis * above).sum(axis=0)
        axis = np.where((height < 0) & (np.arange(COUNT) < 140), axis - 2 * height * above, axis)  # above the surface
        flux[:, 80:110] = 0.0  # purely glossy
        lobe[:, 110:120] = 0.0  # purely diffuse
        exponent = np.where(np.arange(COUNT) % 8 == 0, 0.0, 10.0 ** random.uniform(0, 3, COUNT))
        exponent[140:] = np.minimum(exponent[140:], 8.0)  # some axes lie below their surface
        lobes = lobe, axis, exponent
    recipe = Recipe(id, "pairs", what)
    record(recipe, lambda: pairs(receiver[:, None], _unit(facing)[:, None], place, _unit(normal), flux, *lobes))
    return recipe.case()


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=0))


def _across(vectors: Array) -> Array:
    """Return unit vectors across others."""
    other = np.where(np.abs(vectors[0]) < 0.5, 0, 1)
    helper = np.zeros_like(vectors)
    helper[other, np.arange(vectors.shape[1])] = 1.0
    return _unit(np.cross(vectors, helper, axis=0))


def sii_settings(plan: Plan) -> SiiSettings:
    """Return the settings of a plan, whose lights are Halton points; no clamp unless it says otherwise."""
    return of(SiiSettings, **{"lights": plan.lights * len(plan.scene.lights), "clamp": "none", **plan.choices})


def range_settings(plan: Plan) -> SiiSettings:
    """Return the settings of a plan with the paper's cut, unless it says otherwise."""
    return sii_settings(plan._replace(choices={"cut": "relative", **plan.choices}))


def bounds(id: str) -> Case:
    """Return the bounds of regions by their exponents."""
    recipe = Recipe(id, "sii", "ellipsoids around the region of lights and lobes of several exponents")
    record(recipe, lambda: ellipsoids(np.array(EXPONENTS)))
    return recipe.case()


def gather_settings(plan: Plan) -> GatherSettings:
    """Return the settings of a plan; every pixel runs the sum unless it says otherwise."""
    return of(GatherSettings, **{"interpolation": None, **plan.choices})


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


SII: Plans = {
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
SII_FULL: Plans = {
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
RANGE: Plans = {
    "sii-range-spot": lambda: Plan("the paper's cut of 5 % with the picture's reference length; no lobes",
                                   room(SPOT, matte=True), (21, 16), 13, 24, {}),
    "sii-range-lamps": lambda: Plan("lamps of unequal strength, lobes of their own range, discs", room(SPOT, DOWN, SUN),
                                    (17, 13), 11, 12, {"clamp": "disc"}),
    "sii-range-length": lambda: Plan("10 % with a reference length of 3 m", room(SPOT), (16, 12), 13, 16,
                                     {"cut.share": 0.1, "cut.reference_length": 3.0}),
    "sii-range-no-flux": lambda: Plan("a lamp that meets no surface: no light, a picture of 0", room(AWAY, matte=True),
                                      (12, 9), 7, 5, {}),
}
RANGE_FULL: Plans = {
    "sii-range-large": lambda: Plan("32 x 24 pixels, 2 x 32 lights", room(SPOT, SUN, smooth=True), (32, 24), 23, 32,
                                    {}),
}
GATHER: Plans = {
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
GATHER_FULL: Plans = {
    "gather-no-flux": lambda: Plan("a lamp that meets no surface: no light, a picture of 0", room(AWAY, matte=True),
                                   (12, 9), 7, choices={"samples": 8}),
}
QUICK: dict[str, Callable[[], Case]] = {
    "pairs-diffuse": partial(single_pairs, "pairs-diffuse", "one light, one receiver: random, coincident, grazing, "
                             "behind, 1 mm to 1 km apart", glossy=False),
    "pairs-glossy": partial(single_pairs, "pairs-glossy", "one glossy light and one receiver: exponents 0 to 1000, "
                            "purely glossy ones", glossy=True),
    **cases_of(SII, "sii", sii_settings), **cases_of(RANGE, "sii", range_settings),
    "sii-range-bounds": partial(bounds, "sii-range-bounds"),
    **cases_of(GATHER, "gather", gather_settings), "gather-border": at_borders}
FULL = {**cases_of(SII_FULL, "sii", sii_settings), **cases_of(RANGE_FULL, "sii", range_settings),
        **cases_of(GATHER_FULL, "gather", gather_settings)}
