"""Discontinuities within cells: min-max mipmaps against thresholds (Nichols and Wyman 2009, Sec. 3.2 and 4.1).

A cell is discontinuous where any criterion says so; mipmaps of others are not built. Only pixels that show a surface
count, so that a silhouette against the background is no discontinuity.
"""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.error_target.grid import COLUMNS, ROWS, START, Mipmap, coarsen, element_count, layout, level_views, rows_of
from refgi.jit import kernel, prange
from refgi.splat.multires.derivatives import curvatures, depth_slopes
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rsm import GBuffer
    from refgi.splat.multires.settings import Criteria, Criterion

CHANNELS = {"depth": ("depth",), "derivative": ("depth",), "normal": ("normal",), "curvature": ("normal", "position")}
CHUNK = 4096  # cells that a thread takes at once


@stage("multires.depth_ranges")
def depth_ranges(depth: Array, covered: Array, top: int, rim: int = 0) -> Mipmap:
    """Return the least and largest depth within each cell (AMS Sec. 3.2.1).

    depth (h, w): Axial depth, m.
    rim: Pixels around a cell that count too (Fig. 15 top): with 1, an edge that lies between two cells is in both.
    -> low tuple of (h_l, w_l): Least depth in each cell, m; inf where empty.
    -> high tuple of (h_l, w_l): Largest depth in each cell, m; -inf where empty.
    """
    mip = _ranges(np.ascontiguousarray(depth)[None], covered, top, rim)
    low, high = (tuple(level[0] for level in side) for side in (mip.low, mip.high))
    return Mipmap(low, high, mip.lows, mip.highs)


@stage("multires.normal_ranges")
def normal_ranges(normal: Array, covered: Array, top: int, rim: int = 0, components: int = 3) -> Mipmap:
    """Return the least and largest of each component of the normals within each cell (AMS Sec. 3.2.2).

    rim: Pixels around a cell that count too (Fig. 15 top).
    components: How many count: x, y and z, or the first two.
    -> low tuple of (xyz, h_l, w_l): Least component of normals in each cell; inf where empty.
    -> high tuple of (xyz, h_l, w_l): Largest component of normals in each cell; -inf where empty.
    """
    return _ranges(np.ascontiguousarray(normal[:components]), covered, top, rim)


def _ranges(plane: Array, covered: Array, top: int, rim: int) -> Mipmap:
    """Return the min-max mipmap of the channels of a picture, (c, h, w)."""
    height, width = covered.shape
    sizes = layout(height, width, top, first=1)
    cells = element_count(sizes) if top else 0
    lows, highs = np.empty((len(plane), cells), plane.dtype), np.empty((len(plane), cells), plane.dtype)
    if top:
        strips, across = sizes[top, ROWS], 2 * sizes[1, COLUMNS] + 2 * rim
        rows = np.empty((strips, 2, across), plane.dtype)
        _build_ranges(plane, np.ascontiguousarray(covered), rim, sizes, rows, lows, highs)
    low, high = ((plane, *level_views(side, sizes, first=1)) for side in (lows, highs))
    return Mipmap(low, high, lows, highs)


@kernel(parallel=True)
def _build_ranges(
    plane: Array, covered: Array, rim: int, sizes: Array, rows: Array, lows: Array, highs: Array
) -> None:
    for strip in prange(len(rows)):
        _ranges_of_strip(np.int64(strip), plane, covered, rim, sizes, rows, lows, highs)


@kernel
def _ranges_of_strip(
    strip: Any, plane: Array, covered: Array, rim: int, sizes: Array, rows: Array, lows: Array, highs: Array
) -> None:
    """Fill all levels in a row of cells of the coarsest one."""
    height, width = covered.shape
    start, _, columns = sizes[1]
    least, most = rows[strip, 0], rows[strip, 1]
    inner_least, inner_most = least[rim : rim + width], most[rim : rim + width]
    begin, end = rows_of(strip, 1, sizes)
    for c in range(len(plane)):
        for i in range(begin, end):
            least[:] = math.inf
            most[:] = -math.inf
            for y in range(max(0, 2 * i - rim), min(height, 2 * i + 2 + rim)):
                _over_row(plane[c, y], covered[y], inner_least, inner_most)
            here = start + i * columns
            _over_columns(least, most, rim, lows[c, here : here + columns], highs[c, here : here + columns])
        coarsen(strip, 1, sizes, lows[c], highs[c])


@kernel
def _over_row(values: Array, covered: Array, least: Array, most: Array) -> None:
    """Widen the ranges over columns of pixels by one row more."""
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


@stage("multires.criteria", steps="refgi.splat.multires.steps.discontinuity_steps")
def discontinuities(buffer: "GBuffer", criteria: "Criteria", top: int, finest: int = 0) -> tuple[Array, ...]:
    """Return which cells of each level hold a discontinuity.

    criteria: Mipmaps to build, their thresholds and the `rim`.
    top, finest: Coarsest and finest level.
    -> tuple of (h_l, w_l) bool: Levels 0 to `top`; False at levels up to `finest`, which is never refined, and where a
        cell shows no surface.
    """
    height, width = buffer.covered.shape
    sizes = layout(height, width, top, first=1)
    discontinuous = np.zeros(element_count(sizes) if top else 0, np.bool_)
    begin = sizes[finest + 1, START] if finest < top else len(discontinuous)
    if begin < len(discontinuous):
        chosen = [name for name in sorted(CHANNELS) if getattr(criteria, name) is not None]
        buffer.resolve(*(channel for name in chosen for channel in CHANNELS[name]))
        for name in chosen:
            mip = mipmap_of(name, buffer, criteria, top)
            mark(mip.lows if mip.low else None, mip.highs, getattr(criteria, name), sizes, discontinuous, begin)
    return (np.zeros((height, width), np.bool_), *level_views(discontinuous, sizes, first=1))


def mipmap_of(name: str, buffer: "GBuffer", criteria: Any, top: int) -> Mipmap:
    """Return the mipmap that a criterion of this name compares with its threshold."""
    covered, criterion = buffer.covered, getattr(criteria, name)
    if name == "depth":
        return depth_ranges(buffer.depth, covered, top, criteria.rim)
    if name == "normal":
        return normal_ranges(buffer.normal, covered, top, criteria.rim, len(criterion.components))
    if name == "derivative":
        return depth_slopes(buffer.depth, covered, top, criterion.measure != "absolute")
    return curvatures(buffer.normal, buffer.position, covered, top, criterion.name() == "rate")


def mark(
    lows: Array | None, highs: Array, criterion: "Criterion", sizes: Array, discontinuous: Array, begin: int = 0
) -> None:
    """Mark the cells (n,) of a layout where `lows` to `highs` (c, n) spread beyond a threshold, or `highs` are."""
    measure, count = getattr(criterion, "measure", "absolute"), len(discontinuous)
    parts = [(begin, count, criterion.threshold)]
    if measure == "demo":
        parts = [(start, start + rows * columns, criterion.threshold * 3 / level)
                 for level, (start, rows, columns) in enumerate(sizes) if level > 0 and start >= begin]
    for first, last, threshold in parts:
        _mark(lows, highs, highs.dtype.type(threshold), measure != "absolute", first, last, discontinuous)


@kernel(parallel=True)
def _mark(
    lows: Array | None, highs: Array, threshold: Any, relative: bool, first: int, last: int, discontinuous: Array
) -> None:
    for chunk in prange((last - first + CHUNK - 1) // CHUNK):
        a, b = first + chunk * CHUNK, min(first + (chunk + 1) * CHUNK, last)
        for c in range(len(highs)):
            if lows is None:
                _mark_maxima_of_chunk(highs[c, a:b], threshold, discontinuous[a:b])
            else:
                _mark_spreads_of_chunk(lows[c, a:b], highs[c, a:b], threshold, relative, discontinuous[a:b])


@kernel
def _mark_spreads_of_chunk(low: Array, high: Array, threshold: Any, relative: bool, discontinuous: Array) -> None:
    for k in range(len(discontinuous)):
        # Sec. 3.2.1, 3.2.2, depth or normal threshold: max - min of a channel, of depth over a share of the least
        discontinuous[k] |= high[k] - low[k] > (threshold * low[k] if relative else threshold)


@kernel
def _mark_maxima_of_chunk(high: Array, threshold: Any, discontinuous: Array) -> None:
    for k in range(len(discontinuous)):
        # Eq. (1), curvature threshold, and depth derivatives
        discontinuous[k] |= high[k] > threshold
