"""Maps of what area lights see, and the depths and basis that their series compares (VAL Sec. 4.1, 4.2, 5.1, 6).

A map is a paraboloid: the texel at (s, t) = (x, y) / (1 + z), -1 to 1 to the right and down, looks along the unit
vector (x, y, z) of right, down and forward. It holds the distance to the nearest blocker, inf where there is none.

Symbols: K area lights; n texels a side, their centres at + 1/2; z distances, m; t depths of the series, 0 to `end`, so
that its period is not reached; M terms, c_k = (2k - 1) pi.
"""

from typing import Any

import numpy as np

LIFT = 4e-6  # of the illuminated box's largest coordinate: a map's centre lies that far off its surface
TOLERANCE = 1e-6  # of the diagonal of what takes part: ends of light so near a plane lie on neither side of it
INSIDE = 1.5  # texels from the rim, within which the centre of a texel lies in the disc
LEAST_RATIO, MOST_RATIO = 1.05, 2.0**20  # of the farthest and the nearest distance on a scale of depths


def map_views(visible: Any, illuminated: Any, center: Any, normal: Any, radius: Any, near_distance: float) -> Any:
    """Return where maps look from (K, 3), within what no surface blocks, and the farthest there can be (K,), m.

    A centre is lifted off its surface; what is nearer than a share of the cluster's radius is ignored, as the centre
    may lie inside of it (Sec. 5.1, E-VAL-12). Boxes: least, greatest; center, normal (3, K).
    """
    largest = np.abs(illuminated).max()
    place = (center + LIFT * largest * normal).T
    ball = near_distance * radius
    low, high = np.minimum(visible[0], illuminated[0]), np.maximum(visible[1], illuminated[1])
    corner = np.maximum(np.abs(low - place), np.abs(high - place))
    return place, ball, np.sqrt((corner**2).sum(axis=1))


def seen_vertices(vertices: Any, faces: Any, triangle_id: Any) -> Any:
    """Return the vertices (n, 3), m, of the triangles that pixels see (h, w), -1 without surface."""
    face = triangle_id[triangle_id >= 0]
    return vertices[np.unique(faces[face])]


def occluders(
    vertices: Any, faces: Any, seen: Any, light_position: Any, visible: Any, illuminated: Any, touching: bool,
) -> Any:
    """Return which triangles (F,) may lie between pixel lights and what is seen: those with both on either side.

    Light ends at lights and within the triangles that are seen. `touching`: planes that all of it lies on count too.
    """
    ends = np.concatenate([seen, light_position.T])
    side = np.maximum(visible[1], illuminated[1]) - np.minimum(visible[0], illuminated[0])
    tolerance = TOLERANCE * np.sqrt((side**2).sum())
    a, b, c = vertices[faces].swapaxes(0, 1)
    normal = np.cross(b - a, c - a)
    height = ends @ normal.T - (a * normal).sum(axis=1)
    least = (-tolerance if touching else tolerance) * np.linalg.norm(normal, axis=1)
    return (height > least).any(axis=0) & (height < -least).any(axis=0)


def texel_centers(depth: Any) -> Any:
    """Return s and t (n, n) of a map's texels."""
    at = ((np.arange(depth.shape[-1]) + 0.5) * 2 / depth.shape[-1] - 1).astype(depth.dtype)
    return np.meshgrid(at, at)


def direction(s: Any, t: Any) -> Any:
    """Return the unit vector (3, ...) of places of a map."""
    q = s * s + t * t
    return np.stack([2 * s, 2 * t, 1 - q]) / (1 + q)


def depth_maps(
    vertices: Any, faces: Any, blocks: Any, center: Any, frame: Any, ball: Any, members: Any, texels: int,
) -> Any:
    """Return the distance (K, n, n), m, to the nearest blocker along each texel's direction (Sec. 4.2, E-VAL-06).

    A ray meets a triangle where it passes its three edges on the same side. What it meets within the ball is ignored;
    a light without members has an empty map. Frames (K, 3, 3): rows right, down, forward.
    """
    distance = np.full((len(center), texels, texels), np.inf, center.dtype)
    s, t = texel_centers(distance)
    inside = s * s + t * t <= 1  # the hemisphere before the light
    toward = direction(s, t)[:, inside]
    corners = vertices[faces[blocks]]
    for k in np.flatnonzero(members):
        rays = frame[k].T @ toward
        a, b, c = (corners - center[k]).swapaxes(0, 1)
        normal = np.cross(b - a, c - a)
        height = (a * normal).sum(axis=1, keepdims=True)
        slope = normal @ rays
        z = height / np.where(slope == 0, np.inf, slope)
        sides = np.stack([np.cross(a, b), np.cross(b, c), np.cross(c, a)]) @ rays
        meets = (sides >= 0).all(axis=0) | (sides <= 0).all(axis=0)
        hit = meets & (z > 0) & (z >= ball[k])
        nearest = np.where(hit, z, np.inf).min(axis=0, initial=np.inf)
        distance[k][inside] = nearest
    return distance


def frames_behind(frame: Any) -> Any:
    """Return frames (K, 3, 3) of maps of the hemispheres behind: right and forward are turned round (E-VAL-12)."""
    return frame * np.array([[-1], [1], [-1]], frame.dtype)


def map_ranges(depth: Any) -> Any:
    """Return the nearest and the farthest distance on each map (K,), m: inf and 0 on empty ones (E-VAL-05)."""
    near = depth.min(axis=(1, 2))
    far = np.where(np.isfinite(depth), depth, 0).max(axis=(1, 2))
    return near, far


def depth_scale(near: Any, far: Any, scene_far: Any, end: Any, kind: str) -> Any:
    """Return the distance of depth 0 (K,), m, and depths per octave or metre (K,), 0 on empty maps (E-VAL-05).

    "log_map": octaves from the nearest to the farthest of what each map holds; "map": metres between them; "scene":
    metres up to the farthest place there is. Two biases are left behind the farthest blocker, that it hides what is
    there; or half the range where so few terms leave less.
    """
    held = np.isfinite(near)
    near, far = np.where(held, near, 1), np.where(held, far, 1)
    near = np.maximum(near, far / MOST_RATIO)
    ratio = np.maximum(far / near, LEAST_RATIO)
    top = np.maximum(2 * end - 1, end / 2)
    span = np.log2(ratio) if kind == "log_map" else near * (ratio - 1)
    origin, slope = (0 * near, end / scene_far) if kind == "scene" else (near, top / span)
    return np.where(held, origin, 0), np.where(held, slope, 0)


def series_depth(d: Any, origin: Any, slope: Any, end: Any, logarithmic: bool) -> Any:
    """Return t of distances (K, h, w), m (E-VAL-05)."""
    start, steep = origin[:, None, None], slope[:, None, None]
    start = np.where(steep > 0, start, 1)  # an empty map has no scale
    beyond = np.log2(d / start) if logarithmic else d - start
    t = np.maximum(beyond * steep, 0)
    return np.minimum(t, end)


def map_depths(depth: Any, origin: Any, slope: Any, end: Any, logarithmic: bool, mirrored: bool) -> Any:
    """Return t of each texel (K, n, n): the far end where nothing is, 0 on empty maps (E-VAL-05).

    `mirrored`: texels beyond the disc hold what lies in the direction mirrored at the light's plane, so that means over
    texels see nothing but the hemisphere.
    """
    held = slope[:, None, None] > 0
    z = np.where(held, depth, 1)
    t = series_depth(z, origin, slope, end, logarithmic)
    if mirrored:
        row, column = mirrored_texels(depth)
        t = t[:, row, column]
    return np.where(held, t, 0)


def mirrored_texels(depth: Any) -> Any:
    """Return row and column (n, n) of the texel whose depth each takes: beyond the disc that at (s, t) / r^2."""
    n = depth.shape[1]
    row, column = np.indices((n, n))
    s, t = texel_centers(depth)
    beyond = s * s + t * t > 1
    s, t = s[beyond], t[beyond]
    r = np.sqrt(s * s + t * t)
    factor = np.minimum(1 / r, 1 - INSIDE / n) / r
    column[beyond] = (s * factor + 1) / 2 * n
    row[beyond] = (t * factor + 1) / 2 * n
    return row, column


def basis(t: Any, terms: int, in_bytes: bool) -> Any:
    """Return S_k = sin(c_k t), C_k = cos(c_k t), t S_k, t C_k of all k, and t: (K, 4 M + 1, n, n) (Sec. 4.1).

    Means of depths need t itself (E-VAL-02). 0 on empty maps. `in_bytes`: as the published textures hold it (Sec. 6).
    """
    held = t.any(axis=(1, 2))[:, None, None, None]
    z = t[:, None]
    k = np.arange(1, terms + 1, dtype=t.dtype)[:, None, None]
    c = (2 * k - 1) * np.pi
    s, co = np.sin(c * z), np.cos(c * z)
    made = np.concatenate([s, co, z * s, z * co, z], axis=1)
    made = np.where(held, made, 0)
    return rounded_level(made) if in_bytes else made


def rounded_level(level: Any) -> Any:
    """Return channels as published textures hold them: 8 bits for S and C, halves up, half floats for the rest."""
    m = level.shape[1] // 4
    eight = np.floor((level[:, : 2 * m] + 1) * 127.5 + 0.5001) / 127.5 - 1
    half = level[:, 2 * m :].astype(np.float16).astype(level.dtype)
    return np.where(level.any(axis=(1, 2, 3), keepdims=True), np.concatenate([eight, half], axis=1), 0)
