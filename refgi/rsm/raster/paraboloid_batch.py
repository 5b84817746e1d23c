"""Triangles of paraboloid maps, a chunk at a time in SIMD lanes: those between texels, then boxes, planes, nearness.

The box of a triangle's corners is widened, because straight edges are arcs on a paraboloid map.

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
from refgi.rsm.raster.triangle import BOX_PAD, CHUNK, SMALLEST, Chunks, centres_between
from refgi.types import Array

NEAREST = 1e-9  # share of a triangle's size under which a hit is rounding: its plane holds the centre

# rows of a set-up, CHUNK numbers each
PLANES = 0  # of each of three edges: x, y, z of n, and the value of e from which on a texel is inside
NEARNESS = 12 * CHUNK  # x, y, z of the vector whose product with a texel's direction is 1/tau
LIMIT = 15 * CHUNK  # greatest 1/tau that is no rounding
SQUARE = 16 * CHUNK  # 1 / squared distance of the plane from the centre
STATE = 17 * CHUNK  # one of those below
BOX = 18 * CHUNK  # first and last column, first and last row
CORNERS = 22 * CHUNK  # x, y, z of the corners in the map's frame
ROWS = 31
# behind the plane z = 0; ahead of it; across it; ahead of it but between texels; within the ball that is cut away
BEHIND, AHEAD, ACROSS, BETWEEN_TEXELS, NEAR = 0.0, 1.0, 2.0, 3.0, 4.0


@kernel
def bulge(square: float) -> Any:
    """Return how far an edge may leave its chord of squared length L^2: 1 - sqrt(1 - L^2/4).

    Result: in the units of the unit disc, a little too much.

    Each edge is an arc of at most half a circle, of radius R >= 1: R - sqrt(R^2 - L^2/4) is largest for R = 1.
    """
    if square < 0.04:
        return 0.13 * square + 1e-12
    return 1.0 - math.sqrt(max(1.0 - 0.25 * square, 0.0)) + 1e-12


@kernel
def box_across(x: Any, y: Any, z: Any) -> tuple[float, float, float, float]:
    """Return the range of s and of t that the part ahead of z = 0 may cover of a triangle that crosses it.

    `x`, `y`, `z`: corners in the map's frame, the first again at the end. Result: least and greatest s, least and
    greatest t.
    """
    s_low, s_high, t_low, t_high, longest = np.inf, -np.inf, np.inf, -np.inf, 0.0
    s_first, t_first, s_last, t_last = np.nan, np.nan, np.nan, np.nan
    for half_step in range(6):  # each corner, then where its edge meets the plane
        a = half_step // 2
        if half_step % 2 == 0:
            if z[a] < 0.0:
                continue
            scale = 1.0 / max(math.sqrt(x[a] * x[a] + y[a] * y[a] + z[a] * z[a]) + z[a], SMALLEST)
            s, t = x[a] * scale, y[a] * scale
        else:
            if (z[a] < 0.0) == (z[a + 1] < 0.0):
                continue
            share = z[a] / (z[a] - z[a + 1])
            rim_x, rim_y = x[a] + share * (x[a + 1] - x[a]), y[a] + share * (y[a + 1] - y[a])
            length = math.sqrt(rim_x * rim_x + rim_y * rim_y)
            if length == 0.0:  # through the centre itself: no way to tell
                return -1.0, 1.0, -1.0, 1.0
            s, t = rim_x / length, rim_y / length
        s_low, s_high, t_low, t_high = min(s_low, s), max(s_high, s), min(t_low, t), max(t_high, t)
        if s_first == s_first:
            longest = max(longest, (s - s_last) * (s - s_last) + (t - t_last) * (t - t_last))
        else:
            s_first, t_first = s, t
        s_last, t_last = s, t
    longest = max(longest, (s_first - s_last) * (s_first - s_last) + (t_first - t_last) * (t_first - t_last))
    spare = bulge(longest)
    return s_low - spare, s_high + spare, t_low - spare, t_high + spare


@kernel
def is_behind(box: Array, chunk: int, view: Any) -> bool:
    """Return whether a whole chunk lies behind a map's plane z = 0.

    `box` (c, 6): box of each chunk, m. `view`: centre of the map, then its frame, row by row. Result: true where no
    corner's z can be 0 or more: z is summed as that of corners is, and rounding is monotone.
    """
    ox, oy, oz, _, _, _, _, _, _, fx, fy, fz = view
    px = (box[chunk, 3] if fx > 0.0 else box[chunk, 0]) - ox
    py = (box[chunk, 4] if fy > 0.0 else box[chunk, 1]) - oy
    pz = (box[chunk, 5] if fz > 0.0 else box[chunk, 2]) - oz
    z: float = fx * px + fy * py + fz * pz
    return z < 0.0


@kernel
def _edge(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float, sign: float
) -> tuple[float, float, float, float]:
    """Return n = a x b times the sign of det, and the value of e from which on a texel is inside."""
    nx, ny, nz = (ay * bz - az * by) * sign, (az * bx - ax * bz) * sign, (ax * by - ay * bx) * sign
    owns = (nx > 0.0) | ((nx == 0.0) & ((ny > 0.0) | ((ny == 0.0) & (nz > 0.0))))
    return nx, ny, nz, 0.0 if owns else SMALLEST


@kernel
def _longest(x: float, y: float, z: float) -> Any:
    return max(abs(x), max(abs(y), abs(z)))


@kernel
def gather(vertices: Array, faces: Array, members: Array, count: int, setup: Array) -> None:
    """Write the corners of some triangles, world space: loads that wait for memory, many under way at once.

    `vertices` (n, 3): m. `faces` (m, 3): vertices of each triangle. `members`: triangles, of which the first `count`
    are taken. `setup` (ROWS * CHUNK,): receives corners.
    """
    for b in range(count):
        face = members[b]
        i, j, k, at = faces[face, 0], faces[face, 1], faces[face, 2], CORNERS + b
        for axis in range(3):
            setup[at + axis * CHUNK] = vertices[i, axis]
            setup[at + (3 + axis) * CHUNK] = vertices[j, axis]
            setup[at + (6 + axis) * CHUNK] = vertices[k, axis]


@kernel
def transform(view: Any, half: float, size: int, ball: float, setup: Array) -> None:
    """Write where every triangle of a batch lies on a map.

    `view`: centre of the map, then its frame, row by row. `half`: half extent of the map. `size`: texels along a side.
    `ball`: triangles all nearer than this to the centre are `NEAR`, m. `setup` (ROWS * CHUNK,): corners are taken to
    the map's frame; receives state and box of each.
    """
    ox, oy, oz, rx, ry, rz, dx, dy, dz, fx, fy, fz = view
    texels, within = 0.5 * size / half, ball * ball
    low_offset, high_offset = half * texels - (0.5 + BOX_PAD), half * texels + (BOX_PAD - 0.5)
    for b in range(CHUNK):
        at = CORNERS + b
        px, py, pz = setup[at] - ox, setup[at + CHUNK] - oy, setup[at + 2 * CHUNK] - oz
        xi, yi, zi = rx * px + ry * py + rz * pz, dx * px + dy * py + dz * pz, fx * px + fy * py + fz * pz
        px, py, pz = setup[at + 3 * CHUNK] - ox, setup[at + 4 * CHUNK] - oy, setup[at + 5 * CHUNK] - oz
        xj, yj, zj = rx * px + ry * py + rz * pz, dx * px + dy * py + dz * pz, fx * px + fy * py + fz * pz
        px, py, pz = setup[at + 6 * CHUNK] - ox, setup[at + 7 * CHUNK] - oy, setup[at + 8 * CHUNK] - oz
        xk, yk, zk = rx * px + ry * py + rz * pz, dx * px + dy * py + dz * pz, fx * px + fy * py + fz * pz
        setup[at], setup[at + CHUNK], setup[at + 2 * CHUNK] = xi, yi, zi
        setup[at + 3 * CHUNK], setup[at + 4 * CHUNK], setup[at + 5 * CHUNK] = xj, yj, zj
        setup[at + 6 * CHUNK], setup[at + 7 * CHUNK], setup[at + 8 * CHUNK] = xk, yk, zk
        qi, qj, qk = xi * xi + yi * yi + zi * zi, xj * xj + yj * yj + zj * zj, xk * xk + yk * yk + zk * zk
        wi = 1.0 / max(math.sqrt(qi) + zi, SMALLEST)
        wj = 1.0 / max(math.sqrt(qj) + zj, SMALLEST)
        wk = 1.0 / max(math.sqrt(qk) + zk, SMALLEST)
        s_low, s_high = min(xi * wi, min(xj * wj, xk * wk)), max(xi * wi, max(xj * wj, xk * wk))
        t_low, t_high = min(yi * wi, min(yj * wj, yk * wk)), max(yi * wi, max(yj * wj, yk * wk))
        # the diagonal of the corners' box is no shorter than the longest chord
        spare = bulge((s_high - s_low) * (s_high - s_low) + (t_high - t_low) * (t_high - t_low))
        last = size - 1.0
        first_column = np.ceil(max((s_low - spare) * texels + low_offset, 0.0))
        last_column = np.floor(min((s_high + spare) * texels + high_offset, last))
        first_row = np.ceil(max((t_low - spare) * texels + low_offset, 0.0))
        last_row = np.floor(min((t_high + spare) * texels + high_offset, last))
        nearest, farthest = min(zi, min(zj, zk)), max(zi, max(zj, zk))
        has_texels = (first_column <= last_column) & (first_row <= last_row)
        state = ACROSS if nearest < 0.0 else (AHEAD if has_texels else BETWEEN_TEXELS)
        state = NEAR if max(qi, max(qj, qk)) < within else state
        setup[STATE + b] = BEHIND if farthest < 0.0 else state
        at = BOX + b
        setup[at], setup[at + CHUNK], setup[at + 2 * CHUNK], setup[at + 3 * CHUNK] = (
            first_column, last_column, first_row, last_row)  # fmt: skip


@kernel
def orient(setup: Array) -> None:
    """Write the planes through the centre and the edges of every triangle of a chunk, and its own plane.

    `setup` (ROWS * CHUNK,): corners are read, the rest is written.
    """
    for b in range(CHUNK):
        at = CORNERS + b
        xi, yi, zi = setup[at], setup[at + CHUNK], setup[at + 2 * CHUNK]
        xj, yj, zj = setup[at + 3 * CHUNK], setup[at + 4 * CHUNK], setup[at + 5 * CHUNK]
        xk, yk, zk = setup[at + 6 * CHUNK], setup[at + 7 * CHUNK], setup[at + 8 * CHUNK]
        ax, ay, az, bx, by, bz = xj - xi, yj - yi, zj - zi, xk - xi, yk - yi, zk - zi
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        det = xi * nx + yi * ny + zi * nz
        sign = 1.0 if det > 0.0 else -1.0
        scale = 1.0 / det
        nx, ny, nz = nx * scale, ny * scale, nz * scale
        x0, y0, z0, t0 = _edge(xj, yj, zj, xk, yk, zk, sign)
        x1, y1, z1, t1 = _edge(xk, yk, zk, xi, yi, zi, sign)
        x2, y2, z2, t2 = _edge(xi, yi, zi, xj, yj, zj, sign)
        setup[b], setup[CHUNK + b], setup[2 * CHUNK + b], setup[3 * CHUNK + b] = x0, y0, z0, t0
        setup[4 * CHUNK + b], setup[5 * CHUNK + b], setup[6 * CHUNK + b], setup[7 * CHUNK + b] = x1, y1, z1, t1
        setup[8 * CHUNK + b], setup[9 * CHUNK + b], setup[10 * CHUNK + b], setup[11 * CHUNK + b] = x2, y2, z2, t2
        at = NEARNESS + b
        setup[at], setup[at + CHUNK], setup[at + 2 * CHUNK] = nx, ny, nz
        longest = max(_longest(xi, yi, zi), max(_longest(xj, yj, zj), _longest(xk, yk, zk)))
        # no area, or seen edge-on: nothing is near enough
        setup[LIMIT + b] = 1.0 / (NEAREST * longest) if det != 0.0 else 0.0
        setup[SQUARE + b] = nx * nx + ny * ny + nz * nz if det != 0.0 else 0.0


@kernel
def bound_across(setup: Array, b: int, half: float, size: int) -> bool:
    """Bound a triangle that crosses the plane z = 0.

    `setup` (ROWS * CHUNK,): set-up of the chunk; receives the box. `half`: half extent of the map. `size`: texels along
    a side. Result: whether it may cover a texel.
    """
    at, texels = CORNERS + b, 0.5 * size / half
    xi, yi, zi = setup[at], setup[at + CHUNK], setup[at + 2 * CHUNK]
    xj, yj, zj = setup[at + 3 * CHUNK], setup[at + 4 * CHUNK], setup[at + 5 * CHUNK]
    xk, yk, zk = setup[at + 6 * CHUNK], setup[at + 7 * CHUNK], setup[at + 8 * CHUNK]
    s_low, s_high, t_low, t_high = box_across((xi, xj, xk, xi), (yi, yj, yk, yi), (zi, zj, zk, zi))
    first, last = centres_between((s_low + half) * texels, (s_high + half) * texels, size)
    top, bottom = centres_between((t_low + half) * texels, (t_high + half) * texels, size)
    at = BOX + b
    setup[at], setup[at + CHUNK], setup[at + 2 * CHUNK], setup[at + 3 * CHUNK] = first, last, top, bottom
    return first <= last and top <= bottom


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
