"""Lamps as arrays, as stages that are recorded read them."""

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.scene.light import DirectionalLight, Falloff, Light, PointLight, SpotLight

Array = npt.NDArray[Any]


class Lamp(NamedTuple):
    """What a lamp is, float64."""

    strength: Array  # (3,) W/sr, radiant intensity, of a spot on its axis; directional: irradiance across it, W/m^2
    place: Array | None  # (3,) m; None: directional
    direction: Array | None  # (3,) where it shines to, any length; None: point light
    half_angles: Array | None  # (2,) rad, inner and outer: full light within, none beyond; None: no spot
    falloff: Falloff | None  # of a spot

    @property
    def kind(self) -> str:
        """Its word: spot, point or directional."""
        return "directional" if self.place is None else "point" if self.direction is None else "spot"


@lru_cache(maxsize=64)
def lamp_of(light: Light) -> Lamp:
    """Return a light as arrays, the same ones for equal lights."""
    if isinstance(light, DirectionalLight):
        return Lamp(np.array(light.irradiance, float), None, np.array(light.direction, float), None, None)
    strength, place = np.array(light.intensity, float), np.array(light.position, float)
    if isinstance(light, PointLight):
        return Lamp(strength, place, None, None, None)
    return Lamp(strength, place, np.array(light.direction, float),
                np.array([light.inner_half_angle, light.outer_half_angle]), light.falloff)


def light_of(lamp: Lamp) -> Light:
    """Return the light that arrays say."""
    strength, place, direction = (None if one is None else tuple(np.asarray(one, np.float64).tolist())
                                  for one in lamp[:3])
    assert strength is not None
    if place is None:
        assert direction is not None
        return DirectionalLight(direction, strength)
    if direction is None:
        return PointLight(place, strength)
    assert lamp.half_angles is not None
    inner, outer = np.asarray(lamp.half_angles, np.float64).tolist()
    return SpotLight(place, direction, min(inner, outer), outer, strength, lamp.falloff or SpotLight.falloff)
