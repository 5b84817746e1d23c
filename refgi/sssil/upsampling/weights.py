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
from refgi.sssil.upsampling.lines import SPAN, WIDE
from refgi.sssil.upsampling.tent import tent_at

Array = npt.NDArray[Any]

TOTAL, MEANS = 3 * SPAN, 4 * SPAN  # after three lines of light
LEAST = 1e-20  # sum of weights that is too small to divide by
SURE = 1 / 16  # weight but for the tent from which on the own texel's light is what others are compared with


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
    kept = cosine if cosine > zero else zero
    q = one - off * off
    q = q if q > zero else zero
    w = q * q
    if power is None:
        w = kept * w
    w2 = w * w
    w4 = w2 * w2
    if power is None:
        return w4 * w4
    return (w4 * w4) * pow(kept, power)


@kernel
def average(above: Array, middle: Array, below: Array, here: Array, power: Any, means: Array) -> None:
    """Average the light of three by three texels for each pixel of a row.

    Parameters
    ----------
    above, middle, below : (lines.LINES,) ndarray
        Rows of texels; the middle one has the pixels.
    here : (HERE,) ndarray
        The pixels.
    power : float or None
        Of `alike`.
    means : (MEANS,) ndarray
        Filled: light, three lines, and the sum of the weights; light is 0 where that is too small.

    Notes
    -----
    Means are taken of differences to the own texel's light where that is likely of the same surface, so that equal
    light stays equal to the bit.
    """
    real = means.dtype.type
    zero, one, sure, least = real(0.0), real(1.0), real(SURE), real(LEAST)
    for i in range(np.uint64(WIDE)):
        across, plane = here[np.uint64(receivers.ACROSS) + i], here[np.uint64(receivers.PLANE) + i]
        down = here[np.uint64(receivers.DOWN) + i]
        columns = tent_at(here[np.uint64(receivers.X) + i])
        upper, own, lower = tent_at(here[np.uint64(receivers.Y) + i])
        u0, u1, u2 = _weights(above, here, columns, upper, i, plane - down, across, power)
        m0, m1, m2 = _weights(middle, here, columns, own, i, plane, across, power)
        d0, d1, d2 = _weights(below, here, columns, lower, i, plane + down, across, power)
        total = ((u0 + u2) + u1) + ((m0 + m2) + m1) + ((d0 + d2) + d1)
        likely = m1 >= sure * (own * columns[1])
        known = total >= least
        inverse = one / (total if known else one)
        # written out: a loop over the channels would cost the compiler its even split into lanes
        red, green, blue = _light(middle, i)
        red, green, blue = red if likely else zero, green if likely else zero, blue if likely else zero
        r = (_sum(above, 0, i, u0, u1, u2, red) + _sum(middle, 0, i, m0, m1, m2, red)
             + _sum(below, 0, i, d0, d1, d2, red))
        g = (_sum(above, 1, i, u0, u1, u2, green) + _sum(middle, 1, i, m0, m1, m2, green)
             + _sum(below, 1, i, d0, d1, d2, green))
        b = (_sum(above, 2, i, u0, u1, u2, blue) + _sum(middle, 2, i, m0, m1, m2, blue)
             + _sum(below, 2, i, d0, d1, d2, blue))
        means[i] = red + r * inverse if known else zero
        means[np.uint64(SPAN) + i] = green + g * inverse if known else zero
        means[np.uint64(2 * SPAN) + i] = blue + b * inverse if known else zero
        means[np.uint64(TOTAL) + i] = total


@kernel
def _weights(
    texels: Array, here: Array, columns: Any, row: Any, i: Any, plane: Any, across: Any, power: Any
) -> Any:
    """Return what left, own and right texel of a row weigh."""
    left = _alike_at(texels, np.uint64(lines.LEFT) + i, here, i, plane - across, power) * (row * columns[0])
    own = _alike_at(texels, np.uint64(lines.OWN) + i, here, i, plane, power) * (row * columns[1])
    right = _alike_at(texels, np.uint64(lines.RIGHT) + i, here, i, plane + across, power) * (row * columns[2])
    return left, own, right


@kernel
def _alike_at(texels: Array, at: Any, here: Array, i: Any, plane: Any, power: Any) -> Any:
    n, m, span = np.uint64(receivers.NORMAL) + i, np.uint64(lines.NORMAL) + at, np.uint64(SPAN)
    cosine = here[n] * texels[m] + here[n + span] * texels[m + span] + here[n + span + span] * texels[m + span + span]
    off = (texels[np.uint64(lines.NEARNESS) + at] - plane) * here[np.uint64(receivers.SCALE) + i]
    return alike(cosine, off, power)


@kernel
def _light(texels: Array, i: Any) -> Any:
    at, span = np.uint64(lines.OWN + lines.LIGHT) + i, np.uint64(SPAN)
    return texels[at], texels[at + span], texels[at + span + span]


@kernel
def _sum(texels: Array, channel: int, i: Any, left: Any, own: Any, right: Any, reference: Any) -> Any:
    at = np.uint64(lines.LIGHT + channel * SPAN) + i
    beside = (left * (texels[np.uint64(lines.LEFT) + at] - reference)
              + right * (texels[np.uint64(lines.RIGHT) + at] - reference))
    return beside + own * (texels[np.uint64(lines.OWN) + at] - reference)
