"""Stages of sums over pixel lights: footprints, Eq. 2 and 3 at every receiver, one pair at a time (SII)."""

from typing import Any

import numpy as np

from refgi.lobes import lobe_norm
from refgi.pairs.irradiance import Receivers, irradiance
from refgi.pairs.pixel_lights import PixelLights
from refgi.pairs.settings import PairSettings
from refgi.settings import of, replaced
from refgi.vectors.recipe import Recipe, reading
from refgi.vectors.spec import Array, Arrays, Decoy, Run, Spec
from refgi.vectors.stages.buffers import VECTOR
from refgi.vectors.stages.lights import LIGHT, LOBE, light_names, pixel_lights_of

RECEIVERS = ("gbuffer.position", "gbuffer.normal", "gbuffer.triangle_id")
EQ2 = "SII Eq. 2 and 3; unit directions and r^2 (E-SII-02)"
CLAMPED, DISC = "<a.b> = max(0, a.b)", "r^2 + A/pi"


def receivers_of(arrays: Arrays, real: Any) -> Receivers:
    """Return the camera's pixels among arrays as points to light."""
    position, normal = (np.ascontiguousarray(arrays[name], real) for name in RECEIVERS[:2])
    return Receivers(position, normal, np.asarray(arrays["gbuffer.triangle_id"]) >= 0)


def add_footprints(recipe: Recipe, maps: int) -> None:
    """Add the surface that each pixel light stands for: Omega d^2 / cos of its texel, times T/N w."""
    reads = tuple(f"rsm{k}.{key}" for k in range(maps) for key in ("solid_angle", "texel", "weight"))
    places = tuple(f"light{k}.position" if f"light{k}.position" in recipe.specs else f"light{k}.direction"
                   for k in range(maps))

    def run(arrays: Arrays, real: Any, squared: bool = True, slanted: bool = True) -> Arrays:
        lights, chosen = pixel_lights_of(arrays, real), np.asarray(arrays["lights.map"])
        area = np.zeros(len(chosen), real)
        for k in range(maps):
            here = chosen == k
            texel = np.asarray(arrays["lights.texel"])[here]
            weight = dict(zip(np.asarray(arrays[f"rsm{k}.texel"]).tolist(), arrays[f"rsm{k}.weight"], strict=True))
            angle = arrays[f"rsm{k}.solid_angle"].reshape(-1)[texel] * np.array([weight[int(t)] for t in texel], real)
            near = f"light{k}.position" in arrays
            away = (arrays[f"light{k}.position"][:, None] - lights.position[:, here] if near else
                    np.broadcast_to(-arrays[f"light{k}.direction"][:, None], (3, int(here.sum()))))
            square = (away**2).sum(axis=0)
            cosine = np.abs((away * lights.normal[:, here]).sum(axis=0)) / np.sqrt(square)
            area[here] = angle * (square if near and squared else 1) / (np.maximum(cosine, 1e-3) if slanted else 1)
        return {"lights.area": area}

    recipe.add("footprints", "surface that each light stands for", run,
               (*light_names(recipe), "lights.texel", "lights.map", *places, *reads),
               {"lights.area": Spec("light", "m^2", "Omega d^2 / cos of the light's texel, times T/N w")},
               paper="docs/methods/sii_sum", decoys=(
                   Decoy("the squared distance is missing", lambda a, r: run(a, r, False), "A = Omega d^2 / cos"),
                   Decoy("the cosine is missing", lambda a, r: run(a, r, True, False), "A = Omega d^2 / cos")))


def add_sum(recipe: Recipe, pairs: PairSettings | None = None) -> None:
    """Add the sum of all lights at all pixels."""
    settings = of(PairSettings, clamp="none") if pairs is None else pairs
    names = light_names(recipe)
    area = ("lights.area",) if settings.needs_footprints else ()

    def run(arrays: Arrays, real: Any, how: PairSettings = settings) -> Arrays:
        receivers = receivers_of(arrays, real)
        footprint = np.ascontiguousarray(arrays["lights.area"], np.float64) if area else None
        return {"sum.irradiance": irradiance(receivers, pixel_lights_of(arrays, real), how, footprint)}

    recipe.facts["sum.clamp"] = "none" if settings.clamp is None else settings.clamp.name()
    recipe.factors["N"] = float(recipe.expected()["lights.flux"].shape[1])
    recipe.add("sum", "irradiance of every pixel light at every pixel, without visibility and albedo/pi", run,
               (*RECEIVERS, *names, *area),
               {"sum.irradiance": Spec("rgb, row, column", "W/m^2", "indirect irradiance", "linear RGB", EQ2)},
               paper=EQ2, decoys=(*pair_decoys(run, bool(area), "lights.lobe_flux" in recipe.specs), *(
                   (Decoy("nothing is clamped", lambda a, r: run(a, r, replaced(settings, {"clamp": "none"})),
                          "docs/methods/sii_sum"),) if settings.clamp is not None else ())),
               exact=("gbuffer.position", "lights.position"))


def add_pairs(recipe: Recipe, lights: Arrays, position: Array, normal: Array) -> None:
    """Add pairs of one light and one receiver each: (3, n) arrays, light k with receiver k alone."""
    count = position.shape[1]
    _give_lights(recipe, lights)
    recipe.give("gbuffer.position", position[:, None], Spec("xyz, row, receiver", "m", "receivers", "world"))
    recipe.give("gbuffer.normal", normal[:, None], Spec("xyz, row, receiver", VECTOR, "their normals", "world"))
    recipe.give("gbuffer.triangle_id", np.zeros((1, count), np.int32),
                Spec("row, receiver", "1", "0: all are surfaces", tier="T0"))
    names = light_names(recipe)

    def run(arrays: Arrays, real: Any) -> Arrays:
        made = np.zeros((3, 1, count), real)
        for k in range(count):
            one = {name: arrays[name][..., k : k + 1] for name in names}
            here = receivers_of({name: arrays[name][..., k : k + 1] for name in RECEIVERS}, real)
            made[..., k : k + 1] = irradiance(here, pixel_lights_of(one, real), of(PairSettings, clamp="none"))
        return {"pairs.irradiance": made}

    recipe.add("pairs", "irradiance of light k at receiver k", run, (*RECEIVERS, *names), {
        "pairs.irradiance": Spec("rgb, row, pair", "W/m^2", "irradiance; 0 where light and receiver coincide",
                                 "linear RGB", EQ2, alone=True)},
        paper=EQ2, decoys=pair_decoys(run, False, "lights.lobe_flux" in lights, own=True),
        exact=("gbuffer.position", "lights.position"))


def _give_lights(recipe: Recipe, lights: Arrays) -> None:
    units = {"position": "m", "flux": "W", "lobe_flux": "W", "lobe_exponent": "1"}
    for key in (*LIGHT, *LOBE):
        if f"lights.{key}" in lights:
            recipe.give(f"lights.{key}", lights[f"lights.{key}"],
                        Spec("light" if key == "lobe_exponent" else "xyz or rgb, light", units.get(key, VECTOR),
                             key.replace("_", " ")))


def pair_decoys(run: Run, clamped: bool, glossy: bool, own: bool = False) -> tuple[Decoy, ...]:
    """Return likely bugs of Eq. 2 and 3; `own`: light k meets receiver k alone."""
    def literal(**bugs: Any) -> Run:
        def altered(arrays: Arrays, real: Any) -> Arrays:
            return {("pairs" if own else "sum") + ".irradiance": _literal(arrays, own, **bugs).astype(real)}

        return altered

    found = [
        Decoy("the receiver's cosine is missing", literal(receiver=False), EQ2),
        Decoy("the light's cosine is missing", literal(sender=False), EQ2),
        Decoy("cosines are not clamped at 0: lights behind a surface count", literal(floor=None), CLAMPED),
        Decoy("cosines are taken as absolute values", literal(floor="abs"), CLAMPED),
        Decoy("1/r^4 with unit directions", literal(power=4), "E-SII-02"),
        Decoy("1/r in place of 1/r^2", literal(power=1), "E-SII-02"),
        Decoy("directions are not normalised", literal(power=0), "E-SII-02"),
        Decoy("the distance is clamped at 0.1 m", literal(least=0.1), "no clamp unless asked for"),
        Decoy("the light's normal points inwards", reading(run, lights__normal=lambda a: -a), EQ2),
        Decoy("the receiver's normal points inwards", reading(run, gbuffer__normal=lambda a: -a), EQ2),
        Decoy("only the first half of the lights", reading(run, lights__flux=_first_half, **(
            {"lights__lobe_flux": _first_half} if glossy else {})), "all lights"),
    ] if not clamped else [
        Decoy("the footprint is divided by 2 pi instead of pi", reading(run, lights__area=lambda a: a / 2), DISC),
        Decoy("the footprint is not divided by pi", reading(run, lights__area=lambda a: a * np.pi), DISC),
    ]
    if glossy:
        found += [
            Decoy("lobes are missing", reading(run, lights__lobe_flux=np.zeros_like), "SII Eq. 3"),
            Decoy("the diffuse part is missing", reading(run, lights__flux=np.zeros_like), "SII Eq. 3"),
            Decoy("lobes are around the normal", _lobes_at_normal(run), "SII Eq. 3"),
            Decoy("the lobe's exponent is one too high", reading(run, lights__lobe_exponent=lambda a: a + 1),
                  "SII Eq. 3"),
        ]
        found += [] if clamped else [
            Decoy("lobes are not normalised", literal(norm="none"), "E-SII-03: (P + 1) / 2 pi K"),
            Decoy("lobes are normalised over the whole lobe, not over what lies above the surface",
                  literal(norm="full"), "E-SII-03: (P + 1) / 2 pi K"),
            Decoy("lobes reach below the light's horizon", literal(horizon=False), "SII Eq. 3"),
        ]
    return tuple(found)


def _lobes_at_normal(run: Run) -> Run:
    return lambda arrays, real: run({**arrays, "lights.lobe_axis": arrays["lights.normal"]}, real)


def _first_half(array: Array) -> Array:
    kept = array.copy()
    kept[..., (array.shape[-1] + 1) // 2 :] = 0
    return kept


def _literal(
    arrays: Arrays, own: bool, *, receiver: bool = True, sender: bool = True, floor: Any = 0.0, power: int = 2,
    least: float = 0.0, norm: str = "exact", horizon: bool = True,
) -> Array:
    """Return Eq. 2 and 3 with a bug, in float64: (3, h, w)."""
    x, n = (np.asarray(arrays[name], np.float64) for name in RECEIVERS[:2])
    shape, covered = x.shape[1:], np.asarray(arrays["gbuffer.triangle_id"]).reshape(-1) >= 0
    lights = pixel_lights_of(arrays, np.float64)
    d = x.reshape(3, 1, -1) - lights.position[:, :, None]
    if own:  # (3, 1, n): light k with receiver k
        d = x.reshape(3, 1, -1) - lights.position[:, None]
    unit, r = _directions(d)
    facing, leaving = n.reshape(3, 1, -1), (lights.normal[:, None] if own else lights.normal[:, :, None])
    arriving, sent = -(facing * unit).sum(axis=0), (leaving * unit).sum(axis=0)
    with np.errstate(divide="ignore"):
        fall = {0: np.ones_like(r), 1: 1 / r}.get(power, 1 / np.maximum(r, least) ** power)
    if power == 0:
        arriving, sent = arriving * r, sent * r
    received = (_cut(arriving, floor) if receiver else (arriving > 0)) * np.where(r > 0, fall, 0)
    flux = lights.flux[:, None] if own else lights.flux[:, :, None]
    total = flux / np.pi * ((_cut(sent, floor) if sender else sent > 0) * received)
    if lights.lobe_flux is not None and lights.lobe_axis is not None and lights.lobe_exponent is not None:
        axis = lights.lobe_axis[:, None] if own else lights.lobe_axis[:, :, None]
        exponent = lights.lobe_exponent[None] if own else lights.lobe_exponent[:, None]
        lobe = lights.lobe_flux[:, None] if own else lights.lobe_flux[:, :, None]
        peak = _norms(lights, norm)
        shape_of = np.maximum(0, (axis * unit).sum(axis=0)) ** exponent * (peak[None] if own else peak[:, None])
        total = total + lobe * (np.where((sent > 0) | (not horizon), shape_of, 0) * received)
    return np.asarray(np.where(covered, total.sum(axis=1), 0).reshape(3, *shape))


def _directions(d: Array) -> tuple[Array, Array]:
    r = np.sqrt((d**2).sum(axis=0))
    return np.divide(d, r, out=np.zeros_like(d), where=r > 0), r


def _cut(cosine: Array, floor: Any) -> Array:
    return np.abs(cosine) if floor == "abs" else cosine if floor is None else np.maximum(floor, cosine)


def _norms(lights: PixelLights, norm: str) -> Array:
    assert lights.lobe_axis is not None
    assert lights.lobe_exponent is not None
    if norm == "none":
        return np.ones(lights.position.shape[1])
    if norm == "full":
        return (lights.lobe_exponent + 1) / (2 * np.pi)
    cosine = np.clip((lights.normal * lights.lobe_axis).sum(axis=0), -1, 1)
    return np.array([lobe_norm(c, p) for c, p in zip(cosine, lights.lobe_exponent, strict=True)], np.float64)


