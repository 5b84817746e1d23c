"""Pixel lights with visibility: faces, shadow rays, their sum (SII Eq. 2 with V; docs/conventions).

Symbols: x receiver, n its normal, f that of the triangle that it sees, on the side of n; p, m pixel light and normal;
V 1 where nothing lies between. Receivers are (3, h, w) with triangle_id (h, w), -1 without surface; lights (3, N).
Imperfect shadow maps, which stand in place of rays, are refgi.literal.imperfect.
"""

from typing import Any

import numpy as np

from refgi.literal.direct import distance
from refgi.literal.pairs import pair

LIFT = 1e-5  # m: ends of rays off their surfaces, more than places in float32 are off them


def facing(vertices: Any, faces: Any, normal: Any, triangle_id: Any) -> Any:
    """Return f (3, h, w), the unit normals of the triangles that pixels see; 0 without surface."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    unit = across / np.sqrt((across**2).sum(axis=1, keepdims=True))
    f = np.moveaxis(unit[triangle_id], -1, 0)
    side = np.where((f * normal).sum(axis=0) < 0, -1, 1)
    return np.where(triangle_id >= 0, side * f, 0)


def visible(
    vertices: Any, faces: Any, position: Any, normal: Any, triangle_id: Any, face_normal: Any, light_position: Any,
    light_normal: Any,
) -> Any:
    """Return V (N, h, w): whether n and f look at p, m at x, and no triangle crosses the ray from x to p."""
    x, n, f = (plane.reshape(3, 1, -1) for plane in (position, normal, face_normal))
    p, m = light_position[:, :, None], light_normal[:, :, None]
    toward = p - x
    faces_light = ((n * toward).sum(axis=0) > 0) & ((f * toward).sum(axis=0) > 0)
    sends = faces_light & ((m * toward).sum(axis=0) < 0) & (triangle_id.ravel() >= 0)
    start, end = x + LIFT * f, p + LIFT * m
    blocked = np.zeros(sends.shape, bool)
    for corners in vertices[faces]:
        t = distance(corners, start, end - start)  # of the way
        blocked = blocked | (t < 1)
    seen = sends & ~blocked
    return seen.reshape(-1, *triangle_id.shape)


def shadowed_sum(
    position: Any, normal: Any, triangle_id: Any, seen: Any, light_position: Any, light_normal: Any, flux: Any,
    lobe_flux: Any = None, lobe_axis: Any = None, lobe_exponent: Any = None,
) -> Any:
    """Return the irradiance (3, h, w) of the lights that each receiver sees (N, h, w), W/m^2, without albedo/pi."""
    x, n = position[:, None], normal[:, None]
    p, m, phi = (one[:, :, None, None] for one in (light_position, light_normal, flux))
    lobe = None
    if lobe_flux is not None:
        lobe = lobe_flux[:, :, None, None], lobe_axis[:, :, None, None], lobe_exponent[:, None, None]
    # Eq. (2) with V
    total = (pair(x, n, p, m, phi, lobe) * seen).sum(axis=1)
    return np.where(triangle_id >= 0, total, 0)
