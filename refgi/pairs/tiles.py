"""The pixels of a picture in an order that keeps neighbours together, and which lights can reach a tile of them.

Blocks of 16 x 16 pixels go row by row, within a block 8 x 8 after 8 x 8, within these 4 x 4 after 4 x 4, without pixels
that show no surface: tiles are filled and compact. A light is passed over when the whole tile lies behind its surface,
or it behind the surface of every receiver, by more than rounding: its terms are 0 in the kernels too.
"""

from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.rsm.pool import plane
from refgi.skips import left_out
from refgi.types import Array

BLOCK = 16  # BLOCK^2 pixels fill one tile of the kernels
AT_ONCE = 1 << 12  # pixels that a thread copies at once
ROUNDING = 32.0  # units of rounding of |d| that a cosine computed from d may be off; about 6 are possible


def receiving(covered: Array) -> Array:
    """Return the pixels (h, w) to sum at: those with a surface; without the skip all, and `clear` follows."""
    if left_out("pairs.pixels", lambda: (covered.size - np.count_nonzero(covered), covered.size)):
        return covered
    return np.ones_like(covered)


def clear(picture: Array, covered: Array, receiving: Array) -> None:
    """Set pixels without surface of (3, h, w) to 0 that were summed at, where a zero normal gave them anything."""
    if receiving is not covered:
        picture[:, ~covered] = 0


def block_by_block(covered: Array, nth: Array | slice = slice(None)) -> Array:
    """Return the flat indices of covered pixels (h, w), block by block, (n,) int64; only the `nth` ones where given."""
    counts = np.add.reduceat(np.count_nonzero(covered, axis=1), np.arange(0, len(covered), BLOCK))
    starts = np.concatenate([[0], np.cumsum(counts)])
    index = np.arange(BLOCK * BLOCK).reshape(2, 2, 4, 2, 2, 4).transpose(0, 3, 1, 4, 2, 5).reshape(-1)
    places = plane((int(starts[-1]),), np.int64)
    _fill_strips(covered, np.stack([index // BLOCK, index % BLOCK]), starts, places)
    return places[nth]


def taken(values: Array, places: Array) -> Array:
    """Return the values of three channels (3, h, w) at pixels of flat indices (n,), (3, n)."""
    some = plane((3, len(places)), values.dtype)
    _take(np.ascontiguousarray(values).reshape(3, -1), places, some)
    return some


def put(picture: Array, places: Array, values: Array) -> None:
    """Store the values (3, n) of three channels at pixels of distinct flat indices (n,) of a contiguous picture."""
    _put(values, places, picture.reshape(3, -1))


@kernel(parallel=True)
def _fill_strips(covered: Array, path: Array, starts: Array, places: Array) -> None:
    height, width = covered.shape
    for strip in prange(len(starts) - 1):
        top, count = strip * BLOCK, starts[strip]
        for left in range(0, width, BLOCK):
            first = top * width + left
            if _is_full(covered, top, left):
                for i in range(BLOCK * BLOCK):
                    places[count + i] = first + path[0, i] * width + path[1, i]
                count += BLOCK * BLOCK
                continue
            for i in range(BLOCK * BLOCK):
                row, column = top + path[0, i], left + path[1, i]
                if row < height and column < width and covered[row, column]:
                    places[count] = row * width + column
                    count += 1


@kernel
def _is_full(covered: Array, top: int, left: int) -> bool:
    """Return whether a whole block lies on the picture and shows surfaces alone."""
    if top + BLOCK > covered.shape[0] or left + BLOCK > covered.shape[1]:
        return False
    full = True
    for row in range(top, top + BLOCK):
        for column in range(left, left + BLOCK):
            full &= covered[row, column]
    return full


@kernel(parallel=True)
def _take(values: Array, places: Array, some: Array) -> None:
    for part in prange(-(-len(places) // AT_ONCE)):
        for c in range(3):
            for i in range(part * AT_ONCE, min((part + 1) * AT_ONCE, len(places))):
                some[c, i] = values[c, places[i]]


@kernel(parallel=True)
def _put(some: Array, places: Array, values: Array) -> None:
    for part in prange(-(-len(places) // AT_ONCE)):
        for c in range(3):
            for i in range(part * AT_ONCE, min((part + 1) * AT_ONCE, len(places))):
                values[c, places[i]] = some[c, i]


@kernel
def bound_tile(tile: Array, size: int, low: Array, high: Array) -> None:
    """Fill the corners of the bounding boxes of a tile's first `size` positions (entries 0 to 2) and normals (3 to 5).

    The tile is (>= 6, lanes), with a power of two of lanes.
    """
    bound_rows(tile, 0, 6, size, low, high, 0)


@kernel
def bound_rows(tile: Array, first: int, rows: int, size: int, low: Array, high: Array, entry: int) -> None:
    """Fill entries from `entry` on with the extremes of the rows of a tile from `first` on, of `size` lanes."""
    # by halves, element by element, which runs in lanes; a running minimum would not
    lanes = tile.shape[1]
    least, most = np.empty(lanes, tile.dtype), np.empty(lanes, tile.dtype)
    for row in range(rows):
        for i in range(lanes):
            least[i] = most[i] = tile[first + row, i if i < size else 0]
        half = lanes // 2
        while half > 0:
            for i in range(half):
                least[i] = least[i + half] if least[i + half] < least[i] else least[i]
                most[i] = most[i + half] if most[i + half] > most[i] else most[i]
            half //= 2
        low[entry + row], high[entry + row] = least[0], most[0]


@kernel
def extremes(values: Array, row: int, first: int, last: int) -> Any:
    """Return the least and the largest of values[row, first:last]."""
    # four at a time, so that one comparison need not wait for another
    a = b = c = d = e = f = g = h = values[row, first]
    rest = first + (last - first) // 4 * 4
    for i in range(first, rest, 4):
        p, q, r, s = values[row, i], values[row, i + 1], values[row, i + 2], values[row, i + 3]
        a, b, c, d = p if p < a else a, q if q < b else b, r if r < c else c, s if s < d else d
        e, f, g, h = p if p > e else e, q if q > f else f, r if r > g else g, s if s > h else h
    for i in range(rest, last):
        p = values[row, i]
        a, e = p if p < a else a, p if p > e else e
    return min(min(a, b), min(c, d)), max(max(e, f), max(g, h))


@kernel
def lights_in_reach(lights: Array, first: int, last: int, low: Array, high: Array, reach: Array, chosen: Array) -> int:
    """List the lights first to last - 1 that may reach a tile, rising, in `chosen`, and return how many.

    `lights` (>= 6, N) hold position and reversed normal, `low` and `high` (6,) are the tile's boxes of `bound_tile`,
    `reach` (>= last - first,) bool is scratch.
    """
    _reaches(lights, first, last, low, high, reach)
    count = 0
    for k in range(first, last):
        chosen[count] = k
        count += reach[k - first]
    return count


@kernel
def list_all(first: int, last: int, chosen: Array) -> int:
    """List the lights first to last - 1 in `chosen`, as `lights_in_reach` does where all may reach a tile."""
    for k in range(first, last):
        chosen[k - first] = k
    return last - first


@kernel
def _reaches(lights: Array, first: int, last: int, low: Array, high: Array, reach: Array) -> None:
    real = lights.dtype.type
    zero = real(0.0)
    slack = real(ROUNDING) * real(np.finfo(lights.dtype).eps)
    ax, ay, az, bx, by, bz = low[0], low[1], low[2], high[0], high[1], high[2]
    ux, uy, uz, vx, vy, vz = low[3], low[4], low[5], high[3], high[4], high[5]
    start = np.uint64(first)  # unsigned, which needs no check for places counted from the end
    for k in range(start, np.uint64(last)):
        # d = light - receiver lies between e and f
        ex, ey, ez = lights[0, k] - bx, lights[1, k] - by, lights[2, k] - bz
        fx, fy, fz = lights[0, k] - ax, lights[1, k] - ay, lights[2, k] - az
        lx, ly, lz = lights[3, k], lights[4, k], lights[5, k]
        cl = max(ex * lx, fx * lx) + max(ey * ly, fy * ly) + max(ez * lz, fz * lz)
        cx = (max(max(ex * ux, ex * vx), max(fx * ux, fx * vx)) + max(max(ey * uy, ey * vy), max(fy * uy, fy * vy))
              + max(max(ez * uz, ez * vz), max(fz * uz, fz * vz)))
        size = max(abs(ex), abs(fx)) + max(abs(ey), abs(fy)) + max(abs(ez), abs(fz))
        reach[k - start] = (cl + slack * size > zero) & (cx + slack * size > zero)
