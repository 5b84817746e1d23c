"""Which triangles of its chunks a paraboloid map is drawn from: those that may cover the centre of a texel.

Most triangles of a dense mesh fall between the texels of a map. A chunk keeps its corners in float32 as well, measured
from the least corner of its box: bounds of these tell so from half of the memory, in twice as many SIMD lanes. What
they leave in doubt is set up in float64, so that no number on the map comes from float32.

Rounding: let R be the largest distance of a point of the chunk's box from the centre of the map. A coordinate of a
corner v in the map's frame is off by less than E = 15 2^-24 R: of which rounding corners and centre takes 3, their
difference 1, by sqrt(3) for three coordinates, the frame 2 and the sum of three products 5. Where z >= 0, |v| + z is
|v| at least, so that s and t are off by less than 3 E / |v|, at most 6 E / (|v| + z), and some roundings of their own.
"""

import math
from typing import Any

import numpy as np

from refgi.jit import kernel
from refgi.rsm.raster.paraboloid_batch import is_behind
from refgi.rsm.raster.triangle import BOX_PAD, CHUNK, Chunks
from refgi.types import Array

KINDS = 4  # triangles that cover up to 1, 2 and 4 texels along a side; last ANY
ANY = KINDS - 1
DOUBT = 2.0**-19  # times R: E, and as much to spare
CLOSE = 256.0  # times E: |v| + z up to which float32 says nothing
LEAST, MOST = 1e-6, 1e12  # values of R whose cubes float32 holds, m
BULGE, SHORT = 0.131, 0.039  # `bulge` and up to which squared length it holds, with something to spare


@kernel
def next_batch(
    triangles: Chunks, chunk: int, view: Any, half: float, size: int, ball: float, small: bool, work: Any
) -> int:
    """Add triangles to those that wait to be drawn, until a batch of a kind is full or no chunk is left.

    `chunk`: the next chunk. `view`: centre of the map, then its frame, row by row. `half`: half extent of the map.
    `size`: texels along a side. `ball`: triangles all nearer than this are kept, m. `small`: whether small triangles
    are kinds of their own. `work`: Scratch. Result: the chunk after those taken.
    """
    corners, box = triangles.corners, triangles.box
    members, waiting, kind, drawn = work.members, work.waiting, work.kind, work.drawn
    while chunk < len(box):
        full = False
        for i in range(KINDS):
            full |= waiting[i] >= CHUNK
        if full:
            break
        if is_behind(box, chunk, view):
            chunk += 1
            continue
        kind[:] = ANY
        far = _farthest(box, chunk, view)
        if LEAST < far < MOST and ball < MOST:
            sort_chunk(corners, box, chunk, view, half, size, ball, far, kind)
        count = 0
        for b in range(CHUNK):
            drawn[count] = b
            count += kind[b] < KINDS
        for i in range(count):
            b = drawn[i]
            found = kind[b] if small else ANY
            members[found, waiting[found]] = chunk * CHUNK + b
            waiting[found] += 1
        chunk += 1
    return chunk


@kernel
def _farthest(box: Array, chunk: int, view: Any) -> float:
    """Return the largest distance of a chunk's box from the centre of a map, m."""
    x = max(view[0] - box[chunk, 0], box[chunk, 3] - view[0])
    y = max(view[1] - box[chunk, 1], box[chunk, 4] - view[1])
    z = max(view[2] - box[chunk, 2], box[chunk, 5] - view[2])
    return math.sqrt(x * x + y * y + z * z)


@kernel
def sort_chunk(
    corners: Array, box: Array, chunk: int, view: Any, half: float, size: int, ball: float, far: float, kind: Array
) -> None:
    """Write of which kind the triangles of a chunk are; KINDS for those that certainly cover no centre of a texel.

    `corners` (c, 9, CHUNK) float32: corners less the least corner of the chunk's box, m. `far`: R, m. `kind` (CHUNK,):
    int32. Other parameters as in `next_batch`.
    """
    real = np.float32
    ox, oy, oz = real(view[0] - box[chunk, 0]), real(view[1] - box[chunk, 1]), real(view[2] - box[chunk, 2])
    rx, ry, rz = real(view[3]), real(view[4]), real(view[5])
    dx, dy, dz = real(view[6]), real(view[7]), real(view[8])
    fx, fy, fz = real(view[9]), real(view[10]), real(view[11])
    texels, texel, doubt = real(0.5 * size / half), real(2.0 * half / size), real(DOUBT * far)
    padding = real(2.0 * BOX_PAD + 1e-5 * size)
    middle, last, close = real(0.5 * size - 0.5), real(size - 1.0), real(CLOSE * DOUBT * far)
    within = real((ball + DOUBT * far) ** 2 * 1.00001)
    # kinds as float32 until the end: lanes of another width would halve their number
    zero, one, two, four, any_size, none = real(0), real(1), real(2), real(4), real(ANY), real(KINDS)
    for b in range(CHUNK):
        px, py, pz = corners[chunk, 0, b] - ox, corners[chunk, 1, b] - oy, corners[chunk, 2, b] - oz
        xi, yi, zi = rx * px + ry * py + rz * pz, dx * px + dy * py + dz * pz, fx * px + fy * py + fz * pz
        px, py, pz = corners[chunk, 3, b] - ox, corners[chunk, 4, b] - oy, corners[chunk, 5, b] - oz
        xj, yj, zj = rx * px + ry * py + rz * pz, dx * px + dy * py + dz * pz, fx * px + fy * py + fz * pz
        px, py, pz = corners[chunk, 6, b] - ox, corners[chunk, 7, b] - oy, corners[chunk, 8, b] - oz
        xk, yk, zk = rx * px + ry * py + rz * pz, dx * px + dy * py + dz * pz, fx * px + fy * py + fz * pz
        qi, qj, qk = xi * xi + yi * yi + zi * zi, xj * xj + yj * yj + zj * zj, xk * xk + yk * yk + zk * zk
        wi, wj, wk = np.sqrt(qi) + zi, np.sqrt(qj) + zj, np.sqrt(qk) + zk
        nearest = max(min(wi, min(wj, wk)), close)
        wi, wj, wk = max(wi, close), max(wj, close), max(wk, close)
        scale = texels / (wi * wj * wk)
        wi, wj, wk = wj * wk * scale, wi * wk * scale, wi * wj * scale
        xi, xj, xk, yi, yj, yk = xi * wi, xj * wj, xk * wk, yi * wi, yj * wj, yk * wk
        left, right = min(xi, min(xj, xk)), max(xi, max(xj, xk))
        top, bottom = min(yi, min(yj, yk)), max(yi, max(yj, yk))
        square = ((right - left) * (right - left) + (bottom - top) * (bottom - top)) * texel
        # an edge leaves its chord by BULGE times its squared length; s and t are off by 6 E / (|v| + z)
        spare = real(BULGE) * square + real(8.0) * doubt * max(wi, max(wj, wk)) + padding
        first, final = np.ceil(max(left - spare + middle, zero)), np.floor(min(right + spare + middle, last))
        upper, lower = np.ceil(max(top - spare + middle, zero)), np.floor(min(bottom + spare + middle, last))
        behind = max(zi, max(zj, zk)) < -doubt
        ahead = (min(zi, min(zj, zk)) > doubt) & (nearest > close)
        certain = ahead & (square < real(SHORT) * texels) & (max(qi, max(qj, qk)) > within)
        side = max(final - first, lower - upper)
        found = zero if side < one else (one if side < two else (two if side < four else any_size))
        found = none if (first > final) | (upper > lower) else found
        kind[b] = np.int32(none if behind else (found if certain else any_size))
