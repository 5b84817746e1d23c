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
from refgi.splat.pair_sum import GROUP, LEAST_SQUARE, NX, ROWS, SUM, TILE, TOTAL, Clamp, X, close_group, load_tile

Array = npt.NDArray[Any]

NO_NORM, FULL_LOBE, CLAMPED = 0, 1, 2  # lobe_norm as a kernel sees it
H, TERM, R, EXPONENT = range(ROWS, ROWS + 4)  # further rows of a tile, of one light
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
    count = position.shape[1]
    for block in prange((count + TILE - 1) // TILE):
        first = block * TILE
        size = min(TILE, count - first)
        tile = np.zeros((ROWS + 4, TILE), position.dtype)
        load_tile(tile, position, normal, first, size)
        for group in range(0, lights.shape[1], GROUP):
            for k in range(group, min(group + GROUP, lights.shape[1])):
                _shine(tile, _light(lights, k), clamp.least, clamp.softness[k], clamp.bound)
                if widening is not None:
                    _widen(tile, lights[9, k], widening, k)
                _add(tile, lights[9, k], lights[10, k], lights[11, k], lights[12, k], widening is not None)
            close_group(tile)
        for c in range(3):
            for i in range(size):
                irradiance[c, first + i] += tile[TOTAL + c, i]


@kernel
def _light(lights: Array, k: int) -> Any:
    return (lights[0, k], lights[1, k], lights[2, k], lights[3, k], lights[4, k], lights[5, k], lights[6, k],
            lights[7, k], lights[8, k])


@kernel
def _shine(tile: Array, light: Any, least: Any, softness: Any, bound: Any) -> None:
    """Fill rows H with 1 - r . w, TERM with c_x / r^2 where the lobe reaches (0 elsewhere) and R with r."""
    real = tile.dtype.type
    zero, half, one = real(0.0), real(0.5), real(1.0)
    x, y, z, lx, ly, lz, ax, ay, az = light
    for i in range(TILE):
        dx, dy, dz = x - tile[X, i], y - tile[X + 1, i], z - tile[X + 2, i]
        square = dx * dx + dy * dy + dz * dz
        square = square if square > real(LEAST_SQUARE) else real(LEAST_SQUARE)
        r = math.sqrt(square)
        inverse = one / r
        cx = (dx * tile[NX, i] + dy * tile[NX + 1, i] + dz * tile[NX + 2, i]) * inverse
        ox, oy, oz = ax - dx * inverse, ay - dy * inverse, az - dz * inverse
        h = half * (ox * ox + oy * oy + oz * oz)
        kept = (square if square > least else least) + softness
        term = (cx if cx > zero else zero) / kept
        term = term if term < bound else bound
        above = dx * lx + dy * ly + dz * lz
        reach = h if above > zero else one
        tile[H, i] = reach if reach < one else zero
        tile[TERM, i] = term if reach < one else zero
        tile[R, i] = r


@kernel
def _widen(tile: Array, exponent: Any, widening: Widening, k: int) -> None:
    """Fill row EXPONENT with P' (Sec. 3.3) and scale TERM by c(P') / c(P)."""
    real = tile.dtype.type
    one = real(1.0)
    cos_theta = widening.cos_theta[k]
    whole = lobe_norm_factor(cos_theta, exponent, widening.norm)
    for i in range(TILE):
        r = tile[R, i]
        share = r / widening.distance if widening.slope == CORRECTED else one / (r * widening.distance)
        tile[EXPONENT, i] = exponent * (share if share < one else one)
        if widening.norm >= 0 and share < one and tile[TERM, i] > real(0.0):
            tile[TERM, i] *= lobe_norm_factor(cos_theta, tile[EXPONENT, i], widening.norm) / whole


@kernel
def _add(tile: Array, exponent: Any, red: Any, green: Any, blue: Any, widened: bool) -> None:
    """Add flux (1 - h)^P c_x / r^2 of one light to the group's sum; Eq. (3), whose norm is part of the flux."""
    if not widened:
        for i in range(TILE):
            tile[EXPONENT, i] = exponent
    for i in range(TILE):
        tile[H, i] = log1p(-tile[H, i])
    for i in range(TILE):
        tile[TERM, i] *= exp(tile[EXPONENT, i] * tile[H, i])
    for i in range(TILE):
        tile[SUM, i] += tile[TERM, i] * red
        tile[SUM + 1, i] += tile[TERM, i] * green
        tile[SUM + 2, i] += tile[TERM, i] * blue
