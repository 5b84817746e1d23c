"""Slow literal twins of range and bounds: membership pair by pair, the appendix's curves by definition."""

import math

import numpy as np

from refgi.literal.pairs import pair


def peak(flux, norm=1 / math.pi):
    """I_0 of an RGB light: its largest channel times the peak of a lobe of unit flux."""
    return float(np.max(flux)) * norm


def counts(x, p, axis, exponent, intensity, low):
    """Inside iff I_0 <cos alpha>^n >= I_low r^2 (procedure P3)."""
    d = x - p
    r = float(np.linalg.norm(d))
    cosine = max(0.0, float(axis @ d) / r) if r > 0 else 0.0
    return cosine > 0 and intensity * cosine**exponent >= low * r**2


def irradiance(position, normal, lights, low, term=pair):
    """Sum the diffuse pairs inside the range, and those outside; also count those inside at each receiver."""
    inside, outside = (np.zeros((3, position.shape[1])) for _ in range(2))
    overdraw = np.zeros(position.shape[1], int)
    for i in range(position.shape[1]):
        for k in range(lights.position.shape[1]):
            p, n, flux = lights.position[:, k], lights.normal[:, k], lights.flux[:, k]
            value = term(position[:, i], normal[:, i], p, n, flux)
            if counts(position[:, i], p, n, 1, peak(flux), low):
                inside[:, i] += value
                overdraw[i] += 1
            else:
                outside[:, i] += value
    return inside, outside, overdraw


def widened_region(r, cosine, exponent, widening):
    """Tell whether I(w) >= r^2 for a lobe of exponent P min(1, r / a), lengths in R_0, no new norm."""
    return (cosine > 0) & (np.maximum(cosine, 0.0) ** (exponent * np.minimum(1, r / widening)) >= r**2)


def captured_share(distance, radius, exponent):
    """Return the share of a light's flux that a plane across its axis receives from within the range.

    By the midpoint rule over the polar angle: flux goes as (n + 1) cos^n, and the plane lies at r = D / cos.
    """
    cosine = (np.arange(100_000) + 0.5) / 100_000
    kept = cosine**exponent * radius**2 >= (distance / cosine) ** 2
    return float(((exponent + 1) * cosine**exponent * kept).mean())
