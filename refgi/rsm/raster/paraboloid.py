"""Exact rasterization of paraboloid maps: a texel is covered when its direction lies within the triangle's planes.

Straight edges are arcs on a paraboloid map, so the test is made in direction space. With vertices v_i in the map's
frame, n_i = v_j x v_k, and the texel's direction d = (2s, 2t, 1 - s^2 - t^2) of length 1 + s^2 + t^2:

- e_i = d . n_i = -n_z s^2 + 2 n_x s + (2 t n_y + (1 - t^2) n_z), along a row a quadratic in s,
- inside where all e_i have the sign of det(v); on a plane the sign of n's first component that is not zero decides,
- the hit is tau d with 1/tau = sum(e_i)/det, its distance tau (1 + s^2 + t^2).

Adjacent triangles get exactly negated n, so a texel on a shared edge belongs to exactly one.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.rsm.pool import plane
from refgi.rsm.raster.batch import EMPTY, key_of, unpack
from refgi.rsm.raster.paraboloid_batch import (
    ACROSS,
    BEHIND,
    BETWEEN_TEXELS,
    BOX,
    LIMIT,
    NEAR,
    NEARNESS,
    ROWS,
    SQUARE,
    STATE,
    bound_across,
    is_behind,
    orient,
    transform_chunk,
)
from refgi.rsm.raster.projection import Projection
from refgi.rsm.raster.triangle import CHUNK, LANES, SPAN_CUT, Chunks, chunks
from refgi.scene.cutouts import CutFaces
from refgi.scene.model import Geometry
from refgi.scene.texture.alpha import is_opaque, lent

Array = npt.NDArray[Any]


class Ignored(NamedTuple):
    """Which geometry near its centre each map ignores."""

    planes: Array  # (k,) float64, m: triangles whose plane passes nearer than this
    ball: Array  # (k,) float64, m: surfaces nearer than this, as if cut away


class CutChunks(NamedTuple):
    """Triangles that may have holes."""

    triangles: Chunks
    holes: CutFaces


def cut_chunks(geometry: Geometry) -> CutChunks | None:
    """Group the triangles that may have holes in chunks, None where there are none."""
    holes = geometry.cut
    return None if holes is None else CutChunks(chunks(geometry.vertices, geometry.faces[holes.face]), holes)


def draw_paraboloids(
    projection: Projection, vertices: Array, faces: Array, workers: int, nearness: Array, ids: Array,
    cut: CutChunks | None = None,
) -> None:
    """Draw triangles on every paraboloid map, inside the hemisphere's disc.

    `vertices` (n, 3): world space, m. `faces` (m, 3): vertices of each triangle. `workers`: threads; maps are assigned
    to them round-robin. `nearness` (H, W): float32, receives 1/tau; 0 where nothing is. `ids` (H, W): int32, receives
    the triangle's id, -1 where nothing is. `cut`: those that may have holes, which `faces` show nothing of.
    """
    _draw_maps(projection, chunks(vertices, faces), cut, _keys(projection, workers), nearness, ids)


def draw_distances(
    projection: Projection, triangles: Chunks, ignored: Ignored, workers: int, distance: Array,
    cut: CutChunks | None = None,
) -> tuple[Array, Array]:
    """Draw triangles on every paraboloid map and turn nearness into distance.

    `ignored`: what lies too near the centres to count. `workers`: threads; maps are assigned to them round-robin.
    `distance` (H, W): float32 or float64, of any content; receives the distance, m, inf where nothing is and outside
    the disc. Returns `nearest` (k,): float64: smallest distance on each map, m; inf where nothing is. `left_out` (k,):
    int64: triangles that reach into each map's hemisphere and are ignored for their planes or lie in its ball. `cut`:
    further triangles, that may have holes.
    """
    left_out, nearest = np.zeros(projection.maps, np.int64), np.full(projection.maps, np.inf)
    _draw_distances(projection, triangles, cut, ignored, _keys(projection, workers), distance, left_out, nearest)
    return nearest, left_out


def _keys(projection: Projection, workers: int) -> Array:
    """Return a row of keys for each worker: those of a map, with LANES columns more that nobody reads."""
    return plane((workers, projection.height * (projection.width + LANES)), np.int64)


@kernel(parallel=True)
def _draw_maps(
    projection: Projection, triangles: Chunks, cut: CutChunks | None, keys: Array, nearness: Array, ids: Array
) -> None:
    workers, height, width = len(keys), projection.height, projection.width
    for worker in prange(workers):
        setup, map_keys = np.zeros(ROWS * CHUNK), keys[worker]
        for m in range(worker, len(projection.origin), workers):
            rows = slice(m * height, (m + 1) * height)
            map_keys[:] = EMPTY
            draw(projection, m, triangles, None, (np.inf, 0.0), setup, None, map_keys)
            if cut is not None:
                draw(projection, m, cut.triangles, cut.holes, (np.inf, 0.0), setup, None, map_keys)
            unpack(map_keys, width, 0, height - 1, nearness[rows], ids[rows])
            clear_outside_disc(projection, nearness[rows], ids[rows])


@kernel(parallel=True)
def _draw_distances(
    projection: Projection, triangles: Chunks, cut: CutChunks | None, ignored: Ignored, keys: Array, distance: Array,
    left_out: Array, nearest: Array,
) -> None:
    workers, height = len(keys), projection.height
    for worker in prange(workers):
        setup, map_keys = np.zeros(ROWS * CHUNK), keys[worker]
        for m in range(worker, len(projection.origin), workers):
            shown = distance[m * height : (m + 1) * height]
            limits = 1.0 / (ignored.planes[m] * ignored.planes[m]), ignored.ball[m]
            map_keys[:] = 0
            left_out[m] = draw(projection, m, triangles, None, limits, setup, shown, map_keys)
            if cut is not None:
                left_out[m] += draw(projection, m, cut.triangles, cut.holes, limits, setup, shown, map_keys)
            nearest[m] = to_distance(projection, map_keys, shown)


@kernel
def clear_outside_disc(projection: Projection, nearness: Array, ids: Array) -> None:
    """Empty the texels beyond the hemisphere."""
    n, half = projection.width, projection.half[0]
    step = 2.0 * half / n
    for row in range(n):
        t = (row + 0.5) * step - half
        for column in range(n):
            s = (column + 0.5) * step - half
            if s * s + t * t > 1.0:
                nearness[row, column] = 0.0
                ids[row, column] = -1


@kernel
def to_distance(projection: Projection, keys: Array, distance: Array) -> float:
    """Write distances of a map from its keys, inf where there is no surface and outside the disc.

    Result: the smallest.
    """
    n, half, least = projection.width, projection.half[0], np.inf
    step, real, nearness = 2.0 * half / n, distance.dtype.type, keys.view(np.float64)
    for row in range(n):
        t = (row + 0.5) * step - half
        line, place = np.uint64(row), np.uint64(row * (n + LANES))
        for column in range(n):
            s = (column + 0.5) * step - half
            square = s * s + t * t
            # no surface: nearness 0, distance inf
            far = (1.0 + square) / nearness[place + np.uint64(column)]
            distance[line, np.uint64(column)] = real(far if square <= 1.0 else np.inf)
        for column in range(n):
            least = min(least, distance[row, column])
    return least


@kernel
def nearness_of(value: float, rounded: Array | None) -> Any:
    """Return 1/tau as it is kept: rounded to float32, or to the type of the distances that become of it."""
    if rounded is None:
        return np.float32(value)
    return np.float64(rounded.dtype.type(value))


@kernel
def key_at(near: Any, earliness: Any, rounded: Array | None) -> Any:
    """Return a number that is greater for the nearer triangle: with ids as `key_of`, else the bits of a float64."""
    if rounded is None:
        return key_of(near, earliness)
    kept = np.float64(near)
    return kept.view(np.int64)


@kernel
def draw(
    projection: Projection, m: int, triangles: Chunks, holes: CutFaces | None, limits: tuple[float, float],
    setup: Array, rounded: Array | None, keys: Array,
) -> int:
    """Keep the greatest key at each texel of one map; the loop is inside because calls with arrays count references.

    With `holes`, those of `triangles`, a mask is asked only where its triangle would be seen. `limits`: 1 / distance^2
    of planes, distance of hits that are ignored. `rounded`: distances that become of the keys; None where these hold
    ids as well. `keys` (n (n + LANES),). Result: how many triangles ahead are left out.
    """
    n, half = projection.width, projection.half[0]
    step, stride = 2.0 * half / n, n + LANES
    steepest, ball = limits
    nearest, within = 1.0 / ball, 1.0 / (ball * ball)
    origin, frame, corners, box = projection.origin, projection.frame, triangles.corners, triangles.box
    count = len(box) * CHUNK
    if holes is not None:
        table, uv, count = lent(holes.table), holes.uv, len(holes.face)
    view = (origin[m, 0], origin[m, 1], origin[m, 2], frame[m, 0, 0], frame[m, 0, 1], frame[m, 0, 2],
            frame[m, 1, 0], frame[m, 1, 1], frame[m, 1, 2], frame[m, 2, 0], frame[m, 2, 1], frame[m, 2, 2])  # fmt: skip
    left_out = 0
    for chunk in range(len(box)):
        if is_behind(box, chunk, view):
            continue
        transform_chunk(corners, chunk, view, half, n, ball, setup)
        orient(setup)
        for b in range(CHUNK):
            state, face = setup[STATE + b], chunk * CHUNK + b
            if state == BEHIND or face >= count:
                continue
            if state == NEAR or setup[SQUARE + b] > steepest:  # its plane lies 1/sqrt of this from the centre
                left_out += 1
                continue
            if state == BETWEEN_TEXELS or (state == ACROSS and not bound_across(setup, b, half, n)):
                continue
            if holes is None:
                earliness = EMPTY - np.int64(face)
            else:
                earliness, mask = EMPTY - np.int64(holes.face[face]), holes.mask[face]
            limit = key_at(nearness_of(setup[LIMIT + b], rounded), EMPTY, rounded)
            x0, y0, z0, t0 = setup[b], setup[CHUNK + b], setup[2 * CHUNK + b], setup[3 * CHUNK + b]
            x1, y1, z1, t1 = setup[4 * CHUNK + b], setup[5 * CHUNK + b], setup[6 * CHUNK + b], setup[7 * CHUNK + b]
            x2, y2, z2, t2 = setup[8 * CHUNK + b], setup[9 * CHUNK + b], setup[10 * CHUNK + b], setup[11 * CHUNK + b]
            at = NEARNESS + b
            xn, yn, zn = setup[at], setup[at + CHUNK], setup[at + 2 * CHUNK]
            cut_short = nearest if setup[SQUARE + b] > within else np.inf
            at = BOX + b
            first, last = int(setup[at]), int(setup[at + CHUNK])
            for row in range(int(setup[at + 2 * CHUNK]), int(setup[at + 3 * CHUNK]) + 1):
                t = (row + 0.5) * step - half
                rest = 1.0 - t * t
                r0, r1, r2 = 2.0 * t * y0 + rest * z0, 2.0 * t * y1 + rest * z1, 2.0 * t * y2 + rest * z2
                rn = 2.0 * t * yn + rest * zn
                left, right, length = first, last, 1.0 + t * t
                if last - first > SPAN_CUT:
                    left, right = shorten(left, right, x0, z0, r0, step, 0.5 * (n - 1))
                    left, right = shorten(left, right, x1, z1, r1, step, 0.5 * (n - 1))
                    left, right = shorten(left, right, x2, z2, r2, step, 0.5 * (n - 1))
                place, centre = np.uint64(row * stride + left), left + 0.5
                if holes is None:
                    # a multiple of LANES is SIMD code without a rest; lanes outside the triangle fail by themselves
                    for lane in range((right - left + LANES) & -LANES):
                        at_texel = place + np.uint64(lane)
                        s = (centre + np.int32(lane)) * step - half
                        near = nearness_of((2.0 * xn - zn * s) * s + rn, rounded)
                        key, before = key_at(near, earliness, rounded), keys[at_texel]
                        inside = (
                            ((2.0 * x0 - z0 * s) * s + r0 >= t0)
                            & ((2.0 * x1 - z1 * s) * s + r1 >= t1)
                            & ((2.0 * x2 - z2 * s) * s + r2 >= t2)
                        )
                        far_enough = (key <= limit) & (near <= (length + s * s) * cut_short)
                        keys[at_texel] = key if inside & far_enough & (key > before) else before
                else:
                    for lane in range(right - left + 1):
                        at_texel = place + np.uint64(lane)
                        s = (centre + lane) * step - half
                        near = nearness_of((2.0 * xn - zn * s) * s + rn, rounded)
                        key = key_at(near, earliness, rounded)
                        e0, e1 = (2.0 * x0 - z0 * s) * s + r0, (2.0 * x1 - z1 * s) * s + r1
                        e2 = (2.0 * x2 - z2 * s) * s + r2
                        far_enough = (key <= limit) & (near <= (length + s * s) * cut_short)
                        inside = (e0 >= t0) & (e1 >= t1) & (e2 >= t2)
                        if inside & far_enough & (key > keys[at_texel]):
                            scale = 1.0 / (e0 + e1 + e2)
                            u = (e0 * uv[face, 0] + e1 * uv[face, 2] + e2 * uv[face, 4]) * scale
                            v = (e0 * uv[face, 1] + e1 * uv[face, 3] + e2 * uv[face, 5]) * scale
                            if is_opaque(table, mask, u, v):
                                keys[at_texel] = key
    return left_out


@kernel
def shorten(
    first: int, last: int, nx: float, nz: float, rest: float, step: float, middle: float
) -> tuple[int, int]:
    """Shorten a span to where -n_z s^2 + 2 n_x s + rest may be >= 0, with a texel to spare."""
    square = nx * nx + nz * rest
    if square < 0.0:
        return (first, last) if nz < 0.0 else (first, first - 1)
    q = nx + math.copysign(math.sqrt(square), nx)
    if q == 0.0:
        return first, last
    one, other = q / (nz + 0.0) / step + middle, -rest / q / step + middle  # roots, as columns; nz + 0.0 is never -0.0
    low = min(max(min(one, other), first - 2.0), last + 2.0)
    high = min(max(max(one, other), first - 2.0), last + 2.0)
    if nz >= 0.0:  # between the roots
        return max(first, int(low) - 1), min(last, int(high) + 2)
    if low < first - 1.0:  # outside them: to the right
        return max(first, int(high) - 1), last
    if high > last + 1.0:
        return first, min(last, int(low) + 2)
    return first, last
