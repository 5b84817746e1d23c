"""Weighted sums over three by three texels for a row of pixels; the pixels are the SIMD lanes.

A texel weighs tent * exp(-u) * max(0, <n . n'>)^p for a pixel, u = delta^2 / (2 sigma^2), delta = z (1/z' - d) with d
the nearness that the plane through the pixel has at the texel's place. The exponential is taken as (1 - u / 16)^16, 0
from u = 16 (5.7 sigma) on, so that with p = 8 the product is the eighth power of cosine * (1 - u / 16)^2.

Left and right texels are added to each other first: pictures that mirror each other get sums that do, to the bit.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.elementary import pow
from refgi.jit import kernel
from refgi.sssil.upsampling import lines, receivers
from refgi.sssil.upsampling.lines import SPAN
from refgi.sssil.upsampling.tent import AFTER, BEFORE

Array = npt.NDArray[Any]

TOTAL, MEANS = 3 * SPAN, 4 * SPAN  # after three lines of light
LEAST = 1e-20  # sum of weights, of tents that add up to 1, that is too small to divide by


@kernel
def alike(cosine: Any, off: Any, power: Any) -> Any:
    """Return how much two points are of the same surface.

    Parameters
    ----------
    cosine : float
        Between their normals.
    off : float
        delta / (4 sqrt(2) sigma), whose square is u / 16.
    power : float or None
        p; None stands for 8.

    Returns
    -------
    float
        0 to 1.
    """
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
    above: Array, middle: Array, below: Array, here: Array, bounds: Array, tents: Array, place: int, wide: int,
    factor: int, power: Any, means: Array,
) -> None:
    """Average the light of three by three texels for each pixel of a row.

    Parameters
    ----------
    above, middle, below : (lines.LINES,) ndarray
        Rows of texels; the middle one has the pixels.
    here : (HERE,) ndarray
        The pixels.
    bounds : (lines.BOUNDS,) ndarray
        Between which means lie.
    tents : (TENTS,) ndarray
        Of `write_tents`.
    place : int
        Of the row in its texels, 0 to factor - 1.
    wide : int
        Pixels of the block.
    factor : int
        Pixels along a texel's side.
    power : float or None
        Of `alike`.
    means : (MEANS,) ndarray
        Filled: light, three lines, and the sum of the weights, 0 where that is too small.

    Notes
    -----
    Bounds cut off roundings: equal light stays equal to the bit. Dividing keeps light of 1 so beside any other surface.
    """
    real = means.dtype.type
    zero, one, least, side = real(0.0), real(1.0), real(LEAST), np.uint64(factor)
    u_rising, u_level, u_falling = _tents(tents, BEFORE, np.uint64(place))
    d_rising, d_level, d_falling = _tents(tents, AFTER, np.uint64(place))
    for i in range(np.uint64(wide)):
        across, plane = here[np.uint64(receivers.ACROSS) + i], here[np.uint64(receivers.PLANE) + i]
        down = here[np.uint64(receivers.DOWN) + i]
        b_rising, b_level, b_falling = _tents(tents, BEFORE, i)
        a_rising, a_level, a_falling = _tents(tents, AFTER, i)
        before, after = _by_sign(across, b_rising, b_level, b_falling), _by_sign(across, a_rising, a_level, a_falling)
        upper, lower = _by_sign(down, u_rising, u_level, u_falling), _by_sign(down, d_rising, d_level, d_falling)
        u0, u1, u2 = _alike_in(above, here, i, side, plane - down, across, power)
        m0, m1, m2 = _alike_in(middle, here, i, side, plane, across, power)
        d0, d1, d2 = _alike_in(below, here, i, side, plane + down, across, power)
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
def _by_sign(value: Any, positive: Any, none: Any, negative: Any) -> Any:
    zero = type(value)(0.0)
    # as a sum: a choice of three would be gathered
    chosen = (positive if value > zero else zero) + (negative if value < zero else zero)
    return chosen + (none if value == zero else zero)


@kernel
def _alike_in(texels: Array, here: Array, i: Any, side: Any, plane: Any, across: Any, power: Any) -> Any:
    """Return how much left, own and right texel of a row are of the pixel's surface."""
    return (_alike_at(texels, i, here, i, plane - across, power), _alike_at(texels, side + i, here, i, plane, power),
            _alike_at(texels, side + side + i, here, i, plane + across, power))


@kernel
def _alike_at(texels: Array, at: Any, here: Array, i: Any, plane: Any, power: Any) -> Any:
    n, m, span = np.uint64(receivers.NORMAL) + i, np.uint64(lines.NORMAL) + at, np.uint64(SPAN)
    cosine = here[n] * texels[m] + here[n + span] * texels[m + span] + here[n + span + span] * texels[m + span + span]
    off = (texels[np.uint64(lines.NEARNESS) + at] - plane) * here[np.uint64(receivers.SCALE) + i]
    return alike(cosine, off, power)


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
