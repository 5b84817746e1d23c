"""Slow twin of back projection: which points of a light's rectangle do the patches of its map hide from a receiver.

A texel's patch has its four corners at the texel's depth in the directions of the texel's corners. It hides the points
of the rectangle that lie within the quadrilateral its corners are projected to from the receiver, through them, onto
the rectangle's plane. Texels that are not nearer than the receiver's own tangent plane hide nothing.
"""

import numpy as np

CELLS = 32


def directions(frame, rows, columns, size):
    """Return unit vectors (k, 3) of places on a stereographic map, (x, y) / (1 + z) = (s, t) in its frame."""
    s, t = 2 * columns / size - 1, 2 * rows / size - 1
    square = s * s + t * t
    return np.stack([2 * s, 2 * t, 1 - square], axis=-1) / (1 + square)[..., None] @ frame


def patches(depth, frame):
    """Return directions through centres (k, 3), corners (k, 4, 3) in turn, from the map's centre, and depths (k,)."""
    rows, columns = np.nonzero(np.isfinite(depth))
    far = depth[rows, columns].astype(float)
    corners = [directions(frame, rows + i, columns + j, len(depth)) for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))]
    return (directions(frame, rows + 0.5, columns + 0.5, len(depth)), np.stack(corners, axis=1) * far[:, None, None],
            far)


def visible(depth, frame, center, middle, sides, normal, x, facing, slack=0.0):
    """Return V of a receiver: the share of 32 x 32 points of the rectangle, above the receiver's plane, it sees.

    `middle`: of the rectangle; `sides` (2, 3): its sides, m; `slack`: share by which a texel must be nearer.
    """
    place = (np.arange(CELLS) + 0.5) / CELLS - 0.5
    v, u = np.meshgrid(place, place, indexing="ij")
    on_light = middle + u[..., None] * sides[0] + v[..., None] * sides[1]
    counts = (on_light - x) @ facing > 0
    toward, corners, far = patches(depth, frame)
    with np.errstate(divide="ignore"):
        plane = (x - center) @ facing / (toward @ facing)
    nearer = far < np.where(plane > 0, plane, np.inf) * (1 - slack)
    corners = corners[nearer] + center
    fall = (x - corners) @ normal
    corners, fall = corners[(fall > 0).all(axis=1)], fall[(fall > 0).all(axis=1)]
    shadow = x + ((x - middle) @ normal / fall)[..., None] * (corners - x)
    hidden = np.zeros(counts.shape, bool)
    for quad in shadow:
        edge = np.roll(quad, -1, axis=0) - quad
        side = np.cross(edge, on_light[:, :, None] - quad) @ normal
        hidden |= (side > 0).all(axis=-1) | (side < 0).all(axis=-1)
    return (counts & ~hidden).sum() / counts.sum() if counts.any() else 1.0
