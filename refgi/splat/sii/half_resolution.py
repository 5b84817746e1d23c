"""Half-resolution indirect light with joint bilateral upsampling (SII Table 3): one pixel of each 2 x 2 is evaluated.

The paper gives frame rates of a 256^2 indirect image under a 512^2 picture and no filter. Here a pixel takes the
bilinear mean of the four blocks around it, each times the bilateral weight::

    a = max(0, n . n_k)^8 (1 - |n . (x_k - x)| / |x_k - x|)^2,

the first factor for edges, the second for depth: the sine of x_k's height over the pixel's plane, which has no unit
and no parameter. A pixel that no block resembles is evaluated by itself. `joint=False` leaves a out: the plain
bilinear filter, which smears light over edges.

Symbols: x, n position and normal of the pixel, x_k, n_k those of a block's pixel.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from refgi.jit import kernel, prange
from refgi.pairs.irradiance import Receivers
from refgi.stages import stage
from refgi.types import Array

LEAST_WEIGHT = 0.05  # of 1, sum of weights below which a pixel is evaluated by itself


@stage("sii.half_resolution")
def half_resolution(
    receivers: Receivers, evaluate: Callable[[Receivers], Array], *, joint: bool = True
) -> Array:
    """Evaluate light at a quarter of the pixels and interpolate it to all.

    evaluate: Gives the irradiance (3, h', w') of receivers of any height and width.
    joint: Weight blocks by position and normal; else by place on the screen only.
    -> (3, h, w): Irradiance, W/m^2; 0 where there is no surface.

    Notes
    -----
    A block is evaluated at its first covered pixel, row by row. That pixel keeps its value, a constant stays that
    constant to the bit, and pixels without surface count nowhere.
    """
    position, normal, covered = (np.asarray(part) for part in receivers)
    chosen = _block_pixels(covered)
    flat = [part.reshape(*part.shape[:-2], -1) for part in (position, normal, covered)]
    blocks = Receivers(*(np.ascontiguousarray(part[..., chosen]) for part in flat))
    coarse = evaluate(blocks)
    result = np.zeros(position.shape, coarse.dtype)
    resolved = np.zeros(covered.shape, np.bool_)
    _interpolate(Receivers(position, normal, covered), blocks, chosen, coarse, joint, result, resolved)
    unresolved = np.flatnonzero(covered & ~resolved)
    if len(unresolved):
        here = Receivers(*(np.ascontiguousarray(part[..., unresolved][..., None, :]) for part in flat))
        result.reshape(3, -1)[:, unresolved] = evaluate(here)[:, 0]
    return result


def _block_pixels(covered: Array) -> Array:
    """Return the flat index of the first covered pixel of each block, (h', w') int64."""
    height, width = covered.shape
    padded = np.zeros((height + height % 2, width + width % 2), np.bool_)
    padded[:height, :width] = covered
    blocks = padded.reshape(len(padded) // 2, 2, -1, 2).transpose(0, 2, 1, 3)
    first = blocks.reshape(*blocks.shape[:2], 4).argmax(axis=2)
    rows, columns = (np.arange(size) * 2 for size in first.shape)
    return np.asarray((rows[:, None] + first // 2) * width + columns + first % 2)


@kernel(parallel=True)
def _interpolate(
    pixels: Receivers, blocks: Receivers, chosen: Array, coarse: Array, joint: bool, result: Array, resolved: Array
) -> None:
    for i in prange(resolved.shape[0]):
        _interpolate_row(pixels, blocks, chosen, coarse, joint, result, resolved, i)


@kernel
def _interpolate_row(
    pixels: Receivers, blocks: Receivers, chosen: Array, coarse: Array, joint: bool, result: Array, resolved: Array,
    i: int,
) -> None:
    """Fill the covered pixels of row i with the mean of up to four blocks, and mark those that have one."""
    real = coarse.dtype.type
    x, n, xk, nk = pixels.position, pixels.normal, blocks.position, blocks.normal
    height, width = chosen.shape
    top = i // 2
    for j in range(resolved.shape[1]):
        if not pixels.covered[i, j]:
            continue
        left = j // 2
        total, red, green, blue = real(0.0), real(0.0), real(0.0), real(0.0)
        most, p, q, r = real(0.0), real(0.0), real(0.0), real(0.0)
        for corner in range(1 if chosen[top, left] == i * resolved.shape[1] + j else 4):
            row, column = top + corner // 2, left + corner % 2
            weight = real(0.25 * (2 - i % 2 if corner < 2 else i % 2) * (j % 2 if corner % 2 else 2 - j % 2))
            if weight == real(0.0) or row >= height or column >= width or not blocks.covered[row, column]:
                continue
            if joint:
                weight *= _bilateral_weight(
                    xk[0, row, column] - x[0, i, j], xk[1, row, column] - x[1, i, j], xk[2, row, column] - x[2, i, j],
                    n[0, i, j], n[1, i, j], n[2, i, j], nk[0, row, column], nk[1, row, column], nk[2, row, column])
            a, b, c = coarse[0, row, column], coarse[1, row, column], coarse[2, row, column]
            # differences to p, q, r, the block of most weight: constants are exact, what hardly counts costs no digits
            if weight > most:
                red, green, blue = red + total * (p - a), green + total * (q - b), blue + total * (r - c)
                most, p, q, r = weight, a, b, c
            total += weight
            red, green, blue = red + weight * (a - p), green + weight * (b - q), blue + weight * (c - r)
        if total >= real(LEAST_WEIGHT):
            resolved[i, j] = True
            result[0, i, j] = p + red / total
            result[1, i, j] = q + green / total
            result[2, i, j] = r + blue / total


@kernel
def _bilateral_weight(dx: Any, dy: Any, dz: Any, nx: Any, ny: Any, nz: Any, mx: Any, my: Any, mz: Any) -> Any:
    """Return the bilateral weight a for a block's pixel d away, with normals n of the pixel and m of the block."""
    real = type(dx)
    one, zero = real(1.0), real(0.0)
    cosine = nx * mx + ny * my + nz * mz
    square = dx * dx + dy * dy + dz * dz
    if cosine <= zero:
        return zero
    sine = abs(dx * nx + dy * ny + dz * nz) / math.sqrt(square) if square > zero else zero
    flat = one - (sine if sine < one else one)
    power = cosine * cosine
    power *= power
    return power * power * (flat * flat)
