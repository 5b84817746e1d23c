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
NEAREST = 1e-9  # share of a triangle's depth under which a hit is rounding: its plane holds the eye
BOX_PAD = 1e-3  # texels; far above the rounding of a projected vertex
SPAN_CUT = 32  # texels; narrower boxes are cheaper to test whole
LANES = 16  # texels tested at once; a map has at least as many columns in memory
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
def project_vertex(projection: Projection, m: int, vertices: Array, i: int, corners: Array) -> None:
    """Fill row `i` of `corners` with the vertex as seen on map `m`.

    Parameters
    ----------
    projection : Projection
        Perspective or orthographic maps.
    m : int
        Which map.
    vertices : (n, 3) ndarray
        World space, m.
    i : int
        Which vertex.
    corners : (n, 4) ndarray
        Column, row, w, n.
    """
    x, y, depth = view_coordinates(projection, m, vertices[i, 0], vertices[i, 1], vertices[i, 2])
    w, nearness = depth, 1.0
    if projection.kind == ORTHOGRAPHIC:
        w, nearness = 1.0, 1.0 - depth / projection.reach
    elif abs(w) < SMALLEST_W:
        w = SMALLEST_W
    corners[i, 0] = (x / w / projection.half[0] + 1.0) * (0.5 * projection.width)
    corners[i, 1] = (y / w / projection.half[1] + 1.0) * (0.5 * projection.height)
    corners[i, 2] = w
    corners[i, 3] = nearness


@kernel
def texel_box(corners: Array, i: int, j: int, k: int, width: int, height: int) -> tuple[int, int, int, int]:
    """Return the texels whose centres a triangle may cover.

    Parameters
    ----------
    corners : (n, 4) ndarray
        Projected vertices.
    i, j, k : int
        The triangle's vertices.
    width, height : int
        Size of the map, texels.

    Returns
    -------
    tuple of 4 int
        First and last column, first and last row; first > last where the triangle covers nothing.
    """
    if corners[i, 2] > 0.0 and corners[j, 2] > 0.0 and corners[k, 2] > 0.0:
        x0, x1, x2 = corners[i, 0], corners[j, 0], corners[k, 0]
        y0, y1, y2 = corners[i, 1], corners[j, 1], corners[k, 1]
        left, right = min(x0, min(x1, x2)), max(x0, max(x1, x2))
        top, bottom = min(y0, min(y1, y2)), max(y0, max(y1, y2))
    elif corners[i, 2] > 0.0 or corners[j, 2] > 0.0 or corners[k, 2] > 0.0:
        left, right = _open_interval(corners, i, j, k, 0)
        top, bottom = _open_interval(corners, i, j, k, 1)
    else:
        return 1, 0, 1, 0
    first_x, last_x = _centres_between(left, right, width)
    first_y, last_y = _centres_between(top, bottom, height)
    return first_x, last_x, first_y, last_y


@kernel
def _centres_between(low: float, high: float, size: int) -> tuple[int, int]:
    first = np.ceil(min(max(low, 0.0), size + 1.0) - (0.5 + BOX_PAD))
    last = np.floor(min(max(high, -1.0), float(size)) + (BOX_PAD - 0.5))
    return max(int(first), 0), min(int(last), size - 1)


@kernel
def _open_interval(corners: Array, i: int, j: int, k: int, axis: int) -> tuple[float, float]:
    """Return the range on one axis of the part in front of the eye: an edge through its plane goes to infinity."""
    low, high = np.inf, -np.inf
    ends = (i, j, k, i)
    for s in range(3):
        a, b = ends[s], ends[s + 1]
        wa, wb = corners[a, 2], corners[b, 2]
        if wa > 0.0:
            low, high = min(low, corners[a, axis]), max(high, corners[a, axis])
        if (wa > 0.0) != (wb > 0.0):
            # the sign of the coordinate times w where the edge meets the plane of the eye
            pa, pb = corners[a, axis] * wa, corners[b, axis] * wb
            meets = (pa * wb - pb * wa) * (1.0 if wa < 0.0 else -1.0)
            doubt = 1e-9 * (abs(pa * wb) + abs(pb * wa))
            if meets <= doubt:
                low = -np.inf
            if meets >= -doubt:
                high = np.inf
    return low, high


@kernel
def edge(corners: Array, j: int, k: int, sign: float) -> tuple[float, float, float, float]:
    """Return the edge function v_j x v_k and the value from which on a texel centre is inside.

    Parameters
    ----------
    corners : (n, 4) ndarray
        Projected vertices.
    j, k : int
        The edge's vertices.
    sign : float
        Sign of the triangle's determinant, 1 or -1.

    Returns
    -------
    tuple of 4 floats
        a, b, c of a x + b y + c, and the threshold.
    """
    wj, wk = corners[j, 2], corners[k, 2]
    xj, yj, xk, yk = corners[j, 0] * wj, corners[j, 1] * wj, corners[k, 0] * wk, corners[k, 1] * wk
    a = (yj * wk - yk * wj) * sign
    b = (xk * wj - xj * wk) * sign
    c = (xj * yk - xk * yj) * sign
    owns = a > 0.0 or (a == 0.0 and b > 0.0)
    return a, b, c, 0.0 if owns else SMALLEST


@kernel
def determinant(corners: Array, i: int, j: int, k: int) -> float:
    """Return det(v_i, v_j, v_k): twice the area on the map, in perspective times the three depths.

    Parameters
    ----------
    corners : (n, 4) ndarray
        Projected vertices.
    i, j, k : int
        The triangle's vertices.

    Returns
    -------
    float
        Zero where the triangle is seen edge-on or has no area.
    """
    x0, y0 = corners[i, 0], corners[i, 1]
    xj, yj, xk, yk = corners[j, 0] - x0, corners[j, 1] - y0, corners[k, 0] - x0, corners[k, 1] - y0
    return (xj * yk - xk * yj) * (corners[i, 2] * corners[j, 2] * corners[k, 2])


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
    width = nearness.shape[1]
    for place in range(part.start, part.stop):
        face = part.members[place]
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        det = determinant(corners, i, j, k)
        if det == 0.0:
            continue
        sign = 1.0 if det > 0.0 else -1.0
        a0, b0, c0, t0 = edge(corners, j, k, sign)
        a1, b1, c1, t1 = edge(corners, k, i, sign)
        a2, b2, c2, t2 = edge(corners, i, j, sign)
        n0, n1, n2, scale = corners[i, 3], corners[j, 3], corners[k, 3], sign / det
        an = (a0 * n0 + a1 * n1 + a2 * n2) * scale
        bn = (b0 * n0 + b1 * n1 + b2 * n2) * scale
        cn = (c0 * n0 + c1 * n1 + c2 * n2) * scale
        farthest = max(abs(corners[i, 2]), max(abs(corners[j, 2]), abs(corners[k, 2])))
        limit = np.float32(1.0 / (NEAREST * farthest))
        box = part.boxes[face - part.base]
        left, right = np.int64(box[0]), np.int64(box[1])
        for row in range(max(np.int64(box[2]), part.top), min(np.int64(box[3]), part.bottom) + 1):
            y = row + 0.5
            r0, r1, r2, rn = b0 * y + c0, b1 * y + c1, b2 * y + c2, bn * y + cn
            first, last = left, right
            if last - first > SPAN_CUT:
                first, last = _cut(first, last, a0, r0)
                first, last = _cut(first, last, a1, r1)
                first, last = _cut(first, last, a2, r2)
            for block in range((last - first + LANES) // LANES):
                # a fixed number of lanes becomes straight SIMD code; those outside the span fail the test by themselves
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
def _cut(first: int, last: int, a: float, r: float) -> tuple[int, int]:
    """Shorten a span to where a x + r may be >= 0, with a texel to spare."""
    if a == 0.0:
        return (first, last) if r >= 0.0 else (first, first - 1)
    crossing = min(max(-r / a, first - 2.0), last + 2.0)
    if a > 0.0:
        return max(first, int(crossing) - 1), last
    return first, min(last, int(crossing) + 1)
