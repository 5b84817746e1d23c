"""Which cells hold a discontinuity (Nichols and Wyman 2009, Sec. 3.2 and 4.1): mips against thresholds.

A cell needs to be refined where any criterion asked for says so. Criteria not asked for are not built.

Min-max mips that find discontinuities (Nichols and Wyman 2009, Sec. 3.2): ranges of depth and of normals.

Each cell of each level holds the least and the largest value of its pixels. Only those that show a surface count, so a
silhouette against nothing is no discontinuity. A picture of any size has such a mip: cells at its border are cut.
Differences between neighbours have max mips in `changes`.
"""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.splat.multires.refinement.changes import curvatures, depth_slopes
from refgi.splat.multires.refinement.pyramid import COLUMNS, ROWS, START, Mip, coarsen, layout, room, rows_of, views
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.rsm import GBuffer
    from refgi.splat.multires.settings import MultiresSettings

Array = npt.NDArray[Any]
CHANNELS = {"depth": ("depth",), "derivative": ("depth",), "normal": ("normal",), "curvature": ("normal", "position")}
CHUNK = 4096  # cells that a thread takes at once


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
    low, high = (tuple(level[0] for level in side) for side in (mip.low, mip.high))
    return Mip(low, high, mip.lows, mip.highs)


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


def _ranges(plane: Array, covered: Array, top: int, rim: int) -> Mip:
    """Return the min-max mip of the channels (c, h, w) of a picture."""
    height, width = covered.shape
    sizes = layout(height, width, top, first=1)
    cells = room(sizes) if top else 0
    lows, highs = np.empty((len(plane), cells), plane.dtype), np.empty((len(plane), cells), plane.dtype)
    if top:
        strips, across = sizes[top, ROWS], 2 * sizes[1, COLUMNS] + 2 * rim
        rows = np.empty((strips, 2, across), plane.dtype)
        _build_ranges(plane, np.ascontiguousarray(covered), rim, sizes, rows, lows, highs)
    low, high = ((plane, *views(side, sizes, first=1)) for side in (lows, highs))
    return Mip(low, high, lows, highs)


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


@stage("splat.criteria")
def needs(buffer: "GBuffer", settings: "MultiresSettings", top: int) -> tuple[Array, ...]:
    """Return which cells of each level hold a discontinuity.

    Parameters
    ----------
    buffer : GBuffer
        What the camera sees.
    settings : MultiresSettings
        Criteria, their thresholds, `rim` and the level that is `finest`.
    top : int
        Coarsest level.

    Returns
    -------
    tuple of (h_l, w_l) ndarray of bool
        For levels 0 to `top`; False at levels up to `finest`, which is never refined, and where no surface is.
    """
    height, width = buffer.covered.shape
    sizes = layout(height, width, top, first=1)
    need = np.zeros(room(sizes) if top else 0, np.bool_)
    begin = sizes[settings.finest + 1, START] if settings.finest < top else len(need)
    if begin < len(need):
        buffer.resolve(*(name for criterion in sorted(settings.criteria) for name in CHANNELS[criterion]))
        for criterion in sorted(settings.criteria):
            _JUDGES[criterion](buffer, settings, top, need, begin)
    return (np.zeros((height, width), np.bool_), *views(need, sizes, first=1))


def _judge_depth(buffer: "GBuffer", settings: "MultiresSettings", top: int, need: Array, begin: int) -> None:
    mip = depth_ranges(buffer.depth, buffer.covered, top, settings.rim)
    _mark_depths(mip.lows[0], mip.highs[0], buffer.depth.dtype.type(settings.depth_threshold), begin, need)


def _judge_derivative(buffer: "GBuffer", settings: "MultiresSettings", top: int, need: Array, begin: int) -> None:
    mip = depth_slopes(buffer.depth, buffer.covered, top)
    _mark_maxima(mip.highs[0], buffer.depth.dtype.type(settings.derivative_threshold), begin, need)


def _judge_normal(buffer: "GBuffer", settings: "MultiresSettings", top: int, need: Array, begin: int) -> None:
    components = buffer.normal if settings.normal_components == "xyz" else buffer.normal[:2]
    mip = normal_ranges(components, buffer.covered, top, settings.rim)
    _mark_normals(mip.lows, mip.highs, buffer.normal.dtype.type(settings.normal_threshold), begin, need)


def _judge_curvature(buffer: "GBuffer", settings: "MultiresSettings", top: int, need: Array, begin: int) -> None:
    mip = curvatures(buffer.normal, buffer.position, buffer.covered, top, settings.curvature == "rate")
    _mark_maxima(mip.highs[0], buffer.normal.dtype.type(settings.curvature_threshold), begin, need)


_JUDGES = {"depth": _judge_depth, "derivative": _judge_derivative, "normal": _judge_normal,
           "curvature": _judge_curvature}


@kernel(parallel=True)
def _mark_depths(low: Array, high: Array, threshold: Any, begin: int, need: Array) -> None:
    """Mark cells whose depths spread by more than a share of the nearest."""
    for chunk in prange((len(need) - begin + CHUNK - 1) // CHUNK):
        a, b = begin + chunk * CHUNK, min(begin + (chunk + 1) * CHUNK, len(need))
        _mark_depths_of_chunk(low[a:b], high[a:b], threshold, need[a:b])


@kernel
def _mark_depths_of_chunk(low: Array, high: Array, threshold: Any, need: Array) -> None:
    for k in range(len(need)):
        need[k] |= high[k] - low[k] > threshold * low[k]


@kernel(parallel=True)
def _mark_normals(low: Array, high: Array, threshold: Any, begin: int, need: Array) -> None:
    """Mark cells in which any component of the normals spreads by more than the threshold (Sec. 3.2.2)."""
    for chunk in prange((len(need) - begin + CHUNK - 1) // CHUNK):
        a, b = begin + chunk * CHUNK, min(begin + (chunk + 1) * CHUNK, len(need))
        for c in range(len(low)):
            _mark_spreads_of_chunk(low[c, a:b], high[c, a:b], threshold, need[a:b])


@kernel
def _mark_spreads_of_chunk(low: Array, high: Array, threshold: Any, need: Array) -> None:
    for k in range(len(need)):
        need[k] |= high[k] - low[k] > threshold


@kernel(parallel=True)
def _mark_maxima(high: Array, threshold: Any, begin: int, need: Array) -> None:
    """Mark cells whose largest value exceeds the threshold."""
    for chunk in prange((len(need) - begin + CHUNK - 1) // CHUNK):
        a, b = begin + chunk * CHUNK, min(begin + (chunk + 1) * CHUNK, len(need))
        _mark_maxima_of_chunk(high[a:b], threshold, need[a:b])


@kernel
def _mark_maxima_of_chunk(high: Array, threshold: Any, need: Array) -> None:
    for k in range(len(need)):
        need[k] |= high[k] > threshold
