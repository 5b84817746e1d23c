"""One triangle on a perspective or orthographic map: where it may be, and which texels it owns.

A vertex is kept as (column, row, w, n): its continuous texel coordinates, w (axial depth; 1 when orthographic) and n
(1; the nearness 1 - depth/reach when orthographic). With v_i = (column w, row w, w) and the texel centre (x, y, 1):

- edge function e_i = (x, y, 1) . (v_j x v_k) = a x + b y + c, barycentric coordinate b_i = e_i / sum(e),
- nearness = sum(e_i n_i) / det(v), that is 1/w in perspective, an affine function of (x, y) in both.

Nothing is clipped: the forward part of a triangle that crosses the plane of the eye is where all e_i have the sign
of det. Adjacent triangles compute exactly negated edges from the same two vertices (strict IEEE products commute), so
a texel centre on an edge belongs to exactly one of them: to the one that would own it after a shift of the sample by
an infinitesimal to the right, and a smaller one downwards (the top-left rule).
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel
from refgi.rsm.projection import ORTHOGRAPHIC, Projection, view_coordinates

Array = npt.NDArray[Any]

SMALLEST_W = 1e-30  # stands for a vertex in the plane of the eye, m
NEAREST = 1e-9  # share of a triangle's size under which a hit is rounding: its plane holds the eye
BOX_PAD = 1e-3  # texels; far above the rounding of a projected vertex
SPAN_CUT = 32  # texels; narrower boxes are cheaper to test whole
BEHIND = -1  # column of a vertex that is not in front of the eye
LANES = 16  # texels tested at once; a map has at least as many columns in memory
BATCH = 64  # triangles set up at once
LIMIT, CORNERS, ROWS = 15 * BATCH, 16 * BATCH, 28  # where a batch's limits and corners start, and its rows in all
SMALLEST = 1e-300  # an edge that owns its line needs e >= 0, another needs e >= SMALLEST


class Part(NamedTuple):
    """Triangles to draw, and the rows to draw them in."""

    members: Array  # (...) int32: triangle ids, in mesh order
    start: int  # first and one past the last place in `members`
    stop: int
    boxes: Array  # (..., 4) uint16: first and last column, first and last row of triangle `base`, `base` + 1, ...
    base: int
    top: int  # first and last row to draw
    bottom: int


@kernel
def project_vertices(
    projection: Projection, m: int, vertices: Array, first: int, last: int, corners: Array, cells: Array
) -> None:
    """Fill rows of `corners` and `cells` with vertices as seen on map `m`.

    Parameters
    ----------
    projection : Projection
        Perspective or orthographic maps.
    m : int
        Which map.
    vertices : (n, 3) ndarray
        World space, m.
    first, last : int
        First vertex and one past the last.
    corners : (n, 4) ndarray
        Column, row, w, n.
    cells : (n, 4) ndarray of int
        First column whose centre is not left of the vertex, last one whose centre is not right of it, and the same of
        rows, a little widened; `BEHIND` first where the vertex is not in front of the eye.
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
        cells[i, 0], cells[i, 1] = left if w > 0.0 else BEHIND, right
        cells[i, 2], cells[i, 3] = centres_between(y, y, height)


@kernel
def bound_triangles(
    corners: Array, cells: Array, faces: Array, first: int, last: int, size: tuple[int, int], boxes: Array
) -> None:
    """Write the texels whose centres triangles may cover.

    Parameters
    ----------
    corners : (n, 4) ndarray
        Projected vertices.
    cells : (n, 4) ndarray of int
        The texels that each lies between.
    faces : (m, 3) ndarray
        Vertices of each triangle.
    first, last : int
        First triangle and one past the last.
    size : tuple of 2 int
        Columns and rows of the map.
    boxes : (last - first, 4) ndarray
        First and last column, first and last row; first > last where a triangle covers nothing.

    Notes
    -----
    The loop over triangles is inside, because a call with arrays costs atomic reference counts, which threads share.
    """
    for face in range(first, last):
        i, j, k, place = faces[face, 0], faces[face, 1], faces[face, 2], face - first
        left, right = min(cells[i, 0], cells[j, 0], cells[k, 0]), max(cells[i, 1], cells[j, 1], cells[k, 1])
        top, bottom = min(cells[i, 2], cells[j, 2], cells[k, 2]), max(cells[i, 3], cells[j, 3], cells[k, 3])
        if left == BEHIND:
            w = corners[i, 2], corners[j, 2], corners[k, 2], corners[i, 2]
            low, high = _open_interval((corners[i, 0], corners[j, 0], corners[k, 0], corners[i, 0]), w)
            left, right = centres_between(low, high, size[0])
            low, high = _open_interval((corners[i, 1], corners[j, 1], corners[k, 1], corners[i, 1]), w)
            top, bottom = centres_between(low, high, size[1])
        if left > right or top > bottom:
            left, right, top, bottom = 1, 0, 1, 0
        boxes[place, 0], boxes[place, 1], boxes[place, 2], boxes[place, 3] = left, right, top, bottom


@kernel
def centres_between(low: float, high: float, size: int) -> tuple[int, int]:
    """Return the first and last texel whose centre lies in an interval, or a little outside it.

    Parameters
    ----------
    low, high : float
        The interval, continuous texel coordinates.
    size : int
        Texels in all.

    Returns
    -------
    tuple of 2 int
        Within 0 to `size` - 1; first > last where there is none.
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


@kernel
def edge(
    xj: float, yj: float, wj: float, xk: float, yk: float, wk: float, sign: float
) -> tuple[float, float, float, float]:
    """Return the edge function v_j x v_k and the value from which on a texel centre is inside.

    Parameters
    ----------
    xj, yj, wj, xk, yk, wk : float
        Column, row and w of the edge's two vertices.
    sign : float
        Sign of the triangle's determinant, 1 or -1.

    Returns
    -------
    tuple of 4 floats
        a, b, c of a x + b y + c, and the threshold.
    """
    xj, yj, xk, yk = xj * wj, yj * wj, xk * wk, yk * wk
    a = (yj * wk - yk * wj) * sign
    b = (xk * wj - xj * wk) * sign
    c = (xj * yk - xk * yj) * sign
    owns = a > 0.0 or (a == 0.0 and b > 0.0)
    return a, b, c, 0.0 if owns else SMALLEST


@kernel
def draw(corners: Array, faces: Array, part: Part, nearness: Array, ids: Array) -> None:
    """Write nearness and id of triangles where each is the nearest so far; ties stay with the earlier one.

    Parameters
    ----------
    corners : (n, 4) ndarray
        Projected vertices.
    faces : (m, 3) ndarray
        Vertices of each triangle.
    part : Part
        Which triangles, in which order, and where.
    nearness : (h, max(w, LANES)) ndarray
        Nearest so far, float32; 0 where nothing is.
    ids : (h, max(w, LANES)) ndarray
        Triangle id, int32.

    Notes
    -----
    The loop over triangles is inside, because a call with arrays costs atomic reference counts, which threads share.
    """
    width, members, boxes = nearness.shape[1], part.members, part.boxes
    setup = np.zeros(ROWS * BATCH)
    for base in range(part.start, part.stop, BATCH):
        count = min(BATCH, part.stop - base)
        _gather(corners, faces, members, base, count, setup)
        _set_up(setup, width)
        for b in range(count):
            face, limit = members[base + b], np.float32(setup[LIMIT + b])
            a0, b0, c0, t0 = setup[b], setup[BATCH + b], setup[2 * BATCH + b], setup[3 * BATCH + b]
            a1, b1, c1, t1 = setup[4 * BATCH + b], setup[5 * BATCH + b], setup[6 * BATCH + b], setup[7 * BATCH + b]
            a2, b2, c2, t2 = setup[8 * BATCH + b], setup[9 * BATCH + b], setup[10 * BATCH + b], setup[11 * BATCH + b]
            an, bn, cn = setup[12 * BATCH + b], setup[13 * BATCH + b], setup[14 * BATCH + b]
            place_of_box = face - part.base
            left, right = _integer(boxes[place_of_box, 0]), _integer(boxes[place_of_box, 1])
            upper, lower = _integer(boxes[place_of_box, 2]), _integer(boxes[place_of_box, 3])
            for row in range(max(upper, part.top), min(lower, part.bottom) + 1):
                y = row + 0.5
                r0, r1, r2, rn = b0 * y + c0, b1 * y + c1, b2 * y + c2, bn * y + cn
                first, last = left, right
                if last - first > SPAN_CUT:
                    first, last = _cut(first, last, a0, r0)
                    first, last = _cut(first, last, a1, r1)
                    first, last = _cut(first, last, a2, r2)
                for block in range((last - first + LANES) // LANES):
                    # a fixed number of lanes becomes straight SIMD code; those outside the span fail by themselves
                    start = min(first + block * LANES, width - LANES)
                    line, place_0, x0 = np.uint64(row), np.uint64(start), start + 0.5
                    for lane in range(LANES):
                        x, column = x0 + lane, place_0 + np.uint64(lane)
                        near = np.float32(an * x + rn)
                        inside = (a0 * x + r0 >= t0) & (a1 * x + r1 >= t1) & (a2 * x + r2 >= t2)
                        if inside & (near > nearness[line, column]) & (near <= limit):
                            nearness[line, column] = near
                            ids[line, column] = face


@kernel
def _gather(corners: Array, faces: Array, members: Array, base: int, count: int, setup: Array) -> None:
    """Write the corners of some triangles: loads that wait for memory, many under way at once."""
    for b in range(count):
        face = members[base + b]
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        for c in range(4):
            setup[CORNERS + c * BATCH + b] = corners[i, c]
            setup[CORNERS + (4 + c) * BATCH + b] = corners[j, c]
            setup[CORNERS + (8 + c) * BATCH + b] = corners[k, c]


@kernel
def _set_up(setup: Array, width: int) -> None:
    """Write edges, plane of nearness and limit of a batch from its corners, in SIMD lanes."""
    for b in range(BATCH):
        at = CORNERS + b
        xi, yi, wi, ni = setup[at], setup[at + BATCH], setup[at + 2 * BATCH], setup[at + 3 * BATCH]
        xj, yj, wj, nj = setup[at + 4 * BATCH], setup[at + 5 * BATCH], setup[at + 6 * BATCH], setup[at + 7 * BATCH]
        xk, yk, wk, nk = setup[at + 8 * BATCH], setup[at + 9 * BATCH], setup[at + 10 * BATCH], setup[at + 11 * BATCH]
        det = ((xj - xi) * (yk - yi) - (xk - xi) * (yj - yi)) * (wi * wj * wk)
        sign = 1.0 if det > 0.0 else -1.0
        a0, b0, c0, t0 = edge(xj, yj, wj, xk, yk, wk, sign)
        a1, b1, c1, t1 = edge(xk, yk, wk, xi, yi, wi, sign)
        a2, b2, c2, t2 = edge(xi, yi, wi, xj, yj, wj, sign)
        scale = sign / det
        setup[b], setup[BATCH + b], setup[2 * BATCH + b], setup[3 * BATCH + b] = a0, b0, c0, t0
        setup[4 * BATCH + b], setup[5 * BATCH + b], setup[6 * BATCH + b], setup[7 * BATCH + b] = a1, b1, c1, t1
        setup[8 * BATCH + b], setup[9 * BATCH + b], setup[10 * BATCH + b], setup[11 * BATCH + b] = a2, b2, c2, t2
        setup[12 * BATCH + b] = (a0 * ni + a1 * nj + a2 * nk) * scale
        setup[13 * BATCH + b] = (b0 * ni + b1 * nj + b2 * nk) * scale
        setup[14 * BATCH + b] = (c0 * ni + c1 * nj + c2 * nk) * scale
        size = max(_size(xi, yi, wi, width), max(_size(xj, yj, wj, width), _size(xk, yk, wk, width)))
        # no area, or seen edge-on: nothing is near enough
        setup[LIMIT + b] = 1.0 / (NEAREST * size) if det != 0.0 else 0.0


@kernel
def _size(x: float, y: float, w: float, width: int) -> float:
    """Return about how far a corner is from the eye, whatever plane holds both."""
    return max(abs(w), max(abs(x * w), abs(y * w)) / width)


@kernel
def _integer(side: Any) -> Any:
    """Widen a side of a box: 16-bit and signed integers together would become floats."""
    return np.int64(side)


@kernel
def _cut(first: int, last: int, a: float, r: float) -> tuple[int, int]:
    """Shorten a span to where a x + r may be >= 0, with a texel to spare."""
    if a == 0.0:
        return (first, last) if r >= 0.0 else (first, first - 1)
    crossing = min(max(-r / a, first - 2.0), last + 2.0)
    if a > 0.0:
        return max(first, int(crossing) - 1), last
    return first, min(last, int(crossing) + 1)
