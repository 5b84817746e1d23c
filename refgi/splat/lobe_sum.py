"""The sum over all pairs of glossy pixel light and receiver (SII Eq. 3 in Eq. 2), Phong lobes clamped to the surface.

The lobe of light p is I(w) = Phi c(P) <r . w>^P where n . w > 0, with c(P) by `lobe_norm`. The power is taken as
exp(P ln(1 - h)), h = |r - w|^2 / 2 = 1 - r . w: near the axis, where a lobe of exponent 10^6 lives, h keeps its
digits and r . w does not.

Symbols as in `pair_sum`; w unit vector from light to receiver, th angle between lobe axis and normal, a the distance
from which on the exponent is whole (0: not widened), P' the exponent after widening.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.elementary import exp, log1p
from refgi.jit import kernel, prange
from refgi.radiometry import lobe_fraction
from refgi.splat.pair_sum import GROUP, LEAST_SQUARE, NX, SUM, TILE, TOTAL, Clamp, X, load_tile

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
        1/sr, of the type of `cos_theta`.
    """
    real = type(cos_theta)
    if norm == NO_NORM:
        return real(1.0)
    factor = (exponent + real(1.0)) * real(1.0 / (2.0 * math.pi))
    return factor if norm == FULL_LOBE else factor / lobe_fraction(cos_theta, exponent)


@kernel(parallel=True)
def add_lobes(
    position: Array, normal: Array, lights: Array, clamp: Clamp, widening: Widening | None, irradiance: Array
) -> None:
    """Add E = sum over glossy lights of I(w) c_x / r^2 to the irradiance of every receiver (SII Eq. 2 and 3).

    Parameters
    ----------
    position, normal : (3, n) ndarray
        Receivers, world space; m and unit vectors.
    lights : (13, N) ndarray
        Packed lights: position, reversed normal, reversed lobe axis, exponent, flux times norm.
    clamp : Clamp
        How near pairs are kept finite; the bound applies to c_x / r^2.
    widening : Widening or None
        How exponents fall near the light; None keeps them.
    irradiance : (3, n) ndarray
        Added to, W/m^2.
    """
    real = position.dtype.type
    count = position.shape[1]
    for block in prange((count + TILE - 1) // TILE):
        first = block * TILE
        size = min(TILE, count - first)
        tile = np.zeros((12, TILE), position.dtype)
        load_tile(tile, position, normal, first, size)
        for group in range(0, lights.shape[1], GROUP):
            for k in range(group, min(group + GROUP, lights.shape[1])):
                light = _light(lights, k)
                for i in range(TILE):
                    receiver = tile[X, i], tile[X + 1, i], tile[X + 2, i], tile[NX, i], tile[NX + 1, i], tile[NX + 2, i]
                    if widening is None:
                        g = _lobe(light, receiver, clamp, k)
                    else:
                        g = _widened_lobe(light, receiver, clamp, widening, k)
                    for c in range(3):
                        tile[SUM + c, i] += g * light[10 + c]
            for c in range(3):
                for i in range(TILE):
                    tile[TOTAL + c, i] += tile[SUM + c, i]
                    tile[SUM + c, i] = real(0.0)
        for c in range(3):
            for i in range(size):
                irradiance[c, first + i] += tile[TOTAL + c, i]


@kernel
def _light(lights: Array, k: int) -> Any:
    return (lights[0, k], lights[1, k], lights[2, k], lights[3, k], lights[4, k], lights[5, k], lights[6, k],
            lights[7, k], lights[8, k], lights[9, k], lights[10, k], lights[11, k], lights[12, k])


@kernel
def _geometry(light: Any, receiver: Any, clamp: Clamp, k: int) -> Any:
    """Return h = 1 - r . w (2 where the light's surface hides the receiver), c_x / r^2 and r."""
    x, y, z, nx, ny, nz = receiver
    real = type(x)
    zero, half = real(0.0), real(0.5)
    dx, dy, dz = light[0] - x, light[1] - y, light[2] - z
    square = dx * dx + dy * dy + dz * dz
    square = square if square > real(LEAST_SQUARE) else real(LEAST_SQUARE)
    r = math.sqrt(square)
    inverse = real(1.0) / r
    cx = (dx * nx + dy * ny + dz * nz) * inverse
    above = dx * light[3] + dy * light[4] + dz * light[5]
    ox, oy, oz = light[6] - dx * inverse, light[7] - dy * inverse, light[8] - dz * inverse
    h = half * (ox * ox + oy * oy + oz * oz)
    kept = (square if square > clamp.least else clamp.least) + clamp.softness[k]
    term = (cx if cx > zero else zero) / kept
    return h if above > zero else real(2.0), term if term < clamp.bound else clamp.bound, r


@kernel
def _power(h: Any, exponent: Any) -> Any:
    """Return (1 - h)^P, 0 from h = 1 on."""
    real = type(h)
    one = real(1.0)
    inside = h if h < one else real(0.0)
    value = exp(exponent * log1p(-inside))
    return value if h < one else real(0.0)


@kernel
def _lobe(light: Any, receiver: Any, clamp: Clamp, k: int) -> Any:
    h, term, _ = _geometry(light, receiver, clamp, k)
    return _power(h, light[9]) * term  # Eq. (3); the norm is part of the packed flux


@kernel
def _widened_lobe(light: Any, receiver: Any, clamp: Clamp, widening: Widening, k: int) -> Any:
    h, term, r = _geometry(light, receiver, clamp, k)
    real = type(h)
    if not (h < real(1.0) and term > real(0.0)):
        return real(0.0)
    share = r / widening.distance if widening.slope == CORRECTED else real(1.0) / (r * widening.distance)
    if share >= real(1.0):
        return _power(h, light[9]) * term
    widened = light[9] * share  # P' of Sec. 3.3
    term *= _power(h, widened)
    if widening.norm < 0:
        return term
    cos_theta = widening.cos_theta[k]
    whole = lobe_norm_factor(cos_theta, light[9], widening.norm)
    return term * (lobe_norm_factor(cos_theta, widened, widening.norm) / whole)
