"""Joint bilateral weights and weighted means of 3 x 3 texels for a row of pixels; the pixels are the SIMD lanes.

A texel weighs tent * exp(-u) * max(0, <n . n'>)^p, u = delta^2 / (2 sigma^2), delta = z (1/z' - d) with d the nearness
of the pixel's plane there. The exponential is (1 - u / 16)^16, so that with p = 8 the product is an eighth power. Left
and right are added to each other first: mirrored pictures get mirrored sums. The tent t texels from the middle weighs
(1 - 2 |t|) / 6, (2 - |t|) / 3, (1 + 4 |t|) / 6: the one that leaves linear functions linear.
"""

from typing import Any

import numpy as np

from refgi.elementary import pow
from refgi.jit import kernel
from refgi.sssil import upsampling_lines as lines
from refgi.sssil.upsampling_lines import SPAN, WIDE
from refgi.types import Array

TOTAL, MEANS = 3 * SPAN, 4 * SPAN  # after three lines of light
LEAST = 1e-20  # sum of weights, of tents that add up to 1, that is too small to divide by
BEFORE, AFTER, TENTS = SPAN, 4 * SPAN, 7 * SPAN
SIXTH, THIRD = 1 / 6, 1 / 3


@kernel
def bilateral_weight(cosine: Any, off: Any, power: Any) -> Any:
    """Return the range weight max(0, cosine)^p (1 - off^2)^16, off = delta / (4 sqrt(2) sigma); `power` None: 8."""
    zero, one = type(off)(0.0), type(off)(1.0)
    q = one - off * off
    if power is None:
        w = cosine * (q * q)
        w = w if (cosine > zero) & (q > zero) else zero
    else:
        w = q * q if q > zero else zero
    w2 = w * w
    w4 = w2 * w2
    if power is None:
        return w4 * w4
    return (w4 * w4) * pow(cosine if cosine > zero else zero, power)


@kernel
def average(
    above: Array, middle: Array, below: Array, pixels: Array, bounds: Array, tents: Array, place: int, wide: int,
    factor: int, power: Any, means: Array,
) -> None:
    """Average the light of 3 x 3 texels for each of `wide` pixels of a row; `means` gets light and the sum of weights.

    Bounds cut off rounding: equal light stays equal to the bit. Dividing keeps light of 1 exact beside other surfaces.
    """
    real = means.dtype.type
    zero, one, least, side = real(0.0), real(1.0), real(LEAST), np.uint64(factor)
    u_rising, u_level, u_falling = _tents(tents, BEFORE, np.uint64(place))
    d_rising, d_level, d_falling = _tents(tents, AFTER, np.uint64(place))
    for i in range(np.uint64(wide)):
        across, plane = pixels[np.uint64(lines.ACROSS) + i], pixels[np.uint64(lines.PLANE) + i]
        down = pixels[np.uint64(lines.DOWN) + i]
        b_rising, b_level, b_falling = _tents(tents, BEFORE, i)
        a_rising, a_level, a_falling = _tents(tents, AFTER, i)
        before = _by_slope_sign(across, b_rising, b_level, b_falling)
        after = _by_slope_sign(across, a_rising, a_level, a_falling)
        upper = _by_slope_sign(down, u_rising, u_level, u_falling)
        lower = _by_slope_sign(down, d_rising, d_level, d_falling)
        u0, u1, u2 = _row_weights(above, pixels, i, side, plane - down, across, power)
        m0, m1, m2 = _row_weights(middle, pixels, i, side, plane, across, power)
        d0, d1, d2 = _row_weights(below, pixels, i, side, plane + down, across, power)
        u0, u1, u2 = u0 * (upper * before), u1 * upper, u2 * (upper * after)
        m0, m2 = m0 * before, m2 * after
        d0, d1, d2 = d0 * (lower * before), d1 * lower, d2 * (lower * after)
        total = ((u0 + u2) + u1) + ((m0 + m2) + m1) + ((d0 + d2) + d1)
        # the tents, of which the own texel's is 1 here, add up to this
        whole = (one + (before + after)) * (one + (upper + lower))
        total = total if total >= least * whole else zero
        divisor = total if total > zero else one
        # written out: a loop over the channels would cost the compiler its even split into lanes
        r = (_sum(above, 0, i, side, u0, u1, u2) + _sum(middle, 0, i, side, m0, m1, m2)
             + _sum(below, 0, i, side, d0, d1, d2))
        g = (_sum(above, 1, i, side, u0, u1, u2) + _sum(middle, 1, i, side, m0, m1, m2)
             + _sum(below, 1, i, side, d0, d1, d2))
        b = (_sum(above, 2, i, side, u0, u1, u2) + _sum(middle, 2, i, side, m0, m1, m2)
             + _sum(below, 2, i, side, d0, d1, d2))
        means[i] = _bounded(r / divisor, bounds, 0, i)
        means[np.uint64(SPAN) + i] = _bounded(g / divisor, bounds, 1, i)
        means[np.uint64(2 * SPAN) + i] = _bounded(b / divisor, bounds, 2, i)
        means[np.uint64(TOTAL) + i] = total


@kernel
def _tents(tents: Array, line: int, i: Any) -> Any:
    at, span = np.uint64(line) + i, np.uint64(SPAN)
    return tents[at], tents[at + span], tents[at + span + span]


@kernel
def _by_slope_sign(value: Any, positive: Any, none: Any, negative: Any) -> Any:
    zero = type(value)(0.0)
    # as a sum: a choice of three would be gathered
    chosen = (positive if value > zero else zero) + (negative if value < zero else zero)
    return chosen + (none if value == zero else zero)


@kernel
def _row_weights(texels: Array, pixels: Array, i: Any, side: Any, plane: Any, across: Any, power: Any) -> Any:
    """Return the range weights of left, own and right texel of a row."""
    return (_texel_weight(texels, i, pixels, i, plane - across, power),
            _texel_weight(texels, side + i, pixels, i, plane, power),
            _texel_weight(texels, side + side + i, pixels, i, plane + across, power))


@kernel
def _texel_weight(texels: Array, at: Any, pixels: Array, i: Any, plane: Any, power: Any) -> Any:
    n, m, span = np.uint64(lines.RECEIVER_NORMAL) + i, np.uint64(lines.NORMAL) + at, np.uint64(SPAN)
    cosine = (pixels[n] * texels[m] + pixels[n + span] * texels[m + span]
              + pixels[n + span + span] * texels[m + span + span])
    off = (texels[np.uint64(lines.NEARNESS) + at] - plane) * pixels[np.uint64(lines.SCALE) + i]
    return bilateral_weight(cosine, off, power)


@kernel
def _sum(texels: Array, channel: int, i: Any, side: Any, left: Any, own: Any, right: Any) -> Any:
    at = np.uint64(lines.LIGHT + channel * SPAN) + i
    return (left * texels[at] + right * texels[side + side + at]) + own * texels[side + at]


@kernel
def _bounded(value: Any, bounds: Array, channel: int, i: Any) -> Any:
    least = bounds[np.uint64(lines.LEAST + channel * SPAN) + i]
    most = bounds[np.uint64(lines.MOST + channel * SPAN) + i]
    value = value if value > least else least
    return value if value < most else most


@kernel
def _tent_at(t: Any) -> Any:
    """Return the weights of the texel before, the own and the one after, of sum 1, `t` from the middle one's point."""
    real = type(t)
    zero, one, two, four = real(0.0), real(1.0), real(2.0), real(4.0)
    away = abs(t)
    inner = away < real(0.5)
    far = (one - two * away) * real(SIXTH) if inner else zero
    own = (two - away) * real(THIRD) if inner else one - away
    near = (one + four * away) * real(SIXTH) if inner else away
    return near if t < zero else far, own, far if t < zero else near


@kernel
def write_tents(factor: int, corner: Any, tents: Array) -> None:
    """Write offsets of a row's pixels from their texels' centres, -1/2 to 1/2, and weights beside over the own."""
    for i in range(WIDE):
        t = _offset(i % factor, factor, tents)
        tents[i] = t
        for lie in range(3):
            before, own, after = _tent_at(t + tents.dtype.type(lie - 1) * corner)
            tents[BEFORE + lie * SPAN + i] = before / own
            tents[AFTER + lie * SPAN + i] = after / own


@kernel
def _offset(place: int, factor: int, like: Array) -> Any:
    """Return the offset of a pixel's centre from that of its texel, texels, -1/2 to 1/2; in the dtype of `like`."""
    real = like.dtype.type
    return real(2 * place + 1 - factor) / real(2 * factor)
