"""Joint bilateral upsampling of irradiance (Sec. 3.2; Kopf, Cohen, Lischinski and Uyttendaele 2007).

Threads take blocks of WIDE pixels by BAND rows of texels.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.jit import kernel, prange
from refgi.sssil.upsampling import lines, receivers, weights
from refgi.sssil.upsampling.lines import SPAN, WIDE
from refgi.sssil.upsampling.weights import TENTS, write_tents

Array = npt.NDArray[Any]

BAND = 8  # rows of texels of a block
LANES = 32  # pixels that are looked at together for one without any weight: whole texels of any size


@kernel(parallel=True)
def fill_bilateral(
    light: Array, coarse_depth: Array, coarse_normal: Array, depth: Array, normal: Array, factor: int, sharpness: Any,
    corner: Any, power: Any, added: Array, adds: bool, result: Array,
) -> None:
    """Upsample irradiance of texels to pixels of the same surface, and add `added` if `adds`.

    `light` (3, hc, wc), W/m^2; `coarse_depth`, `coarse_normal` of texels and `depth`, `normal` of pixels: m, inf for no
    surface, and unit vectors. `factor` pixels along a texel's side. `sharpness`, `corner`: of `load_receivers`;
    `power`: of `bilateral_weight`. `result` (3, h, w) is filled, W/m^2.
    """
    tents = np.empty(TENTS, depth.dtype)
    write_tents(factor, corner, tents)
    across = (depth.shape[1] + WIDE - 1) // WIDE
    bands = (coarse_depth.shape[0] + BAND - 1) // BAND
    for task in prange(across * bands):
        left, first = np.int64(task) % across * WIDE, np.int64(task) // across * BAND
        _fill_block(light, coarse_depth, coarse_normal, depth, normal, left, first, factor, tents, sharpness, corner,
                    power, added, adds, result)


@kernel
def _fill_block(
    light: Array, coarse_depth: Array, coarse_normal: Array, depth: Array, normal: Array, left: int, first: int,
    side: int, tents: Array, sharpness: Any, corner: Any, power: Any, added: Array, adds: bool, result: Array,
) -> None:
    texels, nearness = np.empty((3, lines.LINES), depth.dtype), np.empty((3, SPAN), depth.dtype)
    pixels, means = np.zeros(receivers.HERE, depth.dtype), np.empty(weights.MEANS, depth.dtype)
    bounds, scratch = np.empty(lines.BOUNDS, depth.dtype), np.empty((2, SPAN), depth.dtype)
    wide = min(WIDE, (depth.shape[1] - left + LANES - 1) // LANES * LANES)
    # two rows of texels and two of pixels are loaded before the first that is filled
    for y in range((first - 2) * side, min((first + BAND) * side, depth.shape[0])):
        row, place = y // side, y % side
        if place == 0:
            lines.load_texels(light, coarse_depth, coarse_normal, row + 1, left, wide, side, scratch,
                              texels[(row + 4) % 3])
            if row >= first:
                lines.load_bounds(light, row, left, wide, side, scratch, bounds)
        if y >= first * side - 2:
            receivers.load_nearness(depth, y + 1, left, wide, nearness[(y + 4) % 3])
        if y >= first * side:
            receivers.load_receivers(normal, y, left, wide, side, sharpness, corner, nearness[(y + 2) % 3],
                                     nearness[y % 3], nearness[(y + 1) % 3], tents, pixels)
            above, middle, below = texels[(row + 2) % 3], texels[row % 3], texels[(row + 1) % 3]
            weights.average(above, middle, below, pixels, bounds, tents, place, wide, side, power, means)
            for start in range(0, wide, LANES):
                if _any_unfilled(pixels, means, start):
                    _fill_from_nearest(above, middle, below, pixels, tents, place, side, start, means)
            _store(y, left, pixels, means, added, adds, result)


@kernel
def _any_unfilled(pixels: Array, means: Array, start: int) -> bool:
    """Return whether one of LANES pixels has no texel of any weight."""
    real = means.dtype.type
    count = 0
    for i in range(np.uint64(start), np.uint64(start + LANES)):
        covered = pixels[np.uint64(receivers.SCALE) + i] > real(0.0)
        count += covered & (means[np.uint64(weights.TOTAL) + i] == real(0.0))
    return count > 0


@kernel
def _fill_from_nearest(
    above: Array, middle: Array, below: Array, pixels: Array, tents: Array, place: int, side: int, start: int,
    means: Array,
) -> None:
    """Take the light of the texel that is nearest in depth where no texel has any weight."""
    real = means.dtype.type
    up = -1 if tents[place] < real(0.0) else 1
    for i in range(start, start + LANES):
        if means[weights.TOTAL + i] > real(0.0) or pixels[receivers.SCALE + i] <= real(0.0):
            continue
        nearer = -1 if tents[i] < real(0.0) else 1
        best = real(lines.NOWHERE / 2)
        for c in range(3):
            means[c * SPAN + i] = real(0.0)
        for dy in (0, up, -up):
            texels = above if dy < 0 else (below if dy > 0 else middle)
            for dx in (0, nearer, -nearer):
                at = i + (dx + 1) * side
                plane = (pixels[receivers.PLANE + i] + real(dy) * pixels[receivers.DOWN + i]
                         + real(dx) * pixels[receivers.ACROSS + i])
                off = abs(texels[lines.NEARNESS + at] - plane)
                if off < best:
                    best = off
                    for c in range(3):
                        means[c * SPAN + i] = texels[lines.LIGHT + c * SPAN + at]


@kernel
def _store(y: int, left: int, pixels: Array, means: Array, added: Array, adds: bool, result: Array) -> None:
    zero = means.dtype.type(0.0)
    start, size = np.uint64(left), np.uint64(min(WIDE, result.shape[2] - left))
    for c in range(3):
        line = np.uint64(c * SPAN)
        if adds:
            for i in range(size):
                means[line + i] = means[line + i] + added[c, y, start + i]
        for i in range(size):
            result[c, y, start + i] = means[line + i] if pixels[np.uint64(receivers.SCALE) + i] > zero else zero
