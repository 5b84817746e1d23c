"""Closed meshes and hostile rays inside and upon them: a sphere, a star, 5000 needles at each of two poles.

All hold a ball of radius 0.3 around the origin before they are scaled, and all of them are seen whole from there; so
every ray from that ball hits them. The sphere and the needles are convex.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from refgi.scene import Geometry
from refgi.types import Array

NEEDLES = 5000
WITHIN = 0.25  # radius of the ball that rays start in, of size 1
TURN = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])  # a rotation that aligns nothing


class Mesh(NamedTuple):
    """A closed mesh; its faces are turned outwards."""

    geometry: Geometry
    convex: bool
    corners: Array  # (m, 3, 3) float64 of the float32 vertices that Embree has


def _mesh(vertices: Array, faces: Array, size: float, convex: bool) -> Mesh:
    places = (size * (vertices @ TURN.T)).astype(np.float32).astype(np.float64)
    faces = np.asarray(faces, np.int32)
    return Mesh(Geometry(places, faces, np.zeros(len(faces), np.int32)), convex, places[faces])


def sphere(size: float) -> Mesh:
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=5)
    return _mesh(np.asarray(ball.vertices), ball.faces, size, True)


def star(size: float) -> Mesh:
    """Return a ball of radius 0.4 with a spike of length 1 upon each of 320 faces."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2)
    base, faces = 0.4 * np.asarray(ball.vertices), np.asarray(ball.faces)
    tips = base[faces].mean(axis=1)
    tips /= np.linalg.norm(tips, axis=1, keepdims=True)
    tip = len(base) + np.arange(len(faces))
    sides = [np.stack([faces[:, a], faces[:, b], tip], axis=1) for a, b in ((0, 1), (1, 2), (2, 0))]
    return _mesh(np.concatenate([base, tips]), np.concatenate(sides), size, False)


def needles(size: float) -> Mesh:
    """Return two cones, base to base, of 5000 triangles each: at either pole meet 5000 needles of 0.07 degrees."""
    angle = 2 * np.pi * np.arange(NEEDLES) / NEEDLES
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(NEEDLES)], axis=1)
    here = np.arange(NEEDLES)
    after = (here + 1) % NEEDLES
    upper = np.stack([here, after, np.full(NEEDLES, NEEDLES)], axis=1)
    lower = np.stack([after, here, np.full(NEEDLES, NEEDLES + 1)], axis=1)
    return _mesh(np.concatenate([ring, [[0, 0, 1], [0, 0, -1]]]), np.concatenate([upper, lower]), size, True)


MESHES: dict[str, Callable[[float], Mesh]] = {"sphere": sphere, "star": star, "needles": needles}


class Rays(NamedTuple):
    """Rays, and the face each leaves or -1."""

    origins: Array  # (n, 3) float32, m
    directions: Array  # (n, 3) float32
    own: Array  # (n,) int64


def _inside(rng: np.random.Generator, size: float, count: int) -> Array:
    way = rng.standard_normal((count, 3), np.float32)
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    return np.asarray(way * (np.float32(WITHIN * size) * rng.random((count, 1), np.float32)), np.float32)


def random_rays(mesh: Mesh, size: float, rng: np.random.Generator, count: int) -> Rays:  # noqa: ARG001
    """Return rays from the ball in any direction."""
    directions = rng.standard_normal((count, 3), np.float32)
    return Rays(_inside(rng, size, count), directions, np.full(count, -1))


def aimed_rays(mesh: Mesh, size: float, rng: np.random.Generator, count: int) -> Rays:
    """Return rays to vertices and edges, a quarter of them from the origin; length 1 of a direction ends there."""
    origins = _inside(rng, size, count) * (rng.random((count, 1)) < 0.75)
    face, corner = rng.integers(0, len(mesh.corners), count), rng.integers(0, 3, count)
    start, end = mesh.corners[face, corner], mesh.corners[face, (corner + 1) % 3]
    kind = rng.integers(0, 4, count)
    along = np.select([kind == 0, kind == 1, kind == 2], [0.0, 0.5, np.exp(rng.uniform(-25, 0, count))],
                      rng.random(count))
    targets = start + along[:, None] * (end - start)
    origins = origins.astype(np.float32)
    return Rays(origins, (targets - origins).astype(np.float32), np.full(count, -1))


class Places(NamedTuple):
    """Points of faces."""

    points: Array  # (n, 3) float64, m
    normals: Array  # (n, 3) unit vectors, outwards
    face: Array  # (n,)


def places_upon(mesh: Mesh, rng: np.random.Generator, count: int) -> Places:
    """Return points upon faces, a thousandth of an edge off the next face and more."""
    face = rng.integers(0, len(mesh.corners), count)
    weight = rng.dirichlet((0.5, 0.5, 0.5), count)
    weight = np.maximum(weight, 1e-3)
    weight /= weight.sum(axis=1, keepdims=True)
    corner = mesh.corners[face]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return Places((weight[:, :, None] * corner).sum(axis=1), normal / np.linalg.norm(normal, axis=1, keepdims=True),
                  face)


def leaving_rays(mesh: Mesh, offsets: Any, rng: np.random.Generator, count: int) -> Rays:
    """Return rays that leave faces outwards, down to 1e-6 above them, from points lifted by `offsets`."""
    at = places_upon(mesh, rng, count)
    along = np.cross(at.normals, rng.normal(size=(count, 3)))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    height = np.exp(rng.uniform(np.log(1e-6), 3, count))
    origins = at.points + np.asarray(offsets(at.points))[:, None] * at.normals
    return Rays(origins.astype(np.float32), (along + height[:, None] * at.normals).astype(np.float32), at.face)
