"""What the caller of `load_scene` chooses of how files are read: the unit of glTF's lights, lamps on what emits."""

import contextlib
import math
from collections.abc import Iterator
from contextvars import ContextVar
from typing import Literal, get_args

from refgi.errors import expect

LightUnit = Literal["cd", "lm", "W/sr"]
Emissive = Literal["seen", "lamps"]
LUMEN_PER_WATT = 683.0  # which defines the candela

_unit: ContextVar[LightUnit] = ContextVar("_unit", default="cd")
_emissive: ContextVar[Emissive] = ContextVar("_emissive", default="seen")


@contextlib.contextmanager
def reading_as(unit: LightUnit, emissive: Emissive) -> Iterator[None]:
    """Let readers inside the block take glTF's lights in a unit, and put lamps on emissive surfaces or none."""
    expect(unit in get_args(LightUnit), "light_unit", " or ".join(get_args(LightUnit)), unit)
    expect(emissive in get_args(Emissive), "emissive", " or ".join(get_args(Emissive)), emissive)
    tokens = _unit.set(unit), _emissive.set(emissive)
    try:
        yield
    finally:
        _unit.reset(tokens[0])
        _emissive.reset(tokens[1])


def per_watt(*, directional: bool) -> float:
    """Return what a number of a glTF light is divided by to be W/sr, or W/m^2 of a directional light.

    Of lumen an isotropic source of that flux is meant, of a spot too: its intensity is the flux over 4 pi sr. A
    directional light is in lux with either photometric unit.
    """
    unit = _unit.get()
    if unit == "W/sr":
        return 1.0
    return LUMEN_PER_WATT * (4.0 * math.pi if unit == "lm" and not directional else 1.0)


def wants_lamps() -> bool:
    """Return whether emissive surfaces get lamps."""
    return _emissive.get() == "lamps"
