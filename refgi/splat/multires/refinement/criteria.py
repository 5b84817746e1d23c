"""Discontinuities within cells: min-max mipmaps against thresholds (Nichols and Wyman 2009, Sec. 3.2 and 4.1).

A cell is discontinuous where any of the criteria says so; mipmaps of other criteria are not built. Each cell of a
min-max mipmap holds the least and the largest value of its pixels. Only pixels that show a surface count, so a
silhouette against the background is no discontinuity. `derivatives` has the max mipmaps of differences between
neighbours.
"""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from refgi.error_target.grid import (
    COLUMNS,
    ROWS,
    START,
    Mipmap,
    coarsen,
    element_count,
    layout,
    level_views,
    rows_of,
)
from refgi.jit import kernel, prange
from refgi.splat.multires.refinement.derivatives import curvatures, depth_slopes
from refgi.stages import stage
from refgi.types import Array

if TYPE_CHECKING:
    from refgi.rsm import GBuffer
    from refgi.splat.multires.settings import Chord, Criteria, DepthCriterion, DepthRange, DepthSlope, NormalRange, Rate
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


@stage("multires.criteria", steps="refgi.splat.multires.refinement.steps.discontinuity_steps")
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
        chosen = [name for name in sorted(_MARK_BY) if getattr(criteria, name) is not None]
        buffer.resolve(*(channel for name in chosen for channel in CHANNELS[name]))
        for name in chosen:
            _MARK_BY[name](buffer, getattr(criteria, name), criteria.rim, sizes, discontinuous, begin)
    return (np.zeros((height, width), np.bool_), *level_views(discontinuous, sizes, first=1))


def _mark_by_depth(
    buffer: "GBuffer", settings: "DepthRange", rim: int, sizes: Array, discontinuous: Array, begin: int
) -> None:
    mip = depth_ranges(buffer.depth, buffer.covered, len(sizes) - 1, rim)
    mark_depth_ranges(mip.lows, mip.highs, settings, sizes, discontinuous, begin)


def mark_depth_ranges(
    lows: Array, highs: Array, settings: "DepthRange", sizes: Array, discontinuous: Array, begin: int = 0
) -> None:
    """Mark the cells (n,) of a layout whose depths `lows` to `highs`, (1, n) m, spread beyond the threshold."""
    real = lows.dtype.type
    if settings.measure == "absolute":
        _mark_spreads(lows, highs, real(settings.threshold), begin, discontinuous)
        return
    for cells, threshold in _by_level(settings, sizes, begin):
        _mark_depths(lows[0, cells], highs[0, cells], real(threshold), 0, discontinuous[cells])


def _mark_by_derivative(
    buffer: "GBuffer", settings: "DepthSlope", _: int, sizes: Array, discontinuous: Array, begin: int
) -> None:
    mip = depth_slopes(buffer.depth, buffer.covered, len(sizes) - 1, settings.measure != "absolute")
    mark_depth_slopes(mip.highs, settings, sizes, discontinuous, begin)


def mark_depth_slopes(
    highs: Array, settings: "DepthSlope", sizes: Array, discontinuous: Array, begin: int = 0
) -> None:
    """Mark the cells (n,) of a layout whose steepest slope `highs`, (1, n), exceeds the threshold."""
    for cells, threshold in _by_level(settings, sizes, begin):
        _mark_maxima(highs[0, cells], highs.dtype.type(threshold), 0, discontinuous[cells])


def _by_level(settings: "DepthCriterion", sizes: Array, begin: int) -> Iterator[tuple[slice, float]]:
    """Yield cells of one threshold from `begin` on, and it: all of them, or with that of the demo a level's."""
    if settings.measure != "demo":
        yield slice(begin, None), settings.threshold
        return
    for level, (start, rows, columns) in enumerate(sizes):
        if level > 0 and start >= begin:
            yield slice(start, start + rows * columns), settings.threshold * 3 / level


def _mark_by_normal(
    buffer: "GBuffer", settings: "NormalRange", rim: int, sizes: Array, discontinuous: Array, begin: int
) -> None:
    mip = normal_ranges(buffer.normal, buffer.covered, len(sizes) - 1, rim, len(settings.components))
    mark_normal_ranges(mip.lows, mip.highs, settings, discontinuous, begin)


def mark_normal_ranges(
    lows: Array, highs: Array, settings: "NormalRange", discontinuous: Array, begin: int = 0
) -> None:
    """Mark the cells (n,) in which a component of the normals, `lows` to `highs`, (c, n), spreads too far."""
    _mark_spreads(lows, highs, lows.dtype.type(settings.threshold), begin, discontinuous)


def _mark_by_curvature(
    buffer: "GBuffer", settings: "Chord | Rate", _: int, sizes: Array, discontinuous: Array, begin: int
) -> None:
    mip = curvatures(buffer.normal, buffer.position, buffer.covered, len(sizes) - 1, settings.name() == "rate")
    mark_curvatures(mip.highs, settings, discontinuous, begin)


def mark_curvatures(highs: Array, settings: "Chord | Rate", discontinuous: Array, begin: int = 0) -> None:
    """Mark the cells (n,) whose largest curvature `highs`, (1, n), exceeds the threshold."""
    _mark_maxima(highs[0], highs.dtype.type(settings.threshold), begin, discontinuous)


_MARK_BY: dict[str, Any] = {"depth": _mark_by_depth, "derivative": _mark_by_derivative, "normal": _mark_by_normal,
            "curvature": _mark_by_curvature}


@kernel(parallel=True)
def _mark_depths(low: Array, high: Array, threshold: Any, begin: int, discontinuous: Array) -> None:
    """Mark cells whose depths spread by more than a share of the nearest."""
    for chunk in prange((len(discontinuous) - begin + CHUNK - 1) // CHUNK):
        a, b = begin + chunk * CHUNK, min(begin + (chunk + 1) * CHUNK, len(discontinuous))
        _mark_depths_of_chunk(low[a:b], high[a:b], threshold, discontinuous[a:b])


@kernel
def _mark_depths_of_chunk(low: Array, high: Array, threshold: Any, discontinuous: Array) -> None:
    for k in range(len(discontinuous)):
        # Sec. 3.2.1, depth threshold: max - min of depth over a share of the least
        discontinuous[k] |= high[k] - low[k] > threshold * low[k]


@kernel(parallel=True)
def _mark_spreads(low: Array, high: Array, threshold: Any, begin: int, discontinuous: Array) -> None:
    """Mark cells in which any channel spreads by more than the threshold (Sec. 3.2)."""
    for chunk in prange((len(discontinuous) - begin + CHUNK - 1) // CHUNK):
        a, b = begin + chunk * CHUNK, min(begin + (chunk + 1) * CHUNK, len(discontinuous))
        for c in range(len(low)):
            _mark_spreads_of_chunk(low[c, a:b], high[c, a:b], threshold, discontinuous[a:b])


@kernel
def _mark_spreads_of_chunk(low: Array, high: Array, threshold: Any, discontinuous: Array) -> None:
    for k in range(len(discontinuous)):
        # Sec. 3.2.1, 3.2.2, depth or normal threshold: max - min of a channel
        discontinuous[k] |= high[k] - low[k] > threshold


@kernel(parallel=True)
def _mark_maxima(high: Array, threshold: Any, begin: int, discontinuous: Array) -> None:
    """Mark cells whose largest value exceeds the threshold."""
    for chunk in prange((len(discontinuous) - begin + CHUNK - 1) // CHUNK):
        a, b = begin + chunk * CHUNK, min(begin + (chunk + 1) * CHUNK, len(discontinuous))
        _mark_maxima_of_chunk(high[a:b], threshold, discontinuous[a:b])


@kernel
def _mark_maxima_of_chunk(high: Array, threshold: Any, discontinuous: Array) -> None:
    for k in range(len(discontinuous)):
        # Eq. (1), curvature threshold, and depth derivatives
        discontinuous[k] |= high[k] > threshold
