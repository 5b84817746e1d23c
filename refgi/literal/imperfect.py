"""Imperfect shadow maps: a depth map of few points for each pixel light, holes filled (Ritschel et al. 2008, Sec. 3).

Symbols: d from light to point, x, y, z along the frame of the light's map, z along its normal; (s, t) = (x, y) /
(|d| + z) the place on the paraboloid, -1 to 1; r radius of the disc that a point stands for, pi r^2 = A / n, n points
on the area A; c cosine at the point. Maps are (N, R, R), rows along t, columns along s, inf where nothing is.
"""

from typing import Any

import numpy as np

GROWTH = 1.32471795724474602596  # g^3 = g + 1: steps of a sequence of low discrepancy (Roberts 2018)
HORIZON = 1e-3  # least cosine at the light: points of its own face lie at 0, but for rounding
NEAR = 0.1  # by which share a distance may be farther and still be of one surface
GRAZING = 0.05  # least cosine at a receiver that the bias grows with


def scattered_points(vertices: Any, faces: Any, shift: Any, count: int) -> Any:
    """Return points (N, n, 3) all over the surfaces, m, their triangles (N, n), and the radius r (1,), m.

    Point k of a light lies in the k-th of n equal shares of the area; three random numbers a light shift all (N, 3).
    """
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.sqrt((across**2).sum(axis=1)) / 2
    upto = np.cumsum(area)
    k = np.arange(count)
    x0, x1, x2 = shift.T[:, :, None]
    face = np.searchsorted(upto, (k + x0) / count * upto[-1], side="right")
    face = np.minimum(face, len(faces) - 1)
    a = np.sqrt((x1 + k / GROWTH) % 1)
    b = (x2 + k / GROWTH**2) % 1
    A, B, C = 1 - a, a * (1 - b), a * b  # evenly over a triangle
    place = A[..., None] * corners[face, 0] + B[..., None] * corners[face, 1] + C[..., None] * corners[face, 2]
    radius = np.sqrt(area.sum() / (np.pi * count))
    return place, face, np.array([radius])


def map_frames(normal: Any) -> Any:
    """Return the axes (N, 3, 3) of maps along normals (3, N): right, down, forward (Duff et al. 2017)."""
    x, y, z = normal
    e = np.copysign(1, z)
    a = -1 / (e + z)
    right = np.stack([1 + e * x**2 * a, e * x * y * a, -e * x])
    down = np.stack([x * y * a, e + y**2 * a, -y])
    return np.stack([right, down, normal]).transpose(2, 0, 1)


def depth_maps(
    vertices: Any, faces: Any, point: Any, point_face: Any, radius: Any, light_position: Any, frame: Any, side: int,
    splat: float = 1.0,
) -> Any:
    """Return the distance (N, R, R) of the nearest point in each texel, m: boxes as wide as the discs look.

    A box is `splat` discs wide, or holds the texel of its middle alone. Points behind the light's plane and those
    nearer than r are left out.
    """
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    up = (across / np.sqrt((across**2).sum(axis=1, keepdims=True)))[point_face]
    d = point - light_position.T[:, None]
    x, y, z = np.moveaxis(np.einsum("lij,lpj->lpi", frame, d), 2, 0)
    distance = np.sqrt((d**2).sum(axis=2))
    counts = (z > HORIZON * distance) & (distance > radius)
    below = np.where(counts, distance + z, 1)
    s, t = x / below, y / below
    c = np.abs((d * up).sum(axis=2)) / distance
    wide = splat * radius * np.sqrt(c) * (1 + s**2 + t**2) / distance
    half = wide / 2 * side / 2  # texels
    depth = np.full((len(d), side, side), np.inf, point.dtype)
    for k in range(len(d)):
        here = counts[k]
        rows, columns = (covered_texels(side * (one[k, here] + 1) / 2, half[k, here], side) for one in (t, s))
        far = distance[k, here]
        for i in range(side):
            box, own = columns[rows[:, i]], far[rows[:, i], None]
            depth[k, i] = np.where(box, own, np.inf).min(axis=0, initial=np.inf)
    return depth


def covered_texels(middle: Any, half: Any, side: int) -> Any:
    """Return which texels (p, R) of a side have their centre in boxes (p,), in texels; else the one at the middle."""
    texel = np.arange(side)
    covered = np.abs(texel + 0.5 - middle[:, None]) <= half[:, None]
    low, high = np.ceil(middle - half - 0.5), np.floor(middle + half - 0.5)
    own = np.clip(np.floor(middle), 0, side - 1)[:, None] == texel
    return np.where((low > high)[:, None], own, covered)


def filled(depth: Any, levels: int) -> Any:
    """Return maps (N, R, R) whose holes of up to 2^levels texels are filled by pulling and pushing.

    Pull: a coarse texel is the mean of those of its four that are near the nearest. Push: a hole takes the coarse map's
    value there, bilinearly of what is near the nearest.
    """
    if levels == 0:
        return depth
    four = np.stack([depth[:, i::2, j::2] for i in (0, 1) for j in (0, 1)], axis=-1)
    coarse = mean_of_nearest(four, np.ones(4))
    coarse = filled(coarse, levels - 1)
    own = np.arange(depth.shape[1]) // 2
    beside = np.clip(own + np.tile([-1, 1], len(own) // 2), 0, coarse.shape[1] - 1)
    taps = np.stack([coarse[:, i][:, :, j] for i in (own, beside) for j in (own, beside)], axis=-1)
    pushed = mean_of_nearest(taps, np.array([9, 3, 3, 1]))
    return np.where(np.isinf(depth), pushed, depth)


def mean_of_nearest(values: Any, weights: Any) -> Any:
    """Return the weighted mean over the last axis of the distances near the least; inf where there is none."""
    least = values.min(axis=-1, keepdims=True)
    near = np.isfinite(values) & (values <= (1 + NEAR) * least)
    share = np.where(near, weights, 0)
    total = (share * np.where(near, values, 0)).sum(axis=-1)
    return np.where(share.any(axis=-1), total / np.maximum(share.sum(axis=-1), 1), np.inf)


def looked_up(
    position: Any, normal: Any, triangle_id: Any, face_normal: Any, light_position: Any, light_normal: Any, frame: Any,
    depth: Any, radius: Any, bias: float,
) -> Any:
    """Return V (N, h, w): whether n and f look at p, m at x, and the map of p holds nothing nearer than x by the bias.

    The bias is in what the receiver's own surface differs by within a box or a texel: its width times max(1, tan(a)).
    """
    x, n, f = (plane.reshape(3, 1, -1) for plane in (position, normal, face_normal))
    d = x - light_position[:, :, None]
    sends = ((n * d).sum(axis=0) < 0) & ((f * d).sum(axis=0) < 0) & ((light_normal[:, :, None] * d).sum(axis=0) > 0)
    across, along, z = np.einsum("lij,jlp->ilp", frame, d)
    distance, side = np.sqrt((d**2).sum(axis=0)), depth.shape[1]
    below = np.where(z > 0, distance + z, 1)
    s, t = across / below, along / below
    column, row = (np.clip(side * (one + 1) / 2, 0, side - 1).astype(int) for one in (s, t))
    light = np.arange(len(depth))[:, None]
    found = depth[light, row, column]
    texel = 4 * distance / (side * (1 + s**2 + t**2))
    c = np.maximum(GRAZING, -(f * d).sum(axis=0) / distance)
    slope = np.maximum(1, np.sqrt(np.maximum(0, 1 - c**2)) / c)
    slack = bias * np.maximum(radius * np.sqrt(c), texel) * slope
    hidden = found < distance - slack
    seen = sends & ~hidden & (z > 0) & (triangle_id.ravel() >= 0)
    return seen.reshape(-1, *triangle_id.shape)
