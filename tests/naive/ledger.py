"""A slow literal twin of the screen's side of the energy ledger: every pixel with every light, in float64."""

import math

import numpy as np

from refgi.literal.light_flux import solid_angle
from refgi.literal.pairs import lobe_intensity, pair


def pixel_solid_angle(camera, width, height, i, j):
    """Solid angle of pixel (row i, column j), from its four corners on the image plane."""
    half = math.tan(camera.vfov / 2)
    y0, y1 = ((2 * k / height - 1) * half for k in (i, i + 1))
    x0, x1 = ((2 * k / width - 1) * half * width / height for k in (j, j + 1))
    return float(solid_angle(x0, x1, y0, y1))


def area(camera, width, height, i, j, position, triangle):
    """A = O d^2 / cos with the normal of the triangle (3 corners)."""
    normal = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
    view = position - np.asarray(camera.eye)
    distance = np.linalg.norm(view)
    cosine = abs(normal @ view) / (np.linalg.norm(normal) * distance)
    return pixel_solid_angle(camera, width, height, i, j) * distance**2 / cosine


def bound(x, p, peak, axis, exponent):
    """B = I_0 <axis . w>^n / r^2, the receiver's cosine taken as 1."""
    r = np.linalg.norm(x - p)
    return peak * max(0.0, float(axis @ ((x - p) / r))) ** exponent / r**2


def screen(pixels, lights, threshold, least):
    """Return arrived, cut, clamped and what meets visible surfaces from behind, (3,) W each.

    `pixels` are (area, position, normal), the clamp is a minimum distance `least`, pairs count where B >= threshold.
    """
    lines = {name: np.zeros(3) for name in ("arrived", "cut", "clamped", "behind")}
    for size, x, normal in pixels:
        for k in range(lights.position.shape[1]):
            for whole, clamped, behind, strength in terms(x, normal, lights, k, least):
                lines["arrived" if strength >= threshold else "cut"] += size * clamped
                lines["clamped"] += size * (whole - clamped)
                lines["behind"] += size * behind
    return lines


def terms(x, normal, lights, k, least):
    """Return of the diffuse part and of the lobe of light k: plain and clamped E, E on the other side, and B."""
    p, n, flux = lights.position[:, k], lights.normal[:, k], lights.flux[:, k]
    found, r = [], float(np.linalg.norm(x - p))
    near = (r / max(r, least)) ** 2 if r else 0.0
    if flux.any():
        e = pair(x, normal, p, n, flux)
        found.append((e, e * near, pair(x, -normal, p, n, flux), bound(x, p, flux.max() / math.pi, n, 1.0)))
    if lights.lobe_flux is not None and lights.lobe_flux[:, k].any():
        axis, exponent, lobe = lights.lobe_axis[:, k], float(lights.lobe_exponent[k]), lights.lobe_flux[:, k]
        e, behind = (pair(x, side, p, n, 0 * lobe, (lobe, axis, exponent)) for side in (normal, -normal))
        peak = lobe.max() * float(lobe_intensity(axis, n, axis, exponent))
        found.append((e, e * near, behind, bound(x, p, peak, axis, exponent)))
    return found
