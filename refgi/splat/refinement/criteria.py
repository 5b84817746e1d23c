"""Which cells hold a discontinuity (Nichols and Wyman 2009, Sec. 3.2 and 4.1): mips against thresholds.

A cell needs to be refined where any criterion asked for says so. Criteria not asked for are not built.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.splat.refinement.pyramid import START, layout, room, views
from refgi.splat.refinement.ranges import curvatures, depth_ranges, depth_slopes, normal_ranges
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.rsm import GBuffer
    from refgi.splat.multires import MultiresSettings

Array = npt.NDArray[Any]

CHANNELS = {"depth": ("depth",), "derivative": ("depth",), "normal": ("normal",), "curvature": ("normal", "position")}
CHUNK = 4096  # cells that a thread takes at once


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
