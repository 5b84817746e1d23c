"""Direct irradiance of all lights as a port sums it, and as it gets it wrong: E = I(w) cos / d^2."""

from typing import Any

import numpy as np

from refgi.scene import DirectionalLight, SpotLight
from refgi.scene.model import Light
from refgi.vectors.bugs.falloffs import CONE, falloffs_of
from refgi.vectors.bugs.spot_integral import Falloff, own_falloff, share_at
from refgi.vectors.spec import Array, Arrays, Bug, Run

Lamps = list[tuple[str, Light]]
LAW, ALL, SHADOW = "E = I(w) cos / d^2", "all lights", "each light has its own shadows"
COSINES = {
    "the cosine at the receiver is missing": "step",
    "the cosine at the receiver is squared": "squared",
    "sine in place of cosine at the receiver": "sine",
}


def direct_family(lamps: Lamps) -> tuple[Bug, ...]:
    """Return likely bugs of the direct irradiance of some lights."""
    def literal(**bugs: Any) -> Run:
        return lambda arrays, real: {"direct.irradiance": literal_direct(arrays, lamps, **bugs).astype(real)}

    if not lamps:
        return ()
    spot = any(isinstance(light, SpotLight) for _, light in lamps)
    found = [Bug(cause, literal(cosine=how), LAW) for cause, how in COSINES.items()]
    found += [
        Bug("every texel is lit where it should be in shadow: visible and hidden are exchanged", literal(
            shadow="inverted"), SHADOW),
        Bug("the first channel of a lamp's strength for all: red", literal(strength="red"), "linear RGB"),
        Bug("channels of a lamp's strength are in reverse order: bgr", literal(strength="reverse"), "linear RGB"),
        Bug("all channels have the mean of the lamp's strength", literal(strength="grey"), "linear RGB"),
    ]
    if not all(isinstance(light, DirectionalLight) for _, light in lamps):
        found += [
            Bug("1/d^2 is missing", literal(power=0), LAW),
            Bug("1/d in place of 1/d^2, or the receiver's cosine is times the distance: the direction is not "
                "normalised, no unit vector", literal(power=1), LAW),
            Bug("1/d^3 in place of 1/d^2: divided by the distance once too often", literal(power=3), LAW),
            Bug("1/d^4 in place of 1/d^2: the squared distance is squared again", literal(power=4), LAW),
            Bug("the distance to a light counts as at least 1 m", literal(least=1.0), LAW),
            Bug("1 is added to d^2: a softened distance", literal(softened=1.0), LAW),
            Bug("lights lie at the origin: their place is missing", literal(place="origin"), LAW),
        ]
    if spot:
        found += _spot_bugs(literal, lamps)
    if len(lamps) > 1:
        found += [
            Bug("the first light's shadow for all lights: shadow0 alone", literal(shadow="first"), SHADOW),
            Bug("the last light's shadow for all lights", literal(shadow="last"), SHADOW),
            Bug("each light has the next one's shadow: an index off by one", literal(shadow="next"), SHADOW),
            Bug("a point is in shadow where any light's shadow is: shadows of all lights together", literal(
                shadow="all"), SHADOW),
            Bug("only the first light has a shadow", literal(shadow="first only"), SHADOW),
            Bug("only the last light has a shadow", literal(shadow="last only"), SHADOW),
            Bug("light of the last lamp replaces that of the others: overwritten, not accumulated", literal(
                joined="last"), ALL),
            Bug("the first light alone: the others are not added", literal(joined="first"), ALL),
            Bug("the strongest light in place of the sum", literal(joined="max"), ALL),
            Bug("the mean of the lights in place of their sum: divided by their number", literal(joined="mean"), ALL),
            Bug("the first light counts twice", literal(joined="twice"), ALL),
            Bug("all lights have the first one's strength", literal(strength="first"), ALL),
            Bug("all lights lie where the first one does", literal(place="first"), ALL),
        ]
    return tuple(found)


def _spot_bugs(literal: Any, lamps: Lamps) -> list[Bug]:
    return [
        *(Bug(cause, literal(falloff=one), CONE) for cause, one in falloffs_of([light for _, light in lamps]).items()),
        Bug("inner and outer half-angle of the cone are exchanged", literal(angles=(1, 0)), CONE),
        Bug("the inner half-angle is left out: light falls off from the axis on", literal(angles=(None, 1)), CONE),
        Bug("whole angles in place of half-angles: the cone is half as wide", literal(widened=0.5), "half-angles"),
        Bug("the cone is twice as wide as its half-angles say", literal(widened=2.0), "half-angles"),
        Bug("the spot's axis is not normalised: the cosine of the cone is times its length", literal(unit=False), CONE),
        Bug("the cosine of the spot's axis counts in place of the receiver's", literal(cosine="axis"), LAW),
        Bug("the intensity is divided by the cone's solid angle 2 pi (1 - cos o): taken for the spot's power",
            literal(strength="cone"), "radiant intensity on the axis"),
    ]


def literal_direct(
    arrays: Arrays, lamps: Lamps, *, cosine: str = "positive", power: int = 2, least: float = 0.0,
    softened: float = 0.0, place: str = "own", falloff: Falloff | None = None, angles: tuple[int | None, int] = (0, 1),
    widened: float = 1.0, unit: bool = True, strength: str = "own", shadow: str = "own", joined: str = "sum",
) -> Array:
    """Return the direct irradiance of all lights, or with a bug: (3, h, w)."""
    x, n = (np.asarray(arrays[f"gbuffer.{key}"], np.float64) for key in ("position", "normal"))
    covered, parts = np.asarray(arrays["gbuffer.triangle_id"]) >= 0, []
    seen = _shadows([np.asarray(arrays[f"shadow{k}.visible"]) for k in range(len(lamps))], shadow)
    placed = [f"{lamp}.position" for lamp, light in lamps if not isinstance(light, DirectionalLight)]
    for k, (lamp, light) in enumerate(lamps):
        directional = isinstance(light, DirectionalLight)
        own = placed[0] if place == "first" and not directional else f"{lamp}.position"
        at = None if directional else np.reshape(arrays[own] if place != "origin" else np.zeros(3), (3, 1, 1))
        d = -np.reshape(arrays[f"{lamp}.direction"], (3, 1, 1)) * np.ones_like(x) if at is None else at - x
        square = (d**2).sum(axis=0)
        with np.errstate(all="ignore"):
            w = np.where(square > 0, d / np.sqrt(square), 0)
            fall = np.where(square > 0, 1 / (np.maximum(np.sqrt(square), least) ** power + softened), 0)
        fall = np.ones_like(fall) if directional else fall
        arriving, cone = (w * n).sum(axis=0), np.zeros(2)
        if isinstance(light, SpotLight):
            axis = np.asarray(arrays[f"{lamp}.direction"], np.float64)
            axis = axis / np.sqrt((axis**2).sum()) if unit else axis
            cone = np.asarray(arrays[f"{lamp}.half_angles"], np.float64)
            off = -(w * axis.reshape(3, 1, 1)).sum(axis=0)
            inner, outer = (1e-9 if one is None else widened * float(cone[one]) for one in angles)
            fall = fall * share_at(off, inner, outer, falloff or own_falloff(light))
            arriving = off * (arriving > 0) if cosine == "axis" else arriving
        power_of = _strength(arrays, lamps, k if strength != "first" else 0, strength, float(cone[1]))
        parts.append(power_of * (_cosine(arriving, cosine) * fall * (seen[k] & covered)))
    total = np.stack(parts)
    joins = {"last": lambda: total[-1], "first": lambda: total[0], "max": lambda: total.max(axis=0),
             "mean": lambda: total.mean(axis=0), "twice": lambda: total.sum(axis=0) + total[0]}
    return np.asarray(joins.get(joined, lambda: total.sum(axis=0))())


def _shadows(seen: list[Array], how: str) -> list[Array]:
    every, count = np.ones_like(seen[0]), len(seen)
    return {"first": [seen[0]] * count, "last": [seen[-1]] * count, "next": [*seen[1:], seen[0]],
            "all": [np.logical_and.reduce(seen)] * count, "inverted": [~one for one in seen],
            "first only": [seen[0], *[every] * (count - 1)], "last only": [*[every] * (count - 1), seen[-1]]}.get(
                how, seen)


def _strength(arrays: Arrays, lamps: Lamps, k: int, how: str, outer: float) -> Array:
    key = "irradiance" if isinstance(lamps[k][1], DirectionalLight) else "intensity"
    own = np.asarray(arrays[f"{lamps[k][0]}.{key}"], np.float64)
    own = {"red": own[[0, 0, 0]], "reverse": own[::-1], "grey": np.full(3, own.mean())}.get(how, own)
    return own.reshape(3, 1, 1) / (2 * np.pi * (1 - np.cos(outer)) if how == "cone" and outer else 1.0)


def _cosine(cosine: Array, how: str) -> Array:
    positive = np.maximum(0, cosine)
    return np.asarray({
        "step": (cosine > 0).astype(np.float64), "squared": positive**2,
        "sine": (cosine > 0) * np.sqrt(np.maximum(0, 1 - cosine**2))}.get(how, positive))
