"""Slow literal twins of SII Eq. 1 to 3, pair by pair in float64, from unit vectors and the printed terms."""

import math

import numpy as np

from tests.naive.radiometry import lobe_fraction


def diffuse_intensity(w, normal, flux):
    """I(w) = Phi / pi max(0, n . w)."""
    return flux / math.pi * max(0.0, float(normal @ w))


def lobe_intensity(w, normal, axis, exponent, flux, norm="clamped"):
    """I(w) = Phi c max(0, r . w)^P above the surface, 0 below it."""
    if normal @ w <= 0 or axis @ w <= 0:
        return 0.0 * flux
    c = 1.0
    if norm != "none":
        c = (exponent + 1) / (2 * math.pi)
    if norm == "clamped":
        c /= lobe_fraction(math.acos(min(1.0, float(normal @ axis))), exponent)
    return flux * c * float(axis @ w) ** exponent


def pair(x, normal_x, p, normal_p, flux):
    """E = I(w) max(0, n_x . -w) / |x - p|^2."""
    r = float(np.linalg.norm(x - p))
    if r == 0:
        return 0.0 * flux
    w = (x - p) / r
    return diffuse_intensity(w, normal_p, flux) * max(0.0, float(normal_x @ -w)) / r**2


def clamped_pair(x, normal_x, p, normal_p, flux, *, least=0.0, bound=math.inf, area=0.0):
    """E of one pair with a minimum distance, a bounded geometry term or a disc of the light's area."""
    r = float(np.linalg.norm(x - p))
    if r == 0:
        return 0.0 * flux
    w = (x - p) / r
    cosines = max(0.0, float(normal_p @ w)) * max(0.0, float(normal_x @ -w))
    # a disc of area A seen from r on its axis has the form factor A / (pi r^2 + A)
    term = math.pi * cosines / (math.pi * r**2 + area) if area else cosines / max(r, least) ** 2
    return flux / math.pi * min(term, bound)


def lobe_pair(x, normal_x, p, normal_p, axis, exponent, flux, norm="clamped", widening=0.0):
    """E of one glossy pair; the exponent is P min(1, r / a) with its own norm."""
    r = float(np.linalg.norm(x - p))
    if r == 0:
        return 0.0 * flux
    w = (x - p) / r
    here = exponent * min(1.0, r / widening) if widening else exponent
    return lobe_intensity(w, normal_p, axis, here, flux, norm) * max(0.0, float(normal_x @ -w)) / r**2


def irradiance(position, normal, lights, term=pair):
    """Sum a term over all lights for every receiver; positions and normals (3, n), lights of (3, N) arrays."""
    total = np.zeros((3, position.shape[1]))
    for i in range(position.shape[1]):
        for k in range(lights.position.shape[1]):
            total[:, i] += term(position[:, i], normal[:, i], lights.position[:, k], lights.normal[:, k],
                                lights.flux[:, k])
    return total
