"""The hierarchical warp of points after an importance map (SII Sec. 3.5, Eq. 4 to 6; Sec. 3.6: several maps).

Symbols: x, y place within a cell, of [0, 1); r the share of importance of a cell's first half; w weight of a point,
1 / density over the unit square. A map is halved in rows, then in columns, on each of its levels; method A takes the
columns of the half that was chosen, B those of the whole cell. Sides need not be powers of two: cell i of level l
begins at row floor(i H / 2^l), and the share of texels of a half stands in place of the paper's 1/2.
"""

from typing import Any

import numpy as np

from refgi.literal.lights import BELOW_1


def warp(points: Any, importance: Any, maps: int, levels: int, method: str) -> Any:
    """Return points (n, 2) warped over maps stacked along rows, and their weights w (n,); importance (maps h, w), W.

    v chooses the map in proportion to its importance and is stretched over the map's share (Sec. 3.6).
    """
    faces = np.split(importance, maps)
    u, v = points.T
    sums = np.array([face.sum() for face in faces])
    sums = sums if sums.any() else np.ones(maps)
    ends = np.cumsum(sums) / np.cumsum(sums)[-1]
    begins = np.append(0, ends[:-1])
    chosen = np.searchsorted(ends, v, side="right")
    share = (ends - begins)[chosen]
    v = np.clip((v - begins[chosen]) / share, 0, BELOW_1)
    warped, w = np.zeros(points.shape), 1 / (maps * share)
    for k, face in enumerate(faces):
        here = chosen == k
        x, y, own = warp_map(u[here], v[here], face, levels, method)
        warped[here] = np.stack([x, (k + y) / maps], axis=1)
        w[here] = w[here] * own
    return np.minimum(warped, BELOW_1), w


def warp_map(x: Any, y: Any, importance: Any, levels: int, method: str) -> Any:
    """Return places (n,) on one map (h, w) after some levels of halving, rows then columns, and their weights (n,)."""
    rows, columns = importance.shape
    cells = mip(importance)
    levels = min(levels, len(cells) - 1)
    i, j, w = np.zeros(len(x), int), np.zeros(len(x), int), np.ones(len(x))
    for level in range(1, levels + 1):
        sums = cells[level]
        a, b = sums[2 * i, 2 * j], sums[2 * i, 2 * j + 1]
        c, d = sums[2 * i + 1, 2 * j], sums[2 * i + 1, 2 * j + 1]
        down, y, by_rows = halve(y, a + b, c + d, even_share(i, level, rows))
        if method == "A":
            left, right = np.where(down, c, a), np.where(down, d, b)
        else:
            left, right = a + c, b + d
        across, x, by_columns = halve(x, left, right, even_share(j, level, columns))
        w = w * by_rows * by_columns
        i, j = 2 * i + down, 2 * j + across
    u, v = place(x, j, levels, columns), place(y, i, levels, rows)
    return u, v, w


def halve(x: Any, first: Any, second: Any, even: Any) -> Any:
    """Return which half (0, 1) places x go to by the halves' importance, their place x' in it, the weight's factor.

    The paper's new coordinate on the whole cell is (half + x') / 2.
    """
    total = first + second
    r = np.divide(first, total, out=np.array(even), where=total > 0)  # E-SII-07: without importance nothing moves
    # Eq. (4)
    half = (x >= r).astype(int)
    begin = np.where(half, r, 0)
    kept = np.where(half, 1 - r, r)
    # Eq. (5)
    x = np.clip((x - begin) / kept, 0, BELOW_1)
    # Eq. (6)
    factor = np.where(half, 1 - even, even) / kept
    return half, x, factor


def mip(importance: Any) -> Any:
    """Return sums over 2^l x 2^l cells of a map (h, w), l = 0 .. L; on the last level a cell is a texel or empty."""
    rows, columns = importance.shape
    depth = (max(rows, columns) - 1).bit_length()
    finest = np.zeros((1 << depth, 1 << depth), importance.dtype)
    i, j = np.arange(1 << depth), np.arange(1 << depth)
    holds = np.ix_(border(i + 1, depth, rows) > border(i, depth, rows),
                   border(j + 1, depth, columns) > border(j, depth, columns))
    finest[holds] = importance
    cells = [finest]
    for _ in range(depth):
        a, b, c, d = (cells[0][p::2, q::2] for p in (0, 1) for q in (0, 1))
        cells.insert(0, a + b + (c + d))
    return cells


def border(index: Any, level: int, size: int) -> Any:
    """Return the row at which cell `index` of a level begins on a side of `size` rows."""
    return index * size >> level


def even_share(index: Any, level: int, size: int) -> Any:
    """Return the first half's share of the rows of cell `index` of the level above; 1/2 in the paper."""
    start, middle, end = (border(2 * index + k, level, size) for k in (0, 1, 2))
    return np.where(end > start, (middle - start) / np.maximum(end - start, 1), 0.5)


def place(x: Any, index: Any, level: int, size: int) -> Any:
    """Return the coordinate on the map, of [0, 1), of a place within cell `index` of a level."""
    start, end = border(index, level, size), border(index + 1, level, size)
    return np.minimum((start + x * (end - start)) / size, BELOW_1)
