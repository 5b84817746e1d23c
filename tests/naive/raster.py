"""Slow literal twin of the rasterizer: one ray per texel, every triangle tried; and what a ray finds there."""

from typing import Any, NamedTuple

import numpy as np

from refgi.literal.light_flux import spot_share


def look(forward, up):
    """Rows right, down, forward of a view."""
    forward = np.asarray(forward, float) / np.linalg.norm(forward)
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    return np.array([right, -np.cross(right, forward), forward])


def perspective_ray(origin, frame, half, height, width, row, column):
    """A direction that reaches axial depth 1."""
    x = half[0] * (2 * (column + 0.5) / width - 1)
    y = half[1] * (2 * (row + 0.5) / height - 1)
    return np.asarray(origin, float), x * frame[0] + y * frame[1] + frame[2]


def orthographic_ray(origin, frame, half, height, width, row, column):
    x = half[0] * (2 * (column + 0.5) / width - 1)
    y = half[1] * (2 * (row + 0.5) / height - 1)
    return origin + x * frame[0] + y * frame[1], frame[2]


def paraboloid_ray(origin, frame, half, height, width, row, column):
    """(s, t) = (x, y)/(1 + z) of a unit vector, so x = 2s/(1 + s^2 + t^2); None outside the hemisphere."""
    s = half[0] * (2 * (column + 0.5) / width - 1)
    t = half[1] * (2 * (row + 0.5) / height - 1)
    square = s * s + t * t
    if square > 1:
        return None
    local = np.array([2 * s, 2 * t, 1 - square]) / (1 + square)
    return np.asarray(origin, float), local @ frame


def _dot(a, b):
    """Dot products of rows, whose rounding does not depend on how many there are, as that of matrix products does."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


def nearest(origin, direction, vertices, faces):
    """Moller-Trumbore over all triangles.

    Returns id (-1: none), t, barycentric coordinates, and the margin: how far, in barycentric coordinates, the
    closest decision was (of the inside tests of every triangle that is not clearly farther, and of the depth order).
    """
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    e1, e2 = b - a, c - a
    p = np.cross(direction, e2)
    det = _dot(e1, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = origin - a
        u = _dot(s, p) / det
        q = np.cross(s, e1)
        v = _dot(q, np.asarray(direction)[None]) / det
        t = _dot(e2, q) / det
        smallest = np.minimum(np.minimum(u, v), 1 - u - v)
    hit = (det != 0) & (smallest >= 0) & (t > 0)
    ts = np.where(hit, t, np.inf)
    winner = int(np.argmin(ts)) if hit.any() else -1
    first = ts[winner] if winner >= 0 else np.inf
    doubtful = (det != 0) & (t > 0) & (t <= first * (1 + 1e-6))
    margin = np.abs(smallest[doubtful]).min(initial=np.inf)
    others = np.delete(ts, winner) if winner >= 0 else ts
    if winner >= 0 and len(others):
        margin = min(margin, abs(others.min() / first - 1))
    weights = (1 - u[winner] - v[winner], u[winner], v[winner]) if winner >= 0 else (0, 0, 0)
    return winner, float(first), weights, float(margin)


def attributes(direction, hit, vertices, faces, normals=None):
    """Position, normal on the seen side, distance of one hit of `nearest`."""
    winner, t, weights, _ = hit
    corners = vertices[faces[winner]]
    position = sum(w * corner for w, corner in zip(weights, corners, strict=True))
    face_normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    face_normal /= np.linalg.norm(face_normal)
    if face_normal @ direction > 0:
        face_normal = -face_normal
    normal = face_normal
    if normals is not None:
        normal = sum(w * n for w, n in zip(weights, normals[faces[winner]], strict=True))
        normal /= np.linalg.norm(normal)
        if normal @ face_normal < 0:
            normal = -normal
    return position, normal, t * np.linalg.norm(direction)


def perspective_density(x, y):
    return (1 + x * x + y * y) ** -1.5


def paraboloid_density(u, v):
    return 4 / (1 + u * u + v * v) ** 2


def spot_texel(cosine, density, x0, x1, y0, y1, inner, outer, n=200):
    """Midpoint sum of the falloff over a texel, n x n samples."""
    middle = (np.arange(n) + 0.5) / n
    x, y = x0 + (x1 - x0) * middle[:, None], y0 + (y1 - y0) * middle
    return (density(x, y) * spot_share(cosine(x, y), inner, outer)).mean() * (x1 - x0) * (y1 - y0)


def perspective_cosine(x, y):
    return (1 + x * x + y * y) ** -0.5


def paraboloid_cosine(u, v):
    return (1 - u * u - v * v) / (1 + u * u + v * v)


class Hit(NamedTuple):
    """The nearest surface along a ray."""

    face: int
    position: Any  # (3,) m
    normal: Any  # (3,) unit, against the ray; interpolated where the mesh has vertex normals
    outward: Any  # (3,) the same on the side of the triangle's vertex order
    material: Any


def unit(vector):
    return np.asarray(vector, float) / np.linalg.norm(vector)


def hit_of(scene, origin, direction, faces=None):
    """Return the nearest hit of a ray among some faces (all if absent), or None."""
    geometry = scene.geometry
    chosen = np.arange(len(geometry.faces)) if faces is None else np.asarray(faces, int)
    if not len(chosen):
        return None
    winner, far, weights, _ = nearest(origin, direction, geometry.vertices, geometry.faces[chosen])
    if winner < 0:
        return None
    face = int(chosen[winner])
    crossing = face_normal(geometry, face)
    outward = crossing
    if geometry.vertex_normals is not None:
        outward = unit(np.asarray(weights) @ geometry.vertex_normals[geometry.faces[face]])
        outward = -outward if outward @ crossing < 0 else outward
    return Hit(face, origin + far * direction, -outward if crossing @ direction > 0 else outward, outward,
               scene.materials[geometry.material_of_face[face]])


def face_normal(geometry, face):
    """Return the unit normal on the side of a triangle's vertex order."""
    a, b, c = geometry.vertices[geometry.faces[face]]
    return unit(np.cross(b - a, c - a))
