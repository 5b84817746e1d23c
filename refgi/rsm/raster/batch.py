"""Batched triangle rasterization on perspective and orthographic maps, by edge functions with the top-left rule.

With vertices v_i = (column w, row w, w) and the texel centre (x, y, 1):

- edge function e_i = (x, y, 1) . (v_j x v_k) = a x + b y + c, barycentric coordinate b_i = e_i / sum(e),
- nearness = sum(e_i n_i) / det(v), that is 1/w in perspective, an affine function of (x, y) in both,
- texture coordinates u = sum(e_i u_i) / sum(e_i), which a mask is asked at.

The forward part of a triangle that crosses the plane of the eye is where all e_i have the sign of det. Adjacent
triangles compute exactly negated edges from the same two vertices (strict IEEE products commute), so a texel centre on
an edge belongs to exactly one of them: to the one that would own it after a shift of the sample by an infinitesimal to
the right, and a smaller one downwards (the top-left rule).
"""

from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel
from refgi.rsm.raster.triangle import LANES, SMALLEST, SPAN_CUT
from refgi.scene.texture.lookup import is_opaque, lent
from refgi.scene.triangles import CutFaces
from refgi.types import Array

IN_PLANE = 1e-7  # share of a triangle's size: a corner not farther from the plane through the eye is taken to lie in it
NEAREST = 1e-9  # share of a triangle's size under which a hit is rounding: its plane holds the eye
BATCH = 64  # triangles set up at once
EMPTY = 0xFFFFFFFF  # key of a texel where nothing is; others have nearness in the upper half, EMPTY - id in the lower
# where a batch's limits, corners and determinants start, then centres of boxes' sides; its rows in all
LIMIT, CORNERS, DET, SIDES, ROWS = 15 * BATCH, 16 * BATCH, 28 * BATCH, 29 * BATCH, 33
STEP = tuple(np.uint64(rows * BATCH) for rows in range(6))  # how far apart a batch's rows are


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
def edge(
    xj: float, yj: float, wj: float, xk: float, yk: float, wk: float, sign: float
) -> tuple[float, float, float, float]:
    """Return the edge function v_j x v_k and the value from which on a texel centre is inside.

    `xj`, `yj`, `wj`, `xk`, `yk`, `wk`: column, row and w of the edge's two vertices. `sign`: sign of the triangle's
    determinant, 1 or -1. Result: a, b, c of a x + b y + c, and the threshold.
    """
    xj, yj, xk, yk = xj * wj, yj * wj, xk * wk, yk * wk
    a = (yj * wk - yk * wj) * sign
    b = (xk * wj - xj * wk) * sign
    c = (xj * yk - xk * yj) * sign
    owns = a > 0.0 or (a == 0.0 and b > 0.0)
    return a, b, c, 0.0 if owns else SMALLEST


@kernel
def draw(corners: Array, faces: Array, part: Part, width: int, holes: CutFaces | None, keys: Array) -> None:
    """Keep the greatest key at each texel: of the nearest triangle, of the earliest one where several are as near.

    `corners` (n, 4): projected vertices. `faces` (m, 3): vertices of each triangle. `part`: which triangles and where.
    `width`: columns of the map. `holes`: ids, coordinates and masks of `faces`, where these may have holes. `keys`
    ((bottom - top + 1) (width + LANES),): keys so far, `EMPTY` where nothing is.

    A mask is asked only where its triangle would be seen. The greatest key does not depend on the order, so triangles
    with holes may be drawn after all others.

    The loop over triangles is inside, because a call with arrays costs atomic reference counts, which threads share.
    """
    setup = np.zeros(ROWS * BATCH)
    for base in range(part.start, part.stop, BATCH):
        count = min(BATCH, part.stop - base)
        gather(corners, faces, part.members, base, count, setup)
        set_up(setup, count, width)
        draw_rows(setup, part, base, count, None, width, holes, keys)


@kernel
def draw_rows(
    setup: Array, part: Part, base: int, count: int, ids: Array | None, width: int, holes: CutFaces | None, keys: Array
) -> None:
    """Draw a batch that is set up, row by row.

    `base`: first of its `count` members of `part`. `ids`: triangle that a member stands for; itself where absent.
    """
    members, boxes, stride = part.members, part.boxes, width + LANES
    if holes is not None:
        table, uv = lent(holes.table), holes.uv
    for b in range(count):
        face = members[base + b]
        if holes is None:
            earliness = EMPTY - np.int64(face if ids is None else ids[face])
        else:
            earliness = EMPTY - np.int64(holes.face[face])
            mask = holes.mask[face]
        nearest = key_of(setup[LIMIT + b], EMPTY)
        a0, b0, c0, t0 = setup[b], setup[BATCH + b], setup[2 * BATCH + b], setup[3 * BATCH + b]
        a1, b1, c1, t1 = setup[4 * BATCH + b], setup[5 * BATCH + b], setup[6 * BATCH + b], setup[7 * BATCH + b]
        a2, b2, c2, t2 = setup[8 * BATCH + b], setup[9 * BATCH + b], setup[10 * BATCH + b], setup[11 * BATCH + b]
        an, bn, cn = setup[12 * BATCH + b], setup[13 * BATCH + b], setup[14 * BATCH + b]
        place_of_box = face - part.base
        left, right = integer(boxes[place_of_box, 0]), integer(boxes[place_of_box, 1])
        upper, lower = integer(boxes[place_of_box, 2]), integer(boxes[place_of_box, 3])
        for row in range(max(upper, part.top), min(lower, part.bottom) + 1):
            y = row + 0.5
            r0, r1, r2, rn = b0 * y + c0, b1 * y + c1, b2 * y + c2, bn * y + cn
            first, last = left, right
            if last - first > SPAN_CUT:
                first, last = shorten(first, last, a0, r0)
                first, last = shorten(first, last, a1, r1)
                first, last = shorten(first, last, a2, r2)
            place, x0 = np.uint64((row - part.top) * stride + first), first + 0.5
            if holes is None:
                # a multiple of LANES is SIMD code without a rest; lanes outside the triangle fail by themselves
                for lane in range((last - first + LANES) & -LANES):
                    at, x = place + np.uint64(lane), x0 + np.int32(lane)
                    key, before = key_of(an * x + rn, earliness), keys[at]
                    inside = (a0 * x + r0 >= t0) & (a1 * x + r1 >= t1) & (a2 * x + r2 >= t2)
                    keys[at] = key if inside & (key <= nearest) & (key > before) else before
            else:
                for column in range(first, last + 1):
                    x, at = column + 0.5, np.uint64((row - part.top) * stride + column)
                    key, e0, e1, e2 = key_of(an * x + rn, earliness), a0 * x + r0, a1 * x + r1, a2 * x + r2
                    if (e0 >= t0) & (e1 >= t1) & (e2 >= t2) & (key <= nearest) & (key > keys[at]):
                        scale = 1.0 / (e0 + e1 + e2)
                        u = (e0 * uv[face, 0] + e1 * uv[face, 2] + e2 * uv[face, 4]) * scale
                        v = (e0 * uv[face, 1] + e1 * uv[face, 3] + e2 * uv[face, 5]) * scale
                        if is_opaque(table, mask, u, v):
                            keys[at] = key


@kernel
def unpack(keys: Array, width: int, top: int, bottom: int, nearness: Array, ids: Array) -> None:
    """Write nearness (h, w) float32 and triangle ids (h, w) int32 of rows `top` to `bottom` from their keys."""
    bits = nearness.view(np.int32)
    for row in range(top, bottom + 1):
        line, place = np.uint64(row), np.uint64((row - top) * (width + LANES))
        for x in range(width):
            key, column = keys[place + np.uint64(x)], np.uint64(x)
            bits[line, column] = key >> 32
            ids[line, column] = EMPTY - (key & EMPTY) if key > EMPTY else -1


@kernel
def key_of(near: float, earliness: Any) -> Any:
    """Return a number that is greater for the nearer triangle, then for the earlier one; negative behind the eye.

    Nearness is rounded to float32, of which positive numbers have the order of their bits.
    """
    rounded = np.float32(near)
    return (np.int64(rounded.view(np.int32)) << 32) | earliness


@kernel
def gather(corners: Array, faces: Array, members: Array, base: int, count: int, setup: Array) -> None:
    """Write the corners of some triangles: loads that wait for memory, many under way at once."""
    for b in range(count):
        face = members[base + b]
        i, j, k = faces[face, 0], faces[face, 1], faces[face, 2]
        for c in range(4):
            setup[CORNERS + c * BATCH + b] = corners[i, c]
            setup[CORNERS + (4 + c) * BATCH + b] = corners[j, c]
            setup[CORNERS + (8 + c) * BATCH + b] = corners[k, c]


@kernel
def set_up(setup: Array, count: int, width: int) -> None:
    """Write edges, plane of nearness, limit and determinant of `count` triangles from their corners, in SIMD lanes."""
    for lane in range((count + LANES - 1) & -LANES):
        b = np.uint64(lane)
        at = b + np.uint64(CORNERS)
        xi, yi, wi, ni = setup[at], setup[at + STEP[1]], setup[at + STEP[2]], setup[at + STEP[3]]
        at += STEP[4]
        xj, yj, wj, nj = setup[at], setup[at + STEP[1]], setup[at + STEP[2]], setup[at + STEP[3]]
        at += STEP[4]
        xk, yk, wk, nk = setup[at], setup[at + STEP[1]], setup[at + STEP[2]], setup[at + STEP[3]]
        size = max(_size(xi, yi, wi, width), max(_size(xj, yj, wj, width), _size(xk, yk, wk, width)))
        det = ((xj - xi) * (yk - yi) - (xk - xi) * (yj - yi)) * (wi * wj * wk)
        # a corner i near the plane of the eye is far away on the map: its digits would hide the other corners'
        det = det if abs(wi) > IN_PLANE * size else _volume(xi, yi, wi, xj, yj, wj, xk, yk, wk)
        sign = 1.0 if det > 0.0 else -1.0
        a0, b0, c0, t0 = edge(xj, yj, wj, xk, yk, wk, sign)
        a1, b1, c1, t1 = edge(xk, yk, wk, xi, yi, wi, sign)
        a2, b2, c2, t2 = edge(xi, yi, wi, xj, yj, wj, sign)
        scale = sign / det
        setup[b], setup[b + STEP[1]], setup[b + STEP[2]], setup[b + STEP[3]] = a0, b0, c0, t0
        at = b + STEP[4]
        setup[at], setup[at + STEP[1]], setup[at + STEP[2]], setup[at + STEP[3]] = a1, b1, c1, t1
        at += STEP[4]
        setup[at], setup[at + STEP[1]], setup[at + STEP[2]], setup[at + STEP[3]] = a2, b2, c2, t2
        at += STEP[4]
        setup[at] = (a0 * ni + a1 * nj + a2 * nk) * scale
        setup[at + STEP[1]] = (b0 * ni + b1 * nj + b2 * nk) * scale
        setup[at + STEP[2]] = (c0 * ni + c1 * nj + c2 * nk) * scale
        # no area, or seen edge-on: nothing is near enough
        limit = 1.0 / (NEAREST * size)
        setup[at + STEP[3]] = limit if (det != 0.0) & (limit > 0.0) else 0.0
        setup[b + np.uint64(DET)] = det


@kernel
def _volume(
    xi: float, yi: float, wi: float, xj: float, yj: float, wj: float, xk: float, yk: float, wk: float
) -> float:
    """Return v_i . (v_j x v_k) of corners as projected, v = (x w, y w, w)."""
    xi, yi, xj, yj, xk, yk = xi * wi, yi * wi, xj * wj, yj * wj, xk * wk, yk * wk
    return xi * (yj * wk - yk * wj) + yi * (xk * wj - xj * wk) + wi * (xj * yk - xk * yj)


@kernel
def _size(x: float, y: float, w: float, width: int) -> float:
    """Return about how far a corner is from the eye, whatever plane holds both."""
    return max(abs(w), max(abs(x * w), abs(y * w)) / width)


@kernel
def integer(side: Any) -> Any:
    """Widen a side of a box: 16-bit and signed integers together would become floats."""
    return np.int64(side)


@kernel
def shorten(first: int, last: int, a: float, r: float) -> tuple[int, int]:
    """Shorten a span to where a x + r may be >= 0, with a texel to spare."""
    if a == 0.0:
        return (first, last) if r >= 0.0 else (first, first - 1)
    crossing = min(max(-r / a, first - 2.0), last + 2.0)
    if a > 0.0:
        return max(first, int(crossing) - 1), last
    return first, min(last, int(crossing) + 1)
