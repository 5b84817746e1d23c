"""Triangle bounds on perspective and orthographic maps: projected vertices, and the texels a triangle may cover.

A vertex is kept as (column, row, w, n): its continuous texel coordinates, w (axial depth; 1 when orthographic) and n
(1; the nearness 1 - depth/reach when orthographic). Nothing is clipped: of a triangle that crosses the plane of the
eye, the box is that of its forward part.

`chunks` groups consecutive triangles, each chunk with its bounding box and float32 corners in the order of SIMD lanes.
"""

from typing import Any, NamedTuple

import numpy as np

from refgi.jit import has_wide_registers, kernel, prange
from refgi.rsm.pool import plane
from refgi.rsm.raster.projection import ORTHOGRAPHIC, Projection, view_coordinates
from refgi.types import Array

SMALLEST_W = 1e-30  # stands for a vertex in the plane of the eye, m
BOX_PAD = 1e-3  # texels; far above the rounding of a projected vertex
SPAN_CUT = 32  # texels; narrower boxes are cheaper to test whole
BEHIND = -1  # column of a vertex that is not in front of the eye
LANES = 8 if has_wide_registers() else 4  # texels tested at once; so many columns more has a row of keys
BLOCK = 256  # triangles bounded without a branch before those among them that cross the plane of the eye
SMALLEST = 1e-300  # an edge that owns its line needs e >= 0, another needs e >= SMALLEST
CHUNK = 64  # triangles


@kernel
def project_vertices(
    projection: Projection, m: int, vertices: Array, first: int, last: int, corners: Array, cells: Array
) -> None:
    """Fill rows of `corners` and `cells` with vertices as projected on map `m`.

    `projection`: perspective or orthographic maps. `vertices` (n, 3): world space, m. `first`, `last`: first vertex and
    one past the last. `corners` (n, 4): column, row, w, n. `cells` (n, 4) int: first column and row whose centre is not
    left of or above the vertex, and the negatives of the last ones whose centre is not right of or below it, a little
    widened: the least of each bounds a triangle. `BEHIND` first where the vertex is not in front of the eye.
    """
    width, height = projection.width, projection.height
    for i in range(first, last):
        x, y, depth = view_coordinates(projection, m, vertices[i, 0], vertices[i, 1], vertices[i, 2])
        w, nearness = depth, 1.0
        if projection.kind == ORTHOGRAPHIC:
            w, nearness = 1.0, 1.0 - depth / projection.reach
        elif abs(w) < SMALLEST_W:
            w = SMALLEST_W
        x = (x / w / projection.half[0] + 1.0) * (0.5 * width)
        y = (y / w / projection.half[1] + 1.0) * (0.5 * height)
        corners[i, 0], corners[i, 1], corners[i, 2], corners[i, 3] = x, y, w, nearness
        left, right = centres_between(x, x, width)
        top, bottom = centres_between(y, y, height)
        cells[i, 0], cells[i, 1] = left if w > 0.0 else BEHIND, top
        cells[i, 2], cells[i, 3] = -right, -bottom


@kernel
def bound_triangles(
    corners: Array, cells: Array, faces: Array, first: int, last: int, size: tuple[int, int], boxes: Array
) -> None:
    """Write the texels whose centres triangles may cover.

    `corners` (n, 4): projected vertices. `cells` (n, 4) int: the texels that each lies between. `faces` (m, 3):
    vertices of each triangle. `first`, `last`: first triangle and one past the last. `size`: columns and rows of the
    map. `boxes` (last - first, 4): first and last column, first and last row; first > last where a triangle covers
    nothing.

    The loop over triangles is inside, because a call with arrays costs atomic reference counts, which threads share.
    """
    for block in range(first, last, BLOCK):
        crossing, stop = 0, min(block + BLOCK, last)
        for face in range(block, stop):
            i, j, k, place = faces[face, 0], faces[face, 1], faces[face, 2], face - first
            left, top = min(cells[i, 0], cells[j, 0], cells[k, 0]), min(cells[i, 1], cells[j, 1], cells[k, 1])
            right, bottom = -min(cells[i, 2], cells[j, 2], cells[k, 2]), -min(cells[i, 3], cells[j, 3], cells[k, 3])
            crossing += left == BEHIND
            empty = (left > right) | (top > bottom)
            boxes[place, 0], boxes[place, 1] = 1 if empty else left, 0 if empty else right
            boxes[place, 2], boxes[place, 3] = 0 if empty else top, 0 if empty else bottom
        if crossing > 0:
            _bound_crossing(corners, faces, block, stop, size, boxes[block - first : stop - first])


@kernel
def _bound_crossing(corners: Array, faces: Array, first: int, last: int, size: tuple[int, int], boxes: Array) -> None:
    """Bound those of some triangles that are not all in front of the eye."""
    for face in range(first, last):
        i, j, k, place = faces[face, 0], faces[face, 1], faces[face, 2], face - first
        w = corners[i, 2], corners[j, 2], corners[k, 2], corners[i, 2]
        if w[0] > 0.0 and w[1] > 0.0 and w[2] > 0.0:
            continue
        columns = corners[i, 0], corners[j, 0], corners[k, 0], corners[i, 0]
        rows = corners[i, 1], corners[j, 1], corners[k, 1], corners[i, 1]
        left, right, top, bottom = crossing_box(columns, rows, w, size)
        boxes[place, 0], boxes[place, 1], boxes[place, 2], boxes[place, 3] = left, right, top, bottom


@kernel
def crossing_box(columns: Any, rows: Any, w: Any, size: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return the texels that the part of a triangle in front of the eye may cover.

    `columns`, `rows`, `w`: of its corners, the first again at the end. Result: as `bound_triangles` writes it.
    """
    low, high = _open_interval(columns, w)
    left, right = centres_between(low, high, size[0])
    low, high = _open_interval(rows, w)
    top, bottom = centres_between(low, high, size[1])
    if left > right or top > bottom:
        left, right, top, bottom = 1, 0, 0, 0
    return left, right, top, bottom


@kernel
def centres_between(low: float, high: float, size: int) -> tuple[int, int]:
    """Return the first and last texel whose centre lies in an interval, or a little outside it.

    `low`, `high`: the interval, continuous texel coordinates. Result: within 0 to `size` - 1; first > last where there
    is none.
    """
    first = np.ceil(min(max(low, 0.0), size + 1.0) - (0.5 + BOX_PAD))
    last = np.floor(min(max(high, -1.0), float(size)) + (BOX_PAD - 0.5))
    return max(int(first), 0), min(int(last), size - 1)


@kernel
def _open_interval(place: Any, w: Any) -> tuple[float, float]:
    """Return the range on one axis of the part in front of the eye: an edge through its plane goes to infinity."""
    low, high = np.inf, -np.inf
    for a in range(3):
        b = a + 1
        if w[a] > 0.0:
            low, high = min(low, place[a]), max(high, place[a])
        if (w[a] > 0.0) != (w[b] > 0.0):
            # the sign of the coordinate times w where the edge meets the plane of the eye
            pa, pb = place[a] * w[a], place[b] * w[b]
            meets = (pa * w[b] - pb * w[a]) * (-1.0 if w[a] > 0.0 else 1.0)
            doubt = 1e-9 * (abs(pa * w[b]) + abs(pb * w[a]))
            if meets <= doubt:
                low = -np.inf
            if meets >= -doubt:
                high = np.inf
    return low, high


class Chunks(NamedTuple):
    """Triangles of c chunks, in mesh order; the last is filled up with triangles without area."""

    vertices: Array  # (n, 3) float64, m
    faces: Array  # (c CHUNK, 3) int32
    corners: Array  # (c, 9, CHUNK) float32, m: x, y, z of the corners from the least of the box, first to third
    box: Array  # (c, 6) float64, m: least x, y, z, then greatest


def chunks(vertices: Array, faces: Array) -> Chunks:
    """Group triangles in chunks.

    `vertices` (n, 3) float64: world space, m. `faces` (m, 3): vertices of each triangle. Result: the same vertices, and
    a copy of corners.
    """
    number = (len(faces) + CHUNK - 1) // CHUNK
    filled = Chunks(np.ascontiguousarray(vertices, np.float64), plane((number * CHUNK, 3), np.int32),
                    plane((number, 9, CHUNK), np.float32), np.empty((number, 6)))
    _fill_chunks(faces, filled)
    return filled


@kernel(parallel=True)
def _fill_chunks(faces: Array, filled: Chunks) -> None:
    vertices, corners, box = filled.vertices, filled.corners, filled.box
    for chunk in prange(len(box)):
        first, last = np.int64(chunk) * CHUNK, len(faces) - 1
        for axis in range(3):
            box[chunk, axis], box[chunk, 3 + axis] = np.inf, -np.inf
        for face in range(first, first + CHUNK):
            for corner in range(3):
                vertex = faces[min(face, last), corner if face <= last else 0]
                filled.faces[face, corner] = vertex
                for axis in range(3):
                    value = vertices[vertex, axis]
                    box[chunk, axis] = min(box[chunk, axis], value)
                    box[chunk, 3 + axis] = max(box[chunk, 3 + axis], value)
        for b in range(CHUNK):
            for corner in range(3):
                vertex = filled.faces[first + b, corner]
                for axis in range(3):
                    corners[chunk, 3 * corner + axis, b] = vertices[vertex, axis] - box[chunk, axis]
