"""Clusters drawn on perspective and orthographic maps: what the keys hide is passed over, small triangles in SIMD lanes.

A cluster's vertices are projected side by side, and its triangles are bounded, by each band of rows that it reaches.
Those that may cover up to 2 x 2 texels are drawn one a lane, at the corners of their box; all others row by row.

Both that and passing over what is hidden rely on edge functions that are right up to little beside the triangle's size.
With u = 2^-53, columns and rows up to S and w up to W, an edge function errs by at most 64 u S^2 W^2, so the computed
nearness of a texel that counts as inside exceeds that of the nearest corner by at most 512 u S^2 W^2 N / |det| and a
share, N the greatest |n|. Triangles whose |det| lies below a bound made of this (`Placed.least_det`), seen edge-on or
almost without area, are drawn row by row wherever their boxes say.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.jit.borrowed import borrowed
from refgi.rsm.raster.batch import (
    BATCH,
    CORNERS,
    EMPTY,
    Part,
    DET,
    FOUR,
    SIDES,
    STEP,
    THREE,
    TWO,
    draw_rows,
    key_of,
    ROWS as ROWS_ALL,
    set_up,
)
from refgi.rsm.raster.projection import ORTHOGRAPHIC, Projection, view_coordinates
from refgi.rsm.raster.triangle import BEHIND, BOX_PAD, LANES, SMALLEST_W, crossing_box
from refgi.scene.clusters import CLUSTER, Clusters

Array = npt.NDArray[Any]

SMALL = 2  # columns and rows of a box whose triangle is drawn in a lane
SLACK = 1e-3  # by how much a sound triangle's nearness may exceed its nearest corner's
ROUNDING = 2.0**-53
PLANE_ERROR = 4e-7  # of a plane in float32, relative to the product of two edges
NOT_DRAWN, IN_LANES, BY_ROWS = np.int32(0), np.int32(1), np.int32(2)
FIVE = np.uint64(5)
MOST = 3 * CLUSTER + LANES  # vertices of a cluster, and lanes beyond them
NEVER = np.int64(0x7FFFFFFFFFFFFFFF)  # key that nothing exceeds
# where a worker's numbers start: columns, rows, w and n of a cluster's vertices
COLUMN, ROW, W, N, PLACES = 0, MOST, 2 * MOST, 3 * MOST, 4 * MOST


class Placed(NamedTuple):
    """Where a map sees each cluster, and what may hide it."""

    rect: Array  # (c, 4) int32: first and last column, first and last row; first > last: nowhere
    nearest: Array  # (c,) float64: nearness that no corner exceeds; inf where one may lie in the plane of the eye
    key: Array  # (c,) int64: keys that sound triangles of the cluster stay below
    least_det: Array  # (c,) float64: |det| of a sound triangle
    ahead: Array  # (c, 4) float64: what a triangle's plane is multiplied by to give its volume: det without the map
    least_volume: Array  # (c,) float64: |volume|, as rounded, of a triangle that is certainly sound


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
                 np.zeros(CLUSTER + 1, np.int32), np.zeros(CLUSTER + 1, np.int32), np.zeros(ROWS_ALL * BATCH),
                 np.zeros(4 * BATCH, np.int64))


@kernel(parallel=True)
def place_clusters(projection: Projection, m: int, clusters: Clusters, placed: Placed) -> None:
    """Fill `placed` with where map `m` sees clusters."""
    box = clusters.box
    width, height = projection.width, projection.height
    for c in prange(len(box)):
        left, right, top, bottom = np.inf, -np.inf, np.inf, -np.inf
        least_w, most_w, near, reach = np.inf, -np.inf, 0.0, 0.0
        for corner in range(8):
            px = box[c, 3 * (corner & 1)]
            py, pz = box[c, 1 + 3 * ((corner >> 1) & 1)], box[c, 2 + 3 * (corner >> 2)]
            x, y, depth = view_coordinates(projection, m, px, py, pz)
            reach = max(reach, abs(x) + abs(y) + abs(depth))
            parallel = projection.kind == ORTHOGRAPHIC
            w = 1.0 if parallel else depth
            near = max(near, 1.0 - depth / projection.reach if parallel else 0.0)
            least_w, most_w = min(least_w, w), max(most_w, w)
            x = (x / w / projection.half[0] + 1.0) * (0.5 * width)
            y = (y / w / projection.half[1] + 1.0) * (0.5 * height)
            left, right, top, bottom = min(left, x), max(right, x), min(top, y), max(bottom, y)
        rect = placed.rect[c]
        if projection.kind != ORTHOGRAPHIC and least_w <= 1e-6 * reach:
            behind = most_w < -1e-6 * reach
            rect[0], rect[1], rect[2], rect[3] = 0, -1 if behind else width - 1, 0, height - 1
            placed.nearest[c], placed.key[c], placed.least_det[c] = np.inf, NEVER, np.inf
            continue
        # the rounding of a projected vertex, many times over
        share = reach / least_w
        pad = 16.0 * ROUNDING * share * (1.0 + share)
        size = max(abs(left), abs(right), abs(top), abs(bottom), width, height)
        pad_x, pad_y = pad * width / projection.half[0], pad * height / projection.half[1]
        pad_x, pad_y = 0.01 + pad_x + 1e-12 * size, 0.01 + pad_y + 1e-12 * size
        rect[0] = np.int32(min(max(np.ceil(left - pad_x - 0.5), 0.0), width))
        rect[1] = np.int32(max(min(np.floor(right + pad_x - 0.5), width - 1.0), -1.0))
        rect[2] = np.int32(min(max(np.ceil(top - pad_y - 0.5), 0.0), height))
        rect[3] = np.int32(max(min(np.floor(bottom + pad_y - 0.5), height - 1.0), -1.0))
        most_n = 1.0
        if projection.kind == ORTHOGRAPHIC:
            most_n = 1.0 + reach / projection.reach
        else:
            near = 1.0 / least_w
        placed.nearest[c] = near
        known = near > 1e-6 * most_n
        placed.key[c] = key_of(near * (1.0 + 2.0 * SLACK), EMPTY) if known else NEVER
        error = 1024.0 * ROUNDING * size * size * most_w * most_w / SLACK
        placed.least_det[c] = error * max(most_w, most_n / near) if known else np.inf
        _write_volume(projection, m, clusters, c, placed)


@kernel
def _write_volume(projection: Projection, m: int, clusters: Clusters, c: int, placed: Placed) -> None:
    """Write what a cluster's planes are multiplied by, and the least volume of a sound triangle with the rounding."""
    box, ahead, diagonal, distance = clusters.box, placed.ahead, 0.0, 0.0
    parallel = projection.kind == ORTHOGRAPHIC
    for axis in range(3):
        offset = 0.5 * (box[c, axis] + box[c, 3 + axis]) - projection.origin[m, axis]
        ahead[c, axis] = projection.frame[m, 2, axis] if parallel else offset
        distance += abs(ahead[c, axis])
        diagonal += box[c, 3 + axis] - box[c, axis]
    ahead[c, 3] = 0.0 if parallel else 1.0
    texels = 0.25 * projection.width * projection.height / (projection.half[0] * projection.half[1])
    reach = distance + diagonal
    placed.least_volume[c] = 2.0 * placed.least_det[c] / texels + PLANE_ERROR * clusters.product[c] * reach + 1e-44 * reach


@kernel
def draw_clusters(
    projection: Projection, m: int, clusters: Clusters, placed: Placed, members: Array, band: Any, passing: bool,
    local: Local, keys: Array,
) -> None:
    """Keep the greatest key at each texel of a band of rows.

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
    for member in range(len(members)):
        c = members[member]
        first, last = c * CLUSTER, min((c + 1) * CLUSTER, len(clusters.face))
        # all its triangles are sound, so that what is seen there hides them
        if passing and is_hidden(placed, c, top, bottom, stride, keys):
            if is_sound(plane, first, last, placed, c):
                continue
        project_cluster(projection, m, vertex, clusters.start[c], clusters.start[c + 1], place)
        bound_cluster(projection, corner, first, last - first, band, place, setup, boxes)
        if placed.nearest[c] == np.inf:
            bound_crossing(projection, corner, first, last - first, band, place, boxes)
        few, many = list_cluster(last - first, boxes, small, large)
        if few > 0:
            gather_small(corner, first, few, place, boxes, small, setup)
            set_up(setup, few, projection.width)
            evaluate_small(few, setup, found)
            many = merge_small(face, first, few, many, boxes, small, large, placed.least_det[c], setup, found, top,
                               stride, keys)
        if many > 0:
            gather_places(corner, first, many, place, large, setup)
            set_up(setup, many, projection.width)
            part = Part(large, 0, many, local.boxes[: 4 * CLUSTER].reshape(4, CLUSTER).T, 0, top, bottom)
            draw_rows(setup, part, 0, many, face[first:last], projection.width, None, keys)


@kernel
def is_hidden(placed: Placed, c: int, top: int, bottom: int, stride: int, keys: Array) -> bool:
    """Return whether all keys of a cluster's texels in a band are greater than those that it may have."""
    rect, least = placed.rect, placed.key[c]
    left, right = np.int64(rect[c, 0]), np.int64(rect[c, 1])
    for row in range(max(np.int64(rect[c, 2]), top), min(np.int64(rect[c, 3]), bottom) + 1):
        lowest, place = NEVER, np.uint64((row - top) * stride + left)
        for i in range(right - left + 1):
            lowest = min(lowest, keys[place + np.uint64(i)])
        if lowest <= least:
            return False
    return True


@kernel
def is_sound(plane: Array, first: int, last: int, placed: Placed, c: int) -> bool:
    """Return whether |det| of each triangle of a cluster is certainly that of a sound one."""
    dx, dy, dz, share = placed.ahead[c, 0], placed.ahead[c, 1], placed.ahead[c, 2], placed.ahead[c, 3]
    least, unsound = placed.least_volume[c], 0
    for b in range(last - first):
        at = np.uint64(first) + np.uint64(b)
        volume = plane[0, at] * dx + plane[1, at] * dy + plane[2, at] * dz + plane[3, at] * share
        unsound += not abs(volume) >= least  # of what is not a number as well
    return unsound == 0


@kernel
def project_cluster(projection: Projection, m: int, vertex: Array, first: int, last: int, place: Array) -> None:
    """Write a cluster's vertices as `project_vertices` does, in SIMD lanes."""
    width, height = projection.width, projection.height
    half_x, half_y, parallel = projection.half[0], projection.half[1], projection.kind == ORTHOGRAPHIC
    for lane in range((last - first + LANES - 1) & -LANES):
        i, at = np.uint64(first) + np.uint64(lane), np.uint64(lane)
        x, y, depth = view_coordinates(projection, m, vertex[0, i], vertex[1, i], vertex[2, i])
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
        at, to = np.uint64(first) + np.uint64(b), np.uint64(CORNERS) + np.uint64(b)
        i, j, k = np.uint64(corner[at, 0]), np.uint64(corner[at, 1]), np.uint64(corner[at, 2])
        setup[to], setup[to + STEP] = place[i], place[i + np.uint64(ROW)]
        setup[to + STEP * TWO], setup[to + STEP * THREE] = place[j], place[j + np.uint64(ROW)]
        setup[to + STEP * FOUR], setup[to + STEP * FIVE] = place[k], place[k + np.uint64(ROW)]
    width, height = float(projection.width), float(projection.height)
    top, bottom = float(band[0]), float(band[1])
    for lane in range((count + LANES - 1) & -LANES):
        b, at = np.uint64(lane), np.uint64(CORNERS) + np.uint64(lane)
        xi, xj, xk = setup[at], setup[at + STEP * TWO], setup[at + STEP * FOUR]
        yi, yj, yk = setup[at + STEP], setup[at + STEP * THREE], setup[at + STEP * FIVE]
        # `centres_between` in float64, which holds the same whole numbers
        left = np.ceil(min(max(min(xi, min(xj, xk)), 0.0), width + 1.0) - (0.5 + BOX_PAD))
        right = np.floor(min(max(max(xi, max(xj, xk)), -1.0), width) + (BOX_PAD - 0.5))
        upper = np.ceil(min(max(min(yi, min(yj, yk)), 0.0), height + 1.0) - (0.5 + BOX_PAD))
        lower = np.floor(min(max(max(yi, max(yj, yk)), -1.0), height) + (BOX_PAD - 0.5))
        left, right, upper, lower = max(left, 0.0), min(right, width - 1.0), max(upper, top), min(lower, bottom)
        boxes[b], boxes[b + STEP] = np.int32(left), np.int32(right)
        boxes[b + STEP * TWO], boxes[b + STEP * THREE] = np.int32(upper), np.int32(lower)
        there = (left <= right) & (upper <= lower)
        tiny = (right - left < SMALL) & (lower - upper < SMALL)
        boxes[b + STEP * FOUR] = (IN_LANES if tiny else BY_ROWS) if there else NOT_DRAWN


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
        a0, b0, c0, t0 = setup[b], setup[b + STEP], setup[b + STEP * TWO], setup[b + STEP * THREE]
        at = b + STEP * FOUR
        a1, b1, c1, t1 = setup[at], setup[at + STEP], setup[at + STEP * TWO], setup[at + STEP * THREE]
        at += STEP * FOUR
        a2, b2, c2, t2 = setup[at], setup[at + STEP], setup[at + STEP * TWO], setup[at + STEP * THREE]
        at += STEP * FOUR
        an, bn, cn = setup[at], setup[at + STEP], setup[at + STEP * TWO]
        nearest = key_of(setup[at + STEP * THREE], EMPTY)
        at = b + np.uint64(SIDES)
        for line in range(2):
            y = setup[at + STEP * (TWO + np.uint64(line))]
            r0, r1, r2, rn = b0 * y + c0, b1 * y + c1, b2 * y + c2, bn * y + cn
            for end in range(2):
                x = setup[at + STEP * np.uint64(end)]
                key = key_of(an * x + rn, 0)
                inside = (a0 * x + r0 >= t0) & (a1 * x + r1 >= t1) & (a2 * x + r2 >= t2) & (key <= nearest)
                found[b + STEP * np.uint64(2 * line + end)] = key if inside else -1


@kernel
def merge_small(
    face: Array, first: int, few: int, many: int, boxes: Array, small: Array, large: Array, least_det: float,
    setup: Array, found: Array, top: int, stride: int, keys: Array,
) -> int:
    """Keep the greater keys; append triangles that are unsound to those drawn row by row, and return their number."""
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
