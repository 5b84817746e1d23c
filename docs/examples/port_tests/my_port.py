"""A tiny port to be tested: pixel lights in NumPy and float32, and the pair term of Eq. 2."""

import numpy as np


def lights_of(texel, weight, position, normal, flux):
    """Return places, normals and flux of the lights of one map, those without flux left out."""
    place, facing, power = (plane.reshape(3, -1)[:, texel] for plane in (position, normal, flux))
    lit = power.any(axis=0)
    return place[:, lit], facing[:, lit], (power * weight)[:, lit]


def irradiance(position, normal, covered, lights):
    """Sum Eq. 2 over lights: (3, h, w) W/m^2."""
    total = np.zeros_like(position)
    for place, facing, power in zip(*(one.T for one in lights), strict=True):
        d = position - place[:, None, None]
        square = (d * d).sum(axis=0)
        w = d / np.sqrt(square)
        sent = np.maximum(0, np.tensordot(facing, w, 1))
        received = np.maximum(0, -(normal * w).sum(axis=0))
        total += power[:, None, None] / np.float32(np.pi) * (sent * received / square)
    return np.where(covered, total, 0)
