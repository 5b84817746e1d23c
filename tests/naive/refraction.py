"""Slow literal twin of light through a ball of glass, ray by ray, from Snell and Fresnel alone.

The ball has centre c, radius R and index n, in air. The paper's simplification crosses the front unbent.
"""

import math

import numpy as np


def bend(direction, normal, near, far):
    """Refract one ray by angles; `normal` on the side it goes to. Return direction and transmittance, 0 if none."""
    cos_in = float(direction @ normal)
    across = direction - cos_in * normal
    sine = float(np.linalg.norm(across))
    angle_in = math.atan2(sine, cos_in)
    if cos_in <= 0 or near * sine >= far:
        return direction, 0.0
    angle_out = math.asin(near * sine / far)
    tangent = across / sine if sine > 0 else across
    return math.cos(angle_out) * normal + math.sin(angle_out) * tangent, 1 - reflectance(angle_in, angle_out, near, far)


def reflectance(angle_in, angle_out, near, far):
    """Fresnel's formulas by sines and tangents, averaged over both polarisations."""
    if angle_in == 0:
        return ((near - far) / (near + far)) ** 2
    perpendicular = math.sin(angle_in - angle_out) / math.sin(angle_in + angle_out)
    parallel = math.tan(angle_in - angle_out) / math.tan(angle_in + angle_out)
    return (perpendicular**2 + parallel**2) / 2


def hits_of_sphere(origin, direction, centre, radius):
    """Both distances along a ray to a sphere, or None."""
    along = float((centre - origin) @ direction)
    square = radius**2 - float(((centre - origin) - along * direction) @ ((centre - origin) - along * direction))
    return (along - math.sqrt(square), along + math.sqrt(square)) if square > 0 else None


def through_ball(origin, direction, centre, radius, index, *, front):
    """Exit point, outward normal, direction and transmittance of a ray, or None; `front`: bend there too."""
    found = hits_of_sphere(origin, direction, centre, radius)
    if found is None:
        return None
    enter = origin + found[0] * direction
    inside, first = bend(direction, (centre - enter) / radius, 1.0, index)
    if front:
        leave = enter + 2 * float((centre - enter) @ inside) * inside
    else:
        inside, leave = direction, origin + found[1] * direction
    outward = (leave - centre) / radius
    out, second = bend(inside, outward, index, 1.0)
    return leave, outward, out, first * second


def mean_transmittance(index, *, front, rays=4_000):
    """Share of parallel light over a ball's disc that gets through: the midpoint rule in h^2."""
    centre, ahead = np.array([0.0, 0.0, 10.0]), np.array([0.0, 0.0, 1.0])
    heights = np.sqrt((np.arange(rays) + 0.5) / rays)
    return float(np.mean([through_ball(np.array([h, 0.0, 0.0]), ahead, centre, 1.0, index, front=front)[3]
                          for h in heights]))
