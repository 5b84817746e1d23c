"""A spot's falloff between its cones as ports get it wrong; t is 0 at the outer and 1 at the inner cone."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from refgi.scene.model import Light, SpotLight
from refgi.vectors.bugs.spot_integral import OWN, Falloff, clamped, smoothstep
from refgi.vectors.spec import Array

CONE = "docs/conventions: falloff between the cosines of the cones"
SQUARED = "the falloff is t^2: smoothstep's 3 - 2t is missing"


def _of_t(shape: Callable[[Array], Array]) -> Falloff:
    return lambda t, cosine, inner, outer: shape(t)  # noqa: ARG005 a falloff among others


def _of_angle(shape: Callable[[Array], Array]) -> Falloff:
    def falloff(t: Array, cosine: Array, inner: float, outer: float) -> Array:  # noqa: ARG001 a falloff among others
        angle = np.arccos(np.clip(cosine, -1, 1))
        return shape(clamped((outer - angle) / (outer - inner)))

    return falloff


def _of_squares(t: Array, cosine: Array, inner: float, outer: float) -> Array:  # noqa: ARG001 a falloff among others
    return smoothstep(clamped((cosine**2 - np.cos(outer) ** 2) / (np.cos(inner) ** 2 - np.cos(outer) ** 2)))


def _times_cosine(t: Array, cosine: Array, inner: float, outer: float) -> Array:  # noqa: ARG001
    return np.asarray(smoothstep(clamped(t)) * cosine)


FALLOFFS: Mapping[str, Falloff] = MappingProxyType({
    "the falloff is linear: no smoothstep": _of_t(clamped),
    SQUARED: OWN["squared_ramp"],
    "smoothstep lacks one t: t (3 - 2t)": _of_t(lambda t: clamped(t) * (3 - 2 * clamped(t))),
    "smoothstep is taken twice": _of_t(lambda t: smoothstep(smoothstep(clamped(t)))),
    "the falloff is squared": _of_t(lambda t: smoothstep(clamped(t)) ** 2),
    "the smoother step of degree 5 in place of smoothstep": _of_t(lambda t: clamped(t) ** 3 * (
        clamped(t) * (6 * clamped(t) - 15) + 10)),
    "the falloff runs the wrong way: 1 minus what it should be, dark within and bright beyond the cone": _of_t(
        lambda t: 1 - smoothstep(clamped(t))),
    "the falloff is twice as steep: a factor 2 of the difference of the cones' cosines is missing": _of_t(
        lambda t: smoothstep(clamped(2 * t))),
    "the falloff is half as steep: the difference of the cones' cosines counts twice": _of_t(
        lambda t: smoothstep(clamped(t / 2))),
    "outside the cone the falloff is not clamped to 0: t below 0": _of_t(lambda t: smoothstep(np.minimum(t, 1))),
    "inside the inner cone the falloff is not clamped to 1: t above 1": _of_t(lambda t: smoothstep(np.maximum(t, 0))),
    "the falloff is not clamped at all: t below 0 and above 1": _of_t(smoothstep),
    "the cone's edge is hard: full light up to the outer half-angle": _of_t(lambda t: (t > 0).astype(np.float64)),
    "no light between inner and outer cone: a hard edge at the inner half-angle": _of_t(
        lambda t: (t >= 1).astype(np.float64)),
    "no falloff: the spot shines as bright beyond its cone, as a point light": _of_t(np.ones_like),
    "smoothstep of angles and not of their cosines": _of_angle(smoothstep),
    "the falloff is linear in the angle": _of_angle(lambda t: t),
    "smoothstep of squared cosines": _of_squares,
    "the cosine off the spot's axis counts as well": _times_cosine,
})


def falloffs_of(lights: Sequence[Light]) -> dict[str, Falloff]:
    """Return the wrong falloffs of some lights' spots: what is right for all of them is none."""
    kinds = {light.falloff for light in lights if isinstance(light, SpotLight)}
    found = {cause: one for cause, one in FALLOFFS.items() if cause != SQUARED or kinds != {"squared_ramp"}}
    if "squared_ramp" in kinds:
        found["a spot of a squared ramp falls off by the smoothstep"] = OWN["smoothstep"]
    return found
