"""Parallel light on the hollow side of an upright half cylinder, whose caustic on the floor is half a nephroid.

Light travels along +x and falls as steeply as 45 degrees; the mirror x^2 + z^2 = R^2, x > 0, stands on the floor
y = 0. The ray that meets the wall at azimuth t and height y leaves at azimuth pi + 2 t and lands a way y further on.
"""

import math

import numpy as np


def landing(azimuth, way, radius):
    """Where a ray lands that runs a horizontal `way` after its reflection: (x, z)."""
    return (radius * np.cos(azimuth) - way * np.cos(2 * azimuth), radius * np.sin(azimuth) - way * np.sin(2 * azimuth))


def caustic(azimuth, radius):
    """The envelope of the rays: each touches it half way, at R cos t / 2."""
    return landing(azimuth, radius * np.cos(azimuth) / 2, radius)


def irradiance_on_axis(x, radius, floor):
    """Irradiance of a perfect mirror at (x, 0, 0) over that of the light on the `floor` itself, R/2 < x < R or below.

    A landing point has the density cos t / |cos t - 2 way / R|. The middle ray (t = 0) reaches every x; beyond the
    cusp at R / 2 two more do, those with cos t = R / (2 x).
    """
    middle = radius / np.abs(2 * x - radius)
    cosine2 = np.minimum((radius / (2 * x)) ** 2, 1)
    pair = np.where(x > radius / 2, 2 * cosine2 / np.maximum(1 - cosine2, 1e-300), 0.0)
    return floor * (middle + pair)


def trace(count, radius, height, exponent, floor, seed):
    """Send photons at the mirror and on into a Phong lobe: where they land (x, z), and the flux of each.

    The lobe is sampled, not evaluated: cos = u^(1 / (P + 1)) about the mirror direction.
    """
    random = np.random.default_rng(seed)
    across = random.uniform(-radius, radius, count)  # even in z: the light is parallel
    azimuth, level = np.arcsin(across / radius), random.uniform(0, height, count)
    point = np.stack([radius * np.cos(azimuth), level, across], axis=1)
    axis = np.stack([-np.cos(2 * azimuth), -np.ones(count), -np.sin(2 * azimuth)], axis=1) / math.sqrt(2)
    side = np.stack([-np.sin(2 * azimuth), np.zeros(count), np.cos(2 * azimuth)], axis=1)
    up = np.cross(axis, side)
    cosine = random.random(count) ** (1 / (exponent + 1))
    turn, sine = 2 * math.pi * random.random(count), np.sqrt(1 - cosine**2)
    out = cosine[:, None] * axis + sine[:, None] * (np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * up)
    way = np.where(out[:, 1] < 0, -level / np.minimum(out[:, 1], -1e-12), np.nan)
    landed = point + way[:, None] * out
    # at 45 degrees a wall of height y catches as much as the floor of length y: floor irradiance times 2 R y
    return landed[:, [0, 2]], floor * 2 * radius * height / count
