"""How much of an area light a pixel sees, by depth tests in the light's map: search, PCF, PCSS (VAL Sec. 4.1, 4.2).

Symbols: K area lights of size delta (K,), m, each with a map (n, n) of distances z, m, inf where it holds nothing;
(s, t) = (x, y) / (|p| + z) a map's coordinates, -1 to 1 to the right and down; local (3, K, h, w) pixels along right,
down and forward of each map, d (K, h, w) their distance, m; a half-angle of a cone, rad; region (K, 3, h, w) a disc
s, t, radius; V share of the light that is seen. Pixels have position and facing (3, h, w); no surface: triangle_id < 0.
"""

import math
from typing import Any

import numpy as np

from refgi.literal.val_maps import direction, texel_centers

STEEPEST = math.radians(80)  # of a cone: more would leave the hemisphere
SLACK = 1e-3  # share of its distance by which a surface lies before a pixel that it hides


def search(
    position: Any, triangle_id: Any, center: Any, frame: Any, delta: Any, near: Any, solid_angle: bool = False,
    squares: bool = False, foreshortened: bool = False, axial: bool = False,
) -> Any:
    """Return pending (K, h, w), region and d: who searches for blockers, in which disc (Sec. 4.2).

    The cone for blockers at the nearest distance that the map holds; as printed, half-way (`solid_angle`). `axial`: all
    directions in which such a blocker may lie.
    """
    local, d = to_map(position, center, frame)
    size = light_size(delta, local, d, foreshortened)
    held = np.isfinite(near)[:, None, None]
    nearest = np.where(held, near[:, None, None], 1)
    ahead = local[2] > 0  # E-VAL-12: from behind the light's plane all is seen
    beyond = d > nearest
    wide = (delta > 0)[:, None, None]
    asked = ahead & beyond & wide
    pending = asked & held & (triangle_id >= 0)
    z = d / 2 if solid_angle else nearest  # E-VAL-09
    a = widest_angle(size, d, z) if axial and not solid_angle else half_angle(size, d, z)
    region = square(local, d, a) if squares else disc(local, d, a)
    return pending, np.where(pending[:, None], region, 0), np.where(pending, d, 0)


def to_map(position: Any, center: Any, frame: Any) -> Any:
    """Return local and d of pixels in the maps around centers (K, 3) with frames (K, 3, 3)."""
    away = position[:, None] - center.T[:, :, None, None]
    local = np.einsum("kac,ckij->akij", frame, away)
    return local, np.sqrt((local**2).sum(axis=0))  # E-VAL-06: distances, not depths along the axis


def light_size(delta: Any, local: Any, d: Any, foreshortened: bool) -> Any:
    """Return Delta (K, h, w), m, of each light; `foreshortened`: as the pixel sees it."""
    size = delta[:, None, None] + 0 * d
    return size * np.sqrt(np.maximum(local[2], 0) / d) if foreshortened else size


def half_angle(size: Any, d: Any, z: Any) -> Any:
    """Return a of the cone in which a pixel sees the light past blockers at z (Sec. 4.2, Fig. 3; E-VAL-07)."""
    # Sec. 4.2: p cos(beta) = (d - z) Delta / z, alpha = 2 a = 2 arctan(p cos(beta) / 2 d)
    tangent = size * (d - z) / (2 * d * z)
    angle = np.arctan(tangent)
    return np.clip(angle, 0, STEEPEST)


def penumbra_angle(size: Any, d: Any, z: Any, alpha: bool) -> Any:
    """Return a of the penumbra of blockers at z; as printed, alpha / 2 of an alpha that begins at the axis."""
    a = half_angle(size, d, z)
    return np.arctan(2 * np.tan(a)) / 2 if alpha else a


def widest_angle(size: Any, d: Any, z: Any) -> Any:
    """Return the angle off the axis, seen from the map, at which a point at z still lies before the light.

    There z sin a = Delta / 2 (1 - z cos a / d); where z is less than about Delta / 2, every point does.
    """
    slant = np.arctan(size / (2 * d))
    sine = size * np.cos(slant) / (2 * z)
    angle = np.arcsin(np.minimum(sine, 1)) - slant
    return np.where(z < d, np.where(sine < 1, np.minimum(angle, STEEPEST), STEEPEST), 0)


def disc(local: Any, d: Any, a: Any) -> Any:
    """Return the disc that a cone about a pixel's direction is on a stereographic map (E-VAL-08)."""
    unit = local / d
    total = unit[2] + np.cos(a)
    s = unit[0] / total
    t = unit[1] / total
    radius = np.sin(a) / total
    return np.stack([s, t, radius], axis=1)


def square(local: Any, d: Any, a: Any) -> Any:
    """Return s, t and half the side of the square of side alpha / pi of the texture, alpha = 2 a, as printed."""
    own = local[:2] / (d + local[2])
    return np.stack([own[0], own[1], 2 * a / np.pi], axis=1)


def depth_tests(
    position: Any, triangle_id: Any, facing: Any, depth: Any, center: Any, frame: Any, delta: Any, near: Any,
    texels: int = 1, points_only: bool = False,
) -> Any:
    """Return V (K, h, w): the share of texels x texels about a pixel's own that do not hide it (PCF; VAL-03).

    Of one texel for lights without extent: a hard shadow; `points_only`: others are not tested.
    """
    local, d = to_map(position, center, frame)
    normal = np.einsum("kac,cij->akij", frame, facing)
    n, k = depth.shape[1], np.arange(len(depth))[:, None, None]
    wide = delta[:, None, None] > 0
    ahead = local[2] > 0  # E-VAL-12
    held = np.isfinite(near)[:, None, None]
    asked = ahead & held & (triangle_id >= 0) & ~(wide & points_only)
    total = np.where(asked, d + local[2], 1)
    s = local[0] / total
    t = local[1] / total
    column = np.floor((s + 1) / 2 * n)
    row = np.floor((t + 1) / 2 * n)
    reach = np.where(wide, texels // 2, 0)
    hidden, count = np.zeros_like(d), np.zeros_like(d)
    for dy in range(-(texels // 2), texels // 2 + 1):
        for dx in range(-(texels // 2), texels // 2 + 1):
            kernel = (-reach <= dy) & (dy <= reach) & (-reach <= dx) & (dx <= reach)
            s = 2 * (column + dx + 0.5) / n - 1
            t = 2 * (row + dy + 0.5) / n - 1
            hemisphere = s * s + t * t <= 1
            own = dy == 0 and dx == 0  # counts always
            tested = kernel & (hemisphere | own)
            x = np.clip(column + dx, 0, n - 1).astype(int)
            y = np.clip(row + dy, 0, n - 1).astype(int)
            z = depth[k, y, x]
            limit = np.minimum(plane_distance(direction(s, t), local, d, normal), d)
            hidden += tested & hides(z, limit)
            count += tested
    share = 1 - hidden / np.maximum(count, 1)
    return np.where(asked, share, 1)


def of_both(ahead: Any, behind: Any) -> Any:
    """Return V (K, h, w) of lights that are seen by a map ahead and one of the hemisphere behind (E-VAL-12)."""
    return np.minimum(ahead, behind)


def plane_distance(w: Any, local: Any, d: Any, normal: Any) -> Any:
    """Return how far along w, m, a pixel's tangent plane lies; d where w does not meet it (E-VAL-14)."""
    height = (normal * local).sum(axis=0)
    slope = (normal * w).sum(axis=0)
    meets = height * slope > 0
    plane = height / np.where(meets, slope, 1)
    return np.where(meets, plane, d)


def hides(z: Any, limit: Any) -> Any:
    """Return whether depths lie before what they may hide."""
    return z < limit * (1 - SLACK)


def pcss_penumbra(
    position: Any, facing: Any, depth: Any, center: Any, frame: Any, delta: Any, near: Any, pending: Any, region: Any,
    alpha: bool = False, squares: bool = False, foreshortened: bool = False, axial: bool = False,
    cone: bool = True, biased: Any = None,
) -> Any:
    """Return shaded (K, h, w), z_avg (K, h, w), m, and the region of the penumbra (Sec. 4.1, 4.2).

    z_avg is the mean distance of the texels of the search region that lie before the pixel's plane, in the cone;
    `axial`: their mean depth along the axis. `biased` (K, h, w), m: a distance to be nearer than, not the plane.
    """
    local, d = to_map(position, center, frame)
    normal = np.einsum("kac,cij->akij", frame, facing)
    size = light_size(delta, local, d, foreshortened)
    nearest = near[:, None, None]
    s, t = texel_centers(depth)
    z, w = depth[:, None, None], direction(s, t)[:, None, None, None]
    place, far = local[..., None, None], d[..., None, None]
    limit = plane_distance(w, place, far, normal[..., None, None]) if biased is None else biased[..., None, None]
    blocks = hides(z, limit) & in_region(region, s, t)
    inside = in_cone(z, w, place, far, size[..., None, None], 2 / len(s) / (1 + s * s + t * t))
    blocks = blocks & (inside | (not cone))
    if axial:
        z, nearest = z * (w * place).sum(axis=0) / far, nearest * math.cos(STEEPEST)
    count = blocks.sum(axis=(3, 4), dtype=d.dtype)
    shaded = pending & (count > 0)
    # Sec. 4.1: z_avg
    z_avg = np.where(blocks, z, 0).sum(axis=(3, 4)) / np.maximum(count, 1)
    z_avg = np.where(shaded, np.minimum(np.maximum(z_avg, nearest), d), d)
    a = penumbra_angle(size, d, z_avg, alpha)
    final = square(local, d, a) if squares else disc(local, d, a)
    return shaded, np.where(shaded, z_avg, 0), np.where(shaded[:, None], final, 0)


def pcss(
    position: Any, facing: Any, depth: Any, center: Any, frame: Any, shaded: Any, region: Any, hard: Any = None,
    biased: Any = None,
) -> Any:
    """Return V (K, h, w): the share of the penumbra's texels that do not hide a pixel; elsewhere 1, or `hard`."""
    local, d = to_map(position, center, frame)
    normal = np.einsum("kac,cij->akij", frame, facing)
    s, t = texel_centers(depth)
    z, w = depth[:, None, None], direction(s, t)[:, None, None, None]
    limit = plane_distance(w, local[..., None, None], d[..., None, None], normal[..., None, None])
    limit = limit if biased is None else biased[..., None, None]
    tested = in_region(region, s, t)
    hidden = (tested & hides(z, limit)).sum(axis=(3, 4), dtype=d.dtype)
    share = 1 - hidden / np.maximum(tested.sum(axis=(3, 4), dtype=d.dtype), 1)
    return np.where(shaded, share, 1 if hard is None else hard)


def in_region(region: Any, s: Any, t: Any) -> Any:
    """Return which texels (K, h, w, n, n) have their centre in a disc; where none has, that which holds its middle."""
    s0, t0, radius = np.moveaxis(region, 1, 0)[..., None, None]
    inside = (s - s0) ** 2 + (t - t0) ** 2 <= radius**2
    n, at = len(s), np.arange(len(s))
    column, row = (np.clip(np.floor((one + 1) / 2 * n), 0, n - 1) for one in (s0, t0))
    own = (at == column) & (at[:, None] == row)
    inside = inside & (s * s + t * t <= 1)  # the hemisphere
    return np.where(inside.any(axis=(3, 4), keepdims=True), inside, own)


def in_cone(z: Any, w: Any, local: Any, d: Any, size: Any, width: Any) -> Any:
    """Return which texels reach into the cone from a pixel to the light; `width`: half a texel's, rad (E-VAL-14).

    A blocker at z w lies `along` the axis from the centre to the pixel and beside it by no more than the cone there.
    """
    z = np.where(np.isfinite(z), z, 0)
    axis = local / d
    along = z * (w * axis).sum(axis=0)
    beside = np.sqrt(((z * w - along * axis) ** 2).sum(axis=0)) - z * math.sqrt(2) * width
    return (along < d) & (beside <= size / 2 * (1 - along / d))
