"""What a camera or a light sees: its nearest triangles, and their depth, position, normal and albedo (SII Sec. 3.1).

A view has k maps of `rows` x `columns` texels, stacked along rows: the faces of a cube, else one. Each map has an eye
`origin` (k, 3) and a `frame` (k, 3, 3) of rows right, down, forward; on its image plane, at the distance 1, it spans
-half to half (2,), horizontally and vertically. Where rays are `parallel` (an orthographic map: all of them run along
forward, as a directional light's do), `half` is in m. Row 0 is the top row.

Symbols: x, y point of the image plane; o, d start and direction of a texel's ray, d of length 1 along forward;
H, W rows and columns of all maps.
"""

from typing import Any

import numpy as np


def tint(triangle_id: Any, position: Any, vertices: Any, faces: Any, colours: Any) -> Any:
    """Return the vertex colours (3, h, w) at points of triangles; 0 where there is no surface.

    `triangle_id` (h, w), -1 for none. `position` (3, h, w): the points, m. `colours` (m, 3, 3): linear factors of each
    triangle's corners. The share of a corner is the part of the triangle's area that lies across from it.
    """
    colour = np.moveaxis(colours[triangle_id], (2, 3), (0, 1))  # corner, rgb, h, w
    p, q, r = np.moveaxis(vertices[faces[triangle_id]], (2, 3), (0, 1))
    normal = np.cross(q - p, r - p, axis=0)
    parts = [np.cross(b - a, position - a, axis=0) for a, b in ((q, r), (r, p), (p, q))]
    share = np.stack([(part * normal).sum(axis=0) for part in parts]) / (normal * normal).sum(axis=0)
    total = (share[:, None] * colour).sum(axis=0)
    return np.where(triangle_id >= 0, total, 0)


NEAREST = 1e-9  # share of a triangle's size: a hit that is nearer to the eye is rounding


def texels(maps: int, rows: int, columns: int) -> Any:
    """Return row and column of every texel within its own map: (H, W) each."""
    row, column = np.mgrid[: maps * rows, :columns]
    return row % rows, column


def image_points(half: Any, maps: int, rows: int, columns: int) -> Any:
    """Return x and y of every texel's centre: (H, W) each."""
    row, column = texels(maps, rows, columns)
    x = (2 * (column + 0.5) / columns - 1) * half[0]
    y = (2 * (row + 0.5) / rows - 1) * half[1]
    return x, y


def map_axes(origin: Any, frame: Any) -> Any:
    """Return the eye of each map and its directions right, down and forward: (k, 3) each."""
    right, down, forward = frame[:, 0], frame[:, 1], frame[:, 2]
    return origin, right, down, forward


def rays(origin: Any, frame: Any, half: Any, rows: int, columns: int, parallel: bool) -> Any:
    """Return o and d of every texel: (3, H, W) each, world space, m."""
    x, y = image_points(half, len(origin), rows, columns)
    map_of_row = np.arange(len(x)) // rows
    eye, right, down, forward = (axis[map_of_row].T[:, :, None] for axis in map_axes(origin, frame))
    across = x * right + y * down
    if parallel:
        return eye + across, forward + 0 * across
    return eye + 0 * across, forward + across


def visible_triangles(
    vertices: Any, faces: Any, origin: Any, frame: Any, half: Any, rows: int, columns: int, parallel: bool
) -> Any:
    """Return the nearest triangle at every texel's centre, -1 for none: (H, W). Of equally near ones it is the lowest.

    A corner seen from the eye is v; the edge function opposite corner i is e_i = (x, y, 1) . (v_j x v_k). Nearness is
    1 / depth = sum e_i / volume, where rays are parallel -depth = sum -depth_i e_i / volume (docs/rasterizer).
    """
    x, y = image_points(half, 1, rows, columns)
    ray = np.stack([x.reshape(-1), y.reshape(-1), np.ones(x.size)])
    found = []
    for eye, right, down, forward in zip(*map_axes(origin, frame), strict=True):
        axes = np.stack([right, down, forward], axis=1)
        v = ((vertices - eye) @ axes)[faces]  # triangle, corner, (right, down, depth)
        depth, weight = v[..., 2], np.ones(v.shape[:2])
        if parallel:
            v, weight = np.dstack([v[..., :2], weight]), -depth
        edge = np.cross(np.roll(v, -1, axis=1), np.roll(v, -2, axis=1))
        volume = (v[:, 0] * edge[:, 0]).sum(axis=-1)
        edge = edge * np.where(volume > 0, 1, -1)[:, None, None]
        some = (volume != 0)[:, None]  # a triangle without area, or seen edge-on, covers nothing
        e = edge @ ray
        inside = (e > 0) | ((e == 0) & owns_border(edge)[..., None])
        nearness = np.divide((e * weight[..., None]).sum(axis=1), np.abs(volume)[:, None], out=0 * e[:, 0], where=some)
        covers = inside.all(axis=1) & some
        too_near = nearness * NEAREST * np.abs(v).max(axis=(1, 2))[:, None] > 1  # the triangle's plane holds the eye
        covers &= ((nearness > 0) & ~too_near) | parallel
        nearest = np.argmax(np.where(covers, nearness.astype(np.float32), -np.inf), axis=0)
        found.append(np.where(covers.any(axis=0), nearest, -1))
    return np.concatenate(found).reshape(-1, columns)


def owns_border(edge: Any) -> Any:
    """Return whether a centre on an edge is the triangle's: where the first coefficient that is not 0 is positive."""
    a, b, c = np.moveaxis(edge, -1, 0)
    return np.where(a != 0, a, np.where(b != 0, b, c)) > 0


def surface(
    triangle_id: Any, vertices: Any, faces: Any, material_of_face: Any, diffuse: Any, origin: Any, frame: Any,
    half: Any, rows: int, columns: int, parallel: bool, vertex_normals: Any = None, colours: Any = None,
) -> Any:
    """Return depth (H, W), m, and position, m, unit normal and albedo (3, H, W) of what every texel sees.

    Without a surface depth is infinite and all else 0. Depth is along the view's axis, normals are on the side that is
    seen: of the triangle, or interpolated where vertices have their own. `colours` (m, 3, 3) multiply the albedo.
    """
    seen = triangle_id >= 0
    face = np.where(seen, triangle_id, 0)
    corner = np.moveaxis(vertices[faces[face]], (2, 3), (0, 1))  # corner, xyz, row, column
    o, d = rays(origin, frame, half, rows, columns, parallel)
    wound = np.cross(corner[1] - corner[0], corner[2] - corner[0], axis=0)
    flat = unit(wound)
    flat = np.where((flat * d).sum(axis=0) > 0, -flat, flat)
    approach = np.where(seen, (flat * d).sum(axis=0), -1)
    depth = (flat * (corner[0] - o)).sum(axis=0) / approach
    position = o + depth * d
    normal = flat
    if vertex_normals is not None:
        share = barycentric(corner, flat, position)
        normal = interpolated(share, np.moveaxis(vertex_normals[faces[face]], (2, 3), (0, 1)), flat)
    albedo = np.moveaxis(diffuse[material_of_face[face]], -1, 0)
    if colours is not None:
        albedo = albedo * tint(triangle_id, position, vertices, faces, colours)
    return (np.where(seen, depth, np.inf), np.where(seen, position, 0), np.where(seen, normal, 0),
            np.where(seen, albedo, 0))


def barycentric(corner: Any, flat: Any, point: Any) -> Any:
    """Return the share of each corner at points of triangles: (corner, H, W), areas of what lies opposite."""
    area = np.stack([(flat * np.cross(corner[k - 2] - point, corner[k - 1] - point, axis=0)).sum(axis=0)
                     for k in range(3)])
    return area / area.sum(axis=0)


def interpolated(share: Any, normals: Any, flat: Any) -> Any:
    """Return the mean of corners' normals (corner, 3, H, W), of unit length, on the side of the face's one, `flat`."""
    mean = (share[:, None] * normals).sum(axis=0)
    normal = unit(mean)
    return np.where((normal * flat).sum(axis=0) < 0, -normal, normal)


def unit(vector: Any) -> Any:
    """Return vectors (3, ...) of length 1; 0 stays 0."""
    length = np.sqrt((vector**2).sum(axis=0))
    return np.divide(vector, length, out=np.zeros_like(vector), where=length > 0)
