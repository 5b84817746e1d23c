"""Direct light at surface points, and whether a lamp reaches them: by its map or by rays (HSS Sec. 4; docs/rasterizer).

E = I(w) cos / d^2, without albedo/pi; of a directional light E = E_perp cos. A map's shadow is judged by the receiver's
own plane: what blocks the light lies above it, a neighbouring point of the same surface does not, at any slope.

Symbols: x, n surface point and its normal; d, w vector and unit direction from x to the lamp; r its length, m. Points
are (3, h, w) with triangle_id (h, w), -1 where there is none; maps are those of `buffers`.
"""

from typing import Any

import numpy as np

from refgi.literal.buffers import map_axes, unit
from refgi.literal.light_flux import spot_share

PLANE_BIAS = 0.1  # texels, also per unit of slope: how far above a receiver's plane its own surface may be stored
LARGEST_SLOPE = 10.0  # depth per sideways distance that the bias follows


def direct_irradiance(
    position: Any, normal: Any, triangle_id: Any, visible: Any, strength: Any, place: Any, direction: Any,
    half_angles: Any, falloff: Any,
) -> Any:
    """Sum the irradiance E (3, h, w), W/m^2, of all lamps where they are `visible` (h, w).

    Each lamp has a strength (3,): intensity, W/sr, or irradiance, W/m^2, where its place (3,) is None; a direction (3,)
    unless it is a point light; half_angles (2,), rad, and a falloff if it is a spot.
    """
    parts = []
    for reached, *lamp in zip(visible, strength, place, direction, half_angles, falloff, strict=True):
        arriving = lamp_irradiance(position, normal, *lamp)
        parts.append(np.where((triangle_id >= 0) & reached, arriving, 0))
    return np.sum(parts, axis=0)


def lamp_irradiance(
    x: Any, n: Any, strength: Any, place: Any, direction: Any, half_angles: Any, falloff: Any
) -> Any:
    """Return E (3, h, w), W/m^2, of one lamp, unblocked."""
    d = to_lamp(x, place, direction)
    r = np.sqrt((d**2).sum(axis=0))
    w = unit(d)
    cosine = np.maximum(0, (n * w).sum(axis=0))
    fall = np.ones_like(r)
    if place is not None:
        fall = np.divide(1, r**2, out=0 * r, where=r > 0)
    if half_angles is not None:
        inner, outer = half_angles
        axis = unit(direction).reshape(3, 1, 1)
        leaving = -(axis * w).sum(axis=0)
        fall = fall * spot_share(leaving, inner, outer, falloff)
    # E = I(w) cos / d^2
    return strength.reshape(3, 1, 1) * (cosine * fall)


def shadow_map(
    position: Any, normal: Any, triangle_id: Any, origin: Any, frame: Any, half: Any, depth: Any, map_position: Any,
    rows: int, columns: int, parallel: bool, place: Any = None, direction: Any = None, interpolated: bool = False,
) -> Any:
    """Return where a lamp arrives (h, w): the point at the nearest texel does not lie above the receiver's plane.

    `normal` is that of the receiver's face. `depth` (H, W), m, and `map_position` (3, H, W), m, are what the lamp sees.
    Faces turned away from the lamp, at a place (3,) or against its direction, are dark where normals are interpolated.
    """
    row, column, away = map_texels(position, origin, frame, half, rows, columns, parallel)
    on_map = row >= 0
    stored = depth[row, column]
    above = (normal * (map_position[:, row, column] - position)).sum(axis=0)
    bias = plane_bias(position, normal, origin, frame, half, row // rows, rows, columns, parallel)
    visible = (away <= stored) | (above <= bias + 1e-6 * away)
    if interpolated:
        visible &= (normal * to_lamp(position, place, direction)).sum(axis=0) > 0
    return (triangle_id >= 0) & on_map & visible


def to_lamp(x: Any, place: Any, direction: Any) -> Any:
    """Return vectors (3, h, w) from points to a lamp at a place (3,), m, or against its direction."""
    return -direction.reshape(3, 1, 1) + 0 * x if place is None else place.reshape(3, 1, 1) - x


def map_texels(position: Any, origin: Any, frame: Any, half: Any, rows: int, columns: int, parallel: bool) -> Any:
    """Return row, -1 outside, column and depth, m, of points on the first of a lamp's maps that sees them: (h, w)."""
    row, column, away = (np.full(position.shape[1:], start) for start in (-1, -1, np.inf))
    axes = ([one.reshape(3, 1, 1) for one in view] for view in zip(*map_axes(origin, frame), strict=True))
    for index, (eye, right, down, forward) in enumerate(axes):
        ahead = (forward * (position - eye)).sum(axis=0)
        scale = np.ones_like(ahead) if parallel else np.where(ahead > 0, ahead, np.nan)
        u = (right * (position - eye)).sum(axis=0) / scale / half[0]
        v = (down * (position - eye)).sum(axis=0) / scale / half[1]
        inside = (row < 0) & (np.abs(u) <= 1) & (np.abs(v) <= 1)
        row[inside] = index * rows + np.minimum((v[inside] + 1) / 2 * rows, rows - 1)
        column[inside] = np.minimum((u[inside] + 1) / 2 * columns, columns - 1)
        away[inside] = ahead[inside]
    return row, column, away


def plane_bias(
    x: Any, n: Any, origin: Any, frame: Any, half: Any, index: Any, rows: int, columns: int, parallel: bool
) -> Any:
    """Return how far above a receiver's plane its surface may be stored (h, w), m: part of a texel, more with slope."""
    eye, _, _, forward = (np.moveaxis(one[index], -1, 0) for one in map_axes(origin, frame))
    away = np.sqrt(((x - eye) ** 2).sum(axis=0))
    d = forward if parallel else unit(x - eye)
    width = 2 * np.maximum(half[0] / columns, half[1] / rows) * (1 if parallel else away)
    cosine = np.abs((d * n).sum(axis=0))
    slope = np.sqrt(np.maximum(0, 1 - cosine**2)) / np.maximum(cosine, 1e-6)
    return PLANE_BIAS * width * (1 + np.minimum(slope, LARGEST_SLOPE))


def shadow_rays(
    position: Any, normal: Any, triangle_id: Any, vertices: Any, faces: Any, place: Any = None, direction: Any = None,
    offset: float = 1e-5,
) -> Any:
    """Return where no triangle lies between a point and a lamp at a place (3,), or against its direction: (h, w).

    Rays begin `offset`, m, above the face, whose normal it is, and end as far before the lamp.
    """
    start = position + offset * normal
    d = to_lamp(start, place, direction)
    reach = np.inf if place is None else 1 - offset / np.sqrt((d**2).sum(axis=0))
    faced = (normal * d).sum(axis=0) > 0
    blocked = np.zeros_like(faced)
    for corners in vertices[faces]:
        blocked |= distance(corners, start, d) < reach
    return (triangle_id >= 0) & faced & ~blocked


def distance(corners: Any, o: Any, d: Any) -> Any:
    """Return how many d (3, h, w) from o a triangle of corners (3, 3) lies; infinite where the ray passes it."""
    a, b, c = corners
    across = np.cross(b - a, c - a)
    square = (across @ across) or np.nan  # without area nothing meets it
    from_a, slope = o - a.reshape(3, 1, 1), np.tensordot(across, d, 1)
    t = -np.tensordot(across, from_a, 1) / np.where(slope == 0, np.nan, slope)  # where the ray meets the plane
    point = from_a + t * d
    u, v = (np.tensordot(one / square, point, 1) for one in (np.cross(c - a, across), np.cross(across, b - a)))
    return np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)


def leaving_radiance(irradiance: Any, extra: Any = None, *, albedo: Any, emission: Any = None) -> Any:
    """Return what the camera receives of diffuse surfaces, L (3, h, w), W/m^2/sr: L_e + albedo/pi (E + extra)."""
    arriving = irradiance + (0 if extra is None else extra)
    # L = albedo/pi E
    reflected = albedo / np.pi * arriving
    return reflected + (0 if emission is None else emission)


def emission(triangle_id: Any, material_of_face: Any, emission: Any) -> Any:
    """Return what each pixel's surface emits (3, h, w), W/m^2/sr, of the radiance (m, 3) of materials."""
    own = np.moveaxis(emission[material_of_face[triangle_id]], -1, 0)
    return np.where(triangle_id >= 0, own, 0)
