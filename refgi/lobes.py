"""Phong lobes clamped to the surface: norm, value and samples, for every user and every exponent.

Symbols: r unit vector along the lobe's axis, w a direction, n the surface's normal, th the angle between r and n,
P the exponent, K(th, P) the part of cos^P above the surface, h = |r - w|^2 / 2 = 1 - r . w.

The lobe is I(w) = c <r . w>^P where n . w > 0, with c = (P + 1) / (2 pi K) for unit flux. The power is taken as
2^(P log2(1 - h)): near the axis, where a lobe of exponent 10^6 lives, h keeps its digits and r . w does not. So both
vectors must be unit vectors: a length off by e costs e^2 / 2 in h. In float64 that holds for every exponent a material
may have (1e20, half of whose flux lies within 1.2e-10 rad); in float32 h is good to 1e-13, which suffices to 1e8.

A receiver reflects by f_s(w, w_o) = specular (P + 2) / (2 pi) <m . w>^P, m the direction to the eye w_o mirrored: no
part of it depends on the tilt, so it is reciprocal, and no more leaves than arrives. The form above is a sender's: with
its K a receiver's would not be reciprocal, and reflect up to 1.36 of a uniform field (docs/radiometry).
"""

import math
from typing import Any

import numpy as np

from refgi.elementary import exp2, log2p1
from refgi.jit import kernel
from refgi.radiometry import lobe_fraction

LEAST_FRACTION = 1e-12  # of a lobe above the surface; less is rounding, of lobes that point into it


@kernel
def inverse_fraction(cos_theta: Any, exponent: Any) -> Any:
    """Return 1 / K(th, P) in the type of `cos_theta`, or 0 for a lobe of which nothing leaves the surface."""
    real = type(cos_theta)
    fraction = lobe_fraction(cos_theta, exponent)
    return real(1.0) / fraction if fraction > real(LEAST_FRACTION) else real(0.0)


@kernel
def lobe_norm(cos_theta: Any, exponent: Any) -> Any:
    """Return c = (P + 1) / (2 pi K), 1/sr, the peak intensity of a lobe of unit flux.

    In the type of `cos_theta`, the cosine of axis and normal; 0 for a lobe of which nothing leaves the surface.
    """
    real = type(cos_theta)
    # (P + 1) / (2 pi K): SII Eq. (3) normalised to unit flux above the surface
    return (exponent + real(1.0)) * real(1.0 / (2.0 * math.pi)) * inverse_fraction(cos_theta, exponent)


@kernel
def lobe_gap(rx: Any, ry: Any, rz: Any, wx: Any, wy: Any, wz: Any) -> Any:
    """Return h = |r - w|^2 / 2 for an axis r of length 1 and a vector w of any length but 0.

    That is 1 - cos of the angle between them, 0 to 2, in the type of the arguments.
    """
    real = type(wx)
    inverse = real(1.0) / math.sqrt(wx * wx + wy * wy + wz * wz)
    ox, oy, oz = rx - wx * inverse, ry - wy * inverse, rz - wz * inverse
    return real(0.5) * (ox * ox + oy * oy + oz * oz)


@kernel
def lobe_power(gap: Any, exponent: Any) -> Any:
    """Return <r . w>^P = (1 - h)^P of the gap h of `lobe_gap`; 0 from a right angle on. Both of one type."""
    real = type(gap)
    return exp2(exponent * log2p1(-gap)) if gap < real(1.0) else real(0.0)


@kernel
def lobe_direction(u: float, v: float, exponent: float) -> tuple[float, float, float]:
    """Return a direction around z (unit vector) of density (P + 1) / (2 pi) cos^P.

    (u, v) is a point of the unit square, u > 0. 1 - z keeps its digits, however sharp the lobe is.
    """
    gap = -math.expm1(math.log(u) / (exponent + 1.0))  # 1 - u^(1 / (P + 1))
    across, phi = math.sqrt(gap * (2.0 - gap)), 2.0 * np.pi * v
    return across * math.cos(phi), across * math.sin(phi), 1.0 - gap


@kernel
def receiver_norm(exponent: Any) -> Any:
    """Return (P + 2) / (2 pi), 1/sr, by which a receiver's lobe of reflectance 1 reflects at most all light."""
    real = type(exponent)
    return (exponent + real(2.0)) * real(1.0 / (2.0 * math.pi))


@kernel
def mirrored(wx: Any, wy: Any, wz: Any, nx: Any, ny: Any, nz: Any) -> Any:
    """Return m = 2 (n . w) n - w: the direction w, away from the surface, mirrored in it (all unit vectors)."""
    twice = type(wx)(2.0) * (wx * nx + wy * ny + wz * nz)
    return twice * nx - wx, twice * ny - wy, twice * nz - wz


@kernel
def receiver_lobe(mx: Any, my: Any, mz: Any, wx: Any, wy: Any, wz: Any, exponent: Any) -> Any:
    """Return (P + 2) / (2 pi) <m . w>^P, 1/sr: f_s of a receiver over its specular reflectance, where n . w > 0.

    m is the direction to the eye, mirrored (unit vector), w any vector towards the light. Whether w and the eye lie
    above the surface is for the caller to know.
    """
    return receiver_norm(exponent) * lobe_power(lobe_gap(mx, my, mz, wx, wy, wz), exponent)
