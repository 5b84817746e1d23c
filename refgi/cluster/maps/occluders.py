"""Which triangles can block anything: those on the hull of the scene cannot (Sec. 6, maps).

A triangle whose plane has the whole scene on one side meets a segment between two points of the scene at an end of it
at most. Floors, walls and ceilings of a closed room are of this kind, and often make up most of what a map shows.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.scene.model import Geometry
from refgi.stages import stage

Array = npt.NDArray[Any]

# Share of the scene's diagonal by which points may lie beyond a plane that still counts as the scene's border; below
# what ends of rays are kept from surfaces.
TOLERANCE = 1e-6
DIRECTIONS = 64  # along which extreme points are found before the hull: enough to tell most triangles from it


class Blockers(NamedTuple):
    """Triangles that maps are drawn from, with no other vertices."""

    vertices: Array  # (n, 3) float64, m
    faces: Array  # (m, 3) int32
    triangle_id: Array  # (m,) int64: index in the geometry


@stage("cluster.occluders")
def occluders(geometry: Geometry) -> Array:
    """Tell which triangles may lie between two points of the scene.

    Parameters
    ----------
    geometry : Geometry
        The triangles.

    Returns
    -------
    (m,) bool ndarray
        False for triangles on the scene's convex hull: no segment between two points of the scene meets them but at
        an end, or within 1e-6 of the scene's diagonal of one. Triangles without area are False too.
    """
    faces = np.ascontiguousarray(geometry.faces)
    outside = np.zeros(len(faces), np.bool_)
    if len(faces) == 0:
        return outside
    tolerance = TOLERANCE * geometry.diagonal
    vertices = np.ascontiguousarray(geometry.vertices, np.float64)
    used = vertices[np.unique(faces)]
    _on_border(vertices, faces, _extreme(used), tolerance, outside)
    doubtful = np.flatnonzero(outside)
    if len(doubtful):
        certain = np.zeros(len(doubtful), np.bool_)
        _on_border(vertices, np.ascontiguousarray(faces[doubtful]), _hull(used), tolerance, certain)
        outside[doubtful] = certain
    return np.logical_not(outside)


@stage("cluster.blockers")
def blockers(geometry: Geometry, alone: bool) -> Blockers:
    """Return the triangles that maps are drawn from.

    Parameters
    ----------
    geometry : Geometry
        The triangles.
    alone : bool
        Leave out those that cannot block anything.

    Returns
    -------
    Blockers
        The triangles, in mesh order.
    """
    if not alone:
        return Blockers(np.ascontiguousarray(geometry.vertices, np.float64), geometry.faces,
                        np.arange(len(geometry.faces)))  # fmt: skip
    triangle_id = np.flatnonzero(occluders(geometry))
    used, place = np.unique(geometry.faces[triangle_id], return_inverse=True)
    faces = np.ascontiguousarray(place.reshape(-1, 3), np.int32)
    return Blockers(np.ascontiguousarray(geometry.vertices[used], np.float64), faces, triangle_id)


def _extreme(points: Array) -> Array:
    """Return the farthest points along evenly spread directions, a first sketch of the hull."""
    step = np.arange(DIRECTIONS) + 0.5
    z, turn = 1.0 - 2.0 * step / DIRECTIONS, np.pi * (1.0 + 5.0**0.5) * step
    ring = np.sqrt(1.0 - z * z)
    directions = np.stack([ring * np.cos(turn), ring * np.sin(turn), z])
    return np.ascontiguousarray(points[[int(np.argmax(points @ direction)) for direction in directions.T]])


def _hull(points: Array) -> Array:
    """Return the corners of the convex hull; all points where they lie in one plane."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.ascontiguousarray(points[ConvexHull(points).vertices])
    except QhullError:
        return points


@kernel(parallel=True)
def _on_border(vertices: Array, faces: Array, points: Array, tolerance: float, outside: Array) -> None:
    """Tell which planes have all points on one side, up to a tolerance."""
    for face in prange(len(faces)):
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        ax, ay, az = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        bx, by, bz = vertices[j, 0] - ax, vertices[j, 1] - ay, vertices[j, 2] - az
        cx, cy, cz = vertices[k, 0] - ax, vertices[k, 1] - ay, vertices[k, 2] - az
        nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        limit = tolerance * np.sqrt(nx * nx + ny * ny + nz * nz)
        above, below, p = False, False, 0
        while p < len(points) and not (above and below):
            height = nx * (points[p, 0] - ax) + ny * (points[p, 1] - ay) + nz * (points[p, 2] - az)
            above, below = above or height > limit, below or height < -limit
            p += 1
        outside[face] = not (above and below)
