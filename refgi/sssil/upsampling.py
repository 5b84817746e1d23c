"""Upsampling of a level's irradiance to the next finer level (Sec. 3.2; Kopf, Cohen, Lischinski and Uyttendaele 2007).

Threads take blocks of WIDE pixels by BAND rows of texels. Bilinear and nearest upsampling bleed across edges.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.errors import expect
from refgi.jit import kernel, prange
from refgi.rsm.pool import plane
from refgi.sssil import upsampling_lines as lines
from refgi.sssil import upsampling_weights as weights
from refgi.sssil.settings import Bilateral, HssilSettings, Nearest
from refgi.sssil.upsampling_lines import PAD, SPAN, WIDE
from refgi.sssil.upsampling_weights import TENTS, write_tents
from refgi.stages import stage
from refgi.types import Array

BAND = 8  # rows of texels of a block
LANES = 32  # pixels that are looked at together for one without any weight: whole texels of any size


class Guide(NamedTuple):
    """Depths and normals that guide joint bilateral upsampling, of a level's texels or the picture's pixels."""

    depth: Array  # (h, w) m along the view direction; inf where there is no surface
    normal: Array  # (3, h, w) unit vectors


class Falloff(NamedTuple):
    """How the weight of a texel falls off."""

    sharpness: Any  # of `load_receivers`
    corner: Any  # likewise
    power: Any  # of `bilateral_weight`


@kernel(parallel=True)
def fill_bilateral(
    light: Array, coarse: Guide, fine: Guide, factor: int, falloff: Falloff, added: Array, adds: bool, result: Array
) -> None:
    """Upsample irradiance of texels of `factor` pixels to pixels of the same surface, and add `added` if `adds`."""
    tents = np.empty(TENTS, fine.depth.dtype)
    write_tents(factor, falloff.corner, tents)
    across = (fine.depth.shape[1] + WIDE - 1) // WIDE
    bands = (coarse.depth.shape[0] + BAND - 1) // BAND
    for task in prange(across * bands):
        left, first = np.int64(task) % across * WIDE, np.int64(task) // across * BAND
        _fill_block(light, coarse, fine, left, first, factor, tents, falloff, added, adds, result)


@kernel
def _fill_block(
    light: Array, coarse: Guide, fine: Guide, left: int, first: int, side: int, tents: Array, falloff: Falloff,
    added: Array, adds: bool, result: Array,
) -> None:
    depth, normal = fine
    sharpness, corner, power = falloff
    texels, nearness = np.empty((3, lines.LINES), depth.dtype), np.empty((3, SPAN), depth.dtype)
    pixels, means = np.zeros(lines.HERE, depth.dtype), np.empty(weights.MEANS, depth.dtype)
    bounds, scratch = np.empty(lines.BOUNDS, depth.dtype), np.empty((2, SPAN), depth.dtype)
    wide = min(WIDE, (depth.shape[1] - left + LANES - 1) // LANES * LANES)
    # two rows of texels and two of pixels are loaded before the first that is filled
    for y in range((first - 2) * side, min((first + BAND) * side, depth.shape[0])):
        row, place = y // side, y % side
        if place == 0:
            lines.load_texels(light, coarse.depth, coarse.normal, row + 1, left, wide, side, scratch,
                              texels[(row + 4) % 3])
            if row >= first:
                lines.load_bounds(light, row, left, wide, side, scratch, bounds)
        if y >= first * side - 2:
            lines.load_nearness(depth, y + 1, left, wide, nearness[(y + 4) % 3])
        if y >= first * side:
            lines.load_receivers(normal, y, left, wide, side, sharpness, corner, nearness[(y + 2) % 3],
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
        covered = pixels[np.uint64(lines.SCALE) + i] > real(0.0)
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
        if means[weights.TOTAL + i] > real(0.0) or pixels[lines.SCALE + i] <= real(0.0):
            continue
        nearer = -1 if tents[i] < real(0.0) else 1
        best = real(lines.NOWHERE / 2)
        for c in range(3):
            means[c * SPAN + i] = real(0.0)
        for dy in (0, up, -up):
            texels = above if dy < 0 else (below if dy > 0 else middle)
            for dx in (0, nearer, -nearer):
                at = i + (dx + 1) * side
                plane = (pixels[lines.PLANE + i] + real(dy) * pixels[lines.DOWN + i]
                         + real(dx) * pixels[lines.ACROSS + i])
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
            result[c, y, start + i] = means[line + i] if pixels[np.uint64(lines.SCALE) + i] > zero else zero


QUICK_POWER = 8.0  # of the cosine between normals: three multiplications


@kernel(parallel=True)
def fill_plain(
    light: Array, coarse_depth: Array, depth: Array, factor: int, nearest: bool, added: Array, adds: bool,
    result: Array,
) -> None:
    """Upsample by the bilinear mean of four texels with surface, or by the `nearest` one; add `added` if `adds`."""
    width = depth.shape[1]
    real = depth.dtype.type
    infinite, zero = real(np.inf), real(0.0)
    for row in prange(depth.shape[0]):
        y = np.int64(row)
        for x in range(width):
            covered = depth[y, x] < infinite
            weights = _weights(coarse_depth, y, x, factor, nearest)
            for c in range(3):
                value = _mean(light, c, y, x, factor, weights) if covered else zero
                if adds:
                    value = value + (added[c, y, x] if covered else zero)
                result[c, y, x] = value


@kernel
def _weights(coarse_depth: Array, y: Any, x: int, factor: int, nearest: bool) -> Any:
    """Return the weights of own texel, row's neighbour, column's neighbour and both's; their sum is 1 or 0."""
    real = coarse_depth.dtype.type
    one = real(1.0)
    tx, ty = (real(0.0), real(0.0)) if nearest else (_distance(x, factor, real), _distance(y, factor, real))
    i, j, ni, nj = x // factor, y // factor, x // factor + _side(x, factor), y // factor + _side(y, factor)
    own = _coverage(coarse_depth, j, i) * ((one - tx) * (one - ty))
    row, column = _coverage(coarse_depth, j, ni) * (tx * (one - ty)), _coverage(coarse_depth, nj, i) * ((one - tx) * ty)
    both = _coverage(coarse_depth, nj, ni) * (tx * ty)
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
    """Return the distance of a pixel's centre from that of its texel, texels."""
    return real(abs(2 * (place % factor) + 1 - factor)) / real(2 * factor)


@kernel
def _side(place: int, factor: int) -> int:
    return -1 if 2 * (place % factor) + 1 < factor else 1


@kernel
def _coverage(depth: Array, row: int, column: int) -> Any:
    real = depth.dtype.type
    inside = (row >= 0) & (row < depth.shape[0]) & (column >= 0) & (column < depth.shape[1])
    return real(1.0) if inside and depth[row, column] < real(np.inf) else real(0.0)


@stage("sssil.upsample", kept=False, each="level")
def upsample(
    coarse: Array, coarse_guide: Guide, guide: Guide, settings: HssilSettings, added: Array | None = None
) -> Array:
    """Upsample irradiance to a finer level, joint bilateral, and add that level's own (HSS Sec. 3.2, E-HSS-12).

    coarse (3, hc, wc): Irradiance of the coarser level's texels, W/m^2; its dtype is that of the result.
    coarse_guide: Depths and normals of those texels.
    guide: Those of the finer level's texels, or of the pixels: (h, w) of them, hc = ceil(h / F) and wc = ceil(w / F)
        for F one of 2, 4, .. 32.
    settings: Filter and its parameters; the downsampling, on which the place of a texel's depth depends.
    added (3, h, w): Irradiance to add, W/m^2.
    -> (3, h, w): Irradiance, W/m^2; 0 where there is no surface.

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
    texel is of the receiver's surface. Where no texel has any weight, the nearest in depth is taken, of several the
    closest, by rows first.
    """
    dtype = coarse.dtype
    values, depth, normal, coarse_depth, coarse_normal = (
        np.ascontiguousarray(array, dtype) for array in (coarse, *guide, *coarse_guide))
    addend = None if added is None else np.ascontiguousarray(added, dtype)
    factor = _factor(depth.shape, coarse_depth.shape)
    expect(values.shape == (3, *coarse_depth.shape), "coarse", f"shape {(3, *coarse_depth.shape)}", values.shape)
    for name, array, shape in (("coarse_guide.normal", coarse_normal, values.shape),
                               ("guide.normal", normal, (3, *depth.shape)),
                               ("added", addend, (3, *depth.shape))):
        expect(array is None or array.shape == shape, name, f"shape {shape}", array is not None and array.shape)
    result = plane((3, *depth.shape), dtype)
    adds, addend = (False, result) if addend is None else (True, addend)
    weights = settings.upsampling
    if not isinstance(weights, Bilateral):
        fill_plain(values, coarse_depth, depth, factor, isinstance(weights, Nearest), addend, adds, result)
        return result
    real = dtype.type
    sharpness = real(1.0 / (4.0 * math.sqrt(2.0) * weights.depth_sigma))
    # the closest of F x F pixels of a slope is at a corner of the texel
    corner = real(0.0 if settings.senders.downsample == "average" else (factor - 1) / (2 * factor))
    power = None if weights.normal_power == QUICK_POWER else real(weights.normal_power)
    fill_bilateral(values, Guide(coarse_depth, coarse_normal), Guide(depth, normal), factor,
                   Falloff(sharpness, corner, power), addend, adds, result)
    return result


def _factor(shape: tuple[int, ...], coarse: tuple[int, ...]) -> int:
    """Return how many pixels a texel has along a side."""
    factor = 2
    while factor <= PAD and coarse != (-(-shape[0] // factor), -(-shape[1] // factor)):
        factor *= 2
    expect(factor <= PAD, "coarse", f"texels of 2, 4, .. {PAD} pixels of {shape}", coarse)
    return factor
