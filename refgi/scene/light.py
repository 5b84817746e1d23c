"""Lights, the table of them that kernels read, and lamps as arrays that stages record.

`cone_row` stores a spot's cone in numbers that keep their digits however narrow or wide it is.
"""

import dataclasses
import decimal
import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Literal, NamedTuple, get_args

import numpy as np

from refgi.elementary.twofold import DIGITS, sine_cosine_digits, twofold
from refgi.errors import expect
from refgi.scene.values import (
    BRIGHTEST,
    LARGEST,
    Rgb,
    Vector,
    as_float_tuples,
    degrees,
    is_direction,
    is_number,
    is_place,
    is_vector,
)
from refgi.types import Array

# places in a row of `cone_row`; sine and cosine of the outer half-angle come in two parts, the second the rest
SINE, SINE_REST, COSINE, COSINE_REST, SPAN, CAP, BEND, LINEAR = range(8)
SPOT, POINT, DIRECTIONAL = 0, 1, 2  # kinds of light in a LightTable
NARROWEST = math.radians(1e-5)  # half-angle; rays in float32 tell directions apart down to a third of it


Falloff = Literal["smoothstep", "squared_ramp", "ramp"]  # of a spot between its cones; the second is glTF's
# b and l of t (l + (1 - l) t) (1 + 2 b - 2 b t)
SHAPES: dict[Falloff, tuple[float, float]] = {"smoothstep": (1.0, 0.0), "squared_ramp": (0.0, 0.0), "ramp": (0.0, 1.0)}
MEANS: dict[Falloff, float] = {"smoothstep": 1 / 2, "squared_ramp": 1 / 3, "ramp": 1 / 2}  # over the cosine


def cone_row(inner: float, outer: float, falloff: Falloff = "smoothstep") -> Array:
    """Return what kernels need of a spot's falloff and half-angles, rad, 0 <= inner <= outer < pi/2.

    (8,) float64: sin outer and cos outer, each a float64 and the rest; cos inner - cos outer; 1 - cos outer; two of
    `SHAPES`.
    """
    sine, cosine = sine_cosine_digits(outer)
    _, cosine_inner = sine_cosine_digits(inner)
    with decimal.localcontext(prec=DIGITS):
        return np.array([*twofold(sine), *twofold(cosine), float(cosine_inner - cosine), float(1 - cosine),
                         *SHAPES[falloff]])


@dataclasses.dataclass(frozen=True)
class SpotLight:
    """A point that shines into a cone.

    On-axis radiant intensity `intensity` (W/sr), half-angles rad. With t = clamp((cos a - cos outer) / (cos inner -
    cos outer), 0, 1) the intensity at angle a off the axis is I0 t t (3 - 2t) where `falloff` is "smoothstep", I0 t t
    where it is "squared_ramp", I0 t where it is "ramp", and nothing outside `outer`.
    """

    position: Vector
    direction: Vector
    inner_half_angle: float
    outer_half_angle: float
    intensity: Rgb
    falloff: Falloff = "smoothstep"

    def __post_init__(self) -> None:
        expect(is_place(self.position), "light: position", f"three finite numbers up to {LARGEST:g} m", self.position)
        expect(is_direction(self.direction), "light: direction", "a finite vector, not zero, up to 1e+100 long",
               self.direction)
        fits = is_number(self.outer_half_angle) and NARROWEST <= self.outer_half_angle <= math.pi / 2
        expect(fits, "light: outer_half_angle_deg", f"{degrees(NARROWEST):g} to 90",
               math.degrees(self.outer_half_angle) if is_number(self.outer_half_angle) else self.outer_half_angle)
        expect(0 <= self.inner_half_angle <= self.outer_half_angle, "light: inner_half_angle_deg",
               "0 to outer_half_angle_deg", degrees(self.inner_half_angle))
        expect(self.falloff in get_args(Falloff), "light: falloff", " or ".join(get_args(Falloff)), self.falloff)
        _expect_power(self.intensity, "intensity_w_per_sr")
        as_float_tuples(self, "position", "direction", "intensity")


@dataclasses.dataclass(frozen=True)
class PointLight:
    """A point that shines equally in all directions with radiant intensity `intensity`, W/sr."""

    position: Vector
    intensity: Rgb

    def __post_init__(self) -> None:
        expect(is_place(self.position), "light: position", f"three finite numbers up to {LARGEST:g} m", self.position)
        _expect_power(self.intensity, "intensity_w_per_sr")
        as_float_tuples(self, "position", "intensity")


@dataclasses.dataclass(frozen=True)
class DirectionalLight:
    """Parallel light that travels along `direction`, with `irradiance` on a perpendicular surface, W/m^2."""

    direction: Vector
    irradiance: Rgb

    def __post_init__(self) -> None:
        expect(is_direction(self.direction), "light: direction", "a finite vector, not zero, up to 1e+100 long",
               self.direction)
        _expect_power(self.irradiance, "irradiance_w_per_m2")
        as_float_tuples(self, "direction", "irradiance")


Light = SpotLight | PointLight | DirectionalLight


class LightTable(NamedTuple):
    """The lights as arrays for kernels: one row a light, float64."""

    kind: Array  # (k,) int32: 0 spot, 1 point, 2 directional
    position: Array  # (k, 3) m; zero for a directional light
    direction: Array  # (k, 3) unit vector the light travels along; zero for a point light
    cone: Array  # (k, 8) `cone_row` of a spot; zero for others
    intensity: Array  # (k, 3) W/sr on the axis; perpendicular irradiance W/m^2 for a directional light


def light_table(lights: Sequence[Light]) -> LightTable:
    """Gather lights into arrays for kernels.

    Parameters
    ----------
    lights : sequence of Light
        The scene's lights.

    Returns
    -------
    LightTable
        One row a light.
    """
    count = len(lights)
    table = LightTable(np.zeros(count, np.int32), np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 8)),
                       np.zeros((count, 3)))
    for row, light in enumerate(lights):
        if isinstance(light, DirectionalLight):
            table.kind[row] = DIRECTIONAL
            table.intensity[row] = light.irradiance
        else:
            table.kind[row] = SPOT if isinstance(light, SpotLight) else POINT
            table.position[row] = light.position
            table.intensity[row] = light.intensity
        if not isinstance(light, PointLight):
            table.direction[row] = np.asarray(light.direction) / np.linalg.norm(light.direction)
        if isinstance(light, SpotLight):
            table.cone[row] = cone_row(light.inner_half_angle, light.outer_half_angle, light.falloff)
    return table


def _expect_power(value: Rgb, key: str) -> None:
    fits = is_vector(value) and min(value) >= 0 and max(value) <= BRIGHTEST
    expect(fits, f"light: {key}", f"three numbers from 0 to {BRIGHTEST:g}", value)


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
