"""Where a perspective or orthographic map sees clusters of triangles, and what hides them exactly.

A triangle's keys are bounded by its nearest corner only where rounding is little beside its size. With u = 2^-53,
columns and rows up to S, w up to W and |n| up to N, an edge function errs by at most 34 u S^2 W^2, |det| by 56 u S^2
W^3, and the products whose sum is nearness by 200 u S^2 W^2 N / |det|. A triangle is sound where

    |det| >= 1024 u S^2 W^2 max(W, N / n) / SLACK,    n: nearness of the cluster's nearest corner.

Barycentric coordinates of a texel that counts as inside are then above -0.034 SLACK, so its nearness is at most
(1 + SLACK) n; and a texel a thousandth beside a triangle of at most three columns or rows never counts as inside.
What is seen almost edge-on or has almost no area is not sound.

|det| is the volume of the triangle and the eye (of one thing of unit depth where rays are parallel) times what the map
has of texels in a unit of its image plane: bounded from planes in float32, without projecting a vertex.
"""

from typing import NamedTuple

import numpy as np

from refgi.jit import kernel, prange
from refgi.rsm.raster.batch import EMPTY, key_of
from refgi.rsm.raster.projection import ORTHOGRAPHIC, Projection, view_coordinates
from refgi.scene.triangles import Clusters
from refgi.types import Array

SLACK = 1e-3  # share by which a sound triangle's nearness may exceed its nearest corner's
ROUNDING = 2.0**-53
PLANE_ERROR = 4e-7  # of a plane in float32, relative to the product of two edges and its distance
IN_FRONT = 1e-6  # share of its distance from the eye that a cluster's w must exceed
NEVER = np.int64(0x7FFFFFFFFFFFFFFF)  # key that nothing exceeds


class Placed(NamedTuple):
    """Where a map sees each cluster, and what may hide it."""

    rect: Array  # (c, 4) int32: first and last column, first and last row; first > last: nowhere
    nearest: Array  # (c,) float64: nearness that no corner exceeds; inf where one may lie in the plane of the eye
    key: Array  # (c,) int64: keys that sound triangles of the cluster stay below
    least_det: Array  # (c,) float64: |det| of a sound triangle
    ahead: Array  # (c, 4) float64: what a triangle's plane is multiplied by to give its volume: det without the map
    least_volume: Array  # (c,) float64: |volume|, as rounded, of a triangle that is certainly sound


def place(projection: Projection, clusters: Clusters) -> Placed:
    """Find where the one map of a projection sees clusters."""
    count = len(clusters.box)
    placed = Placed(np.empty((count, 4), np.int32), np.empty(count), np.empty(count, np.int64), np.empty(count),
                    np.empty((count, 4)), np.empty(count))
    _place(projection, clusters, placed)
    return placed


@kernel(parallel=True)
def _place(projection: Projection, clusters: Clusters, placed: Placed) -> None:
    width, height, parallel = projection.width, projection.height, projection.kind == ORTHOGRAPHIC
    for c in prange(len(clusters.box)):
        left, right, top, bottom = np.inf, -np.inf, np.inf, -np.inf
        least_w, most_w, near, reach = np.inf, -np.inf, 0.0, 0.0
        for corner in range(8):
            x, y, depth = _corner(projection, clusters.box, c, corner)
            reach = max(reach, abs(x) + abs(y) + abs(depth))
            w = 1.0 if parallel else depth
            near = max(near, 1.0 - depth / projection.reach if parallel else 1.0 / depth)
            least_w, most_w = min(least_w, w), max(most_w, w)
            x = (x / w / projection.half[0] + 1.0) * (0.5 * width)
            y = (y / w / projection.half[1] + 1.0) * (0.5 * height)
            left, right, top, bottom = min(left, x), max(right, x), min(top, y), max(bottom, y)
        rect = placed.rect[c]
        if least_w <= IN_FRONT * reach and not parallel:
            behind = most_w < -IN_FRONT * reach
            rect[0], rect[1], rect[2], rect[3] = 0, -1 if behind else width - 1, 0, height - 1
            placed.nearest[c], placed.key[c] = np.inf, NEVER
            placed.least_det[c], placed.least_volume[c] = np.inf, np.inf
            placed.ahead[c, :] = 0.0
            continue
        size, share = max(abs(left), abs(right), abs(top), abs(bottom), width, height), reach / least_w
        # the rounding of a projected vertex, several times over
        error = 64.0 * ROUNDING * share * (1.0 + share)
        error_x, error_y = error * (width / projection.half[0] + size), error * (height / projection.half[1] + size)
        rect[0] = np.int32(min(max(np.ceil(left - error_x - 0.51), 0.0), width))
        rect[1] = np.int32(max(min(np.floor(right + error_x - 0.49), width - 1.0), -1.0))
        rect[2] = np.int32(min(max(np.ceil(top - error_y - 0.51), 0.0), height))
        rect[3] = np.int32(max(min(np.floor(bottom + error_y - 0.49), height - 1.0), -1.0))
        most_n = 1.0 + reach / projection.reach
        known = near > 1e-6 * most_n
        placed.nearest[c] = near
        placed.key[c] = key_of(near * (1.0 + 2.0 * SLACK), EMPTY) if known else NEVER
        least_det = 1024.0 * ROUNDING * size * size * most_w * most_w / SLACK * max(most_w, most_n / near)
        placed.least_det[c] = least_det if known else np.inf
        _bound_volume(projection, clusters, c, 16.0 * size * (error_x + error_y) * most_w**3, placed)


@kernel
def _corner(projection: Projection, box: Array, c: int, corner: int) -> tuple[float, float, float]:
    """Return a corner of a cluster's box in the map's frame."""
    x, y, z = box[c, 3 * (corner & 1)], box[c, 1 + 3 * ((corner >> 1) & 1)], box[c, 2 + 3 * (corner >> 2)]
    return view_coordinates(projection, 0, x, y, z)


@kernel
def _bound_volume(projection: Projection, clusters: Clusters, c: int, error: float, placed: Placed) -> None:
    """Write what a cluster's planes are multiplied by, and from which volume on a triangle is sound.

    `error`: of |det|, by the rounding of vertices.
    """
    box, ahead, reach, parallel = clusters.box, placed.ahead, 0.0, projection.kind == ORTHOGRAPHIC
    for axis in range(3):
        offset = 0.5 * (box[c, axis] + box[c, 3 + axis]) - projection.origin[0, axis]
        ahead[c, axis] = projection.frame[0, 2, axis] if parallel else offset
        reach += abs(ahead[c, axis]) + box[c, 3 + axis] - box[c, axis]
    ahead[c, 3] = 0.0 if parallel else 1.0
    texels = 0.25 * projection.width * projection.height / (projection.half[0] * projection.half[1])
    rounding = (PLANE_ERROR * clusters.product[c] + 1e-44) * reach  # 1e-44: float32 has no smaller steps
    placed.least_volume[c] = (2.0 * placed.least_det[c] + error) / texels + rounding


@kernel
def is_hidden(placed: Placed, c: int, top: int, bottom: int, stride: int, keys: Array) -> bool:
    """Return whether all keys of a cluster's texels in a band are greater than those of its sound triangles."""
    rect, least = placed.rect, placed.key[c]
    left, right = int(rect[c, 0]), int(rect[c, 1])
    for row in range(max(int(rect[c, 2]), top), min(int(rect[c, 3]), bottom) + 1):
        lowest, start = NEVER, np.uint64((row - top) * stride + left)
        for i in range(right - left + 1):
            lowest = min(lowest, keys[start + np.uint64(i)])
        if lowest <= least:
            return False
    return True


@kernel
def is_sound(plane: Array, first: int, last: int, placed: Placed, c: int) -> bool:
    """Return whether a cluster's triangles, `first` to `last` - 1 of all, are certainly sound."""
    dx, dy, dz, share = placed.ahead[c, 0], placed.ahead[c, 1], placed.ahead[c, 2], placed.ahead[c, 3]
    least, unsound = placed.least_volume[c], 0
    for b in range(last - first):
        at = np.uint64(first) + np.uint64(b)
        volume = plane[0, at] * dx + plane[1, at] * dy + plane[2, at] * dz + plane[3, at] * share
        unsound += not abs(volume) >= least  # what is not a number is unsound
    return unsound == 0


def list_clusters(rect: Array, order: Array, rows: int, bands: int) -> tuple[Array, Array]:
    """List the clusters of each band of `rows` rows, in the order given: where each band's begin, and all of them.

    `rect` (c, 4): texels that each cluster may cover. `order` (c,): all clusters. Result: (bands + 1,) and (...) int32.
    """
    seen = order[(rect[order, 0] <= rect[order, 1]) & (rect[order, 2] <= rect[order, 3])]
    first, count = rect[seen, 2] // rows, rect[seen, 3] // rows - rect[seen, 2] // rows + 1
    band = np.repeat(first - np.cumsum(count) + count, count) + np.arange(count.sum())
    members = np.repeat(seen, count)[np.argsort(band.astype(np.uint16), kind="stable")]
    return np.append(0, np.cumsum(np.bincount(band, minlength=bands))), members.astype(np.int32)
