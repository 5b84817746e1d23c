"""Mips that find discontinuities (Nichols and Wyman 2009, Sec. 3.2): ranges of depth and normal, slopes, curvatures.

A min-max mip holds the least and the largest value within each cell, a max mip the largest alone. Only pixels that
show a surface count, so a silhouette against nothing is no discontinuity. A picture of any size has such a mip: cells
at its border are cut.

Symbols: z depth, m; N normal; a level's `low` and `high` are its least and largest values.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.splat.refinement.pyramid import COLUMNS, ROWS, START, layout, least_of_four, most_of_four, room, views
from refgi.stages import stage

Array = npt.NDArray[Any]


class Mip(NamedTuple):
    """Ranges over the cells of levels 0 to top; where a cell shows no surface, `low` is inf and `high` -inf or 0.

    Level 0 of a min-max mip is the channel as it came, on both sides. A max mip has no `low`, and 0 where no surface is.
    """

    low: tuple[Array, ...]  # (h_l, w_l) or (3, h_l, w_l) for each level; () for a max mip
    high: tuple[Array, ...]
    lows: Array  # (c, n): levels 1 to top one after another, which `low` shows; (0, 0) for a max mip
    highs: Array  # (c, n)

    @property
    def top(self) -> int:
        """Coarsest level."""
        return len(self.high) - 1


@stage("splat.depth_ranges")
def depth_ranges(depth: Array, covered: Array, top: int, rim: int = 0) -> Mip:
    """Return the least and largest depth within each cell (Sec. 3.2.1).

    Parameters
    ----------
    depth : (h, w) ndarray
        Axial depth, m.
    covered : (h, w) ndarray of bool
        Whether there is a surface.
    top : int
        Coarsest level.
    rim : int
        Pixels around a cell that count too (Fig. 15 top): with 1, an edge that lies between two cells is in both.

    Returns
    -------
    Mip
        Levels of (h_l, w_l), m.
    """
    mip = _ranges(np.ascontiguousarray(depth)[None], covered, top, rim)
    flat = [tuple(level.reshape(level.shape[-2:]) for level in side) for side in mip[:2]]
    return Mip(*flat, *mip[2:])


@stage("splat.normal_ranges")
def normal_ranges(normal: Array, covered: Array, top: int, rim: int = 0) -> Mip:
    """Return the least and largest of each component of the normals within each cell (Sec. 3.2.2).

    Parameters
    ----------
    normal : (3, h, w) ndarray
        Unit normals, world space.
    covered : (h, w) ndarray of bool
        Whether there is a surface.
    top : int
        Coarsest level.
    rim : int
        Pixels around a cell that count too (Fig. 15 top).

    Returns
    -------
    Mip
        Levels of (3, h_l, w_l).
    """
    return _ranges(np.ascontiguousarray(normal), covered, top, rim)


@stage("splat.depth_slopes")
def depth_slopes(depth: Array, covered: Array, top: int) -> Mip:
    """Return the steepest relative change of depth within each cell, sqrt((dz/dx)^2 + (dz/dy)^2) / z (Sec. 3.2.1).

    Parameters
    ----------
    depth : (h, w) ndarray
        Axial depth, m.
    covered : (h, w) ndarray of bool
        Whether there is a surface.
    top : int
        Coarsest level.

    Returns
    -------
    Mip
        Levels of (h_l, w_l), 1/pixel; a max mip.

    Notes
    -----
    The paper gives no difference: here dz/dx is the larger of those to both neighbours, so that a step is in the cells
    on both its sides and a picture's mirror image has its mip mirrored. It divides nothing by z; a slope relative to
    the depth has one threshold for scenes of any size.
    """
    sizes, values = _room_for_maxima(depth, top)
    _build_slopes(np.ascontiguousarray(depth), np.ascontiguousarray(covered), sizes, values)
    return _max_mip(values, sizes)


@stage("splat.curvatures")
def curvatures(normal: Array, position: Array, covered: Array, top: int, rate: bool = False) -> Mip:
    """Return the largest change of normal between neighbouring pixels within each cell (Eq. 1).

    Parameters
    ----------
    normal : (3, h, w) ndarray
        Unit normals, world space.
    position : (3, h, w) ndarray
        World space, m.
    covered : (h, w) ndarray of bool
        Whether there is a surface.
    top : int
        Coarsest level.
    rate : bool
        Divide by the distance between the two points, which makes it a curvature: 1/R on a sphere of radius R.

    Returns
    -------
    Mip
        Levels of (h_l, w_l), 0 to 2, or 1/m for a rate; a max mip.

    Notes
    -----
    Eq. 1, 2 sin(arccos(N1 . N2) / 2), is the chord |N1 - N2| and computed as that: the arc cosine has no digits near 0
    and no value where rounding makes the product exceed 1. A pair counts in the cells of both its pixels.
    """
    sizes, values = _room_for_maxima(normal[0], top)
    _build_curvatures(np.ascontiguousarray(normal), np.ascontiguousarray(position), np.ascontiguousarray(covered),
                      rate, sizes, values)
    return _max_mip(values, sizes)


def _ranges(plane: Array, covered: Array, top: int, rim: int) -> Mip:
    """Return the min-max mip of the channels (c, h, w) of a picture."""
    sizes = layout(*covered.shape, top, first=1)
    cells = room(sizes) if top else 0
    lows, highs = np.empty((len(plane), cells), plane.dtype), np.empty((len(plane), cells), plane.dtype)
    if top:
        strips, across = sizes[top, ROWS], 2 * sizes[1, COLUMNS] + 2 * rim
        rows = np.empty((strips, 2, across), plane.dtype)
        _build_ranges(plane, np.ascontiguousarray(covered), rim, sizes, rows, lows, highs)
    low, high = ((plane, *views(side, sizes, first=1)) for side in (lows, highs))
    return Mip(low, high, lows, highs)


def _room_for_maxima(plane: Array, top: int) -> tuple[Array, Array]:
    sizes = layout(*plane.shape, top)
    return sizes, np.empty(room(sizes), plane.dtype)


def _max_mip(values: Array, sizes: Array) -> Mip:
    finest = int(sizes[0, ROWS] * sizes[0, COLUMNS])
    return Mip((), views(values, sizes), np.empty((0, 0), values.dtype), values[None, finest:])


@kernel(parallel=True)
def _build_ranges(
    plane: Array, covered: Array, rim: int, sizes: Array, rows: Array, lows: Array, highs: Array
) -> None:
    for strip in prange(len(rows)):
        least, most = rows[strip, 0], rows[strip, 1]
        least[:] = math.inf
        most[:] = -math.inf
        _finest_ranges(strip, plane, covered, rim, sizes, least, most, lows, highs)
        for c in range(len(plane)):
            for level in range(2, len(sizes)):
                _coarsen(strip, level, sizes, lows[c], True)
                _coarsen(strip, level, sizes, highs[c], False)


@kernel
def _finest_ranges(
    strip: int, plane: Array, covered: Array, rim: int, sizes: Array, least: Array, most: Array,
    lows: Array, highs: Array,
) -> None:
    """Fill the rows of level 1 in a strip; `least` and `most` hold ranges over its pixels' columns, and a rim beside."""
    height, width = covered.shape
    columns = sizes[1, COLUMNS]
    begin, end = _rows_of(strip, 1, sizes)
    inner_least, inner_most = least[rim : rim + width], most[rim : rim + width]
    for i in range(begin, end):
        here = sizes[1, START] + i * columns
        for c in range(len(plane)):
            last = min(2 * i + 1, height - 1)
            _over_two_rows(plane[c, 2 * i], plane[c, last], covered[2 * i], covered[last], inner_least, inner_most)
            for y in range(max(0, 2 * i - rim), min(height, 2 * i + 2 + rim)):
                if y < 2 * i or y > last:
                    _over_one_row_more(plane[c, y], covered[y], inner_least, inner_most)
            low, high = lows[c, here : here + columns], highs[c, here : here + columns]
            _over_columns(least, most, rim, low, high)


@kernel
def _over_two_rows(
    upper: Array, lower: Array, upper_covered: Array, lower_covered: Array, least: Array, most: Array
) -> None:
    infinity = upper.dtype.type(math.inf)
    for x in range(len(least)):
        a, b = upper[x], lower[x]
        a, b = a if upper_covered[x] else infinity, b if lower_covered[x] else infinity
        least[x] = a if a < b else b
        a, b = upper[x], lower[x]
        a, b = a if upper_covered[x] else -infinity, b if lower_covered[x] else -infinity
        most[x] = a if a > b else b


@kernel
def _over_one_row_more(values: Array, covered: Array, least: Array, most: Array) -> None:
    infinity = values.dtype.type(math.inf)
    for x in range(len(least)):
        a, b = values[x] if covered[x] else infinity, values[x] if covered[x] else -infinity
        least[x] = a if a < least[x] else least[x]
        most[x] = b if b > most[x] else most[x]


@kernel
def _over_columns(least: Array, most: Array, rim: int, low: Array, high: Array) -> None:
    """Store the ranges over pairs of columns and over `rim` columns on both sides of each pair."""
    for j in range(len(low)):
        low[j] = min(least[2 * j + rim], least[2 * j + rim + 1])
        high[j] = max(most[2 * j + rim], most[2 * j + rim + 1])
    for k in range(rim):
        for j in range(len(low)):
            low[j] = min(low[j], min(least[2 * j + k], least[2 * j + 2 * rim + 1 - k]))
            high[j] = max(high[j], max(most[2 * j + k], most[2 * j + 2 * rim + 1 - k]))


@kernel
def _rows_of(strip: int, level: int, sizes: Array) -> tuple[int, int]:
    """Return the first row of a level in a strip, and one past the last."""
    along = len(sizes) - 1 - level
    return strip << along, min((strip + 1) << along, sizes[level, ROWS])


@kernel
def _coarsen(strip: int, level: int, sizes: Array, values: Array, least: bool) -> None:
    """Fill the rows of a level in a strip from the level below it."""
    below, fine, here, columns = sizes[level - 1, START], sizes[level - 1, COLUMNS], sizes[level, START], sizes[level, 2]
    begin, end = _rows_of(strip, level, sizes)
    for i in range(begin, end):
        upper = below + 2 * i * fine
        lower = below + min(2 * i + 1, sizes[level - 1, ROWS] - 1) * fine
        out = values[here + i * columns : here + (i + 1) * columns]
        if least:
            least_of_four(values[upper : upper + fine], values[lower : lower + fine], out)
        else:
            most_of_four(values[upper : upper + fine], values[lower : lower + fine], out)


@kernel(parallel=True)
def _build_slopes(depth: Array, covered: Array, sizes: Array, values: Array) -> None:
    for strip in prange(sizes[-1, ROWS]):
        begin, end = _rows_of(strip, 0, sizes)
        width = depth.shape[1]
        for y in range(begin, end):
            _slopes_of_row(depth, covered, y, values[y * width : (y + 1) * width])
        for level in range(1, len(sizes)):
            _coarsen(strip, level, sizes, values, False)


@kernel
def _slopes_of_row(depth: Array, covered: Array, y: int, out: Array) -> None:
    height, width = depth.shape
    up, down = max(y - 1, 0), min(y + 1, height - 1)
    for x in range(width):
        left, right = max(x - 1, 0), min(x + 1, width - 1)
        z = depth[y, x]
        across = max(_step(depth, covered, y, left, z), _step(depth, covered, y, right, z))
        along = max(_step(depth, covered, up, x, z), _step(depth, covered, down, x, z))
        slope = math.sqrt(across * across + along * along) / z
        out[x] = slope if covered[y, x] else type(z)(0.0)


@kernel
def _step(depth: Array, covered: Array, y: int, x: int, z: Any) -> Any:
    """Return |z' - z| to the depth of a pixel, 0 where that shows no surface."""
    return abs(depth[y, x] - z) if covered[y, x] else type(z)(0.0)


@kernel(parallel=True)
def _build_curvatures(
    normal: Array, position: Array, covered: Array, rate: bool, sizes: Array, values: Array
) -> None:
    for strip in prange(sizes[-1, ROWS]):
        begin, end = _rows_of(strip, 0, sizes)
        width = covered.shape[1]
        for y in range(begin, end):
            _curvatures_of_row(normal, position, covered, rate, y, values[y * width : (y + 1) * width])
        for level in range(1, len(sizes)):
            _coarsen(strip, level, sizes, values, False)


@kernel
def _curvatures_of_row(
    normal: Array, position: Array, covered: Array, rate: bool, y: int, out: Array
) -> None:
    height, width = covered.shape
    up, down = max(y - 1, 0), min(y + 1, height - 1)
    for x in range(width):
        left, right = max(x - 1, 0), min(x + 1, width - 1)
        across = max(_bend(normal, position, covered, rate, y, x, y, left),
                     _bend(normal, position, covered, rate, y, x, y, right))
        along = max(_bend(normal, position, covered, rate, y, x, up, x),
                    _bend(normal, position, covered, rate, y, x, down, x))
        out[x] = math.sqrt(max(across, along))


@kernel
def _bend(normal: Array, position: Array, covered: Array, rate: bool, y: int, x: int, v: int, u: int) -> Any:
    """Return the square of a pair's chord |N1 - N2| or rate |N1 - N2| / |x1 - x2|, 0 where either shows no surface."""
    zero = normal.dtype.type(0.0)
    square, distance = zero, zero
    for c in range(3):
        turn, move = normal[c, v, u] - normal[c, y, x], position[c, v, u] - position[c, y, x]
        square += turn * turn
        distance += move * move
    if not (covered[y, x] and covered[v, u] and square > zero):
        return zero
    return square / distance if rate else square
