"""Arithmetic of references: the same formula in extended precision over arrays, or with 50 digits.

A reference is a function of a `Maths` and of numbers of its kind. `EXTENDED` has 64 significant bits (x86; elsewhere
more, or no more than float64, which `trusted` tells), `DIGITS` 50 decimal digits by mpmath.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import mpmath
import numpy as np

from refgi.types import Array

digits: Any = mpmath.MPContext()  # of its own: nobody else's precision changes
digits.dps = 50


class Maths(NamedTuple):
    """Functions of one kind of numbers, for arrays."""

    name: str
    pi: Any
    number: Callable[[Any], Any]  # exact, from float32 or float64
    sqrt: Callable[[Any], Any]
    exp: Callable[[Any], Any]
    log: Callable[[Any], Any]
    log1p: Callable[[Any], Any]
    sin: Callable[[Any], Any]
    cos: Callable[[Any], Any]
    atan: Callable[[Any], Any]
    atan2: Callable[[Any, Any], Any]
    tan: Callable[[Any], Any]
    beta: Callable[[Any, Any], Any] | None  # I_x(a, 1/2), regularised; x, a


def _each(function: Callable[..., Any], inputs: int = 1) -> Callable[..., Any]:
    return np.frompyfunc(function, inputs, 1)


EXTENDED = Maths("longdouble", np.longdouble("3.14159265358979323846264338327950288"),
                 lambda x: np.asarray(x).astype(np.longdouble), np.sqrt, np.exp, np.log, np.log1p, np.sin, np.cos,
                 np.arctan, np.arctan2, np.tan, None)
DIGITS = Maths("mpmath, 50 digits", +digits.pi, lambda x: _each(lambda one: digits.mpf(float(one)))(x),
               _each(digits.sqrt), _each(digits.exp), _each(digits.log), _each(digits.log1p), _each(digits.sin),
               _each(digits.cos), _each(digits.atan), _each(digits.atan2, 2), _each(digits.tan),
               _each(lambda x, a: digits.betainc(a, digits.mpf(0.5), 0, x, regularized=True), 2))


def trusted() -> bool:
    """Return whether extended precision has the bits that are asked of it."""
    return bool(np.finfo(np.longdouble).nmant >= 63)


def dot(a: Any, b: Any) -> Any:
    """Return the dot product of two vectors of arrays."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Any, b: Any) -> Any:
    """Return the cross product of two vectors of arrays."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def spacing(value: Array, real: Any) -> Array:
    """Return the unit in the last place of float32 or float64 at some numbers, as extended numbers."""
    info = np.finfo(real)
    _, exponent = np.frexp(np.abs(value).astype(np.longdouble))
    lowest = info.minexp - info.nmant
    power = np.where(np.asarray(value) == 0, lowest, np.maximum(exponent - (info.nmant + 1), lowest))
    return np.ldexp(np.longdouble(1), power)
