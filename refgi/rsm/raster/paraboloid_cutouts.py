"""Cut-outs on paraboloid maps: triangles with holes, drawn on each map after all others."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.rsm.raster.paraboloid import CutChunks, Ignored, clear_outside_disc, draw, shorten, to_distance
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
from refgi.rsm.raster.triangle import CHUNK, SPAN_CUT, Chunks
from refgi.scene.texture.alpha import is_opaque, lent

Array = npt.NDArray[Any]


@kernel(parallel=True)
def draw_maps(
    projection: Projection, triangles: Chunks, cut: CutChunks, ignored: Ignored, nearness: Array, ids: Array,
    scratch: Array, left_out: Array, nearest: Array,
) -> None:
    """Draw on every map the triangles without holes, then `cut`; else as `refgi.rsm.raster.paraboloid` does."""
    workers, height, with_ids = len(scratch), projection.height, len(ids) > 0
    corners, box = triangles.corners, triangles.box
    for worker in prange(workers):
        setup = np.zeros(ROWS * CHUNK)
        for m in range(worker, len(projection.origin), workers):
            first, last = m * height, (m + 1) * height
            map_nearness, map_ids = nearness[first:last], ids[first:last] if with_ids else scratch[worker]
            map_nearness[:] = 0
            limits = 1.0 / (ignored.planes[m] * ignored.planes[m]), ignored.ball[m]
            left_out[m] = draw(projection, m, corners, box, limits, setup, map_nearness, map_ids)
            left_out[m] += _draw_cut(projection, m, cut, limits, setup, map_nearness, map_ids)
            if with_ids:
                clear_outside_disc(projection, map_nearness, map_ids)
            else:
                nearest[m] = to_distance(projection, map_nearness)


@kernel
def _draw_cut(
    projection: Projection, m: int, cut: CutChunks, limits: tuple[float, float], setup: Array, nearness: Array,
    ids: Array,
) -> int:
    """Draw every triangle that may have holes on one map, where it is there and nearest, of equals the first."""
    n, half = projection.width, projection.half[0]
    corners, box, holes, count = cut.chunks.corners, cut.chunks.box, cut.holes, len(cut.holes.face)
    step, real = 2.0 * half / n, nearness.dtype.type
    steepest, ball = limits
    nearest, within = 1.0 / ball, 1.0 / (ball * ball)
    origin, frame, uv, table = projection.origin, projection.frame, holes.uv, lent(holes.table)
    view = (origin[m, 0], origin[m, 1], origin[m, 2], frame[m, 0, 0], frame[m, 0, 1], frame[m, 0, 2],
            frame[m, 1, 0], frame[m, 1, 1], frame[m, 1, 2], frame[m, 2, 0], frame[m, 2, 1], frame[m, 2, 2])  # fmt: skip
    left_out = 0
    for chunk in range(len(box)):
        if is_behind(box, chunk, view):
            continue
        transform_chunk(corners, chunk, view, half, n, ball, setup)
        orient(setup)
        for b in range(CHUNK):
            state, k = setup[STATE + b], chunk * CHUNK + b
            if state == BEHIND or k >= count:
                continue
            if state == NEAR or setup[SQUARE + b] > steepest:
                left_out += 1
                continue
            if state == BETWEEN_TEXELS or (state == ACROSS and not bound_across(setup, b, half, n)):
                continue
            face, mask, limit = holes.face[k], holes.mask[k], real(setup[LIMIT + b])
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
                for column in range(left, right + 1):
                    s = (column + 0.5) * step - half
                    near, before = real((2.0 * xn - zn * s) * s + rn), nearness[row, column]
                    e0, e1 = (2.0 * x0 - z0 * s) * s + r0, (2.0 * x1 - z1 * s) * s + r1
                    e2 = (2.0 * x2 - z2 * s) * s + r2
                    far_enough = (near <= limit) & (near <= (length + s * s) * cut_short)
                    is_first = (near > before) | ((near == before) & (face < ids[row, column]))
                    if (e0 >= t0) & (e1 >= t1) & (e2 >= t2) & far_enough & is_first:
                        scale = 1.0 / (e0 + e1 + e2)
                        u = (e0 * uv[k, 0] + e1 * uv[k, 2] + e2 * uv[k, 4]) * scale
                        v = (e0 * uv[k, 1] + e1 * uv[k, 3] + e2 * uv[k, 5]) * scale
                        if is_opaque(table, mask, u, v):
                            nearness[row, column] = near
                            ids[row, column] = face
    return left_out
