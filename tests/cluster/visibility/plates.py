"""Area lights at the origin that face +z, maps of plates and of a plane before them, and receivers on the plane."""

import numpy as np

from refgi.cluster.maps import ShadowMaps
from refgi.cluster.rectangle import AreaLights
from refgi.cluster.visibility.search_region import (
    CONSTANTS,
    SCRATCH_ROWS,
)


def directions(n):
    """Unit vectors of all texels, (3, n, n), and which lie in the hemisphere."""
    c = (np.arange(n) + 0.5) * 2 / n - 1
    s, t = np.meshgrid(c, c)
    q = s * s + t * t
    return np.stack([2 * s, 2 * t, 1 - q]) / (1 + q), q <= 1


def map_of_plates(n, plates, plane=None, normal=(0, 0, 1), dtype=np.float64):
    """Radial depths of plates (x0, x1, y0, y1, z) before the plane normal . p = plane."""
    w, within = directions(n)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.full((n, n), np.inf)
        if plane is not None:
            r = plane / np.tensordot(normal, w, 1)
            depth = np.where(r > 0, r, np.inf)
        for x0, x1, y0, y1, z in plates:
            r = z / w[2]
            x, y = w[0] * r, w[1] * r
            depth = np.where((x >= x0) & (x <= x1) & (y >= y0) & (y <= y1), np.minimum(depth, r), depth)
    return np.where(within, depth, np.inf).astype(dtype)


def lit_by(depth, delta, far):
    """One square area light and its map, in a scene that ends `far` from it."""
    areas = AreaLights(np.zeros((3, 1)), np.array([[0.0], [0.0], [1.0]]), np.eye(3)[None], np.full((2, 1), delta),
                       np.eye(3)[None, :2], np.zeros((2, 1)), np.array([delta]), np.array([delta * 0.7]), np.array([4]),
                       np.zeros(4, np.int32))
    maps = ShadowMaps(depth[None], np.zeros(1, np.int32), np.zeros((1, 3)), np.eye(3)[None],
                      np.array([float(depth.min())]), np.array([float(np.max(depth, where=depth < np.inf, initial=0))]),
                      np.array([far]))
    return areas, maps


def on_plane(z, half, count):
    """Grid of count x count receivers at a height z, up to x, y = half, and their normals towards the light."""
    g = np.linspace(-half, half, count)
    x, y = (a.ravel() for a in np.meshgrid(g, g))
    return np.stack([x, y, np.full_like(x, z)]), np.tile([[0.0], [0.0], [-1.0]], (1, len(x)))


def square_share(points, delta, plates, count):
    """Share of the square light that each point sees past plates, by count x count points of it."""
    u = ((np.arange(count) + 0.5) / count - 0.5) * delta
    lx, ly = (a.ravel()[:, None] for a in np.meshgrid(u, u))
    hidden = np.zeros((count * count, points.shape[1]), np.bool_)
    for x0, x1, y0, y1, z in plates:
        f = z / points[2]
        x, y = lx + (points[0] - lx) * f, ly + (points[1] - ly) * f
        hidden |= (x >= x0) & (x <= x1) & (y >= y0) & (y <= y1) & (points[2] > z)
    return 1 - hidden.mean(axis=0)


def scratch_arrays(size, terms, dtype=np.float64):
    """What a tile needs: constants, scratch, means, pending, visible."""
    return (np.zeros(CONSTANTS, dtype), np.zeros((SCRATCH_ROWS, size), dtype), np.zeros((4 * terms + 1, size), dtype),
            np.ones(size, np.bool_), np.ones(size, dtype))


def are_shares(values, dtype):
    """Whether values are constants from 0 to 1 of a type."""
    return values.dtype == dtype and bool(((values >= 0) & (values <= 1)).all())
