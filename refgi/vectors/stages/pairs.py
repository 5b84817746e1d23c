"""Stages of sums over pixel lights: footprints, Eq. 2 and 3 at every receiver, one pair at a time (SII)."""

from typing import Any

import numpy as np

from refgi.literal import pairs as literal
from refgi.literal.lights import footprints
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.settings import PairSettings
from refgi.settings import of
from refgi.vectors.forms import pair_lists
from refgi.vectors.recipe import Recipe
from refgi.vectors.rows import Form
from refgi.vectors.spec import Array, Arrays, Spec
from refgi.vectors.stages.buffers import VECTOR
from refgi.vectors.stages.lights import LIGHT, LOBE, light_names, pixel_lights_of

EQ2 = "SII Eq. 2 and 3; unit directions and r^2 (E-SII-02)"
RECEIVERS = ("gbuffer.position", "gbuffer.normal", "gbuffer.triangle_id")
READS = {"position": "gbuffer.position", "normal": "gbuffer.normal", "light_position": "lights.position",
         "light_normal": "lights.normal", "flux": "lights.flux"}
LOBES = {"lobe_flux": "lights.lobe_flux", "lobe_axis": "lights.lobe_axis", "lobe_exponent": "lights.lobe_exponent"}
NORM = "(P + 1) / (2 pi K), K the share of the lobe's integral above the surface; 0 where K is below 1e-12"


def receivers_of(arrays: Arrays, real: Any) -> Receivers:
    """Return the camera's pixels among arrays as points to light."""
    position, normal = (np.ascontiguousarray(arrays[name], real) for name in RECEIVERS[:2])
    return Receivers(position, normal, np.asarray(arrays["gbuffer.triangle_id"]) >= 0)


def add_footprints(recipe: Recipe, maps: int) -> None:
    """Add the surface that each pixel light stands for: Omega d^2 / cos of its texel, times T/N w."""
    numbers, texels = range(maps), ("solid_angle", "texel", "weight")
    near = tuple(f"light{k}.position" in recipe.specs for k in numbers)
    places = tuple(f"light{k}.{'position' if near[k] else 'direction'}" for k in numbers)

    def run(arrays: Arrays, real: Any) -> Arrays:
        lights, chosen = pixel_lights_of(arrays, real), np.asarray(arrays["lights.map"])
        area = np.zeros(len(chosen), real)
        for k in numbers:
            here = chosen == k
            texel = np.asarray(arrays["lights.texel"])[here]
            weight = dict(zip(np.asarray(arrays[f"rsm{k}.texel"]).tolist(), arrays[f"rsm{k}.weight"], strict=True))
            angle = arrays[f"rsm{k}.solid_angle"].reshape(-1)[texel] * np.array([weight[int(t)] for t in texel], real)
            away = (arrays[places[k]][:, None] - lights.position[:, here] if near[k] else
                    np.broadcast_to(-arrays[places[k]][:, None], (3, int(here.sum()))))
            square = (away**2).sum(axis=0)
            cosine = np.abs((away * lights.normal[:, here]).sum(axis=0)) / np.sqrt(square)
            area[here] = angle * (square if near[k] else 1) / np.maximum(cosine, 1e-3)
        return {"lights.area": area}

    form = Form(footprints, {"position": "lights.position", "normal": "lights.normal", "texel": "lights.texel",
                             "number": "lights.map", "lamp": places, **{key: tuple(f"rsm{k}.{name}" for k in numbers)
                             for key, name in zip(("solid_angle", "drawn", "weight"), texels, strict=True)}},
                ("lights.area",), {"near": near})
    recipe.add("footprints", "surface that each light stands for", run,
               (*light_names(recipe), "lights.texel", "lights.map", *places, *(
                   f"rsm{k}.{key}" for k in numbers for key in texels)),
               {"lights.area": Spec("light", "m^2", "Omega d^2 / cos of the light's texel, times T/N w")},
               paper="docs/methods/sii_sum", bugs=form.bugs("footprints"), variants=(form,))


def add_sum(recipe: Recipe, pairs: PairSettings | None = None) -> None:
    """Add the sum of all lights at all pixels."""
    settings = of(PairSettings, clamp="none") if pairs is None else pairs
    names = light_names(recipe)
    area = ("lights.area",) if settings.needs_footprints else ()
    glossy = "lights.lobe_flux" in recipe.specs

    form = Form(literal.irradiance, {**READS, "triangle_id": "gbuffer.triangle_id", **(LOBES if glossy else {}),
                                     **({"area": "lights.area"} if area else {})}, ("sum.irradiance",))

    def run(arrays: Arrays, real: Any) -> Arrays:
        receivers = receivers_of(arrays, real)
        footprint = np.ascontiguousarray(arrays["lights.area"], np.float64) if area else None
        return {"sum.irradiance": irradiance(receivers, pixel_lights_of(arrays, real), settings, footprint)}

    recipe.facts["sum.clamp"] = "none" if settings.clamp is None else settings.clamp.name()
    recipe.facts["sum.lobe_norm"] = NORM
    count = recipe.expected()["lights.flux"].shape[1]
    recipe.factors["number of lights"] = float(count)
    recipe.add("sum", "irradiance of every pixel light at every pixel, without visibility and albedo/pi", run,
               (*RECEIVERS, *names, *area),
               {"sum.irradiance": Spec("rgb, row, column", "W/m^2", "indirect irradiance", "linear RGB", EQ2)},
               paper=EQ2, exact=("gbuffer.position", "lights.position"), variants=(form,),
               bugs=form.bugs(*pair_lists("irradiance", glossy, bool(area), count)))


def add_pairs(recipe: Recipe, lights: Arrays, position: Array, normal: Array) -> None:
    """Add pairs of one light and one receiver each: (3, n) arrays, light k with receiver k alone."""
    count = position.shape[1]
    recipe.facts |= {"pairs.clamp": "none", "pairs.lobe_norm": NORM}
    _give_lights(recipe, lights)
    recipe.give("gbuffer.position", position[:, None], Spec("xyz, row, receiver", "m", "receivers", "world"))
    recipe.give("gbuffer.normal", normal[:, None], Spec("xyz, row, receiver", VECTOR, "their normals", "world"))
    recipe.give("gbuffer.triangle_id", np.zeros((1, count), np.int32),
                Spec("row, receiver", "1", "0: all are surfaces", tier="T0"))
    names, glossy, bare = light_names(recipe), "lights.lobe_flux" in lights, of(PairSettings, clamp="none")

    form = Form(literal.pairs, {**READS, **(LOBES if glossy else {})}, ("pairs.irradiance",))

    def run(arrays: Arrays, real: Any) -> Arrays:
        made = np.zeros((3, 1, count), real)
        for k in range(count):
            one = {name: arrays[name][..., k : k + 1] for name in names}
            here = receivers_of({name: arrays[name][..., k : k + 1] for name in RECEIVERS}, real)
            made[..., k : k + 1] = irradiance(here, pixel_lights_of(one, real), bare)
        return {"pairs.irradiance": made}

    recipe.add("pairs", "irradiance of light k at receiver k", run, (*RECEIVERS, *names), {
        "pairs.irradiance": Spec("rgb, row, pair", "W/m^2", "irradiance; 0 where light and receiver coincide",
                                 "linear RGB", EQ2, alone=True)},
        paper=EQ2, bugs=form.bugs(*pair_lists("pairs", glossy, False, count)),
        exact=("gbuffer.position", "lights.position"), variants=(form,))


def _give_lights(recipe: Recipe, lights: Arrays) -> None:
    units = {"position": "m", "flux": "W", "lobe_flux": "W", "lobe_exponent": "1"}
    for key in (*LIGHT, *LOBE):
        if f"lights.{key}" in lights:
            recipe.give(f"lights.{key}", lights[f"lights.{key}"],
                        Spec("light" if key == "lobe_exponent" else "xyz or rgb, light", units.get(key, VECTOR),
                             key.replace("_", " ")))
