"""Slow literal twin of one pixel light that lights receivers: SII Eq. 1 to 3 with clamps, offset and lobes, float64.

A pixel light has up to two parts, a diffuse one and a lobe. Arrays over receivers come last.
"""

import math
from typing import NamedTuple

import numpy as np

from refgi.settings import replaced
from tests.naive.radiometry import lobe_fractions
from tests.naive.sphere import spherical_pair


class Part(NamedTuple):
    """The diffuse part or the lobe of one pixel light."""

    light: int
    xi: int  # index of its random share: its place among the lights that have such a part
    position: np.ndarray  # (3,) m, moved back by the offset
    normal: np.ndarray
    axis: np.ndarray  # n_p, or r_p of a lobe
    exponent: float | None  # of a lobe
    flux: np.ndarray  # (3,) W
    area: float  # footprint, m^2


def with_clamp(settings, *, bare=False):
    """Return settings whose clamp "auto" is the disc, and none where lights have no footprints or that is `bare`."""
    if settings.pairs.clamp is None or settings.pairs.clamp.name() != "auto":
        return settings
    pathless = settings.lights.source.name() == "walk" or settings.lights.openness.flux == "roulette"
    return replaced(settings, {"pairs.clamp": "none" if pathless or bare else "disc"})


def contributions(position, normal, lights, pairs, footprint=None):
    """Return E (N, n, 3) of N lights at receivers (n, 3) each; `footprint` is the area (N,) of each light."""
    result = np.zeros((lights.position.shape[1], len(position), 3))
    for part in parts(lights, pairs, footprint):
        result[part.light] += np.outer(received(part, position.T, normal.T, pairs), part.flux)
    return result


def parts(lights, pairs, footprint=None) -> list[Part]:
    """Return the parts of all lights that have flux, p moved to p - offset n."""
    found = []
    for glossy, flux in ((False, lights.flux), (True, lights.lobe_flux)):
        shining = [] if flux is None else [k for k in range(flux.shape[1]) if flux[:, k].any()]
        for xi, k in enumerate(shining):
            normal = lights.normal[:, k]
            axis, exponent = (lights.lobe_axis[:, k], float(lights.lobe_exponent[k])) if glossy else (normal, None)
            found.append(Part(k, xi, lights.position[:, k] - pairs.offset * normal, normal, axis, exponent, flux[:, k],
                              0.0 if footprint is None else float(footprint[k])))
    return found


def towards(part, x):
    """Return unit vectors from the part to receivers, and their distance; a light at a receiver sends nothing there."""
    d = x - part.position[:, None]
    r = np.linalg.norm(d, axis=0)
    return np.divide(d, r, out=np.zeros_like(d), where=r > 0), np.where(r > 0, r, np.inf)


def received(part, x, normal, pairs):
    """Return E / Phi at receivers: intensity times the receiver's cosine over r^2 (Eq. 2), with the clamp."""
    w, r = towards(part, x)
    arriving = np.maximum(0, -(normal * w).sum(axis=0))
    if pairs.clamp is not None and pairs.clamp.name() == "sphere":
        return in_spheres(part, x, normal, pairs)
    if part.exponent is None:
        leaving = np.maximum(0, part.normal @ w)
        return diffuse_peak(pairs) * geometry(leaving * arriving, r, pairs.clamp, part.area)
    return lobe(part, w, r, pairs) * geometry(arriving, r, pairs.clamp, part.area)


def geometry(cosines, r, clamp, area):
    """Return cosines / r^2 as the clamp has it."""
    name = "none" if clamp is None else clamp.name()
    if name == "distance":
        return cosines / np.maximum(r, clamp.value) ** 2
    if name == "geometry":
        return np.minimum(cosines / r**2, clamp.value)
    if name == "disc":
        return cosines / (r**2 + area / math.pi)
    return cosines / r**2


def in_spheres(part, x, normal, pairs):
    """Return E / Phi of a virtual spherical light of pi r^2 = value A, a diffuse one."""
    radius = math.sqrt(pairs.clamp.value * part.area / math.pi)
    scale = math.pi * diffuse_peak(pairs)
    return scale * np.array([spherical_pair(here, facing, part.position, part.normal, 1.0, radius=radius)
                             for here, facing in zip(x.T, normal.T, strict=True)])


def diffuse_peak(pairs):
    """Return the peak intensity of unit flux: 1 / pi, or 1 as Eq. 1 prints it."""
    return 1.0 if "sii_no_pi" in pairs.as_published else 1 / math.pi


def intensity(part, w, r, pairs):
    """Return I(w) / Phi of a part (Eq. 1, 3)."""
    if part.exponent is None:
        return diffuse_peak(pairs) * np.maximum(0, part.normal @ w)
    return lobe(part, w, r, pairs)


def lobe(part, w, r, pairs):
    """Return c(P) <r . w>^P above the surface, 0 below it (Eq. 3), with exponents that fall near the light."""
    exponents, of_norms = widened(part.exponent, r, pairs)
    cosine = np.maximum(0, part.axis @ w)
    norms = lobe_norms(part, of_norms, pairs.lobe.norm)
    return np.where((part.normal @ w > 0) & (cosine > 0), norms * cosine**exponents, 0.0)


def widened(exponent, r, pairs):
    """Return P' at the distances r, and the exponents whose norm it has (Sec. 3.3)."""
    a, whole = pairs.lobe.widening, np.array([exponent])
    if a == 0:
        return whole, whole
    if "sii_widening" in pairs.as_published:
        return np.minimum(exponent, exponent / (r * a)), whole
    falling = exponent * np.minimum(1, r / a)
    return falling, whole if "sii_widening_unnorm" in pairs.as_published else falling


def lobe_norms(part, exponents, norm):
    """Return c(P): 1, (P + 1) / 2 pi or (P + 1) / (2 pi K)."""
    if norm == "none":
        return np.ones(len(exponents))
    full = (exponents + 1) / (2 * math.pi)
    theta = math.acos(min(1.0, float(part.normal @ part.axis)))
    return full if norm == "full_lobe" else full / lobe_fractions(theta, exponents)
