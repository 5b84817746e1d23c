"""Fresh directions over a light: n x n cells of equal measure, one jittered ray in each.

Spots and points get equal-area maps of the square to the cap or the sphere, so each ray stands for the same solid
angle, exactly; a directional light gets a rectangle across the scene's bounds. The cells are taken along a Hilbert
curve: neighbours in the list are neighbours on the surfaces they light, which is what makes systematic picks even.
"""

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.sampling import hilbert_order
from refgi.scene import DirectionalLight, Geometry, Light, SpotLight

Array = npt.NDArray[Any]


class LightRays(NamedTuple):
    """One ray for each cell of a light's grid."""

    origins: Array  # (n * n, 3) float64, m
    directions: Array  # (n * n, 3) float64, unit vectors
    measure: float  # solid angle of a ray, sr; for a directional light its perpendicular area, m^2


def light_rays(light: Light, geometry: Geometry, jitter: Array) -> LightRays:
    """Send one ray through each cell of a light's grid.

    Parameters
    ----------
    light : Light
        The light.
    geometry : Geometry
        What it shines on; only its bounds matter, and only to a directional light.
    jitter : (n * n, 2) ndarray
        Place of each ray in its cell, in [0, 1).

    Returns
    -------
    LightRays
        Along a Hilbert curve over the grid.
    """
    n = math.isqrt(len(jitter))
    square = (_cells(n) + jitter) / n
    if isinstance(light, DirectionalLight):
        return _parallel(light, geometry, square)
    if isinstance(light, SpotLight):
        axis = np.asarray(light.direction, np.float64) / np.linalg.norm(light.direction)
        local, measure = _cap(square, 2 * math.sin(light.outer_half_angle / 2) ** 2)
        directions = local @ _frame(axis)
    else:
        directions, measure = _sphere(square), 4 * math.pi
    return LightRays(np.broadcast_to(np.asarray(light.position, np.float64), directions.shape), directions,
                     measure / len(jitter))


def footprint(light: Light, geometry: Geometry, n: int) -> tuple[float, float]:
    """Return the measure of one ray and its largest footprint in the scene.

    Parameters
    ----------
    light : Light
        The light.
    geometry : Geometry
        What it shines on.
    n : int
        Cells along one side of the grid.

    Returns
    -------
    tuple of 2 floats
        Solid angle (sr) or area (m^2) of a ray, and the largest measure x distance^2 (m^2).
    """
    measure = light_rays(light, geometry, np.full((n * n, 2), 0.5)).measure
    if isinstance(light, DirectionalLight):
        return measure, measure
    reach = np.maximum(*(np.abs(np.subtract(corner, light.position)) for corner in geometry.bounds))
    return measure, measure * float(reach @ reach)


@cache
def _cells(n: int) -> Array:
    """Return the cells of an n x n grid along a Hilbert curve: (n * n, 2) integers as floats."""
    order = hilbert_order(n, n)
    return np.stack([order % n, order // n], axis=1).astype(np.float64)


def _disc(square: Array) -> tuple[Array, Array]:
    """Map the unit square to the unit disc, areas in proportion, rings of squares to rings: radius and angle."""
    a, b = 2 * square[:, 0] - 1, 2 * square[:, 1] - 1
    wide = np.abs(a) > np.abs(b)
    radius = np.where(wide, a, b)
    ratio = np.divide(np.where(wide, b, a), radius, out=np.zeros_like(radius), where=radius != 0)
    return radius, np.where(wide, math.pi / 4 * ratio, math.pi / 2 - math.pi / 4 * ratio)


def _cap(square: Array, most: float) -> tuple[Array, float]:
    """Map the unit square to the cap of 1 - cos theta <= most around z, solid angles in proportion (Lambert's map)."""
    radius, phi = _disc(square)
    height = radius * radius * most  # 1 - cos theta
    across = np.sqrt(height * (2 - height)) * np.sign(radius)
    return np.stack([across * np.cos(phi), across * np.sin(phi), 1 - height], axis=1), 2 * math.pi * most


def _sphere(square: Array) -> Array:
    """Map the unit square to all directions, solid angles in proportion: the middle diamond is the upper half."""
    a, b = 2 * square[:, 0] - 1, 2 * square[:, 1] - 1
    inside = 1 - (np.abs(a) + np.abs(b))  # > 0 in the diamond
    radius = 1 - np.abs(inside)
    turn = np.divide(np.abs(b) - np.abs(a), radius, out=np.zeros_like(radius), where=radius > 0)
    phi = math.pi / 4 * (turn + 1)
    across = radius * np.sqrt(2 - radius * radius)
    return np.stack([np.copysign(across * np.cos(phi), a), np.copysign(across * np.sin(phi), b),
                     np.copysign(1 - radius * radius, inside)], axis=1)


def _parallel(light: DirectionalLight, geometry: Geometry, square: Array) -> LightRays:
    axis = np.asarray(light.direction, np.float64) / np.linalg.norm(light.direction)
    frame = _frame(axis)
    corners = np.stack(np.meshgrid(*np.stack(geometry.bounds, axis=1), indexing="ij"), axis=-1).reshape(-1, 3)
    low, high = (corners @ frame.T).min(axis=0), (corners @ frame.T).max(axis=0)
    margin = 1e-3 * (high - low).max()  # rays start before everything, and no edge is missed by rounding
    low, high = low - margin, high + margin
    local = np.column_stack([low[:2] + square * (high - low)[:2], np.full(len(square), low[2])])
    area = float(np.prod((high - low)[:2]))
    return LightRays(local @ frame, np.broadcast_to(axis, (len(square), 3)), area / len(square))


def _frame(axis: Array) -> Array:
    """Return a right-handed frame as rows, the last one the axis."""
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(axis, across), axis])
