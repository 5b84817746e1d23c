"""Norm of Phong lobes and widening of their exponent near the light (SII Eq. 3, Sec. 3.3).

Symbols: P exponent, P' the widened one, th angle between lobe axis and surface normal, a the distance from which on the
exponent is whole.
"""

import math
from typing import Any, NamedTuple

import numpy.typing as npt

from refgi.jit import kernel
from refgi.lobes import lobe_norm

Array = npt.NDArray[Any]

NO_NORM, FULL_LOBE, CLAMPED = 0, 1, 2  # lobe_norm as a kernel sees it
CORRECTED, LITERAL = 0, 1  # slope of the widened exponent: P min(1, r / a), or min(P, P / (r a)) as printed


class Widening(NamedTuple):
    """How exponents fall near the light."""

    distance: Any  # a, m
    slope: int  # CORRECTED or LITERAL
    norm: int  # the lobe_norm that follows P', or -1: the one of P stays
    cos_theta: Array  # (N,) n . r of each light


@kernel
def lobe_norm_factor(cos_theta: Any, exponent: Any, norm: int) -> Any:
    """Return c(P), the peak intensity of a lobe of unit flux, 1/sr; 0 for a lobe of which nothing leaves the surface.

    NO_NORM: 1 as printed in Eq. 3; FULL_LOBE: (P + 1) / 2 pi; CLAMPED: (P + 1) / (2 pi K(th, P)).
    """
    real = type(cos_theta)
    # Eq. (3), normalised
    if norm == NO_NORM:
        return real(1.0)
    if norm == FULL_LOBE:
        return (exponent + real(1.0)) * real(1.0 / (2.0 * math.pi))
    return lobe_norm(cos_theta, exponent)


@kernel
def widened(square: Any, exponent: Any, whole: Any, widening: Widening, k: int, reached: bool) -> tuple[Any, Any]:
    """Return P' and c(P') / c(P) at a receiver of light k, r^2 = `square` (m^2) away, with c(P) = `whole` (Sec. 3.3).

    The ratio is 1 where the light does not reach the receiver, which does not need it.
    """
    real = type(square)
    one = real(1.0)
    r = math.sqrt(square)
    share = r / widening.distance if widening.slope == CORRECTED else one / (r * widening.distance)
    fallen = exponent * (share if share < one else one)
    if widening.norm >= 0 and share < one and reached and whole > real(0.0):
        return fallen, lobe_norm_factor(widening.cos_theta[k], fallen, widening.norm) / whole
    return fallen, one
