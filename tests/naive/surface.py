"""Slow literal twin of what a ray finds: the nearest triangle, its normals and its material."""

from typing import Any, NamedTuple

import numpy as np

from tests.naive.raster import nearest


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
