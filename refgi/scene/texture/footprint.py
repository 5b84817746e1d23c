"""The mean of a texture over what a pixel covers: probes on its footprint, each blended between two mip levels.

The footprint of a pixel is the parallelogram that its sides a and b span on the image, in texels. It is divided along
its longer side into equal parts no longer than `STRETCH` times the shorter one, and a probe in the middle of each is
looked up where a texel is `TEXEL` times as long as the part or, if that is more, the shorter side: a blend of four
texels is wider than one. A longer footprint thus has more probes along it and is not blurred across (anisotropic
filtering); of those more than `MOST` times as long as wide the parts are longer.

Probes are listed for some pixels at once, so that what is done for each needs no branch and runs in SIMD lanes.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from refgi.elementary import log2
from refgi.jit import kernel
from refgi.scene.texture.lookup import neighbours_of
from refgi.scene.texture.table import FILTER, FIRST, LEVELS, NEAREST, TRILINEAR, WRAP_U, WRAP_V, TextureTable
from refgi.types import Array

MOST = 32  # probes along the longer side
STRETCH, TEXEL = 1.2, 0.93  # of these pairs the best on a checkered floor
SHORTEST = 0.5  # texel; smaller parts see no more of a blend of four
EDGE_ON = 1e12  # texels a pixel, of a surface that is seen edge-on
TOGETHER = 64  # most pixels whose probes are listed at once
LOOKS = 2 * MOST * TOGETHER  # of them, on two levels each
# rows of `Looks.pixel`: the image's size and last level; first probe, step to the next, level and number of probes;
# periods of u and v, and one over each; and what is given from PLACE on: u and v of the pixel's centre, their change to
# the next pixel of its row, and to that of the next row
WIDTH, HEIGHT, TOP, U, V, ALONG_U, ALONG_V, LEVEL, PROBES, PERIOD = range(10)
PLACE = PERIOD + 4
PERIODS = (1.0, 0.0, 2.0)  # of u and v, by wrap: repeat, clamp, mirror
X, Y = range(2)  # rows of `Looks.place`
PIXEL, START, RIGHT, BELOW, INTEGERS = range(5)  # rows of `Looks.texel`
WEIGHT, P, Q, SHARES = range(4)  # rows of `Looks.share`


class Looks(NamedTuple):
    """Scratch of one worker: probes of some pixels, and where each is looked up."""

    short: Array  # (TOGETHER,) float32
    pixel: Array  # ((PLACE + 6) TOGETHER,) float64: rows as named above
    place: Array  # (2 LOOKS,) float64: place of a look on its level, in texels
    texel: Array  # (INTEGERS LOOKS,) int32: pixel, first texel (of the level; then of the look), steps to the others
    share: Array  # (SHARES LOOKS,) float32: weight of a look, shares of the second texel along both axes
    span: Array  # (2 TOGETHER, 4) int64: first and one past the last look, texture, level; of those not simply blended


@kernel
def looks() -> Any:
    """Return scratch of one worker."""
    return Looks(np.ones(TOGETHER, np.float32), np.ones((PLACE + 6) * TOGETHER), np.zeros(2 * LOOKS),
                 np.zeros(INTEGERS * LOOKS, np.int32), np.zeros(SHARES * LOOKS, np.float32),
                 np.zeros((2 * TOGETHER, 4), np.int64))


@kernel
def footprint_means(table: TextureTable, texture: Array, count: int, scratch: Looks, colour: Array) -> None:
    """Look up what each texture's filter makes of each of some pixels: the mean over its footprint, or a point.

    `texture` (n,): row of the table, -1 for none. `count`: how many pixels there are, at most TOGETHER. `scratch`: with
    the rows from PLACE on filled, of pixels that have a texture. `colour` (n, 3) float32: filled, 0 where there is no
    texture.
    """
    _describe(table, texture, count, scratch.pixel)
    _plan(scratch.pixel)
    _level(scratch.pixel, scratch.short)
    listed, spans = _list(table, texture, count, scratch)
    _locate(listed, scratch)
    _wrap(table, spans, scratch)
    for i in range(count):
        colour[i, 0], colour[i, 1], colour[i, 2] = np.float32(0), np.float32(0), np.float32(0)
    _blend(table.texels, listed, scratch, colour)


@kernel
def _describe(table: TextureTable, texture: Array, count: int, pixel: Array) -> None:
    """Fill size, last level and periods of the images of some pixels; -1 for filters without levels."""
    for i in range(count):
        row = max(texture[i], 0)
        level = table.texture[row, FIRST]
        pixel[WIDTH * TOGETHER + i], pixel[HEIGHT * TOGETHER + i] = table.level[level, 1], table.level[level, 2]
        for axis, wrap in ((0, WRAP_U), (1, WRAP_V)):
            period = PERIODS[table.texture[row, wrap]]
            pixel[(PERIOD + axis) * TOGETHER + i] = period
            pixel[(PERIOD + 2 + axis) * TOGETHER + i] = 1.0 / period if period > 0.0 else 0.0
        trilinear = table.texture[row, FILTER] == TRILINEAR
        pixel[TOP * TOGETHER + i] = table.texture[row, LEVELS] - 1 if trilinear else -1


@kernel
def _plan(pixel: Array) -> None:
    """Fill first probe, step to the next, level and number of probes of some pixels, in SIMD lanes."""
    for i in range(TOGETHER):
        width, height, top = pixel[WIDTH * TOGETHER + i], pixel[HEIGHT * TOGETHER + i], pixel[TOP * TOGETHER + i]
        u, v = pixel[PLACE * TOGETHER + i], pixel[(PLACE + 1) * TOGETHER + i]
        au, av = pixel[(PLACE + 2) * TOGETHER + i], pixel[(PLACE + 3) * TOGETHER + i]
        bu, bv = pixel[(PLACE + 4) * TOGETHER + i], pixel[(PLACE + 5) * TOGETHER + i]
        # whole turns of the image, exactly; 0 where it does not turn
        u -= pixel[PERIOD * TOGETHER + i] * np.floor(u * pixel[(PERIOD + 2) * TOGETHER + i])
        v -= pixel[(PERIOD + 1) * TOGETHER + i] * np.floor(v * pixel[(PERIOD + 3) * TOGETHER + i])
        ax, ay, bx, by = au * width, av * height, bu * width, bv * height
        a, b = math.sqrt(ax * ax + ay * ay), math.sqrt(bx * bx + by * by)
        across = a >= b
        longer, shorter = a if across else b, b if across else a
        part = longer * (1.0 / MOST)
        part = part if part > SHORTEST else SHORTEST
        part = STRETCH * shorter if STRETCH * shorter > part else part
        # a side that rounding makes longer than the part has no second probe
        probes = np.ceil(longer / part - 1e-6)
        meant = (top >= 0.0) & (not longer <= SHORTEST)
        known = a + b < EDGE_ON
        several = meant & known & (probes > 1.0)
        probes = probes if several else 1.0
        inverse = 1.0 / probes
        part = longer * inverse
        part = TEXEL * (part if part > shorter else shorter)
        part = part if known else EDGE_ON  # the mean of the image
        pixel[LEVEL * TOGETHER + i] = part if meant & (part > 1.0) else 1.0
        share = inverse if several else 0.0
        du, dv = (au if across else bu) * share, (av if across else bv) * share
        back = 0.5 * (probes - 1.0)
        pixel[U * TOGETHER + i], pixel[V * TOGETHER + i] = u - back * du, v - back * dv
        pixel[ALONG_U * TOGETHER + i], pixel[ALONG_V * TOGETHER + i] = du, dv
        pixel[PROBES * TOGETHER + i] = probes


@kernel
def _level(pixel: Array, short: Array) -> None:
    """Turn lengths of parts into levels, in SIMD lanes."""
    for i in range(TOGETHER):
        short[i] = pixel[LEVEL * TOGETHER + i]
    for i in range(TOGETHER):
        short[i] = log2(short[i])
    for i in range(TOGETHER):
        level, top = np.float64(short[i]), pixel[TOP * TOGETHER + i]
        level = level if level < top else top
        pixel[LEVEL * TOGETHER + i] = level if level > 0.0 else 0.0


@kernel
def _list(table: TextureTable, texture: Array, size: int, scratch: Looks) -> tuple[int, int]:
    """List every probe of some pixels on both levels around its own; return how many looks and spans are listed."""
    pixel, place, texel, share, span = scratch.pixel, scratch.place, scratch.texel, scratch.share, scratch.span
    count, spans = 0, 0
    for i in range(size):
        one = texture[i]
        if one < 0:
            continue
        whole = table.texture[one, FILTER] == NEAREST
        probes, lower = int(pixel[PROBES * TOGETHER + i]), int(pixel[LEVEL * TOGETHER + i])
        rest = pixel[LEVEL * TOGETHER + i] - lower
        row = table.texture[one, FIRST] + lower
        for upwards in range(2 if rest > 0.0 else 1):
            level = row + upwards
            start, width, height = table.level[level, 0], table.level[level, 1], table.level[level, 2]
            weight = np.float32((rest if upwards else 1.0 - rest) / probes)
            x, y = pixel[U * TOGETHER + i] * width, pixel[V * TOGETHER + i] * height
            along_x, along_y = pixel[ALONG_U * TOGETHER + i] * width, pixel[ALONG_V * TOGETHER + i] * height
            for k in range(probes):
                at = count + k
                place[X * LOOKS + at], place[Y * LOOKS + at] = x + k * along_x, y + k * along_y
                texel[PIXEL * LOOKS + at], texel[START * LOOKS + at], texel[BELOW * LOOKS + at] = i, start, width
                share[WEIGHT * LOOKS + at] = weight
            far_x, far_y = x + (probes - 1) * along_x, y + (probes - 1) * along_y
            within = (min(x, far_x) >= 0.5) & (max(x, far_x) < width - 0.5)
            within &= (min(y, far_y) >= 0.5) & (max(y, far_y) < height - 0.5)
            span[spans, 0], span[spans, 1], span[spans, 2], span[spans, 3] = count, count + probes, one, level
            spans += whole or not within
            count += probes
    return count, spans


@kernel
def _locate(count: int, scratch: Looks) -> None:
    """Find the four texels around each look, as if the image had no edges, in SIMD lanes."""
    place, texel, share = scratch.place, scratch.texel, scratch.share
    for k in range(count):
        x, y = place[X * LOOKS + k] - 0.5, place[Y * LOOKS + k] - 0.5
        left, upper = np.floor(x), np.floor(y)
        share[P * LOOKS + k], share[Q * LOOKS + k] = x - left, y - upper
        texel[START * LOOKS + k] += np.int32(upper) * texel[BELOW * LOOKS + k] + np.int32(left)
        texel[RIGHT * LOOKS + k] = 1


@kernel
def _wrap(table: TextureTable, spans: int, scratch: Looks) -> None:
    """Find the texels of spans of looks that reach over an edge of the image, and of those without a blend."""
    place, texel, share, span = scratch.place, scratch.texel, scratch.share, scratch.span
    for n in range(spans):
        one, level = span[n, 2], span[n, 3]
        width, height, whole = table.level[level, 1], table.level[level, 2], table.texture[one, FILTER] == NEAREST
        for k in range(span[n, 0], span[n, 1]):
            left, right, p = neighbours_of(place[X * LOOKS + k], width, table.texture[one, WRAP_U])
            upper, under, q = neighbours_of(place[Y * LOOKS + k], height, table.texture[one, WRAP_V])
            texel[START * LOOKS + k] = table.level[level, 0] + upper * width + left
            texel[RIGHT * LOOKS + k], texel[BELOW * LOOKS + k] = right - left, (under - upper) * width
            share[P * LOOKS + k], share[Q * LOOKS + k] = (nearer(p), nearer(q)) if whole else (p, q)


@kernel
def nearer(share: float) -> float:
    """Return the whole of the nearer one of two texels' centres, the second where both are as near."""
    return 1.0 if share >= 0.5 else 0.0


@kernel
def _blend(texels: Array, count: int, scratch: Looks, colour: Array) -> None:
    """Add up what the looks find."""
    texel, share, one = scratch.texel, scratch.share, np.float32(1)
    for k in range(count):
        i = np.uint64(texel[PIXEL * LOOKS + k])
        ul = np.uint64(texel[START * LOOKS + k])
        ur, ll = ul + np.uint64(np.int64(texel[RIGHT * LOOKS + k])), ul + np.uint64(np.int64(texel[BELOW * LOOKS + k]))
        lr = ll + np.uint64(np.int64(texel[RIGHT * LOOKS + k]))
        p, q, weight = share[P * LOOKS + k], share[Q * LOOKS + k], share[WEIGHT * LOOKS + k]
        upper, lower = weight * (one - q), weight * q
        a, b, c, d = upper * (one - p), upper * p, lower * (one - p), lower * p
        colour[i, 0] += (a * texels[ul, 0] + b * texels[ur, 0]) + (c * texels[ll, 0] + d * texels[lr, 0])
        colour[i, 1] += (a * texels[ul, 1] + b * texels[ur, 1]) + (c * texels[ll, 1] + d * texels[lr, 1])
        colour[i, 2] += (a * texels[ul, 2] + b * texels[ur, 2]) + (c * texels[ll, 2] + d * texels[lr, 2])
