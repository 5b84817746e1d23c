"""Area lights by hand, and points on surfaces for them to light."""

import numpy as np

from refgi.cluster.rectangle import AreaLights
from refgi.cluster.settings import ValSettings
from refgi.cluster.visibility.shadow import visibility
from refgi.rsm.raster.projection import paraboloid_projection
from refgi.settings import of


def area_lights(center, normal, radius=0.0, members=None):
    """Area lights of no extent around given centres; `radius` says how far their lights are."""
    center, normal = np.atleast_2d(np.asarray(center, float)), np.atleast_2d(np.asarray(normal, float))
    count = len(center)
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    frame = paraboloid_projection(center, normal, 1).frame
    none = np.zeros((2, count))
    members = np.ones(count, np.int64) if members is None else np.asarray(members, np.int64)
    return AreaLights(np.ascontiguousarray(center.T), np.ascontiguousarray(normal.T), frame, none,
                      np.ascontiguousarray(frame[:, :2]), none, np.zeros(count), np.full(count, float(radius)), members,
                      np.arange(count, dtype=np.int32))


def surface_points(geometry, count, rng):
    """Points spread over the triangles by area, and the triangles' normals, (3, n) each."""
    corners = geometry.vertices[geometry.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    face = rng.choice(len(area), count, p=area / area.sum())
    u, v = rng.uniform(size=(2, count, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    points = corners[face, 0] * (1 - u - v) + corners[face, 1] * u + corners[face, 2] * v
    return np.ascontiguousarray(points.T), np.ascontiguousarray((cross[face] / area[face, None]).T)


def hard_visibility(maps, areas, m, points, facing):
    """V by one depth test."""
    return visibility(maps, areas, m, points, facing, of(ValSettings, visibility="hard"))
