"""Weighted sums of three by three texels for a row of pixels; the pixels are the SIMD lanes.

A texel weighs tent * exp(-delta^2 / (2 sigma^2)) * max(0, <n . n'>)^p for a pixel: delta = z (1/z' - d), with d the
nearness that the plane through the pixel has where the texel lies. Left and right texels are added to each other
first, so that mirrored pictures give mirrored sums to the bit.

The exponential of -u is taken as q(u / 16)^16, q the cubic of its series, 0 from q's root on: within 6e-5 of it
everywhere, and 0 beyond 7 sigma.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from refgi.elementary import pow
from refgi.jit import kernel
from refgi.sssil.upsampling import lines, receivers
from refgi.sssil.upsampling.lines import PAD, SPAN, WIDE

Array = npt.NDArray[Any]

SUM, TOTAL, REFERENCE, SUMS = 0, 3 * SPAN, 4 * SPAN, 7 * SPAN
SURE = 1 / 16  # weight but for the tent from which on the own texel is what others are compared with
HALF, SIXTH = 0.5, 1 / 6


@kernel
def alike(n0: Any, n1: Any, n2: Any, m0: Any, m1: Any, m2: Any, off: Any, power: Any) -> Any:
    """Return how much two points are of the same surface.

    Parameters
    ----------
    n0, n1, n2, m0, m1, m2 : float
        Unit normals.
    off : float
        delta / (4 sqrt(2) sigma).
    power : float or None
        Exponent of the cosine between the normals; None stands for 8.

    Returns
    -------
    float
        exp(-delta^2 / (2 sigma^2)) max(0, cosine)^power, 0 to 1.
    """
    real = type(off)
    zero, one, two = real(0.0), real(1.0), real(2.0)
    cosine = n0 * m0 + n1 * m1 + n2 * m2
    cosine = cosine if cosine > zero else zero
    v = off * off
    v = v if v < two else two
    q = one - v * (one - v * (real(HALF) - v * real(SIXTH)))
    q = q if q > zero else zero
    q2 = q * q
    if power is None:
        w = cosine * q2
        w2 = w * w
        w4 = w2 * w2
        return w4 * w4
    q4 = q2 * q2
    q8 = q4 * q4
    return pow(cosine, power) * (q8 * q8)


@kernel
def start_sums(texels: Array, here: Array, power: Any, sums: Array) -> None:
    """Clear the sums of a row and choose what values are compared with.

    Parameters
    ----------
    texels : (LINES,) ndarray
        The row of texels that has the pixels.
    here : (HERE,) ndarray
        The pixels.
    power : float or None
        Of `alike`.
    sums : (SUMS,) ndarray
        SUM and TOTAL are cleared; REFERENCE is the own texel's light where that is likely of the same surface, else 0:
        then equal light stays equal to the bit.
    """
    zero, sure = sums.dtype.type(0.0), sums.dtype.type(SURE)
    for i in range(np.uint64(WIDE)):
        weight = _alike_at(texels, np.uint64(PAD) + i, here, i, here[np.uint64(receivers.PLANE) + i], power)
        own = weight >= sure
        for c in range(3):
            line = np.uint64(c * SPAN)
            light = texels[np.uint64(lines.LIGHT) + line + np.uint64(PAD) + i]
            sums[np.uint64(REFERENCE) + line + i] = light if own else zero
            sums[np.uint64(SUM) + line + i] = zero
        sums[np.uint64(TOTAL) + i] = zero


@kernel
def add_texels(
    texels: Array, here: Array, tent: Array, factor: int, step: int, share: Any, power: Any, sums: Array
) -> None:
    """Add one row of texels to the sums of a row of pixels.

    Parameters
    ----------
    texels : (LINES,) ndarray
        The row of texels.
    here : (HERE,) ndarray
        The pixels.
    tent : (TENT,) ndarray
        Weights of left, own and right texels.
    factor : int
        Pixels along a texel's side.
    step : int
        -1, 0 or 1: where the row lies from that which has the pixels.
    share : float
        Weight of the row.
    power : float or None
        Of `alike`.
    sums : (SUMS,) ndarray
        Of differences to REFERENCE, and of weights.
    """
    rows = sums.dtype.type(step)
    left, own, right = np.uint64(PAD - factor), np.uint64(PAD), np.uint64(PAD + factor)
    for i in range(np.uint64(WIDE)):
        across = here[np.uint64(receivers.ACROSS) + i]
        plane = here[np.uint64(receivers.PLANE) + i] + rows * here[np.uint64(receivers.DOWN) + i]
        a = _alike_at(texels, left + i, here, i, plane - across, power) * tent[np.uint64(receivers.LEFT) + i] * share
        b = _alike_at(texels, own + i, here, i, plane, power) * tent[np.uint64(receivers.OWN) + i] * share
        c = _alike_at(texels, right + i, here, i, plane + across, power) * tent[np.uint64(receivers.RIGHT) + i] * share
        sums[np.uint64(TOTAL) + i] += (a + c) + b
        _add(texels, 0, left + i, own + i, right + i, a, b, c, i, sums)
        _add(texels, 1, left + i, own + i, right + i, a, b, c, i, sums)
        _add(texels, 2, left + i, own + i, right + i, a, b, c, i, sums)


@kernel
def _alike_at(texels: Array, at: Any, here: Array, i: Any, plane: Any, power: Any) -> Any:
    n, m, span = np.uint64(receivers.NORMAL), np.uint64(lines.NORMAL), np.uint64(SPAN)
    off = (texels[np.uint64(lines.NEARNESS) + at] - plane) * here[np.uint64(receivers.SCALE) + i]
    return alike(here[n + i], here[n + span + i], here[n + span + span + i], texels[m + at], texels[m + span + at],
                 texels[m + span + span + at], off, power)


@kernel
def _add(
    texels: Array, channel: int, left: Any, own: Any, right: Any, a: Any, b: Any, c: Any, i: Any, sums: Array
) -> None:
    line = np.uint64(lines.LIGHT + channel * SPAN)
    reference = sums[np.uint64(REFERENCE + channel * SPAN) + i]
    beside = a * (texels[line + left] - reference) + c * (texels[line + right] - reference)
    sums[np.uint64(SUM + channel * SPAN) + i] += beside + b * (texels[line + own] - reference)
