"""Clusters: triangles near one another, with copies of their vertices side by side.

A mesh is often in no order that a map could profit from. Triangles are sorted along a Z-order curve once, and whatever
draws them reads each cluster's vertices from one place, projects them once and passes over clusters as a whole.
"""

import math
from typing import NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.types import Array

CLUSTER = 64  # triangles
TABLE = 256  # places where a cluster's vertex is looked for; a power of two
SPARE = 8  # vertices of no meaning at the end, so that whole SIMD lanes may be read
MOST_BITS = 10  # of an axis' part of a place on the curve


class Clusters(NamedTuple):
    """Triangles without holes, cluster by cluster: the last one may have fewer than `CLUSTER`."""

    face: Array  # (m,) int32: which triangle of the geometry
    corner: Array  # (m, 3) uint8: its vertices, as places within those of its cluster
    start: Array  # (c + 1,) int64: first vertex of each cluster, then one past the last
    vertex: Array  # (3, n + SPARE) float64, m: x, y, z; mostly once in a cluster
    box: Array  # (c, 6) float64, m: least x, y, z of each cluster, then greatest
    plane: Array  # (4, m) float32: N = e1 x e2 of each triangle, m^2, and N . (v0 - q), m^3, q the middle of the box
    product: Array  # (c,) float64: greatest |e1| |e2| of a cluster's triangles, m^2


def clusters(vertices: Array, faces: Array, bounds: tuple[Array, Array], holed: Array | None) -> Clusters:
    """Sort triangles but those numbered as `holed` along a Z-order curve, and cut it into pieces.

    Which triangles share a cluster changes no picture.
    """
    number = len(faces)
    bits = min(max(math.ceil(math.log2(max(number, 1)) / 2 - 2), 1), MOST_BITS)  # some triangles share a cell
    low, high = bounds
    side = float((high - low).max())
    places = _places_on_curve(vertices[faces[:, 0]] - low, (1 << bits) / side if side > 0 else 0.0, bits)
    if holed is not None:
        places = np.delete(places, holed)
    places.sort()
    number = len(places)
    face, corner = np.empty(number, np.int32), np.empty((number, 3), np.uint8)
    count = -(-number // CLUSTER)
    used, box = np.empty((count, 3 * CLUSTER + 1), np.int32), np.empty((count, 6))
    start = np.zeros(count + 1, np.int64)
    _find_vertices(faces, places, face, corner, used, start)
    np.cumsum(start, out=start)
    vertex = np.zeros((3, start[-1] + SPARE))
    vertex[:, : start[-1]] = vertices[used[np.arange(used.shape[1]) < np.diff(start)[:, None]]].T
    if count:
        box[:, :3] = np.minimum.reduceat(vertex[:, : start[-1]], start[:-1], axis=1).T
        box[:, 3:] = np.maximum.reduceat(vertex[:, : start[-1]], start[:-1], axis=1).T
    plane, product = np.empty((4, number), np.float32), np.empty(count)
    _find_planes(corner, start, vertex, box, plane, product)
    return Clusters(face, corner, start, vertex, box, plane, product)


def _places_on_curve(corner: Array, scale: float, bits: int) -> Array:
    """Return the place of each triangle on the curve, by a corner's (m, 3) distance from the least one, and its number.

    The number is in the lower half, (m,) int64.
    """
    cells = np.minimum((corner * scale).astype(np.int64), (1 << bits) - 1)
    for shift, mask in ((16, 0x30000FF), (8, 0x300F00F), (4, 0x30C30C3), (2, 0x9249249)):  # two zeros before each bit
        cells = (cells | (cells << shift)) & mask
    place = cells[:, 0] | cells[:, 1] << 1 | cells[:, 2] << 2
    return np.asarray(place << 32 | np.arange(len(place)))


@kernel(parallel=True)
def _find_vertices(faces: Array, places: Array, face: Array, corner: Array, used: Array, start: Array) -> None:
    """List the vertices that each cluster uses, mostly once, and count them one place further on in `start`."""
    for cluster in prange(len(used)):
        table = np.zeros(TABLE, np.int32)  # where a vertex may be listed
        known = 0
        for place in range(cluster * CLUSTER, min((cluster + 1) * CLUSTER, len(places))):
            face[place] = places[place] & 0xFFFFFFFF
            for c in range(3):
                vertex = faces[face[place], c]
                entry = vertex & (TABLE - 1)
                there = np.int64(table[entry])
                new = (there >= known) | (used[cluster, there] != vertex)  # free of branches, which nothing foretells
                slot = known if new else there
                used[cluster, known] = vertex
                known += new
                table[entry] = slot
                corner[place, c] = slot
        start[cluster + 1] = known


@kernel(parallel=True)
def _find_planes(corner: Array, start: Array, vertex: Array, box: Array, plane: Array, product: Array) -> None:
    for cluster in prange(len(box)):
        first, last = cluster * CLUSTER, min((cluster + 1) * CLUSTER, len(corner))
        low, high, greatest = box[cluster, :3], box[cluster, 3:], 0.0
        qx, qy, qz = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2])
        for at in range(first, last):
            i, j, k = start[cluster] + corner[at, 0], start[cluster] + corner[at, 1], start[cluster] + corner[at, 2]
            x, y, z = vertex[0, i], vertex[1, i], vertex[2, i]
            ax, ay, az = vertex[0, j] - x, vertex[1, j] - y, vertex[2, j] - z
            bx, by, bz = vertex[0, k] - x, vertex[1, k] - y, vertex[2, k] - z
            nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
            offset = nx * (x - qx) + ny * (y - qy) + nz * (z - qz)
            plane[0, at], plane[1, at], plane[2, at], plane[3, at] = nx, ny, nz, offset
            greatest = max(greatest, (ax * ax + ay * ay + az * az) * (bx * bx + by * by + bz * bz))
        product[cluster] = math.sqrt(greatest)
