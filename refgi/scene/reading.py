"""What the caller of `load_scene` chooses of how files are read: unit of glTF's lights, lamps on what emits, rigour."""

import contextlib
import math
import warnings
from collections.abc import Iterator
from contextvars import ContextVar
from typing import Literal, NamedTuple, get_args

from refgi.errors import InputError, RefgiWarning, expect

LightUnit = Literal["cd", "lm", "W/sr"]
Emissive = Literal["seen", "lamps"]
LUMEN_PER_WATT = 683.0  # which defines the candela


class _Choice(NamedTuple):
    unit: LightUnit = "cd"
    emissive: Emissive = "seen"
    strict: bool = False


AS_FILES_SAY = _Choice()
_choice: ContextVar[_Choice] = ContextVar("_choice", default=AS_FILES_SAY)


@contextlib.contextmanager
def reading_as(unit: LightUnit = "cd", emissive: Emissive = "seen", *, strict: bool = False) -> Iterator[None]:
    """Let readers inside the block take glTF's lights in a unit, put lamps on emissive surfaces or none, be strict.

    `strict`: refuse what a picture can do without, such as an absent material file or an index of no normal.
    """
    expect(unit in get_args(LightUnit), "light_unit", " or ".join(get_args(LightUnit)), unit)
    expect(emissive in get_args(Emissive), "emissive", " or ".join(get_args(Emissive)), emissive)
    token = _choice.set(_Choice(unit, emissive, strict))
    try:
        yield
    finally:
        _choice.reset(token)


def per_watt(*, directional: bool) -> float:
    """Return what a number of a glTF light is divided by to be W/sr, or W/m^2 of a directional light.

    Of lumen an isotropic source of that flux is meant, of a spot too: its intensity is the flux over 4 pi sr. A
    directional light is in lux with either photometric unit.
    """
    unit = _choice.get().unit
    if unit == "W/sr":
        return 1.0
    return LUMEN_PER_WATT * (4.0 * math.pi if unit == "lm" and not directional else 1.0)


def wants_lamps() -> bool:
    """Return whether emissive surfaces get lamps."""
    return _choice.get().emissive == "lamps"


def is_strict() -> bool:
    """Return whether readers refuse what they could do without."""
    return _choice.get().strict


def tolerate(text: str) -> None:
    """Warn of what is passed over; raise `InputError` instead where readers are strict."""
    if is_strict():
        raise InputError(text)
    warnings.warn(RefgiWarning(text), stacklevel=5)
