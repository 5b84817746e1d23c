"""Slow literal twins of the shared radiometry: definitions by quadrature and by hand, no shortcuts."""

import math
from functools import cache

import numpy as np

from refgi.literal.pairs import lobe_share

gauss_legendre = cache(np.polynomial.legendre.leggauss)


def solid_angle_of_rectangle(density, x0, x1, y0, y1, nodes=64):
    """Integrate a solid-angle density over a rectangle of the image plane by Gauss-Legendre quadrature."""
    x, w = gauss_legendre(nodes)
    u = 0.5 * (x0 + x1) + 0.5 * (x1 - x0) * x
    v = 0.5 * (y0 + y1) + 0.5 * (y1 - y0) * x
    return float(density(u[:, None], v[None, :]) @ w @ w) * 0.25 * (x1 - x0) * (y1 - y0)


@cache
def lobe_fraction(theta, exponent):
    """Share of the integral of cos^P over the half space of the lobe that lies above a surface tilted by theta."""
    return float(lobe_share(np.array(math.cos(theta)), exponent))
