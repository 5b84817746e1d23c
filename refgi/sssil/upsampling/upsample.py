"""Irradiance of a level brought to the next finer one, or to the picture, and added to what is known there.

Upsampling that knows of no surfaces: bilinear, which bleeds across edges, and nearest.
"""

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.rsm.memory import plane
from refgi.sssil.upsampling.bilateral import fill_bilateral
from refgi.sssil.upsampling.lines import PAD
from refgi.stages import stage

if TYPE_CHECKING:
    from refgi.sssil.settings import HssilSettings

Array = npt.NDArray[Any]
QUICK_POWER = 8.0  # of the cosine between normals: three multiplications


@kernel(parallel=True)
def fill_plain(
    light: Array, below_depth: Array, depth: Array, factor: int, nearest: bool, added: Array, adds: bool,
    result: Array,
) -> None:
    """Carry irradiance of texels over to pixels, whatever they see.

    Parameters
    ----------
    light : (3, hc, wc) ndarray
        Irradiance of texels, W/m^2.
    below_depth : (hc, wc) ndarray
        Depth of texels, m; those at infinity have no weight.
    depth : (h, w) ndarray
        Depth of pixels, m; those at infinity receive nothing.
    factor : int
        Pixels along a texel's side.
    nearest : bool
        Take a pixel's own texel instead of the bilinear mean of four.
    added : (3, h, w) ndarray
        Irradiance that is added where a surface is seen, W/m^2.
    adds : bool
        Whether it is.
    result : (3, h, w) ndarray
        Filled.
    """
    width = depth.shape[1]
    real = depth.dtype.type
    infinite, zero = real(np.inf), real(0.0)
    for row in prange(depth.shape[0]):
        y = np.int64(row)
        for x in range(width):
            seen = depth[y, x] < infinite
            weights = _weights(below_depth, y, x, factor, nearest)
            for c in range(3):
                value = _mean(light, c, y, x, factor, weights) if seen else zero
                if adds:
                    value = value + (added[c, y, x] if seen else zero)
                result[c, y, x] = value


@kernel
def _weights(below_depth: Array, y: Any, x: int, factor: int, nearest: bool) -> Any:
    """Return the weights of own texel, row's neighbour, column's neighbour and both's; their sum is 1 or 0."""
    real = below_depth.dtype.type
    one = real(1.0)
    tx, ty = (real(0.0), real(0.0)) if nearest else (_distance(x, factor, real), _distance(y, factor, real))
    i, j, ni, nj = x // factor, y // factor, x // factor + _side(x, factor), y // factor + _side(y, factor)
    own = _seen(below_depth, j, i) * ((one - tx) * (one - ty))
    row, column = _seen(below_depth, j, ni) * (tx * (one - ty)), _seen(below_depth, nj, i) * ((one - tx) * ty)
    both = _seen(below_depth, nj, ni) * (tx * ty)
    total = (own + row) + (column + both)
    total = total if total > real(0.0) else one
    return own / total, row / total, column / total, both / total


@kernel
def _mean(light: Array, c: int, y: Any, x: int, factor: int, weights: Any) -> Any:
    zero = light.dtype.type(0.0)
    own, row, column, both = weights
    i, j, ni, nj = x // factor, y // factor, x // factor + _side(x, factor), y // factor + _side(y, factor)
    reference = light[c, j, i] if own > zero else zero
    value = own * (light[c, j, i] - reference) if own > zero else zero
    value = value + (row * (light[c, j, ni] - reference) if row > zero else zero)
    beside = column * (light[c, nj, i] - reference) if column > zero else zero
    beside = beside + (both * (light[c, nj, ni] - reference) if both > zero else zero)
    return reference + (value + beside)


@kernel
def _distance(place: int, factor: int, real: Any) -> Any:
    """Return how far a pixel's centre is from that of its texel, texels."""
    return real(abs(2 * (place % factor) + 1 - factor)) / real(2 * factor)


@kernel
def _side(place: int, factor: int) -> int:
    return -1 if 2 * (place % factor) + 1 < factor else 1


@kernel
def _seen(depth: Array, row: int, column: int) -> Any:
    real = depth.dtype.type
    inside = (row >= 0) & (row < depth.shape[0]) & (column >= 0) & (column < depth.shape[1])
    return real(1.0) if inside and depth[row, column] < real(np.inf) else real(0.0)


class Guide(NamedTuple):
    """What the texels of a level, or the pixels of the picture, see: it says which of them belong together."""

    depth: Array  # (h, w) m along the view direction; inf where no surface is seen
    normal: Array  # (3, h, w) unit vectors


@stage("sssil.upsample", kept=False)
def upsample(
    coarse: Array, below: Guide, here: Guide, settings: "HssilSettings", added: Array | None = None
) -> Array:
    """Carry irradiance over to a finer level and add what that level has of its own.

    Parameters
    ----------
    coarse : (3, hc, wc) ndarray
        Irradiance of the coarser level's texels, W/m^2; its dtype is that of the result.
    below : Guide
        What those texels see.
    here : Guide
        What the finer level's texels, or the pixels, see: (h, w) of them, hc = ceil(h / F) and wc = ceil(w / F) for F
        one of 2, 4, .. 32.
    settings : HssilSettings
        `upsampling`, `depth_sigma`, `normal_power`; `downsample` says where in a texel its depth was found.
    added : (3, h, w) ndarray, optional
        Irradiance to add, W/m^2.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2; 0 where no surface is seen.

    Raises
    ------
    InputError
        If sizes do not fit.

    Notes
    -----
    Sec. 3.2 names a joint bilateral filter of 3 x 3 texels (Sec. 5) and gives no weights. Here a texel weighs
    ``tent * exp(-delta^2 / (2 depth_sigma^2)) * max(0, <n . n'>)^normal_power``: the tent leaves linear functions
    linear, and delta = z (1/z' - 1/z_plane) compares the texel's depth with that of the plane through the receiver at
    the texel's place, so that slanted planes keep the whole tent. That place is where the plane has the nearest of the
    texel's pixels, unless depths are averaged. Equal light stays equal to the bit where the own
    texel is of the receiver's surface. Where no texel has any weight, the nearest in depth is taken.
    """
    dtype = coarse.dtype
    values, depth, normal, below_depth, below_normal = (
        np.ascontiguousarray(array, dtype) for array in (coarse, *here, *below))
    more = None if added is None else np.ascontiguousarray(added, dtype)
    factor = _factor(depth.shape, below_depth.shape)
    expect(values.shape == (3, *below_depth.shape), "coarse", f"shape {(3, *below_depth.shape)}", values.shape)
    for name, array, shape in (("below.normal", below_normal, values.shape), ("here.normal", normal, (3, *depth.shape)),
                               ("added", more, (3, *depth.shape))):
        expect(array is None or array.shape == shape, name, f"shape {shape}", array is not None and array.shape)
    result = plane((3, *depth.shape), dtype)
    adds, more = (False, result) if more is None else (True, more)
    if settings.upsampling != "bilateral":
        fill_plain(values, below_depth, depth, factor, settings.upsampling == "nearest", more, adds, result)
        return result
    real = dtype.type
    sharpness = real(1.0 / (4.0 * math.sqrt(2.0) * settings.depth_sigma))
    # the closest of F x F pixels of a slope is at a corner of the texel
    lean = real(0.0 if settings.downsample == "average" else (factor - 1) / (2 * factor))
    power = None if settings.normal_power == QUICK_POWER else real(settings.normal_power)
    fill_bilateral(values, below_depth, below_normal, depth, normal, factor, sharpness, lean, power, more, adds,
                   result)
    return result


def _factor(shape: tuple[int, ...], coarse: tuple[int, ...]) -> int:
    """Return how many pixels a texel has along a side."""
    factor = 2
    while factor <= PAD and coarse != (-(-shape[0] // factor), -(-shape[1] // factor)):
        factor *= 2
    expect(factor <= PAD, "coarse", f"texels of 2, 4, .. {PAD} pixels of {shape}", coarse)
    return factor
