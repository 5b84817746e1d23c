"""Polygons of mesh files as triangles: fans, and ears where a fan would leave the polygon."""

import numpy as np

from refgi.types import Array

TURNED = 1e-6  # of a polygon's area: a triangle of its fan that is turned over by less is rounding
MOST_CORNERS = 4096  # of a polygon that is cut into ears, which takes the square of their number


def triangles_of(vertices: Array, corners: Array, counts: Array) -> tuple[Array, int]:
    """Return the triangles of polygons, in their order.

    `vertices` (n, 3): positions, m. `corners` (k,): vertex of each corner, polygon after polygon. `counts` (p,):
    corners of each polygon, 3 or more. Returns (m, 3) int64: positions in `corners`. Result: number of polygons that
    have no ears (they cross themselves) or too many corners; they are fans from their first corner, as convex ones are.
    """
    if (counts == 3).all():
        return np.arange(len(corners)).reshape(-1, 3), 0
    counts = np.asarray(counts, np.int64)
    first = np.cumsum(counts) - counts
    of_polygon = np.repeat(np.arange(len(counts)), counts - 2)
    step = np.arange(len(of_polygon)) - np.repeat(np.cumsum(counts - 2) - (counts - 2), counts - 2)
    start = first[of_polygon]
    triangles = np.stack([start, start + step + 1, start + step + 2], axis=1)
    left = 0
    for number in _turned_over(vertices, corners, triangles, of_polygon, counts).tolist():
        chosen = slice(first[number], first[number] + counts[number])
        ears = _ears(_flattened(vertices[corners[chosen]]))
        left += ears is None
        if ears is not None:
            at = first[number] - 2 * number  # two triangles fewer than corners in each polygon before
            triangles[at : at + len(ears)] = np.array(ears) + first[number]
    return triangles, left


def _turned_over(vertices: Array, corners: Array, triangles: Array, of_polygon: Array, counts: Array) -> Array:
    """Return the polygons of which a triangle of the fan faces the other way than the whole."""
    large = np.flatnonzero(counts[of_polygon] > 3)
    a, b, c = (np.asarray(vertices[corners[triangles[large, k]]], np.float64) for k in range(3))
    with np.errstate(over="ignore", invalid="ignore"):  # coordinates are checked later
        cross = np.cross(b - a, c - a)
        owner = of_polygon[large]
        starts = np.flatnonzero(np.diff(owner, prepend=-1))
        area = np.add.reduceat(cross, starts, axis=0)
        size = np.diff(starts, append=len(owner))
        share = np.einsum("ij,ij->i", cross, np.repeat(area, size, axis=0))
        limit = -TURNED * np.repeat(np.einsum("ij,ij->i", area, area), size)
    return np.unique(owner[share < limit])


def _flattened(points: Array) -> Array:
    """Return (k, 2) the points of a polygon in the coordinate plane that it is most parallel to, counter-clockwise."""
    points = np.asarray(points, np.float64) - points[0]
    normal = np.cross(points[1:-1], points[2:]).sum(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    flat = points[:, [(axis + 1) % 3, (axis + 2) % 3]]
    return flat if normal[axis] > 0 else flat * (-1.0, 1.0)


def _ears(points: Array) -> list[tuple[int, int, int]] | None:
    """Return the triangles of a counter-clockwise polygon (k, 2), None where it crosses itself or is too large.

    An ear is a corner whose triangle holds no other corner. Corners at the same place, as of a hole that a slit joins
    to the outline, are in nobody's way; a corner without an angle is cut only where there is no ear.
    """
    if len(points) > MOST_CORNERS:
        return None
    ring, ears, last = np.arange(len(points)), [], 0
    while len(ring) > 3:
        a, b, c = points[np.roll(ring, 1)], points[ring], points[np.roll(ring, -1)]
        angle = _cross(b - a, c - b)
        convex, others = np.flatnonzero(angle > 0), b[angle <= 0]
        # the next ear is often beside the last one
        beside = np.roll(convex, -int(np.searchsorted(convex, last - 1))).tolist()
        chosen = next((k for k in beside if _is_ear(a[k], b[k], c[k], others)), None)
        if chosen is None:
            flat = np.flatnonzero(angle == 0)
            if not len(flat):
                return None
            chosen = int(flat[0])
        ears.append((int(ring[chosen - 1]), int(ring[chosen]), int(ring[(chosen + 1) % len(ring)])))
        ring, last = np.delete(ring, chosen), chosen
    return [*ears, (int(ring[0]), int(ring[1]), int(ring[2]))]


def _is_ear(a: Array, b: Array, c: Array, others: Array) -> bool:
    """Return whether none of the points (k, 2) lies in a triangle, its border included and its corners not."""
    inside = (_cross(b - a, others - a) >= 0) & (_cross(c - b, others - b) >= 0) & (_cross(a - c, others - c) >= 0)
    at_corner = np.logical_or.reduce([(others == corner).all(axis=1) for corner in (a, b, c)])
    return not bool((inside & ~at_corner).any())


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
