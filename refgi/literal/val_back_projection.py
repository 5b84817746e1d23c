"""V of an area light's rectangle: texels of its map, projected back onto it (Guennebaud, Barthe and Paulin 2006).

A texel nearer than the pixel's plane is a patch at its depth. From the pixel it hides a quadrilateral of the light's
plane; V is the share of the rectangle that none hides. Lengths in m, along the rectangle's sides u, v and its normal,
from the map's centre.
"""

from typing import Any

import numpy as np

from refgi.literal.val_maps import direction
from refgi.literal.val_visibility import hides, plane_distance

CELLS = 32  # of a grid along each side of the rectangle
LEAST_SIDE = 1e-9  # of a rectangle, as a share of the farthest place: a point has none


def back_projection(
    position: Any, triangle_id: Any, facing: Any, depth: Any, map_center: Any, frame: Any, axes: Any, side: Any,
    offset: Any, center: Any, normal: Any, scene_far: Any, shading: Any = None,
) -> Any:
    """Return V (K, h, w) of rectangles with axes (K, 2, 3), side and offset (2, K) from their centers (3, K).

    Pixels behind a rectangle see it whole, and so do those with no part of it above their plane. What lies above that
    of normals `shading` (3, h, w), those of cosines, and below the face counts as hidden.
    """
    share = np.ones((len(depth), *triangle_id.shape), position.dtype)
    for k in range(len(depth)):
        turn = np.stack([*axes[k], normal[:, k]])
        x = np.einsum("ac,cij->aij", turn, position - map_center[k][:, None, None])
        up = np.einsum("ac,cij->aij", turn, facing)
        horizon = up if shading is None else np.einsum("ac,cij->aij", turn, shading)
        extent = np.maximum(side[:, k], LEAST_SIDE * scene_far[k])
        low = offset[:, k] - extent / 2
        lift = normal[:, k] @ (center[:, k] - map_center[k])
        toward, corners, z = patches(depth[k], frame[k], turn)
        for i, j in np.argwhere((triangle_id >= 0) & (x[2] > 0)):
            u, v = cells_below(low, extent, x[:, i, j], horizon[:, i, j], lift)
            below = heights(u, v, x[:, i, j], up[:, i, j], lift) <= 0
            limit = plane_distance(toward, x[:, i, j, None], np.inf, up[:, i, j, None])
            quads = projected(corners[:, :, hides(z, limit)], x[:, i, j], lift)
            share[k, i, j] = 1 - (covered(quads, u, v) | below).mean() if u.size else 1
    return share


def patches(depth: Any, frame: Any, turn: Any) -> Any:
    """Return directions (3, T), corners (3, 4, T) and depths (T,) of what a map (n, n) holds."""
    row, column = np.nonzero(np.isfinite(depth))
    z, n = depth[row, column], len(depth)
    to_light = turn @ frame.T

    def toward(down: float, right: float) -> Any:
        s = 2 * (column + right) / n - 1
        t = 2 * (row + down) / n - 1
        return to_light @ direction(s, t).astype(depth.dtype)

    corners = np.stack([z * toward(i, j) for i, j in ((0, 0), (0, 1), (1, 1), (1, 0))], axis=1)
    return toward(0.5, 0.5), corners, z


def cells_below(low: Any, extent: Any, x: Any, up: Any, lift: Any) -> Any:
    """Return u, v (cells,) of the cells' centres that lie above a pixel's plane."""
    step = (np.arange(CELLS) + 0.5) / CELLS
    u, v = np.meshgrid(*(low[a] + step * extent[a] for a in (0, 1)))
    above = heights(u, v, x, up, lift) > 0
    return u[above], v[above]


def heights(u: Any, v: Any, x: Any, up: Any, lift: Any) -> Any:
    """Return how far places u, v of the light's plane lie above a pixel's."""
    return (u - x[0]) * up[0] + (v - x[1]) * up[1] + (lift - x[2]) * up[2]


def projected(corners: Any, x: Any, lift: Any) -> Any:
    """Return where patches (3, 4, T) before a pixel lie on the light's plane, seen from it: (2, 4, T)."""
    before = (corners[2] < x[2]).all(axis=0)
    corners = corners[:, :, before]
    way = (x[2] - lift) / (x[2] - corners[2])
    return x[:2, None, None] + way * (corners[:2] - x[:2, None, None])


def covered(quads: Any, u: Any, v: Any) -> Any:
    """Return which places (cells,) lie in any of the convex quadrilaterals (2, 4, T)."""
    least, most = np.array([[u.min()], [v.min()]]), np.array([[u.max()], [v.max()]])
    meets = (quads.max(axis=1) >= least) & (quads.min(axis=1) <= most)
    quads = quads[:, :, meets.all(axis=0)]
    (u0, v0), (u1, v1) = quads, np.roll(quads, 1, axis=1)
    side = (u1 - u0)[..., None] * (v - v0[..., None]) - (v1 - v0)[..., None] * (u - u0[..., None])
    return ((side > 0).all(axis=0) | (side < 0).all(axis=0)).any(axis=0)
