"""Slow literal twins of the shared radiometry: definitions by quadrature and by hand, no shortcuts."""

import math
from functools import cache

import numpy as np

gauss_legendre = cache(np.polynomial.legendre.leggauss)


def solid_angle_of_rectangle(density, x0, x1, y0, y1, nodes=64):
    """Integrate a solid-angle density over a rectangle of the image plane by Gauss-Legendre quadrature."""
    x, w = gauss_legendre(nodes)
    u = 0.5 * (x0 + x1) + 0.5 * (x1 - x0) * x
    v = 0.5 * (y0 + y1) + 0.5 * (y1 - y0) * x
    return float(density(u[:, None], v[None, :]) @ w @ w) * 0.25 * (x1 - x0) * (y1 - y0)


@cache
def lobe_fraction(theta, exponent, nodes=400):
    """Share of the integral of cos^P over the half space of the lobe that lies above a surface tilted by theta."""
    return float(lobe_fractions(theta, np.array([exponent]), nodes)[0])


def lobe_fractions(theta, exponents, nodes=400):
    """`lobe_fraction` of several exponents P.

    Polar coordinates around the lobe's axis: at angle a off it, the circle lies above the surface for the azimuths
    with cos(theta) cos(a) + sin(theta) sin(a) cos(phi) > 0. The integrand bends at a = pi/2 - theta, where the
    circle first dips below; sin substitutions on both pieces take the square root out of it.
    """
    x, w = gauss_legendre(nodes)
    turn = 0.5 * math.pi * (x + 1)
    weights = 0.5 * math.pi * w
    edge = math.pi / 2 - theta
    total = np.zeros(len(exponents))
    for low, high in ((0.0, edge), (abs(edge), math.pi / 2)):  # an axis below the surface: nothing up to -edge
        a = low + (high - low) * 0.5 * (1 - np.cos(turn))
        da = (high - low) * 0.5 * np.sin(turn) * weights
        if high <= low:
            continue
        cosine = -math.cos(theta) * np.cos(a) / np.maximum(math.sin(theta) * np.sin(a), 1e-300)
        azimuth = 2 * np.arccos(np.clip(cosine, -1, 1))
        total += (azimuth * np.cos(a) ** np.reshape(exponents, (-1, 1)) * np.sin(a) * da).sum(axis=1)
    return total * (np.asarray(exponents) + 1) / (2 * math.pi)
