"""Slow literal twin of a virtual spherical light (Hasan et al. 2009, diffuse), as a nested adaptive integral.

E = Phi / (pi^2 r^2) integral of max(0, n_p . -w) max(0, n_x . w) dw over the cone sin a = min(1, r / d) to the light.
"""

import math
from itertools import pairwise

import numpy as np
from scipy.integrate import quad

ACCURACY = 1e-10  # of the integrals, relative


def spherical_pair(x, normal_x, p, normal_p, flux, *, radius):
    """Integrate one pair; a light that coincides with the receiver adds 0."""
    d = float(np.linalg.norm(p - x))
    if d == 0:
        return 0.0 * flux
    whole = cone_integral((p - x) / d, -normal_p, normal_x, math.asin(min(1.0, radius / d)))
    return flux / (math.pi * radius) ** 2 * whole


def cone_integral(axis, first, second, angle):
    """Integrate max(0, first . w) max(0, second . w) over a cone, ring by ring, split at every kink."""
    u = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    u /= np.linalg.norm(u)
    v = np.cross(axis, u)
    # n . w = c cos(theta) + q sin(theta) cos(phi - turn)
    parts = [(float(n @ axis), math.hypot(n @ u, n @ v), math.atan2(n @ v, n @ u)) for n in (first, second)]

    def ring(theta):
        c, s = math.cos(theta), math.sin(theta)
        kinks = [turn + side * math.acos(-a * c / (q * s)) for a, q, turn in parts if abs(a * c) < q * s
                 for side in (-1, 1)]
        ends = sorted({0.0, 2 * math.pi, *(k % (2 * math.pi) for k in kinks)})
        return s * sum(arc(lo, hi, c, s) for lo, hi in pairwise(ends))

    def arc(lo, hi, c, s):
        middle = (lo + hi) / 2
        if any(a * c + q * s * math.cos(middle - turn) <= 0 for a, q, turn in parts):
            return 0.0
        # a trigonometric polynomial of order 2: 16 Gauss points have it to rounding
        phi = middle + NODES * (hi - lo) / 2
        (a, q, turn), (b, k, other) = parts
        return float(WEIGHTS @ ((a * c + q * s * np.cos(phi - turn)) * (b * c + k * s * np.cos(phi - other)))
                     * (hi - lo) / 2)

    touches = [math.atan2(abs(a), q) for a, q, _ in parts] + _both_horizons(axis, first, second)
    touches = sorted({0.0, angle, *(t for t in touches if 0 < t < angle)})
    return sum(quad(ring, lo, hi, epsabs=1e-13, epsrel=ACCURACY, limit=200)[0]
               for lo, hi in pairwise(touches))


def _both_horizons(axis, first, second):
    """Angles from the axis at which both horizons meet."""
    c = np.cross(first, second)
    length = np.linalg.norm(c)
    return [math.acos(min(1.0, max(-1.0, side * float(axis @ c) / length))) for side in (-1, 1)] if length > 0 else []


NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
