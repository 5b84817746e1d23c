"""Slow literal twin of rays: every ray against every triangle by Cramer's rule, in float64."""

import math

import numpy as np

LIFT = 1e-6  # m: ends of segments are lifted off their surfaces by that


def corners_of(geometry):
    """Return the corners of triangles, (T, 3, 3)."""
    return np.asarray(geometry.vertices, float)[geometry.faces]


def crossings(corners, starts, directions):
    """Return how many `directions` (R, 3) from `starts` (R, 3) each triangle (T, 3, 3) lies, (R, T); inf: missed."""
    starts, directions = np.broadcast_arrays(starts, directions)
    far = np.full((len(directions), len(corners)), math.inf)
    for k, (a, b, c) in enumerate(corners):
        e1, e2, s = b - a, c - a, starts - a
        p, q = np.cross(directions, e2), np.cross(s, e1)
        with np.errstate(all="ignore"):  # rays along a plane miss it
            inverse = 1 / (p @ e1)
            u, v, t = (s * p).sum(1) * inverse, (q * directions).sum(1) * inverse, (q @ e2) * inverse
            far[:, k] = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, math.inf)
    return far


def nearest(corners, starts, directions):
    """Return triangles, -1 for none, and distances of the nearest hits of rays, (R,) each."""
    far = crossings(corners, starts, directions)
    return np.where(np.isfinite(far).any(axis=1), far.argmin(axis=1), -1), far.min(axis=1)


def free(corners, starts, ends, most=1.0):
    """Tell between which places, off their surfaces, nothing lies within the share `most` of the way."""
    t = crossings(corners, starts, ends - starts)
    return ~(t < np.minimum(1, np.reshape(most, (-1, 1)))).any(axis=1)


def face_normals(geometry, triangle, toward):
    """Return unit normals (n, 3) of triangles on the side of vectors `toward` (n, 3)."""
    a, b, c = np.moveaxis(corners_of(geometry)[triangle], 1, 0)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return normal * np.where((normal * toward).sum(1) < 0, -1.0, 1.0)[:, None]
