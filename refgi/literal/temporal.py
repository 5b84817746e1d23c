"""Temporal coherence: motion, look-up in the frame before, entering points, clamp, blend (HSS Sec. 3.3, 4).

Symbols: I_i light of frame i as computed, F_i as filtered, (3, h, w) W/m^2; W reprojection; a share of the frame
before; n frames in which a pixel's surface was found before. A camera is `origin` (1, 3), m, `frame` (1, 3, 3): right,
down, ahead, and `half` (2,): tangents of half its angles of view. Pixels show a surface where triangle_id >= 0.
"""

from typing import Any

import numpy as np

SNAP = 2.0**-8  # pixels: nearer to a centre its texel counts alone


def motion(
    position: Any, normal: Any, triangle_id: Any, faces: Any, vertices: Any, before: Any, origin: Any, frame: Any,
    half: Any, vertex_normals: Any = None, normals_before: Any = None,
) -> tuple[Any, Any, Any]:
    """Return where points (3, h, w), m, were a frame earlier, their normals then, and their speed (h, w), pixels.

    A point is a mean of its triangle's corners, and was the same mean of the corners as they were (HSS Sec. 4).
    """
    corners = faces[np.maximum(triangle_id, 0)]
    now, then = (np.moveaxis(one[corners], (2, 3), (0, 1)) for one in (vertices, before))  # corner, xyz, row, column
    weights = barycentric(now, position)
    step = (weights[:, None] * (then - now)).sum(axis=0)
    up, up_before = face_normal(now), face_normal(then)
    still = (triangle_id < 0) | (now == then).all(axis=(0, 1))
    if vertex_normals is not None:
        smooth = [np.moveaxis(each[corners], (2, 3), (0, 1)) for each in (vertex_normals, normals_before)]
        up, up_before = ((weights[:, None] * each).sum(axis=0) for each in smooth)
        still = (triangle_id < 0) | ((now == then).all(axis=(0, 1)) & (smooth[0] == smooth[1]).all(axis=(0, 1)))
    back = position + step
    side = np.where((up * normal).sum(axis=0) < 0, -1, 1)  # the side that is seen in this frame
    turned = side * up_before / np.maximum(np.sqrt((up_before**2).sum(axis=0)), 1e-300)
    speed = pixels_between(position, step, origin, frame, half, triangle_id.shape)
    return np.where(still, position, back), np.where(still, normal, turned), np.where(still, 0, speed)


def barycentric(corners: Any, point: Any) -> Any:
    """Return the weights (3, ...) of the corners (3, xyz, ...) of triangles at points (xyz, ...) of their planes."""
    b, c, p = corners[1] - corners[0], corners[2] - corners[0], point - corners[0]
    bb, bc, cc, pb, pc = ((one * other).sum(axis=0) for one, other in ((b, b), (b, c), (c, c), (p, b), (p, c)))
    area = bb * cc - bc**2
    v = np.divide(cc * pb - bc * pc, area, out=np.zeros_like(area), where=area > 0)
    w = np.divide(bb * pc - bc * pb, area, out=np.zeros_like(area), where=area > 0)
    return np.stack([1 - v - w, v, w])


def face_normal(corners: Any) -> Any:
    """Return the normals (xyz, ...), not of unit length, of triangles of corners (3, xyz, ...)."""
    return np.cross(corners[1] - corners[0], corners[2] - corners[0], axis=0)


def pixels_between(position: Any, step: Any, origin: Any, frame: Any, half: Any, size: tuple[int, int]) -> Any:
    """Return how many pixels a point and the point moved by `step` lie apart; inf where one lies behind the camera."""
    x, y, z = np.tensordot(frame[0], position - origin[0][:, None, None], 1)
    dx, dy, dz = np.tensordot(frame[0], step, 1)
    ahead = (z > 0) & (z + dz > 0)
    z, behind = np.where(ahead, z, 1), np.where(ahead, z + dz, 1)
    across = (dx - x / z * dz) / behind * size[1] / (2 * half[0])
    down = (dy - y / z * dz) / behind * size[0] / (2 * half[1])
    return np.where(ahead, np.hypot(across, down), np.inf)


def place_in(position: Any, origin: Any, frame: Any, half: Any, size: tuple[int, int]) -> Any:
    """Return row and column, whole numbers at centres, depth, m, and whether points lie ahead and in a picture."""
    x, y, z = np.tensordot(frame[0], position - origin[0][:, None, None], 1)
    ahead = z > 0
    z = np.where(ahead, z, 1)
    row = (y / z / half[1] + 1) * size[0] / 2 - 0.5  # E-HSS-10: centres at + 1/2
    column = (x / z / half[0] + 1) * size[1] / 2 - 0.5
    inside = (row >= -0.5) & (row <= size[0] - 0.5) & (column >= -0.5) & (column <= size[1] - 0.5)
    return row, column, z, ahead, ahead & inside


def reprojection(
    position: Any, normal: Any, triangle_id: Any, origin: Any, frame: Any, half: Any, depth: Any, normal_before: Any,
    irradiance: Any, depth_tolerance: float, normal_cosine: float, fetch: str, frames: Any = None,
) -> Any:
    """Return W(F_{i-1}), the share of the texels around that show the same surface, and n where frames are counted.

    `position`, `normal`: where points were; the camera, depth, normals and light are those of the frame before.
    """
    values = irradiance if frames is None else np.concatenate([irradiance, frames[None]])
    mean, weight = reproject(values, position, normal, triangle_id >= 0, origin, frame, half, depth, normal_before,
                             depth_tolerance, normal_cosine, fetch)
    light = mean[:3]
    return (light, weight) if frames is None else (light, weight, mean[3])


def reproject(
    values: Any, position: Any, normal: Any, covered: Any, origin: Any, frame: Any, half: Any, depth: Any,
    normal_before: Any, depth_tolerance: float, normal_cosine: float, fetch: str,
) -> tuple[Any, Any]:
    """Return the mean of the values (n, h, w) of texels around points that show their surface, and these' weight.

    E-HSS-11: a texel shows it if its depth is the point's, or that of the point's plane there, and normals agree.
    """
    (h, w), away = depth.shape, position - origin[0][:, None, None]
    row, column, z, _, shown = place_in(position, origin, frame, half, (h, w))
    if fetch == "nearest":
        row, column = np.rint(row), np.rint(column)
    row, column = (np.where(np.abs(c - np.rint(c)) <= SNAP, np.rint(c), c) for c in (row, column))
    right, down, ahead = frame[0][:, :, None, None]
    margin, plane = depth_tolerance * z, (normal * away).sum(axis=0)
    total, weight = np.zeros((len(values), *z.shape)), np.zeros(z.shape)
    for below, beside in ((0, 0), (0, 1), (1, 0), (1, 1)):
        i, j = np.floor(row).astype(int) + below, np.floor(column).astype(int) + beside
        share = (1 - np.abs(row - i)) * (1 - np.abs(column - j))
        there = covered & shown & (i >= 0) & (i < h) & (j >= 0) & (j < w)
        i, j = np.clip(i, 0, h - 1), np.clip(j, 0, w - 1)
        there, texel = there & np.isfinite(depth[i, j]), np.where(np.isfinite(depth[i, j]), depth[i, j], 0)
        ray = ahead + half[0] * ((2 * j + 1) / w - 1) * right + half[1] * ((2 * i + 1) / h - 1) * down
        slant = (normal * ray).sum(axis=0)
        at_depth = np.abs(texel - z) <= margin
        on_plane = (slant < 0) & (np.abs(texel * slant - plane) <= -margin * slant)
        alike = (normal_before[:, i, j] * normal).sum(axis=0) >= normal_cosine
        share = share * (there & (at_depth | on_plane) & alike)
        total, weight = total + share * values[:, i, j], weight + share
    return total / np.where(weight > 0, weight, 1), weight


def entering(
    light: Any, weight: Any, position: Any, triangle_id: Any, origin: Any, frame: Any, half: Any, depth: Any,
    irradiance: Any, speed: float,
) -> tuple[Any, Any]:
    """Return W(F_{i-1}) where points outside the earlier picture take the light of its edge, and their share of a.

    The share falls to 1 / e at `speed`, pixels a frame; it is 0 of all other points.
    """
    (h, w) = depth.shape
    y, x, _, ahead, shown = place_in(position, origin, frame, half, (h, w))
    i, j = np.rint(np.clip(y, 0, h - 1)).astype(int), np.rint(np.clip(x, 0, w - 1)).astype(int)
    entered = (triangle_id >= 0) & ahead & ~shown & (weight == 0) & np.isfinite(depth[i, j])
    row, column = np.indices(weight.shape)
    moved = np.hypot(y - row, x - column)
    share = np.exp(-moved / speed)
    return np.where(entered, irradiance[:, i, j], light), np.where(entered, share, 0)


def clamp(earlier: Any, new: Any, triangle_id: Any, deviations: float, radius: int) -> Any:
    """Clamp earlier light to some standard deviations about the mean of I_i in the square around (Salvi 2016)."""
    covered = triangle_id >= 0
    around, known = square_around(new, radius), square_around(covered, radius)
    count = np.maximum(known.sum(axis=-1), 1)
    mean = (around * known).sum(axis=-1) / count
    variance = ((around - mean[..., None]) ** 2 * known).sum(axis=-1) / count
    spread = deviations * np.sqrt(variance)
    return np.where(covered, np.clip(earlier, mean - spread, mean + spread), earlier)


def square_around(plane: Any, radius: int) -> Any:
    """Return the (2 radius + 1)^2 pixels around each along the last axis, 0 beyond the rim."""
    side = 2 * radius + 1
    padded = np.pad(plane, [(0, 0)] * (plane.ndim - 2) + [(radius, radius)] * 2)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (side, side), (-2, -1))
    return windows.reshape(*plane.shape, side * side)


def blend(
    new: Any, earlier: Any, weight: Any, a: float, falloff: float, frames: Any = None, entering_share: Any = None,
    speed: Any = None,
) -> Any:
    """Return F_i, the share of each pixel, and n + 1 where frames are counted (HSS Sec. 3.3).

    A point that was not found has a = 0; a falls to 1 / e at the speed `falloff`, pixels a frame.
    """
    found = weight > 0
    share = np.where(found, a, 0)
    n = np.where(found, 0 if frames is None else frames, 0)
    if frames is not None:
        share = np.minimum(share, n / (n + 1))
    if entering_share is not None:
        share = np.where(found, share, a * entering_share)
    if speed is not None:
        share = share * np.exp(-speed / falloff)
    # F_i = a W(F_{i-1}) + (1 - a) I_i, E-HSS-11: recursive
    light = share * earlier + (1 - share) * new
    return (light, share) if frames is None else (light, share, n + 1)


def recursion(lights: Any, a: float) -> Any:
    """Return F of a point that is seen in all frames: F_0 = I_0, F_i = a F_{i-1} + (1 - a) I_i."""
    light = lights[0]
    for new in lights[1:]:
        light = a * light + (1 - a) * new
    return light
