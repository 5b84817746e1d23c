"""Ellipsoids that bound where a pixel light is significant (SII appendix, Eq. 7 and 8 with the exponent restored).

A light of exponent n (1: diffuse) sends B = I_0 cos^n(alpha) / r^2, so B >= I_low inside r^2 = R_0^2 cos^n(alpha),
R_0^2 = I_0 / I_low. All lengths here are shares of R_0. x runs along the light's axis (normal or lobe axis), rho across
it; F(x) is the radius of the region at x, an ellipse has its centre at (c, 0) and half axes w along and h across.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

TANGENT_POINT = 0.71  # E-SII-13: 0.70 to 0.72 wastes least


class Ellipsoid(NamedTuple):
    """Ellipsoids of revolution about the lights' axes, in units of R_0."""

    center: Array  # (...) along the axis
    half_width: Array  # (...) along the axis
    height: Array  # (...) half axis across it


class Solids(NamedTuple):
    """The bounds of some lights in the world; a light's is the union of its ellipsoid and its half ball."""

    position: Array  # (3, N) of the lights, m
    axis: Array  # (3, N) unit vectors
    square: Array  # (N,) R_0^2, m^2
    ellipsoid: Ellipsoid  # (N,) each
    ball: Array | None  # (N,) radii of half balls, m; None: no lobe is widened


def appendix_ellipsoid(exponent: npt.ArrayLike) -> Ellipsoid:
    """Return the paper's ellipsoid: centred where F is largest, as high as F there and wide enough for [0, 1].

    It encloses the significant region for every exponent n >= 0 (E-SII-13). Eq. 8 reads n/(n+2) (n+2)/4 in print; the
    second fraction is an exponent.

    >>> [round(float(value), 6) for value in appendix_ellipsoid(2.0)]  # the sphere of diameter R_0
    [0.5, 0.5, 0.5]
    """
    n = np.asarray(exponent, np.float64)
    share = n / (n + 2)
    # Eq. (8)
    center = share ** ((n + 2) / 4)
    # Eq. (7) at the centre
    height = share ** (n / 4) * np.sqrt(2 / (n + 2))
    return Ellipsoid(center, np.maximum(center, 1 - center), height)


def tangent_ellipsoid(exponent: npt.ArrayLike, tangent_point: float = TANGENT_POINT) -> Ellipsoid:
    """Return the ellipsoid through the light that touches the significant region at x_0; Eq. 8's for n < 2.

    It encloses the region for every exponent n >= 0; `tangent_point` x_0 lies in (0.4, 1], in R_0. With b = 2n / (n +
    2), F^2 = x g(x) and g = x^(b-1) - x is concave for n >= 2: it lies below its tangent g(x_0) - k (x - x_0), k = 1 -
    (b - 1) x_0^(b-2), and x times a falling line is an ellipse through the origin (E-SII-13).
    """
    n = np.asarray(exponent, np.float64)
    plain = appendix_ellipsoid(n)
    steep = np.maximum(n, 2.0)
    below = -4 / (steep + 2)  # b - 2; what follows keeps its digits for large n, where k falls as 1 / n
    power = below * math.log(tangent_point)  # of e, for x_0^(b - 2)
    slope = -np.expm1(power) - below * np.exp(power)  # k
    value = tangent_point * np.expm1(power)  # g(x_0)
    center = (tangent_point + value / slope) / 2
    height = center * np.sqrt(slope)
    return Ellipsoid(*(np.where(n < 2, old, new) for old, new in zip(plain, (center, center, height), strict=True)))


def half_ball_radius(square_range: Array, widening: float, literal: bool = False) -> Array:
    """Return the radius (m) of the half ball that, with the ellipsoid of P, holds the region of a widened lobe.

    min(a, R_0): beyond a = `widening` (m) the exponent is P, and beyond R_0 nothing is significant (E-SII-14). With
    `literal` the exponent falls as printed, without end away from the light.
    """
    radius: Array = np.sqrt(square_range)
    return radius if literal and widening > 0 else np.minimum(radius, widening)


def light_solids(
    position: Array, axis: Array, exponent: Array, square: Array, tangent: bool, widening: float = 0.0,
    literal: bool = False,
) -> Solids:
    """Return the bounds of lights at `position` (3, N, m) about `axis` (3, N: normal or lobe axis), in float64.

    `exponent` (N,) is n, 1 for diffuse lights, `square` (N,) R_0^2 in m^2; `tangent` picks tangent ellipsoids over
    those of the appendix. Exponents fall within `widening` (m), with `literal` as printed.
    """
    ellipsoid = (tangent_ellipsoid if tangent else appendix_ellipsoid)(exponent)
    square = np.asarray(square, np.float64)
    ball = half_ball_radius(square, widening, literal) if widening > 0 else None
    return Solids(np.asarray(position, np.float64), np.asarray(axis, np.float64), square, ellipsoid, ball)
