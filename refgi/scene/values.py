"""Colours, vectors and numbers of scenes, and their validation."""

import math
import numbers
from typing import Any

Rgb = tuple[float, float, float]
Vector = tuple[float, float, float]

BLACK: Rgb = (0.0, 0.0, 0.0)
BRIGHTEST = 1e20  # W/sr or W/m^2; falls off within float32
LARGEST = 1e9  # m; squares and cubes of coordinates stay within float32


def is_number(value: Any) -> bool:
    """Return whether a value is one finite number; false for text, and for what is no number at all."""
    try:
        return math.isfinite(value)
    except (TypeError, OverflowError):
        return False


def is_count(value: Any) -> bool:
    """Return whether a value is a whole number, of Python or of NumPy.

    Result: false for a float, even one without a fraction.
    """
    return isinstance(value, numbers.Integral)


def is_vector(value: Any) -> bool:
    """Return whether a value is three finite numbers; false for what is no sequence of numbers at all."""
    try:
        return len(value) == 3 and all(math.isfinite(c) for c in value)
    except (TypeError, OverflowError):
        return False


def as_float_tuples(owner: Any, *keys: str) -> None:
    """Convert the vectors of a frozen dataclass to tuples of floats, so that it can be compared and hashed.

    `*keys`: its fields that hold three numbers.
    """
    for key in keys:
        object.__setattr__(owner, key, tuple(float(c) for c in getattr(owner, key)))


def is_place(value: Any) -> bool:
    """Return whether a value is three coordinates that the arithmetic holds.

    Result: false for what is no sequence of numbers at all.
    """
    return is_vector(value) and max(map(abs, value)) <= LARGEST


def is_direction(value: Any) -> bool:
    """Return whether a value is a vector whose length neither vanishes nor overflows.

    Result: false for what is no sequence of numbers at all.
    """
    return is_vector(value) and 1e-100 < math.hypot(*value) < 1e100  # squares neither vanish nor overflow


def degrees(angle: float) -> float:
    """Return an angle in degrees, as it was written in a file; `angle`: in rad."""
    return round(math.degrees(angle), 9)
