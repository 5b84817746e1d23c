"""Texels of paraboloid maps: those of small triangles with triangles in SIMD lanes, others a row at a time.

A small triangle covers one texel of a few, of which a row would fill no lanes and whose loop would cost more than they
do: each of the few is tested for all triangles of a batch together.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.jit import kernel
from refgi.rsm.raster.batch import EMPTY, key_of
from refgi.rsm.raster.paraboloid_batch import (
    ACROSS,
    AHEAD,
    BEHIND,
    BETWEEN_TEXELS,
    BOX,
    KINDS,
    LIMIT,
    NEAR,
    NEARNESS,
    ROWS,
    SQUARE,
    STATE,
    bound_across,
)
from refgi.rsm.raster.triangle import CHUNK, LANES, SPAN_CUT
from refgi.scene.texture.lookup import is_opaque, lent
from refgi.scene.triangles import CutFaces
from refgi.types import Array


class Scratch(NamedTuple):
    """What one thread works with."""

    setup: Array  # (ROWS CHUNK,) float64: a batch of triangles
    members: Array  # (KINDS, 2 CHUNK) int32: triangles of each kind that are to be drawn
    waiting: Array  # (KINDS,) int64: how many
    kind: Array  # (CHUNK,) int32: of the triangles of a chunk
    drawn: Array  # (CHUNK + 1,) int32: those that may cover a texel
    hits: Array  # (CHUNK,) int64: keys of a batch
    places: Array  # (CHUNK,) int32: and where


@kernel
def scratch() -> Scratch:
    """Allocate what one thread works with."""
    return Scratch(
        np.zeros(ROWS * CHUNK), np.zeros((KINDS, 2 * CHUNK), np.int32), np.zeros(KINDS, np.int64),
        np.zeros(CHUNK, np.int32), np.zeros(CHUNK + 1, np.int32), np.zeros(CHUNK, np.int64),
        np.zeros(CHUNK, np.int32))  # fmt: skip


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
def draw_texels(
    n: int, half: float, members: Array, size: int, side: int, ball: float, work: Scratch, rounded: Array | None,
    keys: Array,
) -> None:
    """Draw triangles ahead that cover no more than `side` x `side` texels, of which `size` are set up.

    `n`: texels along a side of the map. `half`: its half extent. `members`: the triangles. `ball`: hits nearer than
    this are ignored, m. `rounded`, `keys`: as in `draw`.
    """
    setup, hits, places = work.setup, work.hits, work.places
    step, stride = 2.0 * half / n, np.int32(n + LANES)
    nearest, within = 1.0 / ball, 1.0 / (ball * ball)
    for place in range(side * side):
        down, right = float(place // side), float(place % side)
        for b in range(CHUNK):
            x0, y0, z0, t0 = setup[b], setup[CHUNK + b], setup[2 * CHUNK + b], setup[3 * CHUNK + b]
            x1, y1, z1, t1 = setup[4 * CHUNK + b], setup[5 * CHUNK + b], setup[6 * CHUNK + b], setup[7 * CHUNK + b]
            x2, y2, z2, t2 = setup[8 * CHUNK + b], setup[9 * CHUNK + b], setup[10 * CHUNK + b], setup[11 * CHUNK + b]
            at = NEARNESS + b
            xn, yn, zn = setup[at], setup[at + CHUNK], setup[at + 2 * CHUNK]
            at = BOX + b
            # a texel beyond the box is its last one once more
            column = max(min(setup[at] + right, setup[at + CHUNK]), 0.0)
            row = max(min(setup[at + 2 * CHUNK] + down, setup[at + 3 * CHUNK]), 0.0)
            s, t = (column + 0.5) * step - half, (row + 0.5) * step - half
            rest, length = 1.0 - t * t, 1.0 + t * t
            rn = 2.0 * t * yn + rest * zn
            near = nearness_of((2.0 * xn - zn * s) * s + rn, rounded)
            key = key_at(near, EMPTY - np.int64(members[b]), rounded)
            limit = key_at(nearness_of(setup[LIMIT + b], rounded), EMPTY, rounded)
            inside = (
                ((2.0 * x0 - z0 * s) * s + (2.0 * t * y0 + rest * z0) >= t0)
                & ((2.0 * x1 - z1 * s) * s + (2.0 * t * y1 + rest * z1) >= t1)
                & ((2.0 * x2 - z2 * s) * s + (2.0 * t * y2 + rest * z2) >= t2)
            )
            cut_short = nearest if setup[SQUARE + b] > within else np.inf
            far_enough = (key <= limit) & (near <= (length + s * s) * cut_short)
            hits[b] = key if inside & far_enough & (setup[STATE + b] == AHEAD) else np.int64(-1)
            places[b] = np.int32(row) * stride + np.int32(column)
        for b in range(size):
            texel = np.uint64(places[b])
            keys[texel] = max(keys[texel], hits[b])


@kernel
def draw_rows(
    n: int, half: float, members: Array, size: int, holes: CutFaces | None, limits: tuple[float, float], work: Scratch,
    rounded: Array | None, keys: Array,
) -> int:
    """Draw triangles of which `size` are set up, a row of texels at a time; parameters and result as in `draw`.

    The loop is inside because calls with arrays count references.
    """
    setup, step, stride = work.setup, 2.0 * half / n, n + LANES
    steepest, ball = limits
    nearest, within = 1.0 / ball, 1.0 / (ball * ball)
    if holes is not None:
        table, uv, known = lent(holes.table), holes.uv, len(holes.face)
    left_out = 0
    for b in range(size):
        state, face = setup[STATE + b], members[b]
        if state == BEHIND or (holes is not None and face >= known):
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
                    s = (centre + np.int32(lane)) * step - half
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
