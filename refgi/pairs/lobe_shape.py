"""Phong lobes as kernels have them: their norm, and how their exponent falls near the light (SII Eq. 3, Sec. 3.3).

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
    """Return c(P): the peak intensity of a lobe of unit flux.

    Parameters
    ----------
    cos_theta : float
        Cosine between lobe axis and surface normal.
    exponent : float
        P.
    norm : int
        NO_NORM: 1 as printed in Eq. 3; FULL_LOBE: (P + 1) / 2 pi; CLAMPED: (P + 1) / (2 pi K(th, P)).

    Returns
    -------
    float
        1/sr, of the type of `cos_theta`; 0 for a lobe of which nothing leaves the surface.
    """
    real = type(cos_theta)
    if norm == NO_NORM:
        return real(1.0)
    if norm == FULL_LOBE:
        return (exponent + real(1.0)) * real(1.0 / (2.0 * math.pi))
    return lobe_norm(cos_theta, exponent)


@kernel
def widened(square: Any, exponent: Any, whole: Any, widening: Widening, k: int, lit: bool) -> tuple[Any, Any]:
    """Return P' and c(P') / c(P) at a receiver (Sec. 3.3).

    Parameters
    ----------
    square : float
        Square of its distance, m^2.
    exponent : float
        P.
    whole : float
        c(P), 1/sr.
    widening : Widening
        How exponents fall.
    k : int
        Which light.
    lit : bool
        Whether the light reaches it; the ratio is not needed elsewhere and then 1.

    Returns
    -------
    tuple of 2 floats
        Exponent and ratio, of the type of `square`.
    """
    real = type(square)
    one = real(1.0)
    r = math.sqrt(square)
    share = r / widening.distance if widening.slope == CORRECTED else one / (r * widening.distance)
    fallen = exponent * (share if share < one else one)
    if widening.norm >= 0 and share < one and lit and whole > real(0.0):
        return fallen, lobe_norm_factor(widening.cos_theta[k], fallen, widening.norm) / whole
    return fallen, one
