"""Vertex colours as factors of the diffuse reflectance: linear between the corners of a triangle (docs/scenes)."""

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
