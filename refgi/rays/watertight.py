"""Rays in float32: offsets against self-intersection, and watertight misses that float64 decides.

A ray that starts on a surface must not hit it again. What moves the surface about in float32, with u = 2^-24: the
rounding of the start, u |y|, and that of the triangle test, a few u times the distance from the start to the corners.
No triangle that Embree has is longer than the larger of the scene's grain and the distance of its points from the
coordinates' origin (`cut`), so the lift 4 u (|y|_1 + grain) covers both, whatever lies elsewhere in the scene. A
segment's far end is subject to the rounding of its direction as well, u times its length.

A ray aimed exactly at a vertex can pass Embree's float32 test of every triangle around it. Such a miss is found by
asking again with the ray shifted sideways by many float32 steps: if that misses as well, the miss stands. Else the
triangles around what the shifted ray hit are tested against the ray itself, in float64, by signed volumes of
(direction, edge) computed in one order per edge, so that two triangles always agree on which side of their common edge
a ray passes (Woop, Benthin & Wald 2013) and no ray passes between them. A volume within its rounding counts as 0: the
ray meets that edge, and at a vertex all of them.

Huge triangles are subdivided for Embree alone: float32 tests are off by a share of a triangle's size. A hit on a quad
of 10^8 m is found to some metres, so that it may hide a floor 1 mm above it. Edges longer than the scene's grain and
than 0.4 of their middle's distance from the coordinates' origin are halved, until none is left: then no piece is longer
than the larger of the grain and the distance of its own points, where float32 coordinates are as coarse. What is cut
depends on the edge alone, so neighbours are cut at the same points and no gap opens. A face of size S becomes some tens
of pieces times log2(S / grain).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel
from refgi.rays.cutouts import RayHoles, is_there
from refgi.types import Array

STEPS = 4 * 2.0**-24
GRAIN = 8.0  # times the power of 2 above half of the triangles' largest coordinates


def grain_of(vertices: Array, faces: Array) -> float:
    """Return the size of details in a scene as its rays know it: a power of 2 that single triangles do not move.

    `vertices` (n, 3): vertices, m. `faces` (m, 3): vertex indices. Result: length up to which triangles near the
    coordinates' origin stay whole, m.
    """
    if not len(faces):
        return GRAIN
    largest = np.abs(vertices).max(axis=1)[faces].max(axis=1)
    middle = float(np.partition(largest, len(largest) // 2)[len(largest) // 2])
    return GRAIN * 2.0 ** math.ceil(math.log2(max(middle, 1e-30)))


@kernel
def ray_offset(x: Any, y: Any, z: Any, grain: Any) -> Any:
    """Return the offset, m, of a ray's start from the surface at a point, against self-intersection.

    `x, y, z`: the point, m; `grain`: the tracer's, m. Of the type of x.
    """
    return type(x)(STEPS) * (abs(x) + abs(y) + abs(z) + grain)


@kernel
def far_offset(dx: Any, dy: Any, dz: Any) -> Any:
    """Return how much farther off its surface a segment (dx, dy, dz) must end for its length; m, of the type of dx."""
    return type(dx)(STEPS) * (abs(dx) + abs(dy) + abs(dz))


REACH = 0.4
ROUNDING = 8 * 2.0**-53  # of the products of a signed volume: 7 roundings of half a unit


class Corners(NamedTuple):
    """Triangles by shared corners: vertices at equal positions count as one."""

    vertices: Array  # (n, 3) float64, distinct positions, m
    faces: Array  # (m, 3) int64
    first: Array  # (n + 1,) int64: the triangles around vertex v are `around[first[v]:first[v + 1]]`
    around: Array  # (3 m,) int64


def corners(vertices: Array, faces: Array) -> Corners:
    """Weld equal positions and list the triangles around each.

    `vertices` (n, 3) float32: vertices as Embree has them. `faces` (m, 3) int32: vertex indices. Result: the tables for
    `closest_around`.
    """
    positions, welded = np.unique(vertices + np.float32(0), axis=0, return_inverse=True)  # + 0 makes -0 equal 0
    faces = welded.reshape(-1)[faces].astype(np.int64)
    order = np.argsort(faces.reshape(-1), kind="stable")
    first = np.concatenate([[0], np.cumsum(np.bincount(faces.reshape(-1), minlength=len(positions)))])
    return Corners(positions.astype(np.float64), faces, first, order // 3)


@kernel
def closest_around(
    tables: Corners, holes: RayHoles, triangle: int, origin: Array, direction: Array, reach: float
) -> tuple[int, float]:
    """Find the nearest hit among the triangles that share a corner with `triangle`, in float64.

    `tables`: the mesh by corners. `holes`: those of its triangles that may have some. `origin`, `direction` (3,)
    float64: the ray; its distance counts in lengths of `direction`. `reach`: how far to look. Result: triangle and
    distance; -1 and inf for a miss. Ties go to the lowest id.
    """
    nearest, hit = np.inf, -1
    for corner in range(3):
        vertex = tables.faces[triangle, corner]
        for k in range(tables.first[vertex], tables.first[vertex + 1]):
            candidate = tables.around[k]
            t = _hit_distance(tables, candidate, origin, direction)
            if t <= reach and (t < nearest or (t == nearest and candidate < hit)) and _is_solid(
                    holes, candidate, origin, direction):
                nearest, hit = t, candidate
    return hit, nearest


@kernel
def _is_solid(holes: RayHoles, triangle: int, origin: Array, direction: Array) -> bool:
    """Return whether a triangle is there where a ray meets it."""
    if len(holes.of_face) == 0 or holes.of_face[triangle] < 0:
        return True
    return is_there(holes, holes.of_face[triangle], origin[0], origin[1], origin[2], direction[0], direction[1],
                    direction[2])


@kernel
def _side(vertices: Array, i: int, j: int, origin: Array, direction: Array) -> Any:
    """Return the signed volume of direction and edge i-j, exactly negated for j-i; 0 where rounding may have made it.

    Else a ray through a vertex might pass every edge there on its outer side, each by its own rounding.
    """
    low, high = min(i, j), max(i, j)
    ax, ay, az = vertices[low, 0] - origin[0], vertices[low, 1] - origin[1], vertices[low, 2] - origin[2]
    bx, by, bz = vertices[high, 0] - origin[0], vertices[high, 1] - origin[1], vertices[high, 2] - origin[2]
    volume = (direction[0] * (ay * bz - az * by) + direction[1] * (az * bx - ax * bz)
              + direction[2] * (ax * by - ay * bx))
    products = (abs(direction[0]) * (abs(ay * bz) + abs(az * by)) + abs(direction[1]) * (abs(az * bx) + abs(ax * bz))
                + abs(direction[2]) * (abs(ax * by) + abs(ay * bx)))
    volume = volume if abs(volume) > ROUNDING * products else 0.0
    return volume if i < j else -volume


@kernel
def _hit_distance(tables: Corners, triangle: int, origin: Array, direction: Array) -> float:
    i, j, k = tables.faces[triangle]
    a = _side(tables.vertices, j, k, origin, direction)
    b = _side(tables.vertices, k, i, origin, direction)
    c = _side(tables.vertices, i, j, origin, direction)
    volume = a + b + c
    if min(a, b, c) < 0 < max(a, b, c) or volume == 0:
        return np.inf
    t = 0.0  # the hit is the corners' mean with weights a, b, c; its distance the same mean of theirs along the ray
    length = direction[0] * direction[0] + direction[1] * direction[1] + direction[2] * direction[2]
    for weight, vertex in ((a, i), (b, j), (c, k)):
        along = 0.0
        for axis in range(3):
            along += (tables.vertices[vertex, axis] - origin[axis]) * direction[axis]
        t += weight / volume * (along / length)
    return t if t > 0 else np.inf


class Pieces(NamedTuple):
    """Triangles for Embree."""

    vertices: Array  # (n, 3) float32, m
    faces: Array  # (m, 3) int32
    face: Array | None  # (m,) int32: the face each is a piece of; None where nothing is cut


def cut(vertices: Array, faces: Array, grain: float) -> Pieces:
    """Cut huge triangles into pieces that grow with their distance.

    `vertices` (n, 3) float32: vertices, m. `faces` (m, 3) int32: vertex indices. `grain`: edges up to this length stay
    whole, m. Result: the same arrays where nothing is cut.
    """
    if not _any_longer(vertices, faces, grain):
        return Pieces(vertices, faces, None)
    places = vertices.astype(np.float64)
    whole: list[tuple[Array, Array]] = []
    left, of = faces, np.arange(len(faces), dtype=np.int32)
    while True:
        start, end = places[left], places[np.roll(left, -1, axis=1)]
        middle, way = (start + end) / 2, end - start
        length = np.sqrt((way * way).sum(axis=2))
        split = length > np.maximum(grain, REACH * np.sqrt((middle * middle).sum(axis=2)))
        cuts = split.any(axis=1)
        whole.append((left[~cuts], of[~cuts]))
        if not cuts.any():
            break
        left, of, split = left[cuts], of[cuts], split[cuts]
        numbers = np.full(split.shape, -1, np.int32)
        numbers[split] = len(places) + np.arange(np.count_nonzero(split))
        places = np.concatenate([places, middle[cuts][split]])
        left, of = _halved(left, numbers, of)
    if len(whole) == 1:
        return Pieces(vertices, faces, None)
    joined = [np.concatenate(parts) for parts in zip(*whole, strict=True)]
    return Pieces(places.astype(np.float32), joined[0].astype(np.int32), joined[1])


def _any_longer(vertices: Array, faces: Array, grain: float) -> bool:
    """Return whether a side of any triangle's box is longer, in little memory."""
    lowest, highest = vertices[faces[:, 0]], vertices[faces[:, 0]]
    for k in (1, 2):
        corner = vertices[faces[:, k]]
        np.minimum(lowest, corner, out=lowest)
        np.maximum(highest, corner, out=highest)
    return bool((highest - lowest).max() * np.sqrt(3) > grain)


def _halved(faces: Array, middles: Array, of: Array) -> tuple[Array, Array]:
    """Return the parts of triangles whose edges (from each corner to the next) have these midpoints; -1: none."""
    count = (middles >= 0).sum(axis=1)
    parts, owners = [], []
    # turn each so that with one middle it lies on the first edge, with two on the first two
    first = np.where(count == 1, np.argmax(middles >= 0, axis=1), (np.argmax(middles < 0, axis=1) + 1) % 3)
    order = (first[:, None] + np.arange(3)) % 3
    order[count == 3] = (0, 1, 2)
    (a, b, c), (p, q, r) = np.take_along_axis(faces, order, 1).T, np.take_along_axis(middles, order, 1).T
    for number, triangles in ((1, ((a, p, c), (p, b, c))), (2, ((p, b, q), (a, p, q), (a, q, c))),
                              (3, ((a, p, r), (p, b, q), (r, q, c), (p, q, r)))):
        for corners in triangles:
            parts.append(np.stack(corners, axis=1)[count == number])
            owners.append(of[count == number])
    return np.concatenate(parts), np.concatenate(owners)
