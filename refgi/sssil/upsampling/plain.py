"""Upsampling that knows of no surfaces: bilinear, which bleeds across edges, and nearest."""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange

Array = npt.NDArray[Any]


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
