"""Clusters drawn on perspective and orthographic maps: hidden ones passed over, small triangles in SIMD lanes.

A cluster's vertices are projected side by side, and its triangles are bounded, by each band of rows that it reaches.
Those that may cover up to 2 x 2 texels are drawn one a lane, at the corners of their box; all others row by row.

Clusters that are hidden and triangles in lanes must be sound (`placed_clusters`): of others a texel beside the triangle
may count as inside, so they are drawn row by row, by the code of maps without clusters.
"""

from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel
from refgi.jit.dispatch import borrowed
from refgi.rsm.raster.batch import (
    BATCH,
    CORNERS,
    DET,
    EMPTY,
    ROWS,
    SIDES,
    STEP,
    Part,
    draw_rows,
    key_of,
    set_up,
)
from refgi.rsm.raster.placed_clusters import Placed, is_hidden, is_sound
from refgi.rsm.raster.projection import ORTHOGRAPHIC, Projection, view_coordinates
from refgi.rsm.raster.triangle import BOX_PAD, LANES, SMALLEST_W, crossing_box
from refgi.scene.triangles import CLUSTER, Clusters
from refgi.types import Array

SMALL = 2  # columns and rows of a box whose triangle is drawn in a lane
NOT_DRAWN, IN_LANES, BY_ROWS = np.int32(0), np.int32(1), np.int32(2)
MOST = 3 * CLUSTER + LANES  # vertices of a cluster, and lanes beyond them
# where a worker's numbers start: columns, rows, w and n of a cluster's vertices
COLUMN, ROW, W, N, PLACES = 0, MOST, 2 * MOST, 3 * MOST, 4 * MOST


class Local(NamedTuple):
    """Scratch arrays of a worker for one cluster at a time."""

    place: Array  # (PLACES,) float64: projected vertices
    boxes: Array  # (5 CLUSTER,) int32: first and last column and row that each may cover in the band; how it is drawn
    small: Array  # (CLUSTER + 1,) int32: triangles drawn in lanes, as places in the cluster
    large: Array  # (CLUSTER + 1,) int32: triangles drawn row by row
    setup: Array  # (ROWS BATCH,) float64
    found: Array  # (4 BATCH,) int64: keys at the four corners of small boxes


@kernel
def local_scratch() -> Local:
    """Allocate scratch arrays of a worker."""
    return Local(np.zeros(PLACES), np.zeros(5 * CLUSTER, np.int32),
                 np.zeros(CLUSTER + 1, np.int32), np.zeros(CLUSTER + 1, np.int32), np.zeros(ROWS * BATCH),
                 np.zeros(4 * BATCH, np.int64))


@kernel
def draw_clusters(
    projection: Projection, clusters: Clusters, placed: Placed, members: Array, band: Any, passing: bool,
    local: Local, keys: Array,
) -> int:
    """Keep the greatest key at each texel of a band of rows, and return how many clusters are passed over.

    `members` (n,) int32: clusters to draw, the nearest first. `band`: first and last row. `passing`: pass over what is
    hidden. `keys`: as `draw` has them.
    """
    top, bottom = band
    stride = projection.width + LANES
    keys, place, boxes = borrowed(keys), borrowed(local.place), borrowed(local.boxes)
    small, large = borrowed(local.small), borrowed(local.large)
    setup, found = borrowed(local.setup), borrowed(local.found)
    face, corner, vertex = borrowed(clusters.face), borrowed(clusters.corner), borrowed(clusters.vertex)
    plane = borrowed(clusters.plane)
    passed = 0
    for member in range(len(members)):
        c = members[member]
        first, last = c * CLUSTER, min((c + 1) * CLUSTER, len(clusters.face))
        if passing and is_hidden(placed, c, top, bottom, stride, keys) and is_sound(plane, first, last, placed, c):
            passed += 1
            continue
        project_cluster(projection, vertex, clusters.start[c], clusters.start[c + 1], place)
        bound_cluster(projection, corner, first, last - first, band, place, setup, boxes)
        if placed.nearest[c] == np.inf:
            bound_crossing(projection, corner, first, last - first, band, place, boxes)
        few, many = list_cluster(last - first, boxes, small, large)
        if few > 0:
            gather_small(corner, first, few, place, boxes, small, setup)
            set_up(setup, few, projection.width)
            evaluate_small(few, setup, found)
            lent = Local(place, boxes, small, large, setup, found)
            many = merge_small(face, first, few, many, lent, placed.least_det[c], top, stride, keys)
        if many > 0:
            gather_places(corner, first, many, place, large, setup)
            set_up(setup, many, projection.width)
            part = Part(large, 0, many, local.boxes[: 4 * CLUSTER].reshape(4, CLUSTER).T, 0, top, bottom)
            draw_rows(setup, part, 0, many, face[first:last], projection.width, None, keys)
    return passed


@kernel
def project_cluster(projection: Projection, vertex: Array, first: int, last: int, place: Array) -> None:
    """Write a cluster's vertices as `project_vertices` does, in SIMD lanes."""
    width, height = projection.width, projection.height
    half_x, half_y, parallel = projection.half[0], projection.half[1], projection.kind == ORTHOGRAPHIC
    for lane in range((last - first + LANES - 1) & -LANES):
        i, at = np.uint64(first) + np.uint64(lane), np.uint64(lane)
        x, y, depth = view_coordinates(projection, 0, vertex[0, i], vertex[1, i], vertex[2, i])
        w = 1.0 if parallel else (SMALLEST_W if abs(depth) < SMALLEST_W else depth)
        place[at] = (x / w / half_x + 1.0) * (0.5 * width)
        place[at + np.uint64(ROW)] = (y / w / half_y + 1.0) * (0.5 * height)
        place[at + np.uint64(W)] = w
        place[at + np.uint64(N)] = 1.0 - depth / projection.reach if parallel else 1.0


@kernel
def bound_cluster(
    projection: Projection, corner: Array, first: int, count: int, band: Any, place: Array, setup: Array, boxes: Array
) -> None:
    """Write the texels of a band that a cluster's triangles in front of the eye may cover, and how to draw them."""
    for b in range(count):
        own, to = np.uint64(first) + np.uint64(b), np.uint64(CORNERS) + np.uint64(b)
        i, j, k = np.uint64(corner[own, 0]), np.uint64(corner[own, 1]), np.uint64(corner[own, 2])
        setup[to], setup[to + STEP[1]] = place[i], place[i + np.uint64(ROW)]
        setup[to + STEP[2]], setup[to + STEP[3]] = place[j], place[j + np.uint64(ROW)]
        setup[to + STEP[4]], setup[to + STEP[5]] = place[k], place[k + np.uint64(ROW)]
    width, height = float(projection.width), float(projection.height)
    top, bottom = float(band[0]), float(band[1])
    for lane in range((count + LANES - 1) & -LANES):
        to, at = np.uint64(lane), np.uint64(CORNERS) + np.uint64(lane)
        xi, xj, xk = setup[at], setup[at + STEP[2]], setup[at + STEP[4]]
        yi, yj, yk = setup[at + STEP[1]], setup[at + STEP[3]], setup[at + STEP[5]]
        # `centres_between` in float64, which holds the same whole numbers
        left = np.ceil(min(max(min(xi, min(xj, xk)), 0.0), width + 1.0) - (0.5 + BOX_PAD))
        right = np.floor(min(max(max(xi, max(xj, xk)), -1.0), width) + (BOX_PAD - 0.5))
        upper = np.ceil(min(max(min(yi, min(yj, yk)), 0.0), height + 1.0) - (0.5 + BOX_PAD))
        lower = np.floor(min(max(max(yi, max(yj, yk)), -1.0), height) + (BOX_PAD - 0.5))
        left, right, upper, lower = max(left, 0.0), min(right, width - 1.0), max(upper, top), min(lower, bottom)
        boxes[to], boxes[to + STEP[1]] = np.int32(left), np.int32(right)
        boxes[to + STEP[2]], boxes[to + STEP[3]] = np.int32(upper), np.int32(lower)
        there = (left <= right) & (upper <= lower)
        tiny = (right - left < SMALL) & (lower - upper < SMALL)
        boxes[to + STEP[4]] = (IN_LANES if tiny else BY_ROWS) if there else NOT_DRAWN


@kernel
def bound_crossing(
    projection: Projection, corner: Array, first: int, count: int, band: Any, place: Array, boxes: Array
) -> None:
    """Bound those that are not all in front of the eye; all of the cluster's are drawn row by row."""
    for b in range(count):
        at = first + b
        w = place[corner[at, 0] + W], place[corner[at, 1] + W], place[corner[at, 2] + W]
        if w[0] > 0.0 and w[1] > 0.0 and w[2] > 0.0:
            boxes[4 * BATCH + b] = NOT_DRAWN if boxes[4 * BATCH + b] == NOT_DRAWN else BY_ROWS
            continue
        left, right, upper, lower = _crossing(projection, corner, at, place)
        upper, lower = max(upper, band[0]), min(lower, band[1])
        boxes[b], boxes[BATCH + b], boxes[2 * BATCH + b], boxes[3 * BATCH + b] = left, right, upper, lower
        boxes[4 * BATCH + b] = BY_ROWS if left <= right and upper <= lower else NOT_DRAWN


@kernel
def list_cluster(count: int, boxes: Array, small: Array, large: Array) -> tuple[int, int]:
    """List triangles by how they are drawn, and return how many are in each list."""
    few, many = 0, 0
    for b in range(count):
        kind = boxes[np.uint64(4 * BATCH) + np.uint64(b)]
        small[few], large[many] = b, b
        few += kind == IN_LANES
        many += kind == BY_ROWS
    return few, many


@kernel
def _crossing(projection: Projection, corner: Array, at: int, place: Array) -> Any:
    i, j, k = corner[at, 0], corner[at, 1], corner[at, 2]
    left, right, top, bottom = crossing_box(
        (place[i], place[j], place[k], place[i]),
        (place[i + ROW], place[j + ROW], place[k + ROW], place[i + ROW]),
        (place[i + W], place[j + W], place[k + W], place[i + W]), (projection.width, projection.height))
    return left, right, top, bottom


@kernel
def gather_places(corner: Array, first: int, count: int, place: Array, chosen: Array, setup: Array) -> None:
    """Write the corners of some triangles of a cluster, as `gather` does."""
    for q in range(count):
        at, to = np.uint64(first + chosen[q]), np.uint64(CORNERS + q)
        i, j, k = np.uint64(corner[at, 0]), np.uint64(corner[at, 1]), np.uint64(corner[at, 2])
        for c in range(4):
            setup[to + np.uint64(c * BATCH)] = place[i + np.uint64(c * MOST)]
            setup[to + np.uint64((4 + c) * BATCH)] = place[j + np.uint64(c * MOST)]
            setup[to + np.uint64((8 + c) * BATCH)] = place[k + np.uint64(c * MOST)]


@kernel
def gather_small(
    corner: Array, first: int, count: int, place: Array, boxes: Array, small: Array, setup: Array
) -> None:
    """Write corners of triangles, and the centres of the first and last column and row of their boxes."""
    gather_places(corner, first, count, place, small, setup)
    for q in range(count):
        for side in range(4):
            setup[SIDES + side * BATCH + q] = boxes[side * BATCH + small[q]] + 0.5


@kernel
def evaluate_small(count: int, setup: Array, found: Array) -> None:
    """Write the keys at four corners of boxes, without the triangles' ids, below 0 outside; a triangle a lane."""
    for lane in range((count + LANES - 1) & -LANES):
        b = np.uint64(lane)
        a0, b0, c0, t0 = setup[b], setup[b + STEP[1]], setup[b + STEP[2]], setup[b + STEP[3]]
        at = b + STEP[4]
        a1, b1, c1, t1 = setup[at], setup[at + STEP[1]], setup[at + STEP[2]], setup[at + STEP[3]]
        at += STEP[4]
        a2, b2, c2, t2 = setup[at], setup[at + STEP[1]], setup[at + STEP[2]], setup[at + STEP[3]]
        at += STEP[4]
        an, bn, cn = setup[at], setup[at + STEP[1]], setup[at + STEP[2]]
        nearest = key_of(setup[at + STEP[3]], EMPTY)
        at = b + np.uint64(SIDES)
        for line in range(2):
            y = setup[at + np.uint64((2 + line) * BATCH)]
            r0, r1, r2, rn = b0 * y + c0, b1 * y + c1, b2 * y + c2, bn * y + cn
            for end in range(2):
                x = setup[at + np.uint64(end * BATCH)]
                key = key_of(an * x + rn, 0)
                inside = (a0 * x + r0 >= t0) & (a1 * x + r1 >= t1) & (a2 * x + r2 >= t2) & (key <= nearest)
                found[b + np.uint64((2 * line + end) * BATCH)] = key if inside else -1


@kernel
def merge_small(
    face: Array, first: int, few: int, many: int, local: Local, least_det: float, top: int, stride: int, keys: Array
) -> int:
    """Keep the greater keys; append triangles that are unsound to those drawn row by row, and return their number."""
    _, boxes, small, large, setup, found = local
    for q in range(few):
        b = small[q]
        det = abs(setup[DET + q])
        if (det < least_det) & (det != 0.0):
            large[many] = b
            many += 1
            continue
        earliness = EMPTY - np.int64(face[first + b])
        left, right = np.int64(boxes[b]), np.int64(boxes[1 * BATCH + b])
        upper, lower = (np.int64(boxes[2 * BATCH + b]) - top) * stride, (np.int64(boxes[3 * BATCH + b]) - top) * stride
        at = np.uint64(upper + left)
        keys[at] = max(keys[at], found[q] | earliness)
        at = np.uint64(upper + right)
        keys[at] = max(keys[at], found[BATCH + q] | earliness)
        at = np.uint64(lower + left)
        keys[at] = max(keys[at], found[2 * BATCH + q] | earliness)
        at = np.uint64(lower + right)
        keys[at] = max(keys[at], found[3 * BATCH + q] | earliness)
    return many
