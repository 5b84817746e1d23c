"""Indirect light at half the resolution of the picture (SII Table 3): one pixel of each 2 x 2 is lit.

The paper gives frame rates of a 256^2 indirect image under a 512^2 picture and no filter. Here a pixel takes the
bilinear mean of the four blocks around it, each weighted by how much its surface is the pixel's own:

    a = max(0, n . n_k)^8 (1 - |n . (x_k - x)| / |x_k - x|)^2,

the first factor for edges, the second for depth: the sine of x_k's height over the pixel's plane, which has no unit
and no parameter. A pixel that no block agrees with is lit by itself. `joint=False` leaves a out: the plain filter,
which smears light over edges.

Symbols: x, n position and normal of the pixel, x_k, n_k those of a block's pixel.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.splat.irradiance import Receivers
from refgi.stages import stage

Array = npt.NDArray[Any]

LEAST_WEIGHT = 0.05  # of 1, that blocks which agree with a pixel must have together


@stage("splat.half_resolution")
def half_resolution(
    receivers: Receivers, evaluate: Callable[[Receivers], Array], *, joint: bool = True
) -> Array:
    """Evaluate light at a quarter of the pixels and interpolate it to all.

    Parameters
    ----------
    receivers : Receivers
        All pixels.
    evaluate : callable
        Gives the irradiance (3, h', w') of receivers of any height and width.
    joint : bool
        Weigh blocks by position and normal; else by place on the screen alone.

    Returns
    -------
    (3, h, w) ndarray
        Irradiance, W/m^2; 0 where there is no surface.

    Notes
    -----
    A block is lit at its first covered pixel, row by row. That pixel keeps its value, a constant stays that constant to
    the bit, and pixels without surface count nowhere.
    """
    position, normal, covered = (np.asarray(part) for part in receivers)
    chosen = _chosen(covered)
    flat = [part.reshape(*part.shape[:-2], -1) for part in (position, normal, covered)]
    coarse = evaluate(Receivers(*(np.ascontiguousarray(part[..., chosen]) for part in flat)))
    result = np.zeros(position.shape, coarse.dtype)
    agreed = np.zeros(covered.shape, np.bool_)
    _interpolate(position, normal, covered, chosen, coarse, joint, result, agreed)
    alone = np.flatnonzero(covered & ~agreed)
    if len(alone):
        here = Receivers(*(np.ascontiguousarray(part[..., alone][..., None, :]) for part in flat))
        result.reshape(3, -1)[:, alone] = evaluate(here)[:, 0]
    return result


def _chosen(covered: Array) -> Array:
    """Return the flat index of the pixel that stands for each block, (h', w') int64."""
    height, width = covered.shape
    padded = np.zeros((height + height % 2, width + width % 2), np.bool_)
    padded[:height, :width] = covered
    blocks = padded.reshape(len(padded) // 2, 2, -1, 2).transpose(0, 2, 1, 3)
    first = blocks.reshape(*blocks.shape[:2], 4).argmax(axis=2)
    rows, columns = (np.arange(size) * 2 for size in first.shape)
    return np.asarray((rows[:, None] + first // 2) * width + columns + first % 2)


@kernel(parallel=True)
def _interpolate(
    position: Array, normal: Array, covered: Array, chosen: Array, coarse: Array, joint: bool, result: Array,
    agreed: Array,
) -> None:
    for i in prange(covered.shape[0]):
        for j in range(covered.shape[1]):
            if covered[i, j]:
                agreed[i, j] = _fill_pixel(position, normal, covered, chosen, coarse, joint, result, i, j)


@kernel
def _fill_pixel(
    position: Array, normal: Array, covered: Array, chosen: Array, coarse: Array, joint: bool, result: Array, i: int,
    j: int,
) -> bool:
    """Give one pixel its mean of four blocks, or return False."""
    width = covered.shape[1]
    top, left = i // 2, j // 2
    if chosen[top, left] == i * width + j:
        for c in range(3):
            result[c, i, j] = coarse[c, top, left]
        return True
    total, red, green, blue = 0.0, 0.0, 0.0, 0.0
    for corner in range(4):
        row, column = top + corner // 2, left + corner % 2
        if row >= chosen.shape[0] or column >= chosen.shape[1]:
            continue
        r, s = chosen[row, column] // width, chosen[row, column] % width
        if not covered[r, s]:
            continue
        weight = (0.5 * (i % 2) if corner // 2 else 1.0 - 0.5 * (i % 2)) * (
            0.5 * (j % 2) if corner % 2 else 1.0 - 0.5 * (j % 2))
        weight *= _agreement(position, normal, i, j, r, s) if joint else 1.0
        total += weight
        # differences to the own block's value: a constant is then exact
        red += weight * (coarse[0, row, column] - coarse[0, top, left])
        green += weight * (coarse[1, row, column] - coarse[1, top, left])
        blue += weight * (coarse[2, row, column] - coarse[2, top, left])
    if total < LEAST_WEIGHT:
        return False
    result[0, i, j] = coarse[0, top, left] + red / total
    result[1, i, j] = coarse[1, top, left] + green / total
    result[2, i, j] = coarse[2, top, left] + blue / total
    return True


@kernel
def _agreement(position: Array, normal: Array, i: int, j: int, r: int, s: int) -> float:
    cosine, height, square = 0.0, 0.0, 0.0
    for axis in range(3):
        step = position[axis, r, s] - position[axis, i, j]
        cosine += normal[axis, r, s] * normal[axis, i, j]
        height += normal[axis, i, j] * step
        square += step * step
    if cosine <= 0.0:
        return 0.0
    sine = min(1.0, abs(height) / math.sqrt(square)) if square > 0.0 else 0.0
    power = cosine * cosine
    power *= power
    return power * power * (1.0 - sine) ** 2
