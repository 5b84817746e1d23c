"""Closed forms of energy exchange between simple shapes: what the sums must converge to.

A form factor F is the share of the flux of one diffuse surface that reaches another; from a point, the irradiance
there is pi L F under a sender of radiance L. All are dimensionless and need only ratios of lengths.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


def disc_form_factor(height: float, radius: float) -> float:
    """Return F from a small surface to a parallel disc centred above it: R^2 / (h^2 + R^2).

    Parameters
    ----------
    height : float
        Distance h to the disc's centre, m.
    radius : float
        Radius R of the disc, m.

    Returns
    -------
    float
        0 to 1.

    Examples
    --------
    >>> disc_form_factor(1.0, 1.0)
    0.5
    """
    return radius * radius / (height * height + radius * radius)


def polygon_form_factor(point: Sequence[float], normal: Sequence[float], corners: npt.ArrayLike) -> float:
    """Return F from a small surface to a flat polygon wholly above its horizon (Lambert 1760).

    Parameters
    ----------
    point : sequence of 3 floats
        Where the small surface is, m.
    normal : sequence of 3 floats
        Its unit normal.
    corners : (n, 3) array_like
        The polygon, in either order.

    Returns
    -------
    float
        0 to 1.

    Notes
    -----
    ``F = |sum over edges of angle(edge) <n . unit normal of the plane through edge and point>| / (2 pi)``.
    """
    rays = np.asarray(corners, np.float64) - np.asarray(point, np.float64)
    following = np.roll(rays, -1, axis=0)
    cross = np.cross(rays, following)
    sine = np.linalg.norm(cross, axis=1)
    angle = np.arctan2(sine, (rays * following).sum(axis=1))
    towards = np.divide(cross @ np.asarray(normal, np.float64), sine, out=np.zeros(len(rays)), where=sine > 0)
    return float(abs((angle * towards).sum()) / (2 * math.pi))


def parallel_rectangles_form_factor(width: float, depth: float, distance: float) -> float:
    """Return F between two equal rectangles that face each other.

    Parameters
    ----------
    width, depth : float
        Sides of the rectangles, m.
    distance : float
        Between their planes, m.

    Returns
    -------
    float
        0 to 1.

    Examples
    --------
    >>> round(parallel_rectangles_form_factor(1.0, 1.0, 1.0), 6)
    0.199825
    """
    x, y = width / distance, depth / distance
    sx, sy = math.sqrt(1 + x * x), math.sqrt(1 + y * y)
    total = math.log(sx * sy / math.sqrt(1 + x * x + y * y))
    total += x * sy * math.atan(x / sy) + y * sx * math.atan(y / sx) - x * math.atan(x) - y * math.atan(y)
    return 2 * total / (math.pi * x * y)


def wedge_form_factor(angle: float) -> float:
    """Return F between the two equally wide, endless faces of a wedge: 1 - sin(angle / 2).

    Parameters
    ----------
    angle : float
        Between the faces, rad.

    Returns
    -------
    float
        0 to 1.

    Examples
    --------
    >>> round(wedge_form_factor(math.pi / 2), 6)
    0.292893
    """
    return 1 - math.sin(angle / 2)


def coaxial_discs_form_factor(sender: float, receiver: float, distance: float) -> float:
    """Return F from one disc to another on the same axis, facing it.

    Parameters
    ----------
    sender, receiver : float
        Their radii, m.
    distance : float
        Between their planes, m.

    Returns
    -------
    float
        Share of the sender's flux that reaches the receiver, 0 to 1.

    Examples
    --------
    >>> round(coaxial_discs_form_factor(1e-4, 1.0, 1.0), 6)
    0.5
    """
    a, b = sender / distance, receiver / distance
    s = 1 + (1 + b * b) / (a * a)
    # (s - sqrt(s^2 - 4 (b/a)^2)) / 2 without the difference
    q = 4 * (b / a) ** 2
    return 0.5 * q / (s + math.sqrt(s * s - q))
